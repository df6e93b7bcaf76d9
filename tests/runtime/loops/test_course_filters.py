"""The temporal filter: which weights switch a course, and when."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime.loops.course_filters import FilterState, SwitchReason, lead_threshold, leads, step
from codra_dsl.runtime.loops.declarations import CourseModel

ACTIONS = ("pick", "start", "dock")
CAUSES = {SwitchReason.WORSE, SwitchReason.HARD_RULE, SwitchReason.NOTHING_KNOWN}


def course(**settings: float) -> CourseModel:
    """Return a course with some settings of its filter."""
    return CourseModel(name="course", choose=ACTIONS, otherwise="start", **settings)


@dataclass(frozen=True)
class Moment:
    """The inputs of the filter at an instant: weights, urgent actions, and the action of a hard rule."""

    instant_s: float
    weights: dict[str, float | None]
    urgent_actions: tuple[str, ...] = ()
    forced_action: str = ""


@dataclass(frozen=True)
class Switch:
    """A change of the course."""

    instant_s: float
    action: str
    because: SwitchReason


def play(model: CourseModel, moments: list[Moment], extra_s: tuple[float, ...] = ()) -> list[Switch]:
    """Take a step at each moment, at extra instants, and whenever the filter is due."""
    switches: list[Switch] = []
    state, due_s = FilterState(), math.inf
    for moment, after in itertools.pairwise([*moments, Moment(moments[-1].instant_s + 100.0, {})]):
        between = [instant_s for instant_s in extra_s if moment.instant_s < instant_s < after.instant_s]
        asked_s = moment.instant_s
        while asked_s < after.instant_s:
            chosen = step(
                model,
                state,
                asked_s,
                moment.weights,
                urgent_actions=moment.urgent_actions,
                forced_action=moment.forced_action,
            )
            if chosen.because is not None:
                switches.append(Switch(asked_s, chosen.state.action, chosen.because))
            state, due_s = chosen.state, chosen.due_s
            assert due_s > asked_s
            between = [instant_s for instant_s in between if instant_s > asked_s]
            asked_s = min(due_s, *between, after.instant_s)
    return switches


def changes(*weights: tuple[float, float, float], every_s: float = 1.0) -> list[Moment]:
    """Return moments at regular intervals."""
    return [
        Moment(index * every_s, dict(zip(ACTIONS, moment_weights, strict=True)))
        for index, moment_weights in enumerate(weights)
    ]


degrees = st.one_of(st.none(), st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]), st.floats(0.0, 1.0, allow_subnormal=False))
settings = st.fixed_dictionaries(
    {
        "smooth_s": st.sampled_from([0.0, 0.3, 1.0, 5.0]),
        "lead": st.sampled_from([0.0, 0.1, 0.3]),
        "hold_s": st.sampled_from([0.0, 0.5, 2.0]),
        "dwell_s": st.sampled_from([0.0, 1.0, 5.0]),
        "cooldown_s": st.sampled_from([0.0, 3.0]),
    }
).map(lambda chosen: course(**chosen))


@st.composite
def stories(draw: st.DrawFn, *, calm: bool = False) -> list[Moment]:
    """Draw the inputs over some time; a calm story has no hard rules and no urgent actions."""
    gaps = draw(st.lists(st.sampled_from([0.05, 0.3, 1.0, 2.5, 7.0]), min_size=1, max_size=12))
    moments, instant_s = [], 0.0
    for gap_s in gaps:
        instant_s += gap_s
        weights = {action: draw(degrees) for action in ACTIONS}
        urgent = () if calm else tuple(draw(st.sets(st.sampled_from(ACTIONS), max_size=1)))
        forced = "" if calm else draw(st.sampled_from(["", "", "", *ACTIONS]))
        moments.append(Moment(instant_s, weights, urgent, forced))
    return moments


@given(settings, stories(), st.fixed_dictionaries({action: st.sampled_from([2.0, 4.0]) for action in ACTIONS}))
def test_times_that_the_compiler_reports_as_useless_change_no_choice(
    model: CourseModel, moments: list[Moment], holds_s: dict[str, float]
) -> None:
    """The finding is CDR4135: each hold is longer than the dwell, or the cooldown is not longer than holds or dwell."""
    without = replace(model, holds_s=holds_s, dwell_s=0.0, cooldown_s=0.0)
    for useless in (replace(without, dwell_s=1.9), replace(without, cooldown_s=2.0)):
        assert play(useless, moments) == play(without, moments)
    with_dwell = replace(model, dwell_s=5.0, cooldown_s=0.0)
    assert play(replace(with_dwell, cooldown_s=5.0), moments) == play(with_dwell, moments)


@given(settings, stories())
def test_only_permitted_reasons_switch_within_the_dwell(model: CourseModel, moments: list[Moment]) -> None:
    switches = play(model, moments)
    for before, after in itertools.pairwise(switches):
        is_soon = after.instant_s - before.instant_s < model.dwell_s - 1e-6
        is_makeshift = before is switches[0] and before.because is SwitchReason.NOTHING_KNOWN
        assert not is_soon or is_makeshift or after.because in CAUSES


@given(settings, stories(calm=True))
def test_an_action_that_was_left_stays_away_for_its_cooldown(model: CourseModel, moments: list[Moment]) -> None:
    left_s: dict[str, float] = {}
    for before, after in itertools.pairwise(play(model, moments)):
        left_s[before.action] = after.instant_s
        if after.because is SwitchReason.LEADS:
            assert after.instant_s - left_s.get(after.action, -math.inf) >= model.cooldown_s - 1e-6


@given(settings, stories())
def test_a_lead_persists_for_the_hold_before_it_counts(model: CourseModel, moments: list[Moment]) -> None:
    """The smoothed weights are computed again here at many instants, by the solution of their differential equation."""
    for before, after in itertools.pairwise(play(model, moments)):
        if after.because not in (SwitchReason.LEADS, SwitchReason.WORSE):
            continue
        since_s = max(after.instant_s - model.hold_s, before.instant_s)
        assert after.instant_s - before.instant_s >= model.hold_s - 1e-5
        for index in range(11):
            instant_s = since_s + (after.instant_s - since_s) * index / 10
            one = smoothed(model, moments, after.action, instant_s)
            other = smoothed(model, moments, before.action, instant_s)
            assert one is not None
            assert other is None or one - other >= lead_threshold(model) - 1e-4


def smoothed(model: CourseModel, moments: list[Moment], action: str, instant_s: float) -> float | None:
    """Return a smoothed weight, with one step for each moment."""
    value: float | None = None
    past = [moment for moment in moments if moment.instant_s <= instant_s + 1e-9]
    for moment, end_s in zip(past, [*(moment.instant_s for moment in past[1:]), instant_s], strict=True):
        target = moment.weights[action]
        if target is None or value is None or not model.smooth_s:
            value = target
        if target is not None and value is not None and model.smooth_s:
            value = target + (value - target) * math.exp(-max(0.0, end_s - moment.instant_s) / model.smooth_s)
    return value


@given(settings, stories(calm=True), st.lists(st.floats(0.0, 60.0), max_size=30).map(sorted).map(tuple))
def test_additional_steps_do_not_change_the_switches(
    model: CourseModel, moments: list[Moment], extra_s: tuple[float, ...]
) -> None:
    plain, often = play(model, moments), play(model, moments, extra_s)
    assert [(switch.action, switch.because) for switch in plain] == [
        (switch.action, switch.because) for switch in often
    ]
    assert all(abs(one.instant_s - other.instant_s) < 1e-4 for one, other in zip(plain, often, strict=True))


@given(settings, stories())
def test_the_same_story_gives_the_same_switches(model: CourseModel, moments: list[Moment]) -> None:
    assert play(model, moments) == play(model, moments)


@given(settings, stories())
def test_an_unknown_weight_never_wins(model: CourseModel, moments: list[Moment]) -> None:
    for switch in play(model, moments):
        latest_moment = [moment for moment in moments if moment.instant_s <= switch.instant_s][-1]
        if switch.because in (SwitchReason.FIRST, SwitchReason.LEADS, SwitchReason.WORSE):
            assert latest_moment.weights[switch.action] is not None


@given(settings, stories())
def test_while_a_hard_rule_holds_its_action_is_the_course(model: CourseModel, moments: list[Moment]) -> None:
    state = FilterState()
    for moment in moments:
        chosen = step(
            model,
            state,
            moment.instant_s,
            moment.weights,
            urgent_actions=moment.urgent_actions,
            forced_action=moment.forced_action,
        )
        state = chosen.state
        assert not moment.forced_action or state.action == moment.forced_action


def test_the_action_with_the_highest_weight_begins_without_waiting() -> None:
    model = course(smooth_s=5.0, hold_s=3.0, dwell_s=9.0)
    assert play(model, changes((0.2, 0.7, 0.7))) == [Switch(0.0, "start", SwitchReason.FIRST)]


def test_a_lead_is_reached_between_two_weights_at_the_computed_instant() -> None:
    model = course(smooth_s=2.0, lead=0.1, hold_s=1.0)
    (_, switch) = play(model, changes((0.6, 0.4, 0.0), (0.6, 0.8, 0.0)))
    crossing_s = 1.0 + 2.0 * math.log((0.2 + 0.2) / (0.2 - 0.1))
    assert switch.instant_s == pytest.approx(crossing_s + 1.0, abs=1e-5)


def test_a_lead_that_shrinks_but_stays_sufficient_counts_from_its_beginning_for_any_steps() -> None:
    model = course(smooth_s=2.0, lead=0.1, hold_s=5.0)
    moments = [Moment(0.0, weights(1.0, 0.0)), Moment(1.0, weights(0.0, 1.0)), Moment(4.0, weights(0.4, 0.6))]
    crossing_s = 1.0 + 2.0 * math.log((1.0 + 1.0) / (1.0 - 0.1))

    for extra_s in ((), (4.1,)):
        assert play(model, moments, extra_s)[1].instant_s == pytest.approx(crossing_s + 5.0, abs=1e-5)


def weights(pick: float, start: float) -> dict[str, float | None]:
    return {"pick": pick, "start": start, "dock": 0.0}


def test_a_dwell_delays_a_leading_action_but_not_an_urgent_one() -> None:
    model = course(dwell_s=5.0)
    calm = changes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert [switch.instant_s for switch in play(model, calm)] == [0.0, pytest.approx(5.0, abs=1e-5)]
    urgent = [calm[0], Moment(1.0, calm[1].weights, urgent_actions=("start",))]
    assert play(model, urgent)[1:] == [Switch(1.0, "start", SwitchReason.WORSE)]


def test_without_known_weights_the_declared_action_is_chosen_after_the_hold() -> None:
    model = course(hold_s=2.0, dwell_s=60.0)
    moments = [*changes((1.0, 0.0, 0.0)), Moment(4.0, dict.fromkeys(ACTIONS))]
    after = play(model, moments)[1]
    assert (after.action, after.because) == ("start", SwitchReason.NOTHING_KNOWN)
    assert after.instant_s == pytest.approx(6.0, abs=1e-5)


def test_a_choice_before_any_weight_was_known_has_no_dwell() -> None:
    model = course(dwell_s=60.0, hold_s=1.0)
    moments = [Moment(0.0, dict.fromkeys(ACTIONS)), Moment(2.0, changes((1.0, 0.0, 0.0))[0].weights)]
    first, second = play(model, moments)
    assert (first.action, second.action, second.because) == ("start", "pick", SwitchReason.LEADS)
    assert second.instant_s == pytest.approx(3.0, abs=1e-5)


def test_weights_that_are_unknown_for_less_than_the_hold_do_not_switch() -> None:
    model = course(hold_s=2.0)
    moments = [
        *changes((1.0, 0.0, 0.0)),
        Moment(4.0, dict.fromkeys(ACTIONS)),
        Moment(5.0, {**changes((1, 0, 0))[0].weights}),
    ]
    assert len(play(model, moments)) == 1


def test_equal_weights_do_not_switch_even_without_a_required_lead() -> None:
    model = course()
    assert len(play(model, changes((1.0, 0.5, 0.0), (0.5, 0.5, 0.5), (0.5, 0.5, 0.0)))) == 1
    assert not leads(model, 0.5, 0.5)


@given(st.floats(0, 1), st.floats(0, 1), st.lists(st.floats(0.01, 3.0), min_size=1, max_size=6))
def test_a_smoothed_weight_follows_its_time_constant_for_any_steps(old: float, new: float, gaps_s: list[float]) -> None:
    model = course(smooth_s=2.0)
    state = step(model, FilterState(), 0.0, {"pick": old, "start": 0.0, "dock": 0.0}).state
    state = step(model, state, 0.0, {"pick": new, "start": 0.0, "dock": 0.0}).state
    for instant_s in itertools.accumulate(gaps_s):
        state = step(model, state, instant_s, {"pick": new, "start": 0.0, "dock": 0.0}).state
    expected = new + (old - new) * math.exp(-sum(gaps_s) / 2.0)
    assert state.tracked_actions["pick"].smoothed_weight == pytest.approx(expected, abs=1e-9)
