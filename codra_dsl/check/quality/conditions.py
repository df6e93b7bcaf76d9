"""Conditions over results that can never hold, and conditions that hold whatever is known."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from codra_dsl.check.contradictions import (
    Stated,
    contradiction,
    limits_of,
    never_true,
    related_to,
    stated,
    without_ranges,
)
from codra_dsl.check.possible import always_holds
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.check.types import Types
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.expression import Name, Node, Not, Truth, names_in, spelt_out
from codra_dsl.model import Algorithm, Condition, Hysteresis, Identification, Kind, Members, Returned, Variable

MAX_MEMBERS = 30
"""Of more members than these, the later ones are not held against those above them."""

MAX_TOLD = 5
"""How many further members a finding names."""


def never_holding(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Some result can be accepted, and can give each variable each value that a condition stands for."""
    yield from _once_per_shape(scope, faults, _never_holding)


def _never_holding(scope: Scope, faults: Faults, algorithm: Algorithm) -> Iterator[Diagnostic]:
    accepted = tuple(_stated(scope, algorithm.accept_when))
    types = scope.returned_types[algorithm.name]
    core = contradiction(accepted, types)
    if core:
        yield _never_true(algorithm, "accept_when", "rejects every result", core, types)
        return
    for entry in algorithm.identifies:
        if faults.sound("context", entry.variable.name) and entry.variable.name in scope.variables:
            yield from _never_identified(scope, algorithm, entry, accepted)


