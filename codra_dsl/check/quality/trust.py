"""Preconditions that would stay true after they have stopped being so."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from codra_dsl.check.ages import upper_bounds
from codra_dsl.check.conditions import Role, Site
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import NEED_KEYS, OBSERVER, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.model import Algorithm, Variable, WhenUnobservable


def unnoticed_preconditions(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What serves as a precondition says how long it stands: else it would stay true unnoticed.

    Enough is `valid_for`, or `when_unobservable: forget` where each algorithm that identifies the variable has
    preconditions itself and nobody else writes it. A condition that bounds the variable's age, and one that only asks
    whether it is known or how old it is, trusts no old value.
    """
    for name, (algorithm, place) in _trusting(scope).items():
        variable = scope.variables.get(name)
        if variable is None or not faults.sound("context", name) or _goes_stale(scope, variable):
            continue
        if not scope.readable("context", name, "source", "valid_for", "when_unobservable"):
            continue
        yield finding(
            "unnoticed-precondition",
            f"context-variable '{name}' is a precondition and would stay true unnoticed: {_reason(scope, variable)}",
            variable.place,
            path=f"context.{name}",
            way_out=_cure(scope, variable),
            related=(Related(f"algorithm '{algorithm.name}' trusts it", place()),),
        )


TRUST = (unnoticed_preconditions,)
"""The rules of this subject."""


def _trusting(scope: Scope) -> Mapping[str, tuple[Algorithm, Callable[[], Place]]]:
    """Return, for each variable whose last value a precondition trusts, the first algorithm that does, and where."""
    found: dict[str, tuple[Algorithm, Callable[[], Place]]] = {}
    sites: dict[str, list[Site]] = {}
    for site in scope.sites:
        if site.role is Role.OBSERVABLE_WHEN and not scope.judgements[id(site.condition)].problems:
            sites.setdefault(site.owner[1], []).append(site)
    for algorithm in scope.algorithms.values():
        if not scope.readable("perception", algorithm.name, "observable_when"):
            continue  # what bounds an age may be what could not be read
        own = sites.get(algorithm.name, [])
        bounded = {bound.name for site in own for bound in upper_bounds(site.condition)}
        for site in own:
            for name in site.values:
                if name.name not in bounded and name.name not in found:
                    found[name.name] = algorithm, partial(site.condition.place_of, name)
        for reference in algorithm.given:
            if reference.name not in bounded:
                found.setdefault(reference.name, (algorithm, partial(getattr, reference, "place")))
    return found


def _goes_stale(scope: Scope, variable: Variable) -> bool:
    """Return whether a variable becomes unknown by itself, or whether nothing can be said about that."""
    if variable.states_validity or variable.posed is not None:  # that goes stale with its poses
        return True
    forgets = variable.when_unobservable is WhenUnobservable.FORGET and _can_be_forgotten(scope, variable)
    return forgets or not (_others_write(variable) or variable.name in scope.producers)


def _can_be_forgotten(scope: Scope, variable: Variable) -> bool:
    """Return whether preconditions tell when a variable can no longer be observed."""
    producers = scope.producers.get(variable.name, ())
    return not _others_write(variable) and all(_waits(scope, name) for name in producers)


def _waits(scope: Scope, algorithm: str) -> bool:
    """Return whether an algorithm has preconditions, or whether nobody can tell."""
    return bool(scope.needs[algorithm]) or not scope.readable("perception", algorithm, *NEED_KEYS)


def _others_write(variable: Variable) -> bool:
    return any(source.name != OBSERVER for source in variable.sources)


def _reason(scope: Scope, variable: Variable) -> str:
    if _others_write(variable):
        return "it has a source other than observers"
    if variable.when_unobservable is WhenUnobservable.KEEP:
        return "its last value is kept"
    open_ended = (name for name in scope.producers[variable.name] if not _waits(scope, name))
    return f"it is never forgotten, for algorithm '{next(open_ended)}' has no preconditions"


def _cure(scope: Scope, variable: Variable) -> str:
    stated = "state 'valid_for', be it 'valid_for: forever'"
    return f"{stated}, or 'when_unobservable: forget'" if _can_be_forgotten(scope, variable) else stated
