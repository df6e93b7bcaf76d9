"""What became of context-variables: names, types, writers, validity, and who identifies them."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from codra_dsl.build_plan.names import camel_case, entry_names
from codra_dsl.check.intervals import in_base
from codra_dsl.diagnostics import Place, suggest
from codra_dsl.model import Kind, Refresh, ValueType, Variable, WhenUnobservable
from codra_dsl.review.changes import Category, Change
from codra_dsl.review.version import Pair, Side, seconds
from codra_dsl.units import ONE, parse_unit

_OBSERVER = "observer"
_NUMERIC = (Kind.INT, Kind.FLOAT)


def variable_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of each variable."""
    told: set[tuple[str, ...]] = set()
    for name, old in pair.old.variables.items():
        new = pair.new.variables.get(name)
        if new is None and not old.is_derived:
            yield _removed(pair, old)
        elif new is not None:
            yield from _of_type(pair, old, new)
            yield from _of_writers(pair, old, new)
            yield from _of_value(pair, old, new)
            yield from _of_words(pair, old, new)
            yield from _of_producers(pair, name, told)
    for name in sorted(pair.gained):
        variable = pair.new.variables[name]
        if variable.is_derived:
            continue
        yield Change(
            category=Category.ADDED,
            element=pair.new.id("context", name),
            message="new context-variable",
            after=variable.place,
        )
    yield from _lost_aliases(pair)


def same_measure(old: ValueType, new: ValueType) -> bool:
    """Return whether numbers of two types mean the same."""
    units = [None if each.unit is None else parse_unit(each.unit) for each in (old, new)]
    return old.kind is new.kind and units[0] == units[1]


def lost_and_gained(old: ValueType, new: ValueType) -> tuple[bool, bool]:
    """Return whether a type has lost values, and whether it has gained some; units of one dimension are converted."""
    if old.kind is Kind.ENUM:
        return not set(old.values) <= set(new.values), not set(new.values) <= set(old.values)
    (low, high), (new_low, new_high) = _extent(old), _extent(new)
    return new_low > low or new_high < high, new_low < low or new_high > high


def described(declared: ValueType) -> str:
    """Return a type as people write it."""
    unit = "" if declared.unit is None else f" in {declared.unit}"
    ends = "" if declared.range is None else f" from {declared.range[0]:g} to {declared.range[1]:g}"
    members = f" of {', '.join(declared.values)}" if declared.values else ""
    return f"{declared.kind}{unit}{ends}{members}"


def _extent(declared: ValueType) -> tuple[Fraction | float, Fraction | float]:
    if declared.range is None:
        return float("-inf"), float("inf")
    unit = (None if declared.unit is None else parse_unit(declared.unit)) or ONE
    low, high = (in_base(end, unit) for end in declared.range)
    return low, high


def _change(
    pair: Pair, both: tuple[Variable, Variable], category: Category, key: str, message: str, *told: str
) -> Change:
    (old, new), (was, now) = both, told or (None, None)
    return Change(
        category=category,
        element=pair.new.id("context", new.name),
        key=key,
        message=message,
        was=was,
        now=now,
        before=_at(old, key),
        after=_at(new, key),
    )


def _at(variable: Variable, key: str) -> Place:
    places = variable.type.places if key in ("type", "unit", "range", "values") else variable.places
    return places.get(key, variable.place)


def _removed(pair: Pair, old: Variable) -> Change:
    successor = _successor(pair, old)
    hint = "" if successor is None else f"; '{successor}' looks like its new name"
    return Change(
        category=Category.REMOVED,
        element=pair.old.id("context", old.name),
        message=f"the context-variable is gone{hint}",
        before=old.place,
    )


def _successor(pair: Pair, old: Variable) -> str | None:
    """Return the new variable of the same type that the same algorithm identifies, or that has a similar name."""
    same = [name for name in sorted(pair.gained) if pair.new.variables[name].type == old.type]
    makers = {pair.algorithms.get(maker) for maker in pair.old.producers.get(old.name, ())} - {None}
    made = [name for name in same if makers & set(pair.new.producers.get(name, ()))]
    if made:
        return made[0] if len(made) == 1 else suggest(old.name, made)
    unmade = [name for name in same if not makers and name not in pair.new.producers]
    return suggest(old.name, unmade)


def _of_type(pair: Pair, old: Variable, new: Variable) -> Iterator[Change]:
    one, other = old.type, new.type
    was, now = described(one), described(other)
    if one.kind is not other.kind:
        yield _change(pair, (old, new), Category.RETYPED, "type", "has another type", was, now)
        return
    if one.kind in _NUMERIC and not same_measure(one, other):
        yield _change(pair, (old, new), Category.RETYPED, "unit", "has another unit", was, now)
        if not _comparable(one, other):
            return
    lost, gained = lost_and_gained(one, other)
    key = "values" if one.kind is Kind.ENUM else "range"
    what = "members" if one.kind is Kind.ENUM else "values"
    if lost:
        yield _change(pair, (old, new), Category.NARROWED, key, f"has lost {what}", was, now)
    if gained:
        yield _change(pair, (old, new), Category.WIDENED, key, f"has new {what}", was, now)


def _comparable(one: ValueType, other: ValueType) -> bool:
    units = [None if each.unit is None else parse_unit(each.unit) for each in (one, other)]
    dimensions = [None if unit is None else unit.dimension for unit in units]
    return dimensions[0] == dimensions[1]