def always_holding(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """A condition can be false for some value: else it says nothing."""
    for algorithm in scope.algorithms.values():
        if not faults.sound("perception", algorithm.name):
            continue
        context = scope.context_types
        for each in _listed(scope, algorithm.observable_when):
            if always_holds(each.tree, context):
                declared = [scope.variables[name] for name in _names(each) if name in scope.variables]
                yield _always(algorithm, "observable_when", each, context, declared)
    yield from _once_per_shape(scope, faults, _always_holding)


def _always_holding(scope: Scope, faults: Faults, algorithm: Algorithm) -> Iterator[Diagnostic]:
    returned = scope.returned_types[algorithm.name]
    absent = frozenset(each.name for each in algorithm.returns if each.optional)
    for each in _listed(scope, algorithm.accept_when):
        if always_holds(each.tree, returned, absent=absent):
            yield _always(algorithm, "accept_when", each, returned, algorithm.returns)
    for entry in algorithm.identifies:
        for each in _truths(scope, faults, entry):
            if always_holds(each.tree, returned, absent=absent):
                key = f"identifies.{entry.variable.name}"
                yield _always(algorithm, key, each, returned, algorithm.returns)


CONDITIONS = (never_holding, always_holding)
"""The rules of this subject."""


def _once_per_shape(
    scope: Scope, faults: Faults, rule: Callable[[Scope, Faults, Algorithm], Iterable[Diagnostic]]
) -> Iterator[Diagnostic]:
    """Yield what a rule finds about what algorithms make of their results.

    Many algorithms of a large spec read alike: where one is right, so are all that have the same shape.
    """
    right: set[object] = set()
    for algorithm in scope.algorithms.values():
        if faults.sound("perception", algorithm.name):
            shape = scope.shape_over_results(algorithm, faults)
            found = () if shape in right else tuple(rule(scope, faults, algorithm))
            yield from found
            if not found:
                right.add(shape)


def _stated(scope: Scope, conditions: Iterable[Condition]) -> Iterator[Stated]:
    """Yield the conditions with which nothing is wrong."""
    for condition in conditions:
        judgement = scope.judgement(condition)
        if judgement is not None and not judgement.problems:
            yield stated(condition, spelt_out(judgement.typed.node))


def _listed(scope: Scope, conditions: Iterable[Condition]) -> Iterator[Stated]:
    """Yield the conditions of a list, the parts of an `and` each on its own, without those that are plain names."""
    for condition in conditions:
        for whole in _stated(scope, [condition]):
            for part in whole.parts or (whole,):
                if not isinstance(part.tree.operand if isinstance(part.tree, Not) else part.tree, Name):
                    yield part


def _names(each: Stated) -> Iterable[str]:
    return dict.fromkeys(name.name for name in names_in(each.tree))


def _truths(scope: Scope, faults: Faults, entry: Identification) -> Iterator[Stated]:
    """Yield the condition under which a bool is True, unless that is a literal: then it is meant so."""
    variable = scope.variables.get(entry.variable.name)
    by = entry.by.enter if isinstance(entry.by, Hysteresis) else entry.by
    if variable is None or not faults.sound("context", variable.name) or not isinstance(by, Condition):
        return
    if _is_bool(scope, entry):
        yield from (each for each in _stated(scope, [by]) if not isinstance(each.tree, (Truth, Name)))


def _always(
    algorithm: Algorithm, key: str, always: Stated, types: Types, declared: Iterable[Variable | Returned]
) -> Diagnostic:
    by_range = not always_holds(always.tree, without_ranges(types, [always.tree]))
    names = tuple(_names(always))
    place = f"'{key.partition('.')[0]}' of algorithm '{algorithm.name}'"
    known = f"remove it, or write 'known({names[0]})' if that is meant" if names else "remove it"
    ways = {"observable_when": known, "accept_when": "change the condition, or remove it"}
    return finding(
        "always-holds",
        f"'{always.text}' holds for every value that there can be ({place})",
        always.place,
        path=f"perception.{algorithm.name}.{key}",
        way_out=ways.get(key, "change the condition: as it is, the variable is never False"),
        related=tuple(limits_of([always.tree], declared)) if by_range else (),
    )


def _never_identified(
    scope: Scope, algorithm: Algorithm, entry: Identification, accepted: tuple[Stated, ...]
) -> Iterator[Diagnostic]:
    """Yield a finding for each value that a variable never gets, one for all that the same conditions keep back."""
    types = scope.returned_types[algorithm.name]
    before: dict[str, tuple[str, Stated]] = {}
    shadowed: dict[tuple[str, ...], list[tuple[str, Stated]]] = {}
    for value, condition in _values(scope, entry):
        for own in _stated(scope, [condition]):
            if isinstance(own.tree, Truth) and not own.tree.value:
                continue
            core = contradiction((*accepted, own), types)
            if core:
                name = entry.variable.name
                yield _never_true(algorithm, f"identifies.{name}", f"never identifies '{name}' as {value}", core, types)
                continue
            if len(before) == MAX_MEMBERS:
                break
            if not before:
                before[value] = value, own
                continue
            denied = [Stated(_denial(each), each.text, each.place) for _, each in before.values()]
            behind = contradiction((*accepted, *denied, own), types)
            blocking = [name for name, denial in zip(before, denied, strict=True) if denial in behind]
            if behind:
                shadowed.setdefault(tuple(blocking), []).append((value, own))
            else:
                before[value] = value, own
    for names, values in shadowed.items():
        if not isinstance(entry.by, Hysteresis) or not always_holds(before["true"][1].tree, types):
            yield _never_first(algorithm, entry, values, [before[name] for name in names])


def _values(scope: Scope, entry: Identification) -> Iterator[tuple[str, Condition]]:
    """Yield the values that conditions give a variable, in the order in which they are tried."""
    by = entry.by
    if isinstance(by, Members):
        yield from ((f"'{member.name}'", condition) for member, condition in by.cases)
    elif isinstance(by, Hysteresis):
        yield "true", by.enter
        if by.leave is not None:
            yield "false", by.leave
    elif _is_bool(scope, entry):
        yield "true", by


def _is_bool(scope: Scope, entry: Identification) -> bool:
    declared = scope.context_types.get(entry.variable.name)
    return declared is not None and declared.kind is Kind.BOOL


def _denial(each: Stated) -> Node:
    return Not(start=each.tree.start, end=each.tree.end, operand=each.tree)


def _never_true(algorithm: Algorithm, key: str, effect: str, core: Sequence[Stated], types: Types) -> Diagnostic:
    return finding(
        "never-holds",
        f"algorithm '{algorithm.name}' {effect}: {never_true(core)}",
        core[-1].place,
        path=f"perception.{algorithm.name}.{key}",
        way_out="change the condition",
        related=tuple(related_to(core, types, algorithm.returns)),
    )


def _never_first(
    algorithm: Algorithm,
    entry: Identification,
    values: Sequence[tuple[str, Stated]],
    blocking: Sequence[tuple[str, Stated]],
) -> Diagnostic:
    name = entry.variable.name
    (value, first), *others = values
    wider = " or ".join(f"'{each.text}'" for _, each in blocking)
    return finding(
        "never-holds",
        f"algorithm '{algorithm.name}' never identifies '{name}' as {value}: wherever '{first.text}' holds, "
        f"so does {wider} above it",
        first.place,
        path=f"perception.{algorithm.name}.identifies.{name}",
        way_out="change the order: the first condition that holds gives the value"
        if isinstance(entry.by, Members)
        else "change the condition",
        related=(
            *(Related("holds whenever it does", each.place) for _, each in blocking),
            *(Related(f"nor is it ever {other}", each.place) for other, each in others[:MAX_TOLD]),
        ),
    )
