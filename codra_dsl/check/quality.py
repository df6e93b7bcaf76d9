"""Phase 5: context that would mislead, and context that nobody asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from codra_dsl import graph
from codra_dsl.check.conditions import Role, Site
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import NEED_KEYS, OBSERVER, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import And, Call, Compare, Comparison, Name, Node
from codra_dsl.model import Algorithm, Variable, WhenUnobservable

_UPPER = (Comparison.LESS, Comparison.LESS_OR_EQUAL)


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


def unreached_variables(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What no skill needs, directly or through others, is not observed; without skills everything is."""
    lost = scope.lost("skills", "preview", "monitor") or scope.lost("perception", *NEED_KEYS, "identifies")
    if not scope.spec.skills or lost or scope.lost("observers", "identifies"):
        return
    wanted = reached(scope, (*decisions(scope), *sorted(faults.meant)))
    for variable in scope.variables.values():
        if variable.name not in wanted and faults.sound("context", variable.name):
            consequence = ": it gets no observer" if variable.name in scope.producers else ""
            message = f"no skill needs context-variable '{variable.name}'{consequence}"
            path, way_out = f"context.{variable.name}", "name it in a skill's 'preview' or 'monitor', or remove it"
            yield finding("unreached-variable", message, variable.place, path=path, way_out=way_out)


def decisions(scope: Scope) -> tuple[str, ...]:
    """Return the variables that decisions are based on, where Algorithm 2 starts (P1, its line 3)."""
    skills = scope.spec.skills
    if not skills:
        return tuple(name for name in scope.variables if name in scope.producers)
    named = (
        reference.name
        for skill in skills
        for reference in (*skill.preview, *(expectation.variable for expectation in skill.monitor))
    )
    return tuple(name for name in dict.fromkeys(named) if name in scope.variables)


def reached(scope: Scope, start: tuple[str, ...]) -> frozenset[str]:
    """Return the variables in force when some are decided on: what trees need and what they identify beside."""
    trees: dict[str, tuple[str, ...]] = {}
    for group in scope.groups:
        needs = dict.fromkeys(name for algorithm in group.algorithms for name in scope.needs[algorithm.name])
        trees |= dict.fromkeys(group.variables, (*group.variables, *needs))
    for setting in scope.spec.observers:
        joined = tuple(reference.name for reference in setting.identifies)
        trees |= {name: (*trees[name], *joined) for name in joined if name in trees}
    return frozenset(graph.closure(trees, start))


QUALITY = (unnoticed_preconditions, unreached_variables)
"""The rules of this phase."""


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
        bounded = {name for site in own for name in _bounded(site.condition.tree)}
        for site in own:
            for name in site.values:
                if name.name not in bounded and name.name not in found:
                    found[name.name] = algorithm, partial(site.condition.place_of, name)
        for reference in algorithm.given:
            if reference.name not in bounded:
                found.setdefault(reference.name, (algorithm, partial(getattr, reference, "place")))
    return found


def _bounded(tree: Node | None) -> Iterator[str]:
    """Yield the names whose age a condition bounds: those of `age(x) < ...` that must hold for it to be true."""
    for part in tree.operands if isinstance(tree, And) else (tree,):
        if isinstance(part, Compare) and len(part.rest) == 1:
            operator, right = part.rest[0]
            young = part.first if operator in _UPPER else right
            if operator not in (Comparison.EQUAL, Comparison.NOT_EQUAL) and isinstance(young, Call):
                argument = young.arguments[0]
                if young.function == "age" and isinstance(argument, Name):
                    yield argument.name


def _goes_stale(scope: Scope, variable: Variable) -> bool:
    """Return whether a variable becomes unknown by itself, or whether nothing can be said about that."""
    if variable.states_validity:
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
