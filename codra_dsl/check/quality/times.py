"""Values that go stale before newer ones can be there, and looking that is more often than is meant or possible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from codra_dsl import graph
from codra_dsl.check.ages import upper_bounds
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import OBSERVER, Faults, Group, Scope, watched_by
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.model import (
    DEFAULT_PERIOD_S,
    FOREVER_S,
    Access,
    Algorithm,
    ObserverSetting,
    Refresh,
    Resource,
    Skill,
    Variable,
    needed_of,
)

MAX_VISITS = 300_000
"""How many variables are visited, for all skills together; skills that come later are not looked at."""

_ROUNDING = 1e-9

MAX_TOLD = 5
"""How many algorithms a finding about a resource names."""


@dataclass(frozen=True, slots=True)
class Renewal:
    """How an algorithm renews evidence: it looks again a pause after it began, and has its result within its timeout.

    Attributes:
        period_s: of its observer.
        setting: the entry under `observers` that sets the period.
    """

    algorithm: Algorithm
    period_s: float
    setting: ObserverSetting | None

    @property
    def pause_s(self) -> float:
        """Return how long after it began to look it does so again."""
        return max(self.period_s, self.algorithm.min_interval_s)

    @property
    def oldest_s(self) -> float:
        """Return how old evidence can be before newer takes its place."""
        return round(self.pause_s + self.algorithm.timeout_s, 9)

    def confirming_s(self, variable: str) -> float:
        """Return how old the first of the results that confirm a variable can be when the last one is there."""
        needed = max(needed_of(entry) for entry in self.algorithm.identifies if entry.variable.name == variable)
        return round((needed - 1) * max(self.pause_s, self.algorithm.timeout_s), 9)


def stale_before_renewed(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Evidence stands until newer can be there, for the variable itself and for who demands a certain age."""
    if scope.lost("observers", "identifies", "period") or scope.lost("perception", "identifies"):
        return
    for name, variable in scope.variables.items():
        if name in scope.reached and variable.valid_for_s < FOREVER_S and faults.sound("context", name):
            renewal = _slowest(scope, faults, name)
            if renewal is not None and variable.valid_for_s < renewal.oldest_s:
                yield _stale(variable, renewal)
            elif renewal is not None and variable.valid_for_s <= renewal.confirming_s(name):
                yield _never_confirmed(variable, renewal)
    for algorithm in scope.algorithms.values():
        reached = any(entry.variable.name in scope.reached for entry in algorithm.identifies)
        if reached and algorithm.observable_when and faults.sound("perception", algorithm.name):
            yield from _demands(scope, faults, algorithm)


