"""Values that become stale before newer values are available, overloaded slots, and `on_event` without effect."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.language import graph
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import OBSERVER, FaultyElements, Group, SpecIndex
from codra_dsl.language.check.solver.ages import upper_bounds
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import (
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
"""The maximum number of visited variables, for all skills together. After this number, further skills are skipped."""

_ROUNDING = 1e-9

MAX_RELATED_PLACES = 5
"""The maximum number of algorithms in a finding about a resource."""


@dataclass(frozen=True, slots=True)
class Renewal:
    """How an algorithm renews evidence.

    Each look begins `pause_s` after the previous look began; if the previous look takes longer, when it ends. Each look
    gives its result within the timeout.

    Attributes:
        period_s: the period of the algorithm's observer.
        setting: the entry under `observers` that sets the period.
    """

    algorithm: Algorithm
    period_s: float
    setting: ObserverSetting | None

    @property
    def pause_s(self) -> float:
        """Return the minimum time between the starts of two looks."""
        return max(self.period_s, self.algorithm.min_interval_s)

    @property
    def pause_key(self) -> str:
        """Return the key that determines the pause."""
        return "min_interval" if self.algorithm.min_interval_s > self.period_s else "period"

    @property
    def max_age_s(self) -> float:
        """Return the maximum age that evidence has when newer evidence replaces it.

        By default, the stamp of evidence is the end of its look. So evidence is oldest if a look ends at once, and the
        next look takes its full timeout. If a function states that its evidence is from the beginning of its looks,
        and these looks take longer than the pause, evidence becomes as old as two timeouts. A spec does not state this,
        and a finding must follow from the spec, so this case is not reported.
        """
        return round(self.pause_s + self.algorithm.timeout_s, 9)

    def max_confirmation_s(self, variable: str) -> float:
        """Return the maximum time between the first and the last of the results that confirm a variable."""
        needed_result_count = max(
            needed_of(entry) for entry in self.algorithm.identifies if entry.variable.name == variable
        )
        return round((needed_result_count - 1) * max(self.pause_s, self.algorithm.timeout_s), 9)


def stale_evidence(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Until newer evidence can arrive, evidence does not go stale or become too old for a condition on its age."""
    if spec_index.has_damage("observers", "identifies", "period") or spec_index.has_damage("perception", "identifies"):
        return
    for name, variable in spec_index.variables.items():
        if (
            name in spec_index.variables_in_force
            and variable.valid_for_s < FOREVER_S
            and faults.is_sound("context", name)
        ):
            renewal = _slowest_renewal(spec_index, faults, name)
            if renewal is not None and variable.valid_for_s < renewal.max_age_s:
                yield _stale_finding(variable, renewal)
            elif renewal is not None and variable.valid_for_s <= renewal.max_confirmation_s(name):
                yield _never_confirmed_finding(variable, renewal)
    for algorithm in spec_index.algorithms.values():
        is_reached = any(entry.variable.name in spec_index.variables_in_force for entry in algorithm.identifies)
        if is_reached and algorithm.observable_when and faults.is_sound("perception", algorithm.name):
            yield from _age_findings(spec_index, faults, algorithm)