def _of_writers(pair: Pair, old: Variable, new: Variable) -> Iterator[Change]:
    before, after = ([source.name for source in each.sources if source.name != _OBSERVER] for each in (old, new))
    was, now = (", ".join(names) or "observers only" for names in (before, after))
    lost, gained = sorted(set(before) - set(after)), sorted(set(after) - set(before))
    if lost:
        message = f"{', '.join(lost)} may not write it any more"
        yield _change(pair, (old, new), Category.UNWRITABLE, "source", message, was, now)
    if gained:
        message = f"{', '.join(gained)} may write it as well"
        yield _change(pair, (old, new), Category.WIDENED, "source", message, was, now)


def _of_value(pair: Pair, old: Variable, new: Variable) -> Iterator[Change]:
    if old.valid_for_s != new.valid_for_s:
        longer = new.valid_for_s > old.valid_for_s
        category = Category.WEAKER if longer else Category.STRONGER
        message = f"evidence stands {'longer' if longer else 'for less time'}"
        was, now = seconds(old.valid_for_s), seconds(new.valid_for_s)
        yield _change(pair, (old, new), category, "valid_for", message, was, now)
    if old.when_unobservable is not new.when_unobservable:
        keeps = new.when_unobservable is WhenUnobservable.KEEP
        category = Category.WEAKER if keeps else Category.STRONGER
        message = f"the last value is {'kept' if keeps else 'forgotten'} when it can no longer be observed"
        yield _change(
            pair, (old, new), category, "when_unobservable", message, old.when_unobservable, new.when_unobservable
        )
    if old.refresh is not new.refresh:
        rarer = new.refresh is Refresh.ON_EVENT
        category = Category.SLOWER if rarer else Category.FASTER
        yield _change(pair, (old, new), category, "refresh", "is looked at by another rule", old.refresh, new.refresh)
    if old.history != new.history:
        fewer = new.history < old.history
        message = f"{'fewer' if fewer else 'more'} readings are kept"
        category = Category.STRONGER if fewer else Category.EASED
        yield _change(pair, (old, new), category, "history", message, str(old.history), str(new.history))


def _of_words(pair: Pair, old: Variable, new: Variable) -> Iterator[Change]:
    if old.label != new.label:
        yield _change(
            pair, (old, new), Category.WORDING, "label", "has another label", repr(old.label), repr(new.label)
        )
    if old.description != new.description:
        yield _change(pair, (old, new), Category.WORDING, "description", "is described in other words")
    if old.node != new.node:
        named = any(side.plan.checked.spec.knows for side in (pair.old, pair.new))  # then agents name it with its node
        category = Category.API if named else Category.LAYOUT
        yield _change(pair, (old, new), category, "of", "belongs to another node", old.node, new.node)


def _of_producers(pair: Pair, name: str, told: set[tuple[str, ...]]) -> Iterator[Change]:
    """Yield what became of the algorithms that identify a variable; an order is told once for all that share it."""
    before = [pair.algorithms.get(each, f"-{each}") for each in pair.old.producers.get(name, ())]
    after = list(pair.new.producers.get(name, ()))
    if before == after:
        return
    kept = [each for each in before if each in after]
    category, message = _meaning(before, after, kept)
    if kept and set(before) == set(after):
        if tuple(after) in told:
            return
        told.add(tuple(after))
    was, now = (", ".join(each.removeprefix("-") for each in names) or "no algorithm" for names in (before, after))
    yield Change(
        category=category,
        element=pair.new.id("context", name),
        message=message,
        was=was,
        now=now,
        before=_first_place(pair.old, name),
        after=_first_place(pair.new, name),
    )


def _meaning(before: list[str], after: list[str], kept: list[str]) -> tuple[Category, str]:
    if not before:
        return Category.OBSERVABLE, "an observer identifies it now"
    if not after:
        return Category.UNOBSERVABLE, "no observer identifies it any more"
    if not kept:
        return Category.PERCEIVED_OTHERWISE, "other algorithms identify it"
    if set(before) - set(after):
        return Category.STRONGER, "it has fewer alternatives"
    if [each for each in after if each in before] != before:
        return Category.PERCEIVED_OTHERWISE, "its alternatives are tried in another order"
    if after[: len(before)] != before:
        return Category.PERCEIVED_OTHERWISE, "a new alternative is tried before one that it had"
    return Category.ADDED, "it has one more alternative"


def _first_place(side: Side, name: str) -> Place:
    producers = side.producers.get(name)
    return side.algorithms[producers[0]].algorithm.place if producers else side.variables[name].place


# Names in the generated package


def enum_types(side: Side) -> dict[str, tuple[str, ...]]:
    """Return the variables by the name that the generated package gives to the type of their values."""
    groups: dict[tuple[str, ...], list[str]] = {}
    kinds: dict[object, None] = {}
    for variable in side.variables.values():
        kinds[variable.type.kind, variable.type.values] = None
        if variable.type.kind is Kind.ENUM:
            groups.setdefault(variable.type.values, []).append(variable.name)
    taken = {side.plan.class_name, *entry_names(side.plan.checked.spec)}
    found: dict[str, tuple[str, ...]] = {}
    for names in groups.values():
        alias = camel_case(names[0])
        while {alias, f"{alias}Name"} & taken:
            alias += "_"
        taken |= {alias, f"{alias}Name"}
        found[alias] = tuple(names)
    return found


def _lost_aliases(pair: Pair) -> Iterator[Change]:
    present = enum_types(pair.new)
    for alias, names in enum_types(pair.old).items():
        still = [name for name in names if name in pair.new.variables]
        enums = [name for name in still if pair.new.variables[name].type.kind is Kind.ENUM]
        if alias not in present and enums:
            now = next(other for other, named in present.items() if enums[0] in named)
            yield Change(
                category=Category.API,
                element=pair.new.id("context", enums[0]),
                key="values",
                message="the generated package has another name for its values",
                was=alias,
                now=now,
                before=pair.old.variables[names[0]].place,
                after=pair.new.variables[enums[0]].place,
            )
