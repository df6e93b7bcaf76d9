"""Does the value of an expression fit the context-variable that gets it?"""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.conditions.types import (
    Problem,
    Type,
    Typed,
    comparisons,
    missing_unit,
    unknown_member_problems,
)
from codra_dsl.language.expression import Node, Text, written_text
from codra_dsl.language.model import Kind
from codra_dsl.language.units import ONE


def fit(value: Typed, wanted_type: Type, name: str, *, may_map: bool) -> Iterator[Problem]:
    """Yield the reasons why a value does not fit the context-variable with this type and name.

    `may_map` states whether the value may be a mapping from members to conditions.
    """
    given = value.type
    if given is None:
        return
    if wanted_type.kind is Kind.ENUM and given.kind is Kind.STR and given.is_literal:
        yield from unknown_member_problems(value, wanted_type, f"'{name}'")
    elif wanted_type.kind is Kind.ENUM and given.kind is Kind.ENUM:
        unknown_members = [member for member in given.values if member not in wanted_type.values]
        if unknown_members:
            help = _members_help(wanted_type, "CONDITION", may_map=may_map)
            message = f"'{unknown_members[0]}' of {written_text(value.node)} is not a value of '{name}'"
            yield Problem("unknown-member", value.node, message, help)
    elif wanted_type.is_number and given.is_number:
        yield from _number_problems(value, given, wanted_type, name)
    elif wanted_type.kind != given.kind and (wanted_type.kind, given.kind) != (Kind.STR, Kind.ENUM):
        message = f"{written_text(value.node)} is {given}, but '{name}' is {wanted_type}"
        help = _conversion_help(value.node, given, wanted_type, may_map=may_map)
        yield Problem("wrong-value-identified", value.node, message, help)


def _number_problems(value: Typed, given: Type, wanted_type: Type, name: str) -> Iterator[Problem]:
    has_same_dimension = given.unit.dimension == wanted_type.unit.dimension
    is_int = given.kind is Kind.INT and (given.is_zero or given.unit == wanted_type.unit)
    if not has_same_dimension and given.unit.dimension == ONE.dimension and not given.is_zero:
        yield missing_unit(value, f"'{name}'", wanted_type.unit)
    elif not has_same_dimension and wanted_type.unit.dimension == ONE.dimension:
        message = f"{written_text(value.node)} is in {given.unit}, but '{name}' has no unit"
        yield Problem("missing-unit", value.node, message, f"declare '{name}' with 'unit: {given.unit}'")
    elif not has_same_dimension and not given.is_zero:
        message = f"{written_text(value.node)} is in {given.unit}, but '{name}' is in {wanted_type.unit}"
        yield Problem("mismatched-units", value.node, message, f"give a quantity in {wanted_type.unit}")
    elif wanted_type.kind is Kind.INT and not is_int:
        message = f"{written_text(value.node)} is {given}, but '{name}' is {wanted_type}"
        yield Problem("wrong-value-identified", value.node, message, f"make '{name}' a float")


def _conversion_help(node: Node, given: Type, wanted_type: Type, *, may_map: bool) -> str:
    if wanted_type.kind is Kind.BOOL:
        return f"compare the value, e.g. with {comparisons(given)}"
    if wanted_type.kind is Kind.ENUM:
        return _members_help(
            wanted_type, written_text(node) if given.kind is Kind.BOOL else "CONDITION", may_map=may_map
        )
    if isinstance(node, Text) and wanted_type.is_number:
        return f"write a number{f' in {wanted_type.unit}' if wanted_type.unit else ''}"
    return f"give {wanted_type}, or change the type of the variable to {given.kind}"


def _members_help(wanted_type: Type, condition: str, *, may_map: bool) -> str:
    first, *others = wanted_type.values
    if may_map:
        return f"map the members to conditions: {{{first}: {condition}, ...}}"
    return f'write "{first}" if {condition} else "{others[0] if others else first}"'
