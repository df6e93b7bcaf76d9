"""Preconditions and inputs of adaptations that stay in the context after they have become false in the world."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

from codra_dsl.language.check.conditions.conditions import Role, Site
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import NEED_KEYS, OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.solver.ages import upper_bounds
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import Call, Name, Node, walk
from codra_dsl.language.model import ADAPTER, Algorithm, Parameter, Variable, WhenUnobservable


def unnoticed_preconditions(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable in a precondition states how long it is valid; otherwise the precondition could stay true forever.

    It is enough to state `valid_for`. `when_unobservable: forget` is enough if each algorithm that identifies the
    variable has preconditions itself, and only observers write the variable. Two kinds of conditions use no old value
    and are ignored: conditions that bound the age of the variable, and conditions that read the variable only by
    `known` or `age`.
    """
    for name, (algorithm, place) in _first_trusting_algorithms(spec_index).items():
        variable = spec_index.variables.get(name)
        if variable is None or not faults.is_sound("context", name) or _goes_stale(spec_index, variable):
            continue
        if not spec_index.is_readable("context", name, "source", "valid_for", "when_unobservable"):
            continue
        yield finding(
            "unnoticed-precondition",
            f"context-variable '{name}' is a precondition, but its value never expires: "
            f"{_reason(spec_index, variable)}",
            variable.place,
            path=f"context.{name}",
            help=_help_text(spec_index, variable),
            related=(Related(f"algorithm '{algorithm.name}' uses it", place()),),
        )