def oversubscribed_slots(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What observers that run at once need of a slot's time is not more than there is."""
    contested = _contested(scope, faults)
    worst: dict[str, _Demand] = {}
    left = MAX_VISITS
    for skill in (scope.spec.skills or (None,)) if contested else ():
        needed = graph.closure(scope.trees, scope.decisions if skill is None else watched_by(skill))
        left -= len(needed)
        if left < 0:
            break
        groups = dict.fromkeys(group for name in needed if (group := scope.group_of.get(name)) is not None)
        for name, shares in contested.items():
            demand = _Demand(skill, tuple(shares[group] for group in groups if group in shares))
            if (
                demand.total
                > max(worst[name].total if name in worst else 0, scope.resources[name].slots or 0) + _ROUNDING
            ):
                worst[name] = demand
    yield from (_oversubscribed(scope.resources[name], demand) for name, demand in worst.items())


def ineffective_on_event(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What is looked at on events only is not identified beside what is looked at periodically."""
    for algorithm in scope.algorithms.values():
        known = [each for entry in algorithm.identifies if (each := scope.variables.get(entry.variable.name))]
        periodic = next((each for each in known if each.refresh is Refresh.PERIODIC), None)
        if periodic is None or not faults.sound("perception", algorithm.name):
            continue
        for variable in known:
            if variable.refresh is Refresh.ON_EVENT and faults.sound("context", variable.name):
                yield finding(
                    "ineffective-on-event",
                    f"'refresh: on_event' of '{variable.name}' has no effect: algorithm '{algorithm.name}' also "
                    f"identifies '{periodic.name}', for which it looks periodically",
                    variable.places.get("refresh", variable.place),
                    path=f"context.{variable.name}.refresh",
                    way_out=f"say 'refresh: on_event' for '{periodic.name}' as well, or for none",
                    related=(Related("declared here", periodic.place),),
                )


TIMES = (stale_before_renewed, oversubscribed_slots, ineffective_on_event)
"""The rules of this subject."""


def _slowest(scope: Scope, faults: Faults, name: str) -> Renewal | None:
    """Return how a variable is renewed by the slowest of its algorithms; None if it is not, or if nobody knows."""
    setting, _ = scope.claims.get(name, (None, None))
    if setting is not None and not faults.sound("observers", setting.name):
        return None
    found = []
    for producer in scope.producers.get(name, ()):
        sound = faults.sound("perception", producer)
        if not sound or not scope.readable("perception", producer, "timeout", "min_interval"):
            return None
        period_s = DEFAULT_PERIOD_S if setting is None else setting.period_s
        found.append(Renewal(scope.algorithms[producer], period_s, setting))
    return max(found, key=lambda each: each.oldest_s, default=None)


def _stale(variable: Variable, renewal: Renewal) -> Diagnostic:
    return finding(
        "stale-before-renewed",
        f"context-variable '{variable.name}' can go stale though everything works: its evidence can be up to "
        f"{_seconds(renewal.oldest_s)} old before newer is there, and is valid for {_seconds(variable.valid_for_s)}",
        variable.places.get("valid_for", variable.place),
        path=f"context.{variable.name}.valid_for",
        way_out="a longer 'valid_for', or a shorter 'timeout' or 'period'",
        related=tuple(_renewed(renewal)),
    )


def _never_confirmed(variable: Variable, renewal: Renewal) -> Diagnostic:
    return finding(
        "stale-before-renewed",
        f"context-variable '{variable.name}' may never be confirmed though everything works: the first result that "
        f"'confirm' needs can be {_seconds(renewal.confirming_s(variable.name))} older than the last, and is valid for "
        f"{_seconds(variable.valid_for_s)}",
        variable.places.get("valid_for", variable.place),
        path=f"context.{variable.name}.valid_for",
        way_out="a longer 'valid_for', a shorter 'period', or a 'confirm' that needs fewer results",
        related=tuple(_renewed(renewal)),
    )


def _demands(scope: Scope, faults: Faults, algorithm: Algorithm) -> Iterator[Diagnostic]:
    """Yield a finding for each age that an algorithm demands and that observers cannot keep up with."""
    for condition in algorithm.observable_when:
        judgement = scope.judgement(condition)
        for bound in upper_bounds(condition) if judgement is not None and not judgement.problems else ():
            variable = scope.variables.get(bound.name)
            if variable is None or bound.limit_s is None or not faults.sound("context", variable.name):
                continue
            observed = all(source.name == OBSERVER for source in variable.sources)
            renewal = _slowest(scope, faults, variable.name)
            if observed and renewal is not None and bound.limit_s < renewal.oldest_s:
                yield finding(
                    "stale-before-renewed",
                    f"algorithm '{algorithm.name}' needs '{condition.text_of(bound.node)}', but evidence about "
                    f"'{variable.name}' can be up to {_seconds(renewal.oldest_s)} old though everything works",
                    condition.place_of(bound.node),
                    path=f"perception.{algorithm.name}.observable_when",
                    way_out="a larger age, or a shorter 'timeout' or 'period'",
                    related=tuple(_renewed(renewal)),
                )


def _renewed(renewal: Renewal) -> Iterator[Related]:
    """Yield where it is said how long a new look takes, and how long the pause before it is."""
    algorithm, setting = renewal.algorithm, renewal.setting
    took = algorithm.places.get("timeout", algorithm.place)
    yield Related(f"algorithm '{algorithm.name}' has its result after up to {_seconds(algorithm.timeout_s)}", took)
    if algorithm.min_interval_s > renewal.period_s:
        place = algorithm.places.get("min_interval", algorithm.place)
        yield Related(f"it looks again after {_seconds(algorithm.min_interval_s)}", place)
    elif setting is not None:
        place = setting.places.get("period", setting.place)
        yield Related(f"observer '{setting.name}' looks again after {_seconds(setting.period_s)}", place)


@dataclass(frozen=True, slots=True)
class _Share:
    """How much of a slot's time an algorithm needs: up to its timeout, once while its evidence is valid."""

    algorithm: Algorithm
    valid_for_s: float

    @property
    def of_slot(self) -> float:
        return self.algorithm.timeout_s / self.valid_for_s


@dataclass(frozen=True, slots=True)
class _Demand:
    """What the observers of a skill, or all of them, need of a resource's slots."""

    skill: Skill | None
    shares: tuple[_Share, ...]

    @property
    def total(self) -> float:
        return sum(share.of_slot for share in self.shares)


def _contested(scope: Scope, faults: Faults) -> Mapping[str, Mapping[Group, _Share]]:
    """Return the resources that all observers together ask too much of: the share of each group of alternatives."""
    found: dict[str, dict[Group, _Share]] = {}
    for group in scope.groups:
        for algorithm in group.algorithms:
            share = _share(scope, faults, algorithm)
            for usage in algorithm.uses if share is not None else ():
                if usage.access is Access.SLOT and share is not None:
                    shares = found.setdefault(usage.resource.name, {})
                    shares[group] = max(share, shares.get(group, share), key=lambda each: each.of_slot)
    return {
        name: shares
        for name, shares in found.items()
        if (resource := scope.resources.get(name)) is not None
        and resource.slots is not None
        and faults.sound("resources", name)
        and scope.readable("resources", name, "slots")
        and sum(share.of_slot for share in shares.values()) > resource.slots
    }


def _share(scope: Scope, faults: Faults, algorithm: Algorithm) -> _Share | None:
    """Return what an algorithm needs of a slot; None if that is nothing, or if nobody knows."""
    sound = faults.sound("perception", algorithm.name)
    if not sound or not scope.readable("perception", algorithm.name, "timeout", "uses"):
        return None
    names = [entry.variable.name for entry in algorithm.identifies]
    valid = [
        scope.variables[name].valid_for_s
        for name in names
        if name in scope.variables and scope.readable("context", name, "valid_for")
    ]
    valid_for_s = min(valid, default=FOREVER_S)
    return _Share(algorithm, valid_for_s) if valid_for_s < FOREVER_S else None


def _oversubscribed(resource: Resource, demand: _Demand) -> Diagnostic:
    skill = demand.skill
    who = "all observers together need" if skill is None else f"the observers of skill '{skill.name}' need"
    number = "1 slot" if resource.slots == 1 else f"{resource.slots} slots"
    largest = sorted(demand.shares, key=lambda each: (-each.of_slot, each.algorithm.name))
    return finding(
        "oversubscribed-slot",
        f"resource '{resource.name}' has {number}, but {who} {demand.total:.4g}: some value goes stale however they "
        "are granted",
        resource.place,
        path=f"resources.{resource.name}",
        way_out="more slots, shorter timeouts, longer validity, or fewer variables in the skill",
        related=(
            *([] if skill is None else [Related("the skill that needs most", skill.place)]),
            *(
                Related(
                    f"algorithm '{share.algorithm.name}' takes a slot for up to {_seconds(share.algorithm.timeout_s)} "
                    f"in every {_seconds(share.valid_for_s)}",
                    share.algorithm.places.get("timeout", share.algorithm.place),
                )
                for share in largest[:MAX_TOLD]
            ),
        ),
    )


def _seconds(duration_s: float) -> str:
    return f"{duration_s:g} s"
