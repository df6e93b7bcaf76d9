"""The temporal filter between weights and courses, which prevents flapping of a mission (P2, section 5.2).

A weight is constant between two steps, and is smoothed exponentially. The lead of one action over another is therefore
monotone between two steps, so the instant at which the required lead is reached or lost can be computed and need not
be searched. A filter whose next step happens at `due_s` therefore makes the same choices at the same instants, even if
other steps happen in between.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from codra_dsl.runtime.loops.declarations import CourseModel

JUST_AFTER_S = 1e-6
"""A filter's next step is this much later than the computed instant: rounding must not make it too early."""

MIN_LEAD = 1e-9
"""The lead that is used instead of 0, so that equal weights do not switch the course."""

_ROUNDING_S = 1e-9


class SwitchReason(StrEnum):
    """Why an action became the course."""

    FIRST = "first"
    """The action had the highest weight when the loop began."""

    LEADS = "leads"
    """For the hold time, the action's weight has exceeded the weight of the running action by the required lead."""

    WORSE = "worse"
    """The same as `LEADS`, but within the dwell or cooldown, because a metric has become worse."""

    HARD_RULE = "hard_rule"
    """A hard rule demands the action."""

    NOTHING_KNOWN = "nothing_known"
    """No weight is known."""

    PLANNER = "planner"
    """A planner that replaces the spec's planner chose the action."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedAction:
    """An action in the filter.

    Attributes:
        weight: the weight of the last step; None if unknown.
        smoothed_weight: the smoothed weight, which decisions use.
        leads_since_s: since when the action leads without a break; None if it does not lead, or is itself the course.
    """

    weight: float | None = None
    smoothed_weight: float | None = None
    leads_since_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterState:
    """The complete state of a filter.

    Attributes:
        instant_s: the instant of the filter's last step.
        action: the action that is the course; empty before the first step.
        since_s: since when this action is the course; minus infinity for a first choice without known weights.
        tracked_actions: the actions by name.
        left_s: when each action was last left.
        unknown_since_s: since when no weight is known; None if a weight is known.
    """

    instant_s: float = -math.inf
    action: str = ""
    since_s: float = -math.inf
    tracked_actions: Mapping[str, TrackedAction] = field(default_factory=dict)
    left_s: Mapping[str, float] = field(default_factory=dict)
    unknown_since_s: float | None = None

    def dwell_until_s(self, model: CourseModel) -> float:
        """Return the end of the course's dwell."""
        return self.since_s + model.dwell_s

    def cooldown_until_s(self, model: CourseModel, action: str) -> float:
        """Return the end of an action's cooldown; the action is not chosen again before this instant."""
        return self.left_s.get(action, -math.inf) + model.cooldown_s

    def after_pause(self) -> FilterState:
        """Return the state after a pause: without smoothed weights and leads, as weights in the pause are unknown."""
        return replace(self, tracked_actions={}, unknown_since_s=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterStep:
    """The result of a step.

    Attributes:
        state: the state after the step.
        before: the state on which the decision is based; it has the new smoothed weights and leads, and the old course.
        because: why the course has changed; None if it has not changed.
        due_s: when the next step is due if no weight changes; infinite if no step is needed.
    """

    state: FilterState
    before: FilterState
    because: SwitchReason | None
    due_s: float


def step(
    model: CourseModel,
    state: FilterState,
    now_s: float,
    weights: Mapping[str, float | None],
    *,
    urgent_actions: Collection[str] = (),
    forced_action: str = "",
) -> FilterStep:
    """Process the weights of an instant, and choose an action.

    Args:
        model: the model of the course.
        state: the state after the previous step.
        now_s: the instant; it must not be before the instant of the state.
        weights: the weights of all actions that the course chooses from.
        urgent_actions: actions that need not wait for dwell and cooldown, because a metric has become worse.
        forced_action: the action that a hard rule demands; empty if no hard rule holds.
    """
    tracked_actions = {action: _track(model, state, action, now_s, weights[action]) for action in model.choose}
    tracked_actions = _with_leads(model, tracked_actions, state.action, now_s)
    is_known = any(candidate.smoothed_weight is not None for candidate in tracked_actions.values())
    unknown_since_s = None if is_known else now_s if state.unknown_since_s is None else state.unknown_since_s
    before = FilterState(
        instant_s=now_s,
        action=state.action,
        since_s=state.since_s,
        tracked_actions=tracked_actions,
        left_s=state.left_s,
        unknown_since_s=unknown_since_s,
    )
    action, reason = _decide(model, before, urgent_actions, forced_action)
    if action == state.action:
        return FilterStep(
            state=before, before=before, because=None, due_s=_due_s(model, before, urgent_actions, forced_action)
        )
    after = _state_after_switch(model, before, action, reason)
    return FilterStep(state=after, before=before, because=reason, due_s=_due_s(model, after, (), forced_action))


def lead_threshold(model: CourseModel) -> float:
    """Return the lead over the weight of the course that an action needs."""
    return max(model.lead, MIN_LEAD)


def leads(model: CourseModel, weight: float | None, course_weight: float | None) -> bool:
    """Return whether a weight leads the weight of the course.

    An unknown weight never leads. A known weight leads a course whose weight is unknown.
    """
    if weight is None:
        return False
    return course_weight is None or weight - course_weight >= lead_threshold(model)


def _track(model: CourseModel, state: FilterState, action: str, now_s: float, weight: float | None) -> TrackedAction:
    """Return the state of an action at an instant, including changes of its lead since the last step."""
    action_before, course = (
        state.tracked_actions.get(action, TrackedAction()),
        state.tracked_actions.get(state.action, TrackedAction()),
    )
    smoothed_weight = _smooth(model, action_before, now_s - state.instant_s, weight)
    if not state.action or action == state.action:
        return TrackedAction(weight=weight, smoothed_weight=smoothed_weight)
    since_s = _leads_since_s(model, action_before, course, state.instant_s, now_s)
    return TrackedAction(weight=weight, smoothed_weight=smoothed_weight, leads_since_s=since_s)


def _smooth(model: CourseModel, action_before: TrackedAction, elapsed_s: float, weight: float | None) -> float | None:
    if weight is None or action_before.smoothed_weight is None or action_before.weight is None or model.smooth_s <= 0.0:
        return weight
    return action_before.weight + (action_before.smoothed_weight - action_before.weight) * math.exp(
        -elapsed_s / model.smooth_s
    )


def _leads_since_s(
    model: CourseModel, action_before: TrackedAction, course: TrackedAction, then_s: float, now_s: float
) -> float | None:
    """Return the instant since which an action leads, just before the new weights apply; None if it does not lead."""
    if action_before.smoothed_weight is None:
        return None
    if course.smoothed_weight is None:
        return action_before.leads_since_s
    gap, limit = _gaps(model, action_before, course)
    min_lead = lead_threshold(model)
    elapsed_s = now_s - then_s
    gap_now = limit + (gap - limit) * math.exp(-elapsed_s / model.smooth_s) if model.smooth_s > 0.0 else limit
    if gap_now < min_lead:
        return None
    if action_before.leads_since_s is not None:
        return action_before.leads_since_s
    crossing_s = _crossing_s(model, gap, limit)
    return then_s + min(crossing_s, elapsed_s)


def _gaps(model: CourseModel, candidate: TrackedAction, course: TrackedAction) -> tuple[float, float]:
    """Return the present lead of an action over the course, and the limit of this lead if no weight changes."""
    assert candidate.smoothed_weight is not None
    assert course.smoothed_weight is not None
    gap = candidate.smoothed_weight - course.smoothed_weight
    if model.smooth_s <= 0.0 or candidate.weight is None or course.weight is None:
        return gap, gap
    return gap, candidate.weight - course.weight


def _crossing_s(model: CourseModel, gap: float, limit: float) -> float:
    """Return the seconds until a gap that approaches a limit reaches the required lead; infinite if it never does."""
    min_lead = lead_threshold(model)
    if gap >= min_lead:
        return 0.0
    if limit <= min_lead:
        return math.inf
    return model.smooth_s * math.log((limit - gap) / (limit - min_lead))


def _with_leads(
    model: CourseModel, tracked_actions: Mapping[str, TrackedAction], course: str, now_s: float
) -> dict[str, TrackedAction]:
    """Return all actions with their leads at an instant, including leads that begin at this instant."""
    if not course:
        return dict(tracked_actions)
    course_weight = tracked_actions[course].smoothed_weight
    actions_with_leads = {}
    for action, candidate in tracked_actions.items():
        is_ahead = action != course and leads(model, candidate.smoothed_weight, course_weight)
        since_s = now_s if candidate.leads_since_s is None else candidate.leads_since_s
        actions_with_leads[action] = replace(candidate, leads_since_s=since_s if is_ahead else None)
    return actions_with_leads


def _decide(
    model: CourseModel, state: FilterState, urgent_actions: Collection[str], forced_action: str
) -> tuple[str, SwitchReason | None]:
    """Return the action to run, and the reason if it is another one than before."""
    if forced_action:
        return forced_action, SwitchReason.HARD_RULE
    if not state.action:
        best_action = _best_action(model, state, model.choose)
        return (best_action, SwitchReason.FIRST) if best_action else (model.otherwise, SwitchReason.NOTHING_KNOWN)
    if state.unknown_since_s is not None:
        is_hold_over = state.instant_s - state.unknown_since_s >= model.hold_s - _ROUNDING_S
        return (model.otherwise if is_hold_over else state.action), SwitchReason.NOTHING_KNOWN
    ready_actions = [
        action
        for action in model.choose
        if _ready_s(model, state, action, urgent_actions) <= state.instant_s + _ROUNDING_S
    ]
    best_action = _best_action(model, state, ready_actions)
    if not best_action:
        return state.action, None
    is_free = _free_s(model, state, best_action) <= state.instant_s + _ROUNDING_S
    return best_action, SwitchReason.LEADS if is_free else SwitchReason.WORSE


def _best_action(model: CourseModel, state: FilterState, allowed_actions: Collection[str]) -> str:
    """Return the first action with the highest weight; empty if no weight is known."""
    weights = [
        (state.tracked_actions[action].smoothed_weight, action) for action in model.choose if action in allowed_actions
    ]
    known_weights = [(weight, action) for weight, action in weights if weight is not None]
    return max(known_weights, key=lambda pair: pair[0])[1] if known_weights else ""


def _free_s(model: CourseModel, state: FilterState, action: str) -> float:
    """Return the instant from which neither dwell nor cooldown prevents the choice of an action."""
    return max(state.dwell_until_s(model), state.cooldown_until_s(model, action))


def _ready_s(model: CourseModel, state: FilterState, action: str, urgent_actions: Collection[str]) -> float:
    """Return when an action can be chosen if no weight changes; infinite if the action can never be chosen."""
    candidate, course = state.tracked_actions[action], state.tracked_actions[state.action]
    if action == state.action or candidate.smoothed_weight is None:
        return math.inf
    leads_s = candidate.leads_since_s
    if leads_s is None:
        leads_s = state.instant_s + _crossing_s(model, *_gaps(model, candidate, course))
    hold_end_s = leads_s + model.hold_of_s(action)
    # An urgent action breaks the dwell and the cooldown: neither may keep a robot from the safe course.
    return hold_end_s if action in urgent_actions else max(hold_end_s, _free_s(model, state, action))


def _due_s(model: CourseModel, state: FilterState, urgent_actions: Collection[str], forced_action: str) -> float:
    if forced_action:
        return math.inf
    if state.unknown_since_s is not None:
        is_otherwise_action = state.action == model.otherwise
        return math.inf if is_otherwise_action else state.unknown_since_s + model.hold_s + JUST_AFTER_S
    return min(_ready_s(model, state, action, urgent_actions) for action in model.choose) + JUST_AFTER_S


def _state_after_switch(
    model: CourseModel, before: FilterState, action: str, reason: SwitchReason | None
) -> FilterState:
    now_s = before.instant_s
    actions_without_leads = {
        name: replace(candidate, leads_since_s=None) for name, candidate in before.tracked_actions.items()
    }
    # A first choice that no known weight supports has no dwell.
    is_unsupported_choice = not before.action and reason is SwitchReason.NOTHING_KNOWN
    return replace(
        before,
        action=action,
        since_s=-math.inf if is_unsupported_choice else now_s,
        tracked_actions=_with_leads(model, actions_without_leads, action, now_s),
        left_s={**before.left_s, before.action: now_s} if before.action else before.left_s,
    )
