"""Which of several conditions exclude each other, and what is to be told about that."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from codra_dsl.check.cases import conjuncts
from codra_dsl.check.cuts import subjects
from codra_dsl.check.outcomes import age_key
from codra_dsl.check.possible import can_hold
from codra_dsl.check.types import Types
from codra_dsl.diagnostics import Place, Related
from codra_dsl.expression import And, Node, names_in
from codra_dsl.model import FOREVER_S, Condition, Returned, Variable

MAX_CONDITIONS = 50
"""Of more conditions than these, the ones that exclude each other are not looked for."""


MAX_QUOTED = 3
"""How many conditions a message quotes beside the offender."""

MAX_RELATED = 10
"""How many places of such conditions a finding names."""


@dataclass(frozen=True, slots=True)
class Stated:
    """A condition as it is stated: what must be true, and where that is written.

    Attributes:
        parts: those of an `and`.
    """

    tree: Node
    text: str
    place: Place
    parts: tuple[Stated, ...] = ()


def stated(condition: Condition, tree: Node) -> Stated:
    """Return a condition with its parts; `tree` is its own, judged."""
    found = conjuncts([tree]) if isinstance(tree, And) else ()
    parts = (Stated(part, condition.text_of(part), condition.place_of(part)) for part in found)
    return Stated(tree, condition.text, condition.place, tuple(parts))


def contradiction(conditions: Sequence[Stated], types: Types) -> tuple[Stated, ...]:
    """Return the fewest found of some conditions that can never be true together, in their order; () if all can.

    Where several are needed, those that are an `and` are narrowed down to their parts.
    """
    if can_hold([each.tree for each in conditions], (), types):
        return ()
    alone = next((each for each in conditions if not can_hold([each.tree], (), types)), None)
    if alone is not None:
        return (alone,)
    needed = _needed(conditions, types)
    return _needed([part for each in needed for part in each.parts or (each,)], types)


def _needed(conditions: Sequence[Stated], types: Types) -> tuple[Stated, ...]:
    kept = list(conditions)
    for each in conditions if len(conditions) <= MAX_CONDITIONS else ():
        fewer = [other for other in kept if other is not each]
        if not can_hold([other.tree for other in fewer], (), types):
            kept = fewer
    return tuple(kept)


def never_true(core: Sequence[Stated]) -> str:
    """Return what is wrong with conditions that exclude each other, the last of them as the offender."""
    *others, last = core
    if not others:
        return f"'{last.text}' is never true"
    if len(core) > MAX_CONDITIONS:
        return "its conditions are never true together"
    quoted = " and ".join(f"'{each.text}'" for each in others[:MAX_QUOTED])
    if len(others) > MAX_QUOTED:
        quoted += f" and {len(others) - MAX_QUOTED} others"
    return f"'{last.text}' is never true together with {quoted}"


def related_to(core: Sequence[Stated], types: Types, declared: Iterable[Variable | Returned]) -> Iterator[Related]:
    """Yield the places that belong to conditions that exclude each other: the others, and ranges that are to blame."""
    *others, _ = core
    yield from (Related("cannot be true together with this", each.place) for each in others[:MAX_RELATED])
    trees = [each.tree for each in core]
    if can_hold(trees, (), without_ranges(types, trees)):
        yield from limits_of(trees, declared)


def without_ranges(types: Types, trees: Iterable[Node]) -> Types:
    """Return the types of the names in some conditions as if neither range nor validity were stated."""
    names = dict.fromkeys(name.name for tree in trees for name in names_in(tree))
    found = {name: types.get(name) for name in names}
    unlimited = ((name, each and replace(each, range=None, valid_for_s=FOREVER_S)) for name, each in found.items())
    return dict(unlimited)


def limits_of(trees: Iterable[Node], declared: Iterable[Variable | Returned]) -> Iterator[Related]:
    """Yield what limits the names in some conditions: ranges, and how long that whose age is asked is valid."""
    keys = {key for tree in trees for key in subjects(tree)}
    for each in declared:
        if isinstance(each, Variable) and age_key(each.name) in keys and each.valid_for_s < FOREVER_S:
            place = each.places.get("valid_for", each.place)
            yield Related(f"'{each.name}' is valid for {each.valid_for_s:g} s", place)
        if each.name in keys and each.type.range is not None:
            low, high = each.type.range
            unit = "" if each.type.unit is None else f" {each.type.unit}"
            place = each.type.places.get("range", each.place)
            yield Related(f"'{each.name}' is between {low:g} and {high:g}{unit}", place)