def oversubscribed_slots(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Observers that run together need no more slots of a resource than the resource has."""
    shares_by_resource = _shares_by_overloaded_resource(spec_index, faults)
    demands: dict[str, _Demand] = {}
    visits_left = MAX_VISITS
    for skill in (spec_index.spec.skills or (None,)) if shares_by_resource else ():
        needed_names = graph.closure(
            spec_index.tree_variables, spec_index.decisions if skill is None else skill.watched_variables
        )
        visits_left -= len(needed_names)
        if visits_left < 0:
            break
        groups = dict.fromkeys(group for name in needed_names if (group := spec_index.group_of.get(name)) is not None)
        for name, shares in shares_by_resource.items():
            demand = _Demand(skill, tuple(shares[group] for group in groups if group in shares))
            if (
                demand.total
                > max(demands[name].total if name in demands else 0, spec_index.resources[name].slots or 0) + _ROUNDING
            ):
                demands[name] = demand
    yield from (_oversubscribed_finding(spec_index.resources[name], demand) for name, demand in demands.items())


def ineffective_on_event_settings(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No algorithm identifies both variables with `refresh: on_event` and periodic variables."""
    for algorithm in spec_index.algorithms.values():
        variables = [
            candidate for entry in algorithm.identifies if (candidate := spec_index.variables.get(entry.variable.name))
        ]
        periodic_variable = next((variable for variable in variables if variable.refresh is Refresh.PERIODIC), None)
        if periodic_variable is None or not faults.is_sound("perception", algorithm.name):
            continue
        for variable in variables:
            if variable.refresh is Refresh.ON_EVENT and faults.is_sound("context", variable.name):
                yield finding(
                    "ineffective-on-event",
                    f"'refresh: on_event' of '{variable.name}' has no effect: algorithm '{algorithm.name}' also "
                    f"identifies '{periodic_variable.name}', for which it looks periodically",
                    variable.places.get("refresh", variable.place),
                    path=f"context.{variable.name}.refresh",
                    help=f"write 'refresh: on_event' for '{periodic_variable.name}' as well, or for neither variable",
                    related=(Related("declared here", periodic_variable.place),),
                )


TIMING_CHECKS = (stale_evidence, oversubscribed_slots, ineffective_on_event_settings)
"""The checks of this module."""


def _slowest_renewal(spec_index: SpecIndex, faults: FaultyElements, name: str) -> Renewal | None:
    """Return the renewal of a variable by its slowest algorithm; None without algorithms or after an error."""
    setting, _ = spec_index.claims.get(name, (None, None))
    if setting is not None and not faults.is_sound("observers", setting.name):
        return None
    renewals = []
    for producer in spec_index.producers.get(name, ()):
        is_sound = faults.is_sound("perception", producer)
        if not is_sound or not spec_index.is_readable("perception", producer, "timeout", "min_interval"):
            return None
        period_s = DEFAULT_PERIOD_S if setting is None else setting.period_s
        renewals.append(Renewal(spec_index.algorithms[producer], period_s, setting))
    return max(renewals, key=lambda renewal: renewal.max_age_s, default=None)


def _stale_finding(variable: Variable, renewal: Renewal) -> Diagnostic:
    return finding(
        "stale-before-renewed",
        f"context-variable '{variable.name}' can become stale although everything works: its evidence can be up to "
        f"{_seconds(renewal.max_age_s)} old before newer evidence arrives, "
        f"but is valid for {_seconds(variable.valid_for_s)}",
        variable.places.get("valid_for", variable.place),
        path=f"context.{variable.name}.valid_for",
        help=f"write a longer 'valid_for', or a shorter 'timeout' or '{renewal.pause_key}'",
        related=tuple(_renewal_places(renewal)),
    )


def _never_confirmed_finding(variable: Variable, renewal: Renewal) -> Diagnostic:
    key = "timeout" if renewal.algorithm.timeout_s > renewal.pause_s else renewal.pause_key
    return finding(
        "stale-before-renewed",
        f"context-variable '{variable.name}' may never be confirmed although everything works: the first result that "
        f"'confirm' needs can be {_seconds(renewal.max_confirmation_s(variable.name))} older than the last result, "
        f"but is valid for {_seconds(variable.valid_for_s)}",
        variable.places.get("valid_for", variable.place),
        path=f"context.{variable.name}.valid_for",
        help=f"write a longer 'valid_for', a shorter '{key}', or a 'confirm' that needs fewer results",
        related=tuple(_renewal_places(renewal)),
    )


def _age_findings(spec_index: SpecIndex, faults: FaultyElements, algorithm: Algorithm) -> Iterator[Diagnostic]:
    """Yield a finding for each maximum age in a precondition that observers cannot guarantee."""
    for condition in algorithm.observable_when:
        judgement = spec_index.judgement(condition)
        for bound in upper_bounds(condition) if judgement is not None and not judgement.problems else ():
            variable = spec_index.variables.get(bound.name)
            if variable is None or bound.limit_s is None or not faults.is_sound("context", variable.name):
                continue
            is_only_observed = all(source.name == OBSERVER for source in variable.sources)
            renewal = _slowest_renewal(spec_index, faults, variable.name)
            if is_only_observed and renewal is not None and bound.limit_s < renewal.max_age_s:
                yield finding(
                    "stale-before-renewed",
                    f"algorithm '{algorithm.name}' needs '{condition.text_of(bound.node)}', but evidence about "
                    f"'{variable.name}' can be up to {_seconds(renewal.max_age_s)} old although everything works",
                    condition.place_of(bound.node),
                    path=f"perception.{algorithm.name}.observable_when",
                    help=f"write a larger age, or a shorter 'timeout' or '{renewal.pause_key}'",
                    related=tuple(_renewal_places(renewal)),
                )


def _renewal_places(renewal: Renewal) -> Iterator[Related]:
    """Yield the places that define the duration of a look, and the pause before the next look."""
    algorithm, setting = renewal.algorithm, renewal.setting
    timeout_place = algorithm.places.get("timeout", algorithm.place)
    yield Related(
        f"algorithm '{algorithm.name}' has its result after up to {_seconds(algorithm.timeout_s)}", timeout_place
    )
    if algorithm.min_interval_s > renewal.period_s:
        place = algorithm.places.get("min_interval", algorithm.place)
        yield Related(f"algorithm '{algorithm.name}' looks again after {_seconds(algorithm.min_interval_s)}", place)
    elif setting is not None:
        place = setting.places.get("period", setting.place)
        yield Related(f"observer '{setting.name}' looks again after {_seconds(setting.period_s)}", place)


@dataclass(frozen=True, slots=True)
class _Share:
    """The share of a slot's time that an algorithm needs: the timeout, divided by the validity of the evidence."""

    algorithm: Algorithm
    valid_for_s: float

    @property
    def slot_fraction(self) -> float:
        return self.algorithm.timeout_s / self.valid_for_s


@dataclass(frozen=True, slots=True)
class _Demand:
    """The shares of a resource's slots that the observers of a skill need, or all observers if `skill` is None."""

    skill: Skill | None
    shares: tuple[_Share, ...]

    @property
    def total(self) -> float:
        return sum(share.slot_fraction for share in self.shares)


def _shares_by_overloaded_resource(
    spec_index: SpecIndex, faults: FaultyElements
) -> Mapping[str, Mapping[Group, _Share]]:
    """Return a mapping from each overloaded resource to the shares of the groups of alternatives.

    A resource is overloaded if all observers together need more slots than the resource has.
    """
    shares_by_resource: dict[str, dict[Group, _Share]] = {}
    for group in spec_index.groups:
        for algorithm in group.algorithms:
            share = _share(spec_index, faults, algorithm)
            for usage in algorithm.uses if share is not None else ():
                if usage.access is Access.SLOT and share is not None:
                    shares = shares_by_resource.setdefault(usage.resource.name, {})
                    shares[group] = max(share, shares.get(group, share), key=lambda candidate: candidate.slot_fraction)
    return {
        name: shares
        for name, shares in shares_by_resource.items()
        if (resource := spec_index.resources.get(name)) is not None
        and resource.slots is not None
        and faults.is_sound("resources", name)
        and spec_index.is_readable("resources", name, "slots")
        and sum(share.slot_fraction for share in shares.values()) > resource.slots
    }


def _share(spec_index: SpecIndex, faults: FaultyElements, algorithm: Algorithm) -> _Share | None:
    """Return the share of a slot that an algorithm needs; None if it needs no share, or if the share is unknown."""
    is_sound = faults.is_sound("perception", algorithm.name)
    if not is_sound or not spec_index.is_readable("perception", algorithm.name, "timeout", "uses"):
        return None
    names = [entry.variable.name for entry in algorithm.identifies]
    validities_s = [
        spec_index.variables[name].valid_for_s
        for name in names
        if name in spec_index.variables and spec_index.is_readable("context", name, "valid_for")
    ]
    valid_for_s = min(validities_s, default=FOREVER_S)
    return _Share(algorithm, valid_for_s) if valid_for_s < FOREVER_S else None


def _oversubscribed_finding(resource: Resource, demand: _Demand) -> Diagnostic:
    skill = demand.skill
    user_text = "all observers together need" if skill is None else f"the observers of skill '{skill.name}' need"
    slots_text = "1 slot" if resource.slots == 1 else f"{resource.slots} slots"
    sorted_shares = sorted(demand.shares, key=lambda share: (-share.slot_fraction, share.algorithm.name))
    return finding(
        "oversubscribed-slot",
        f"resource '{resource.name}' has {slots_text}, but {user_text} {demand.total:.4g}: whatever the order of "
        "the looks, some value becomes stale",
        resource.place,
        path=f"resources.{resource.name}",
        help="add slots, or use shorter timeouts, longer validity, or fewer variables in the skill",
        related=(
            *([] if skill is None else [Related("the skill that needs most", skill.place)]),
            *(
                Related(
                    f"algorithm '{share.algorithm.name}' takes a slot for up to {_seconds(share.algorithm.timeout_s)} "
                    f"in every {_seconds(share.valid_for_s)}",
                    share.algorithm.places.get("timeout", share.algorithm.place),
                )
                for share in sorted_shares[:MAX_RELATED_PLACES]
            ),
        ),
    )


def _seconds(duration_s: float) -> str:
    return f"{duration_s:g} s"
