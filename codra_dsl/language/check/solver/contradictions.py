"""Conditions that exclude each other, and the message and the related places of findings about such conditions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.solver.breakpoints import context_keys_of
from codra_dsl.language.check.solver.case_split import conjuncts
from codra_dsl.language.check.solver.satisfiable import can_hold
from codra_dsl.language.check.solver.values import age_key
from codra_dsl.language.diagnostics import Place, Related
from codra_dsl.language.expression import And, Node, names_in
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import FOREVER_S, Condition, Returned, Variable

MAX_CONDITIONS = 50
"""If there are more conditions than this number, unnecessary conditions are not removed from a contradiction."""


MAX_QUOTED_CONDITIONS = 3
"""The maximum number of conditions that a message quotes besides the offender."""

MAX_RELATED_PLACES = 10
"""The maximum number of conditions besides the offender whose places are in a finding."""


@dataclass(frozen=True, slots=True)
class StatedCondition:
    """A condition that must be true, and the place where the condition is written.

    Attributes:
        parts: the operands if the condition is an `and`; else empty.
    """

    tree: Node
    text: str
    place: Place
    parts: tuple[StatedCondition, ...] = ()


def state_condition(condition: Condition, tree: Node) -> StatedCondition:
    """Return a condition with its parts; `tree` is its typed syntax tree."""
    operands = conjuncts([tree]) if isinstance(tree, And) else ()
    parts = (StatedCondition(part, condition.text_of(part), condition.place_of(part)) for part in operands)
    return StatedCondition(tree, condition.text, condition.place, tuple(parts))


def contradiction(conditions: Sequence[StatedCondition], types: Types) -> tuple[StatedCondition, ...]:
    """Return conditions that can never be true together, in the given order; () if all can be true together.

    Conditions that are found to be unnecessary for the contradiction are left out.
    If several conditions are needed, each `and` among them is narrowed down to the parts that are needed.
    """
    if can_hold([condition.tree for condition in conditions], (), types):
        return ()
    impossible_condition = next(
        (condition for condition in conditions if not can_hold([condition.tree], (), types)), None
    )
    if impossible_condition is not None:
        return (impossible_condition,)
    needed_conditions = _needed_conditions(conditions, types)
    return _needed_conditions(
        [part for condition in needed_conditions for part in condition.parts or (condition,)], types
    )


def _needed_conditions(conditions: Sequence[StatedCondition], types: Types) -> tuple[StatedCondition, ...]:
    needed_conditions = list(conditions)
    for condition in conditions if len(conditions) <= MAX_CONDITIONS else ():
        fewer_conditions = [other for other in needed_conditions if other is not condition]
        if not can_hold([other.tree for other in fewer_conditions], (), types):
            needed_conditions = fewer_conditions
    return tuple(needed_conditions)


def never_true_message(core: Sequence[StatedCondition]) -> str:
    """Return the message about conditions that exclude each other, with the last condition as the offender."""
    *others, last = core
    if not others:
        return f"'{last.text}' is never true"
    if len(core) > MAX_CONDITIONS:
        return "its conditions are never true together"
    quoted_text = " and ".join(f"'{other.text}'" for other in others[:MAX_QUOTED_CONDITIONS])
    if len(others) > MAX_QUOTED_CONDITIONS:
        quoted_text += f" and {len(others) - MAX_QUOTED_CONDITIONS} others"
    return f"'{last.text}' is never true together with {quoted_text}"


def related_places(
    core: Sequence[StatedCondition], types: Types, declared_elements: Iterable[Variable | Returned]
) -> Iterator[Related]:
    """Yield the places of all conditions except the last.

    If there is no contradiction without the limits of names, also yield the places of these limits.
    """
    *others, _ = core
    yield from (Related("cannot be true together with this", other.place) for other in others[:MAX_RELATED_PLACES])
    trees = [condition.tree for condition in core]
    if can_hold(trees, (), types_without_ranges(types, trees)):
        yield from limit_places(trees, declared_elements)


def types_without_ranges(types: Types, trees: Iterable[Node]) -> Types:
    """Return the types of the names in some conditions, without ranges and validity."""
    names = dict.fromkeys(name.name for tree in trees for name in names_in(tree))
    types_by_name = {name: types.get(name) for name in names}
    unlimited_types = (
        (name, type_ and replace(type_, range=None, valid_for_s=FOREVER_S)) for name, type_ in types_by_name.items()
    )
    return dict(unlimited_types)


def limit_places(trees: Iterable[Node], declared_elements: Iterable[Variable | Returned]) -> Iterator[Related]:
    """Yield the limits of the names in some conditions: ranges, and the validity of variables whose age is compared."""
    keys = {key for tree in trees for key in context_keys_of(tree)}
    for element in declared_elements:
        if isinstance(element, Variable) and age_key(element.name) in keys and element.valid_for_s < FOREVER_S:
            place = element.places.get("valid_for", element.place)
            yield Related(f"'{element.name}' is valid for {element.valid_for_s:g} s", place)
        if element.name in keys and element.type.range is not None:
            low, high = element.type.range
            unit_text = "" if element.type.unit is None else f" {element.type.unit}"
            place = element.type.places.get("range", element.place)
            yield Related(f"'{element.name}' is between {low:g} and {high:g}{unit_text}", place)
