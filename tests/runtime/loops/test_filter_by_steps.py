"""The filter against a simple implementation of its documentation, which takes small steps and computes no instants."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace

from hypothesis import assume, given
from hypothesis import settings as of_hypothesis
from hypothesis import strategies as st

from codra_dsl.runtime.loops.declarations import CourseModel
from tests.runtime.loops.test_course_filters import ACTIONS, Moment, course, play

STEP_S = 0.02
LEAD_CHANGE = 0.004
"""The change of the lead, up and down, that shows whether a story depends on rounding."""

Weights = Mapping[str, float | None]


class SteppedFilter:
    """A course that is updated every STEP_S, and counts how long each lead has lasted."""

    def __init__(self, model: CourseModel) -> None:
        self._model = model
        self.action = ""
        self._smoothed: dict[str, float | None] = dict.fromkeys(model.choose)
        self._lead_durations_s: dict[str, float] = {}
        self._course_age_s = math.inf
        self._times_since_left_s: dict[str, float] = {}
        self._unknown_duration_s = -STEP_S

    def pass_step(self, then: Weights) -> None:
        """Let one step pass, in which the weights are constant."""
        for action in self._model.choose:
            smoothed, weight = self._smoothed[action], then[action]
            if smoothed is not None and weight is not None and self._model.smooth_s:
                self._smoothed[action] = smoothed + (weight - smoothed) * -math.expm1(-STEP_S / self._model.smooth_s)
        self._lead_durations_s = {action: led_s + STEP_S for action, led_s in self._lead_durations_s.items()}
        self._times_since_left_s = {action: gone_s + STEP_S for action, gone_s in self._times_since_left_s.items()}
        self._course_age_s += STEP_S
        self._unknown_duration_s += STEP_S

    def take(self, moment: Moment) -> None:
        """Take the weights, and choose."""
        for action, weight in moment.weights.items():
            if weight is None or self._smoothed[action] is None or not self._model.smooth_s:
                self._smoothed[action] = weight
        known = [action for action in self._model.choose if self._smoothed[action] is not None]
        if known:
            self._unknown_duration_s = -STEP_S / 2
        leaders = {action for action in known if action != self.action and self._leads(action)}
        self._lead_durations_s = {action: self._lead_durations_s.get(action, 0.0) for action in leaders}
        self._choose(moment, known)

    def _leads(self, action: str) -> bool:
        weight, course_weight = self._smoothed[action], self._smoothed.get(self.action)
        return weight is not None and (course_weight is None or weight - course_weight >= max(self._model.lead, 1e-9))

    def _choose(self, moment: Moment, known: list[str]) -> None:
        new_action = self.action
        if moment.forced_action:
            new_action = moment.forced_action
        elif not self.action:
            new_action = self._heaviest(known) or self._model.otherwise
        elif not known:
            new_action = (
                self._model.otherwise if self._unknown_duration_s >= self._model.hold_s - STEP_S / 2 else self.action
            )
        else:
            new_action = self._heaviest([action for action in known if self._is_ready(action, moment)]) or self.action
        if new_action != self.action:
            is_makeshift = not self.action and not known and not moment.forced_action
            self._times_since_left_s[self.action] = 0.0
            self.action, self._course_age_s = new_action, math.inf if is_makeshift else 0.0
            self._lead_durations_s = {action: 0.0 for action in known if action != new_action and self._leads(action)}

    def _is_ready(self, action: str, moment: Moment) -> bool:
        if action not in self._lead_durations_s or self._lead_durations_s[action] < self._model.hold_s - STEP_S / 2:
            return False
        is_free = self._course_age_s >= self._model.dwell_s - STEP_S / 2
        is_cool = self._times_since_left_s.get(action, math.inf) >= self._model.cooldown_s - STEP_S / 2
        return action in moment.urgent_actions or (is_free and is_cool)

    def _heaviest(self, actions: list[str]) -> str:
        weights = [(self._smoothed[action] or 0.0, action) for action in self._model.choose if action in actions]
        return max(weights, key=lambda weight_and_action: weight_and_action[0])[1] if weights else ""


def switches_by_steps(model: CourseModel, moments: list[Moment], end_s: float) -> list[tuple[float, str]]:
    """Return the instants at which the course changed, with the new actions."""
    stepped_filter, moments_by_index, switches = SteppedFilter(model), dict(enumerate(moments)), [(0.0, "")]
    for number in range(round(moments[0].instant_s / STEP_S), round(end_s / STEP_S)):
        now_s = number * STEP_S
        latest_index = max(
            index for index, moment in moments_by_index.items() if moment.instant_s <= now_s + STEP_S / 2
        )
        stepped_filter.take(moments[latest_index])
        if stepped_filter.action != switches[-1][1]:
            switches.append((now_s, stepped_filter.action))
        stepped_filter.pass_step(moments[latest_index].weights)
    return switches[1:]


weights = st.none() | st.integers(0, 1000).map(lambda number: number / 1000.0)
models = st.fixed_dictionaries(
    {
        "smooth_s": st.sampled_from([0.0, 0.4, 2.0]),
        "lead": st.sampled_from([0.0, 0.1, 0.3]),
        "hold_s": st.sampled_from([0.0, 0.5, 1.5]),
        "dwell_s": st.sampled_from([0.0, 1.0, 4.0]),
        "cooldown_s": st.sampled_from([0.0, 3.0]),
    }
).map(lambda chosen: course(**chosen))


@st.composite
def stories(draw: st.DrawFn) -> list[Moment]:
    gaps_s = draw(st.lists(st.sampled_from([0.06, 0.34, 0.92, 2.62]), min_size=2, max_size=6))
    return [
        Moment(
            instant_s,
            {action: draw(weights) for action in ACTIONS},
            tuple(draw(st.sets(st.sampled_from(ACTIONS), max_size=1))),
            draw(st.sampled_from(["", "", "", *ACTIONS])),
        )
        for instant_s in itertools.accumulate(gaps_s)
    ]


@of_hypothesis(max_examples=40, deadline=None)
@given(models, stories())
def test_the_filter_chooses_what_small_steps_choose(model: CourseModel, moments: list[Moment]) -> None:
    end_s = moments[-1].instant_s + 6.0
    low, plain, high = (
        switches_by_steps(replace(model, lead=lead), moments, end_s)
        for lead in (max(0.0, model.lead - LEAD_CHANGE), model.lead, model.lead + LEAD_CHANGE)
    )
    names = [action for _, action in plain]
    assume(all([action for _, action in other] == names for other in (low, high)))  # otherwise it depends on rounding
    assume(all(abs(one[0] - other[0]) < 0.2 for one, other in zip(low, high, strict=True)))

    switches = [switch for switch in play(model, moments) if switch.instant_s < end_s - STEP_S]

    assert [switch.action for switch in switches] == names[: len(switches)]
    assert len(names) <= len(switches) + 1
    for switch, (instant_s, _) in zip(switches, plain, strict=False):
        assert abs(switch.instant_s - instant_s) < 0.25
