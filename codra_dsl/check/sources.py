"""Phase 2: who gives each context-variable its value, and which algorithms make up one tree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.check.rules import finding
from codra_dsl.check.scope import NEED_KEYS, OBSERVER, Faults, Group, Scope
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.model import Algorithm, ObserverSetting, Reference


def unidentified_variables(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """A variable is identified by an algorithm or says who else writes it."""
    if scope.lost("perception", "identifies"):
        return
    nobodys = [
        name for name, variable in scope.variables.items() if name not in scope.producers and not variable.sources
    ]
    strange = [name for name in scope.producers if not scope.declares("context", name)]
    for variable in scope.variables.values():
        name = variable.name
        if name in nobodys and len(nobodys) <= len(strange):  # then an unknown name may be meant for it
            continue
        observed = [source for source in variable.sources if source.name == OBSERVER]
        others = len(variable.sources) - len(observed)
        if (
            name in scope.producers
            or name in faults.meant
            or not (faults.sound("context", name) and scope.readable("context", name, "source"))
            or (others and not observed)
        ):
            continue
        if others:
            message = f"source 'observer' of context-variable '{name}', which no algorithm identifies"
            place, way_out = observed[0].place, "remove 'observer', or add an algorithm that identifies it"
        else:
            message = f"nobody identifies context-variable '{name}'"
            place, way_out = (
                variable.place,
                "add an algorithm that identifies it, or say who else writes it with 'source'",
            )
        yield finding("unidentified-variable", message, place, path=f"context.{name}", way_out=way_out)


def observer_is_no_source(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What an algorithm identifies has the observer among its sources."""
    for name, producers in scope.producers.items():
        variable = scope.variables.get(name)
        if variable is None or not variable.sources or not faults.sound("context", name):
            continue
        if not scope.readable("context", name, "source"):
            continue
        if OBSERVER not in (source.name for source in variable.sources):
            algorithm = scope.algorithms[producers[0]]
            sources = " and ".join(f"'{source.name}'" for source in variable.sources)
            message = (
                f"context-variable '{name}' comes only from {sources}, but algorithm '{algorithm.name}' identifies it"
            )
            yield finding(
                "observer-is-no-source",
                message,
                variable.places.get("source", variable.place),
                path=f"context.{name}.source",
                way_out="add 'observer' to 'source'",
                related=(Related("identified here", _identified(algorithm, name).place),),
            )


