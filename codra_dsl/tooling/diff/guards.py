"""The comparison of guards, conditions and values by meaning, as far as `check` can decide.

A guard is a list of conditions that must all be certainly true. A guard counts as following from another guard only if
this is certain. If neither of two guards certainly follows from the other, the relation is `OTHER`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum

from codra_dsl.language.check import Type, Types, declared_type, implies
from codra_dsl.language.check.solver.case_split import names_of
from codra_dsl.language.check.solver.intervals import in_base
from codra_dsl.language.expression import And, Choice, Compare, Comparison, Node, Not, Or, Path, to_text
from codra_dsl.language.model import Kind, ValueType


class Relation(StrEnum):
    """How a guard has changed."""

    SAME = "same"
    WEAKER = "weaker"
    STRONGER = "stronger"
    OTHER = "other"


def relation(old: Sequence[Node], new: Sequence[Node], types: Types) -> Relation:
    """Return how a guard has changed.

    A condition that is a path, or that has a name without a type, is compared only by its text.

    Args:
        old: the conditions before.
        new: the conditions after.
        types: the types of names in both versions, as `joined_types` returns them.
    """
    before, after = ({normal_text(tree): tree for tree in side} for side in (old, new))
    lost, gained = before.keys() - after.keys(), after.keys() - before.keys()
    if not lost and not gained:
        return Relation.SAME
    untyped_texts = {text for text, tree in (before | after).items() if not _is_typed(tree, types)}
    if untyped_texts & (lost | gained):
        holds_after, held_before = not gained, not lost
    else:
        known_before, known_after = (
            [side[text] for text in side if text not in untyped_texts] for side in (before, after)
        )
        holds_after = implies(known_before, [after[text] for text in after if text in gained], types)
        held_before = implies(known_after, [before[text] for text in before if text in lost], types)
    if holds_after:
        return Relation.SAME if held_before else Relation.WEAKER
    return Relation.STRONGER if held_before else Relation.OTHER


def _is_typed(tree: Node, types: Types) -> bool:
    return not isinstance(tree, Path) and all(types.get(name) is not None for name in names_of([tree]))


def normal_text(node: Node) -> str:
    """Return a text that does not depend on the order of the operands of `and` and `or`."""
    match node:
        case And() | Or():
            return f"({f' {type(node).__name__} '.join(sorted(map(normal_text, node.operands)))})"
        case Not():
            return f"not {normal_text(node.operand)}"
        case Path():
            return str(node)
    return to_text(node)


def is_equal(one: Node, other: Node, types: Types) -> bool:
    """Return whether two conditions always have the same value (true, false or unknown)."""
    negations = Not(operand=one, start=0, end=0), Not(operand=other, start=0, end=0)
    return all(relation([before], [after], types) is Relation.SAME for before, after in ((one, other), negations))


def is_same_choice(one: Sequence[tuple[str, Node]], other: Sequence[tuple[str, Node]], types: Types) -> bool:
    """Return whether two lists of cases always choose the same member.

    The chosen member is that of the first condition that holds.
    """
    choices = _conditions_by_member(one), _conditions_by_member(other)
    members = {**choices[0], **choices[1]}
    guards = (
        # a member is chosen if any of its conditions holds
        [Or(operands=tuple(side.get(member, ())), start=0, end=0) for side in choices]
        for member in members
    )
    return all(relation([before], [after], types) is Relation.SAME for before, after in guards)


def _conditions_by_member(cases: Iterable[tuple[str, Node]]) -> Mapping[str, list[Node]]:
    """Return for each member the conditions under which it is chosen."""
    choices: dict[str, list[Node]] = {}
    before: tuple[Node, ...] = ()
    for member, condition in cases:
        choices.setdefault(member, []).append(And(operands=(*before, condition), start=0, end=0))
        before = (*before, Not(operand=condition, start=0, end=0))
    return choices


def is_same_value(one: Node, other: Node, types: Types) -> bool:
    """Return whether two numbers, texts or members are known in the same cases, and are then equal."""
    if to_text(one) == to_text(other):
        return True
    if isinstance(one, Choice) and isinstance(other, Choice) and is_equal(one.condition, other.condition, types):
        return is_same_value(one.then, other.then, types) and is_same_value(one.otherwise, other.otherwise, types)
    if any(types.get(name) is None for name in names_of([one, other])):
        return False
    equality = _equality(one, other)
    return all(implies([_equality(node, node)], [equality], types) for node in (one, other))


def _equality(one: Node, other: Node) -> Node:
    return Compare(first=one, rest=((Comparison.EQUAL, other),), start=0, end=0)


def joined_types(old: Mapping[str, ValueType], new: Mapping[str, ValueType]) -> Types:
    """Return for each name a type that contains its values in both versions; None if there is no such type."""
    return {name: _joined_type(old.get(name), new.get(name)) for name in dict.fromkeys((*old, *new))}


def _joined_type(old: ValueType | None, new: ValueType | None) -> Type | None:
    known_types = [known for side in (old, new) if side is not None and (known := declared_type(side)) is not None]
    if len(known_types) < 2:
        return known_types[0] if known_types else None
    one, other = known_types
    if one.numeric and other.numeric:
        is_int = one.kind is other.kind is Kind.INT and one.unit == other.unit
        return replace(one, kind=Kind.INT if is_int else Kind.FLOAT, range=_joined_range(one, other))
    if {one.kind, other.kind} == {Kind.STR, Kind.ENUM}:
        return Type(Kind.STR)
    values = dict.fromkeys((*one.values, *other.values))
    return replace(one, values=tuple(values)) if one.kind is other.kind else None


def _joined_range(one: Type, other: Type) -> tuple[float, float] | None:
    """Return the smallest range that contains the ranges of both types, in the unit of the first type.

    Return None if one of the types has no range, or if their units have different dimensions.
    """
    if one.range is None or other.range is None or one.unit.dimension != other.unit.dimension:
        return None
    factor = in_base(1, one.unit)
    is_same_unit = one.unit == other.unit
    low, high = (end if is_same_unit else float(in_base(end, other.unit) / factor) for end in other.range)
    return min(one.range[0], low), max(one.range[1], high)
