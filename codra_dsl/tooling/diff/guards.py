"""The comparison of guards, conditions and values by meaning, as far as `check` can decide.

A guard is a list of conditions that must all be certainly true. One guard implies another guard only if `check` can
prove this. If neither of two guards provably implies the other, the relation is `OTHER`.
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


def find_relation(old: Sequence[Node], new: Sequence[Node], types: Types) -> Relation:
    """Return how a guard has changed.

    A condition that is a path, or that has a name without a type, is compared only by its text.

    Args:
        old: the conditions before.
        new: the conditions after.
        types: the types of names in both versions, as `joined_types` returns them.
    """
    before, after = ({normal_text(tree): tree for tree in trees} for trees in (old, new))
    lost_texts, gained_texts = before.keys() - after.keys(), after.keys() - before.keys()
    if not lost_texts and not gained_texts:
        return Relation.SAME
    untyped_texts = {text for text, tree in (before | after).items() if not _is_typed(tree, types)}
    if untyped_texts & (lost_texts | gained_texts):
        is_new_implied, is_old_implied = not gained_texts, not lost_texts
    else:
        typed_before, typed_after = (
            [tree_by_text[text] for text in tree_by_text if text not in untyped_texts]
            for tree_by_text in (before, after)
        )
        is_new_implied = implies(typed_before, [after[text] for text in after if text in gained_texts], types)
        is_old_implied = implies(typed_after, [before[text] for text in before if text in lost_texts], types)
    if is_new_implied:
        return Relation.SAME if is_old_implied else Relation.WEAKER
    return Relation.STRONGER if is_old_implied else Relation.OTHER


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


def is_equal(first: Node, second: Node, types: Types) -> bool:
    """Return whether two conditions always have the same value (true, false or unknown)."""
    negations = Not(operand=first, start=0, end=0), Not(operand=second, start=0, end=0)
    return all(
        find_relation([before], [after], types) is Relation.SAME for before, after in ((first, second), negations)
    )


def is_same_choice(first: Sequence[tuple[str, Node]], second: Sequence[tuple[str, Node]], types: Types) -> bool:
    """Return whether two lists of cases always choose the same member.

    The chosen member is that of the first condition that holds.
    """
    member_conditions = _conditions_by_member(first), _conditions_by_member(second)
    members = {**member_conditions[0], **member_conditions[1]}
    guards = (
        # a member is chosen if any of its conditions holds
        [Or(operands=tuple(conditions.get(member, ())), start=0, end=0) for conditions in member_conditions]
        for member in members
    )
    return all(find_relation([before], [after], types) is Relation.SAME for before, after in guards)


def _conditions_by_member(cases: Iterable[tuple[str, Node]]) -> Mapping[str, list[Node]]:
    """Return a mapping from each member to the conditions under which the member is chosen."""
    conditions_by_member: dict[str, list[Node]] = {}
    previous_negations: tuple[Node, ...] = ()
    for member, condition in cases:
        conditions_by_member.setdefault(member, []).append(
            And(operands=(*previous_negations, condition), start=0, end=0)
        )
        previous_negations = (*previous_negations, Not(operand=condition, start=0, end=0))
    return conditions_by_member


def is_same_value(first: Node, second: Node, types: Types) -> bool:
    """Return whether two numbers, texts or members are known in the same cases, and are then equal."""
    if to_text(first) == to_text(second):
        return True
    if isinstance(first, Choice) and isinstance(second, Choice) and is_equal(first.condition, second.condition, types):
        return is_same_value(first.then, second.then, types) and is_same_value(first.otherwise, second.otherwise, types)
    if any(types.get(name) is None for name in names_of([first, second])):
        return False
    equality = _equality(first, second)
    return all(implies([_equality(node, node)], [equality], types) for node in (first, second))


def _equality(first: Node, second: Node) -> Node:
    return Compare(first=first, rest=((Comparison.EQUAL, second),), start=0, end=0)


def joined_types(old: Mapping[str, ValueType], new: Mapping[str, ValueType]) -> Types:
    """Return a mapping from names to types that contain the values of both versions; None if there is no such type."""
    return {name: _joined_type(old.get(name), new.get(name)) for name in dict.fromkeys((*old, *new))}


def _joined_type(old: ValueType | None, new: ValueType | None) -> Type | None:
    known_types = [
        known_type
        for value_type in (old, new)
        if value_type is not None and (known_type := declared_type(value_type)) is not None
    ]
    if len(known_types) < 2:
        return known_types[0] if known_types else None
    first, second = known_types
    if first.is_number and second.is_number:
        is_int = first.kind is second.kind is Kind.INT and first.unit == second.unit
        return replace(first, kind=Kind.INT if is_int else Kind.FLOAT, range=_joined_range(first, second))
    if {first.kind, second.kind} == {Kind.STR, Kind.ENUM}:
        return Type(Kind.STR)
    values = dict.fromkeys((*first.values, *second.values))
    return replace(first, values=tuple(values)) if first.kind is second.kind else None


def _joined_range(first: Type, second: Type) -> tuple[float, float] | None:
    """Return the smallest range that contains the ranges of both types, in the unit of the first type.

    Return None if one of the types has no range, or if their units have different dimensions.
    """
    if first.range is None or second.range is None or first.unit.dimension != second.unit.dimension:
        return None
    factor = in_base(1, first.unit)
    is_same_unit = first.unit == second.unit
    low, high = (end if is_same_unit else float(in_base(end, second.unit) / factor) for end in second.range)
    return min(first.range[0], low), max(first.range[1], high)