def unnoticed_inputs(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable in the value of a parameter states how long it is valid, or its age is part of the value.

    Otherwise the parameter follows a value that stays although its writer has stopped. Variables that loops compute or
    set are ignored, and so are variables in preconditions, because another rule reports them.
    """
    value_sites = [site for site in spec_index.sites if site.role is Role.VALUE]
    reported_names = set(_first_trusting_algorithms(spec_index)) if value_sites else set[str]()
    seen_names = set[str]()
    for site in value_sites:
        if spec_index.judgements[id(site.condition)].problems:
            continue
        aged_names = _names_with_ages(site.condition.tree)
        names = (name for name in site.values if faults.is_sound(*site.owner) and name.name not in aged_names)
        for name, input_name in _names_with_inputs(spec_index, names, seen_names):
            variable = spec_index.variables.get(input_name)
            if variable is None or input_name in reported_names:
                continue
            if _is_computed(variable) or not faults.is_sound("context", input_name):
                continue
            if not spec_index.is_readable("context", input_name, "source", "valid_for", "when_unobservable"):
                continue
            reported_names.add(input_name)
            if not _goes_stale(spec_index, variable):
                yield finding(
                    "unnoticed-input",
                    f"adaptation '{site.owner[1]}' reads '{input_name}', but its value never expires: "
                    f"{_reason(spec_index, variable)}",
                    variable.place,
                    path=f"context.{input_name}",
                    help=_help_text(spec_index, variable),
                    related=(Related(f"adaptation '{site.owner[1]}' reads it", site.condition.place_of(name)),),
                )


def unnoticed_stops(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable that an adaptation sets states how long it is valid; else it outlives its loop.

    A variable that a precondition reads has a finding of its own.
    """
    reported_names = _first_trusting_algorithms(spec_index)
    for adaptation in spec_index.spec.adaptation:
        if not isinstance(adaptation.does, Parameter) or not faults.is_sound("adaptation", adaptation.name):
            continue
        target = adaptation.does.variable
        variable = spec_index.variables.get(target.name)
        if variable is None or variable.states_validity or target.name in reported_names:
            continue
        if faults.is_sound("context", target.name) and spec_index.is_readable("context", target.name, "valid_for"):
            yield finding(
                "unnoticed-stop",
                f"adaptation '{adaptation.name}' sets '{target.name}', whose value never expires: "
                "after the loop has stopped, the last value stays",
                variable.place,
                path=f"context.{target.name}",
                help="add 'valid_for', such as 'valid_for: 5 s'; or 'valid_for: forever' if the last value may stay",
                related=(Related(f"adaptation '{adaptation.name}' sets it", target.place),),
            )


def _names_with_inputs(
    spec_index: SpecIndex, names: Iterable[Name], seen_names: set[str]
) -> Iterator[tuple[Name, str]]:
    """Yield each name with its variable, or, if this is derived, with each variable from which it is derived."""
    return ((name, input_name) for name in names for input_name in _with_inputs(spec_index, name.name, seen_names))


def _with_inputs(spec_index: SpecIndex, name: str, seen_names: set[str]) -> Iterator[str]:
    """Yield a variable, or, if it is derived, the variables from whose values it is derived.

    Variables in `seen_names` are left out; all others are added to it.
    """
    pending_names = [name]
    while pending_names:
        other = pending_names.pop()
        if other in seen_names:
            continue
        seen_names.add(other)
        derived = spec_index.variables[other].derived if other in spec_index.variables else None
        if derived is None:
            yield other
        else:
            aged_names = _names_with_ages(derived.tree)
            pending_names += [need for need in reversed(spec_index.derived_inputs[other]) if need not in aged_names]


def _names_with_ages(tree: Node | None) -> frozenset[str]:
    """Return the names whose age a condition judges."""
    calls = () if tree is None else (part for part in walk(tree) if isinstance(part, Call))
    arguments = (argument for call in calls if call.function == "age" for argument in call.arguments)
    return frozenset(argument.name for argument in arguments if isinstance(argument, Name))


def _is_computed(variable: Variable) -> bool:
    is_adapted = ADAPTER in (source.name for source in variable.sources)
    return variable.is_derived or variable.rate is not None or is_adapted


TRUST_CHECKS = (unnoticed_preconditions, unnoticed_inputs, unnoticed_stops)
"""The checks of this module."""


def _first_trusting_algorithms(spec_index: SpecIndex) -> Mapping[str, tuple[Algorithm, Callable[[], Place]]]:
    """Return a mapping from variables to the first algorithm that uses the last value of the variable, and the place.

    The mapping contains each variable whose last value is used in a precondition or under `given`. The place is given
    by a function.
    """
    trusting_algorithms: dict[str, tuple[Algorithm, Callable[[], Place]]] = {}
    seen_names: set[str] = set()
    sites: dict[str, list[Site]] = {}
    for site in spec_index.sites:
        if site.role is Role.OBSERVABLE_WHEN and not spec_index.judgements[id(site.condition)].problems:
            sites.setdefault(site.owner[1], []).append(site)
    for algorithm in spec_index.algorithms.values():
        if not spec_index.is_readable("perception", algorithm.name, "observable_when"):
            continue  # a condition that could not be read may bound the age
        algorithm_sites = sites.get(algorithm.name, [])
        bounded_names = {bound.name for site in algorithm_sites for bound in upper_bounds(site.condition)}
        for site in algorithm_sites:
            names = (name for name in site.values if name.name not in bounded_names)
            for name, input_name in _names_with_inputs(spec_index, names, seen_names):
                trusting_algorithms[input_name] = algorithm, partial(site.condition.place_of, name)
        for reference in algorithm.given:
            if reference.name not in bounded_names:
                for input_name in _with_inputs(spec_index, reference.name, seen_names):
                    trusting_algorithms[input_name] = algorithm, partial(getattr, reference, "place")
    return trusting_algorithms


def _goes_stale(spec_index: SpecIndex, variable: Variable) -> bool:
    """Return whether a variable becomes unknown by itself. If this cannot be decided, return True."""
    if variable.states_validity or variable.is_computed:  # such a value expires with its inputs
        return True
    forgets = variable.when_unobservable is WhenUnobservable.FORGET and _can_be_forgotten(spec_index, variable)
    return forgets or not (_has_other_source(variable) or variable.name in spec_index.producers)


def _can_be_forgotten(spec_index: SpecIndex, variable: Variable) -> bool:
    """Return whether preconditions decide when a variable can no longer be observed."""
    producers = spec_index.producers.get(variable.name, ())
    return not _has_other_source(variable) and all(_has_preconditions(spec_index, name) for name in producers)


def _has_preconditions(spec_index: SpecIndex, algorithm: str) -> bool:
    """Return whether an algorithm has preconditions. If this is unknown, return True."""
    return bool(spec_index.needs[algorithm]) or not spec_index.is_readable("perception", algorithm, *NEED_KEYS)


def _has_other_source(variable: Variable) -> bool:
    return any(source.name != OBSERVER for source in variable.sources)


def _reason(spec_index: SpecIndex, variable: Variable) -> str:
    if _has_other_source(variable):
        return "it has a source other than observers"
    if variable.when_unobservable is WhenUnobservable.KEEP:
        return "its last value is kept"
    unconditional_algorithms = (
        name for name in spec_index.producers[variable.name] if not _has_preconditions(spec_index, name)
    )
    return f"it is never forgotten, because algorithm '{next(unconditional_algorithms)}' has no preconditions"


def _help_text(spec_index: SpecIndex, variable: Variable) -> str:
    valid_for_help = "add 'valid_for', for example 'valid_for: forever'"
    return (
        f"{valid_for_help}, or 'when_unobservable: forget'"
        if _can_be_forgotten(spec_index, variable)
        else valid_for_help
    )