def same_rank(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Alternatives are tried in an order, which their ranks settle."""
    for group in scope.groups:
        for rank in sorted({each.rank for each in group.algorithms}):
            tied = sorted((each for each in group.algorithms if each.rank == rank), key=lambda each: each.place.span)
            if len(tied) > 1 and _declared(scope, group) and _readable(scope, tied, "rank"):
                yield _tie(group, tied, rank)


def incomplete_first_alternative(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """The first of several alternatives identifies every variable of their tree."""
    for group in scope.groups:
        whole = _declared(scope, group) and _readable(scope, group.algorithms, "rank", "identifies")
        if group.beyond_first and group.settled and whole:
            first, missing = group.algorithms[0], group.beyond_first[0]
            other = next(each for each in group.algorithms if _has(each, missing))
            yield finding(
                "incomplete-first-alternative",
                f"algorithm '{first.name}' is the first of its alternatives, but does not identify '{missing}'",
                first.places.get("identifies", first.place),
                path=f"perception.{first.name}.identifies",
                way_out=f"identify '{missing}' here too, or in an algorithm that shares no variable with this one",
                related=(Related(f"algorithm '{other.name}' does", _identified(other, missing).place),),
            )


def observers_without_algorithm(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """`observers` names only variables that an algorithm identifies."""
    if scope.lost("perception", "identifies"):
        return
    for setting in scope.spec.observers:
        for reference in setting.identifies:
            variable = scope.variables.get(reference.name)
            if variable is None or reference.name in scope.producers or reference.name in faults.meant:
                continue
            if any(source.name != OBSERVER for source in variable.sources):
                message = f"'{reference.name}' in observer '{setting.name}' has no algorithm that identifies it"
                path, way_out = _path(setting), "remove it: an observer identifies by algorithms"
                yield finding("observer-without-algorithm", message, reference.place, path=path, way_out=way_out)


def variables_in_two_observers(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """A tree has one name, period and priority."""
    for setting in scope.spec.observers:
        reported: set[str] = set()
        for reference in setting.identifies:
            owner, first = scope.claims[reference.name]
            if owner.name != setting.name and owner.name not in reported:
                reported.add(owner.name)
                message = f"'{reference.name}' in observer '{setting.name}' is in observer '{owner.name}', too"
                way_out = "name it in one of them"
                related = (Related(f"in observer '{owner.name}'", first.place),)
                yield finding(
                    "variable-in-two-observers",
                    message,
                    reference.place,
                    path=_path(setting),
                    way_out=way_out,
                    related=related,
                )


def observers_that_mix(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Trees of different algorithms are joined only where their conditions are the same set."""
    for setting in scope.spec.observers:
        groups = _groups(scope, setting)
        others = (group for group in groups[1:] if not _joinable(groups[0], group))
        strange = next(others, None)
        if strange is not None and _in_order(scope, faults, setting, groups):
            yield _mixed(setting, groups[0], strange)


def observers_that_split(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """An observer names all variables of its tree."""
    for setting in scope.spec.observers:
        groups = _groups(scope, setting)
        if not _in_order(scope, faults, setting, groups) or any(not _joinable(groups[0], each) for each in groups[1:]):
            continue
        named = {reference.name for reference in setting.identifies}
        for group in groups:
            missing = [name for name in group.variables if name not in named and name in scope.variables]
            later = [name for name in missing if name in scope.claims and _comes_later(scope, name, setting)]
            if missing and not later:
                yield _split(scope, setting, group, missing[0])


def observer_names_taken(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """No observer has the name that another tree gets from its first algorithm."""
    if scope.lost("observers", "identifies"):
        return
    unnamed = {
        group.algorithms[0].name.casefold(): group.algorithms[0]
        for group in scope.groups
        if not any(name in scope.claims for name in group.variables)
    }
    for setting in scope.spec.observers:
        other = unnamed.get(setting.name.casefold())
        if other is not None:
            message = f"observer '{setting.name}' has the name of the tree of algorithm '{other.name}'"
            yield finding(
                "observer-name-taken",
                message,
                setting.place,
                path=f"observers.{setting.name}",
                way_out="choose another name, or name that tree in 'observers' as well",
                related=(Related("the algorithm", other.place),),
            )


SOURCES = (
    unidentified_variables,
    observer_is_no_source,
    same_rank,
    incomplete_first_alternative,
    observers_without_algorithm,
    variables_in_two_observers,
    observers_that_mix,
    observers_that_split,
    observer_names_taken,
)
"""The rules of this phase."""


def _tie(group: Group, tied: list[Algorithm], rank: int) -> Diagnostic:
    first, second, *rest = tied
    named = " and ".join(f"'{each.name}'" for each in tied)
    shared = max(group.variables, key=lambda name: sum(_has(each, name) for each in tied))
    return finding(
        "same-rank",
        f"algorithms {named} are alternatives for '{shared}' and share rank {rank}",
        second.places.get("rank", second.place),
        path=f"perception.{second.name}.rank",
        way_out="give each a 'rank' of its own: the smallest is tried first",
        related=tuple(
            Related(f"algorithm '{each.name}'", each.places.get("rank", each.place)) for each in (first, *rest)
        ),
    )


def _mixed(setting: ObserverSetting, first: Group, other: Group) -> Diagnostic:
    one, two = first.algorithms[0], other.algorithms[0]
    several = next((group.algorithms[0] for group in (first, other) if len(group.algorithms) > 1), None)
    reason = "whose conditions differ" if several is None else f"of which '{several.name}' has an alternative"
    return finding(
        "observer-mixes-trees",
        f"observer '{setting.name}' joins algorithms '{one.name}' and '{two.name}', {reason}",
        setting.places.get("identifies", setting.place),
        path=_path(setting),
        way_out="make an observer for each, or give both the same 'observable_when' and 'given'",
        related=tuple(Related(f"algorithm '{each.name}'", each.place) for each in (one, two)),
    )


def _split(scope: Scope, setting: ObserverSetting, group: Group, missing: str) -> Diagnostic:
    algorithm = next(each for each in group.algorithms if _has(each, missing))
    owner = scope.claims[missing][0].name if missing in scope.claims else None
    where = "" if owner is None else f", which observer '{owner}' names"
    message = f"observer '{setting.name}' leaves out '{missing}', which algorithm '{algorithm.name}' identifies with it"
    return finding(
        "observer-splits-tree",
        message + where,
        setting.places.get("identifies", setting.place),
        path=_path(setting),
        way_out=f"add '{missing}': an observer names all variables of its tree",
        related=(Related("identified here", _identified(algorithm, missing).place),),
    )


def _path(setting: ObserverSetting) -> str:
    return f"observers.{setting.name}.identifies"


def _has(algorithm: Algorithm, name: str) -> bool:
    return any(entry.variable.name == name for entry in algorithm.identifies)


def _identified(algorithm: Algorithm, name: str) -> Reference:
    return next(entry.variable for entry in algorithm.identifies if entry.variable.name == name)


def _groups(scope: Scope, setting: ObserverSetting) -> tuple[Group, ...]:
    """Return the groups whose variables an observer names, in its order."""
    found = (scope.group_of.get(reference.name) for reference in setting.identifies)
    return tuple(dict.fromkeys(group for group in found if group is not None))


def _declared(scope: Scope, group: Group) -> bool:
    """Return whether all that a group identifies is declared: else it may be another group than was meant."""
    return all(scope.declares("context", name) for name in group.variables)


def _in_order(scope: Scope, faults: Faults, setting: ObserverSetting, groups: Iterable[Group]) -> bool:
    """Return whether nothing has been found wrong with an observer and the algorithms of its trees."""
    shared = any(scope.claims[reference.name][0].name != setting.name for reference in setting.identifies)
    readable = scope.readable("observers", setting.name, "identifies")
    if shared or not readable or not faults.sound("observers", setting.name):
        return False
    return all(
        _declared(scope, group)
        and _readable(scope, group.algorithms, *NEED_KEYS, "identifies", "rank")
        and group.settled
        and not group.beyond_first
        and all(faults.sound("perception", each.name) for each in group.algorithms)
        for group in groups
    )


def _readable(scope: Scope, algorithms: Iterable[Algorithm], *keys: str) -> bool:
    return all(scope.readable("perception", each.name, *keys) for each in algorithms)


def _joinable(one: Group, other: Group) -> bool:
    if len(one.algorithms) > 1 or len(other.algorithms) > 1:
        return False
    return _guards(one.algorithms[0]) == _guards(other.algorithms[0])


def _guards(algorithm: Algorithm) -> frozenset[object]:
    """Return what must hold before an algorithm starts, as a set; conditions are equal if they say the same."""
    conditions = {condition.tree for condition in algorithm.observable_when}
    return frozenset(conditions) | {reference.name for reference in algorithm.given}


def _comes_later(scope: Scope, name: str, setting: ObserverSetting) -> bool:
    return scope.claims[name][0].place.span > setting.place.span
