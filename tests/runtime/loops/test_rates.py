"""Rates of change, shares of time and held bools, computed from histories."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime import Reading, Reason
from codra_dsl.runtime.loops.course_filters import JUST_AFTER_S
from codra_dsl.runtime.loops.declarations import RateKind, RateModel
from codra_dsl.runtime.loops.observations import Observation
from codra_dsl.runtime.loops.rates import RENEWAL_S, observe_rate
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, FOREVER_S, Override
from codra_dsl.runtime.values.declarations import DERIVED, OPERATOR

DRAIN = RateModel(variable="drain", of="level", over_s=20.0, factor=-60.0)
KNOWN = Observation(variable="level", value=50.0)


def history(*points: tuple[float, float | None]) -> list[Reading[Value]]:
    """Return readings by the instant of their evidence."""
    return [
        Reading(name="level", content=level, reason=None if level is not None else Reason.FAILED, evidence_s=instant_s)
        for instant_s, level in points
    ]


@given(st.floats(-5, 5), st.lists(st.floats(0, 20), min_size=2, max_size=30, unique=True))
def test_the_rate_of_a_straight_line_is_its_slope(slope: float, instants_s: list[float]) -> None:
    instants_s = sorted({*instants_s, 0.0, 20.0})
    observed_rate = observe_rate(DRAIN, history(*((at_s, 7.0 + slope * at_s) for at_s in instants_s)), KNOWN, 20.0)
    assert observed_rate.value == pytest.approx(-60.0 * slope, abs=1e-6)
    assert observed_rate.evidence_s == 20.0


@pytest.mark.parametrize(("span_s", "is_known"), [(9.9, False), (10.0, True)])
def test_a_rate_is_unknown_until_half_of_its_window_is_known(span_s: float, is_known: bool) -> None:
    observed_rate = observe_rate(DRAIN, history((100.0 - span_s, 50.0), (100.0, 49.0)), KNOWN, 100.0)
    assert (observed_rate.value is not None) is is_known
    assert is_known or observed_rate.because == "level is known for 9.9 s, but must be for 10 s"


def test_readings_before_a_gap_do_not_count() -> None:
    observed_rate = observe_rate(DRAIN, history((0.0, 90.0), (8.0, None), (9.0, 50.0), (20.0, 50.0)), KNOWN, 20.0)
    assert observed_rate.value == 0.0


def test_readings_before_the_window_do_not_count() -> None:
    observed_rate = observe_rate(DRAIN, history((0.0, 90.0), (80.0, 50.0), (100.0, 48.0)), KNOWN, 100.0)
    assert observed_rate.value == pytest.approx(6.0)


def test_the_rate_of_an_unknown_variable_is_unknown() -> None:
    observed_rate = observe_rate(
        DRAIN, history((80.0, 50.0), (100.0, 48.0)), Observation(variable="level", because="stale"), 100.0
    )
    assert (observed_rate.value, observed_rate.because) == (None, "level is unknown")


def test_two_readings_of_one_instant_have_no_rate() -> None:
    model = RateModel(variable="drain", of="level", over_s=0.0)
    assert observe_rate(model, history((100.0, 50.0), (100.0, 48.0)), KNOWN, 100.0).value is None


BUMPY = RateModel(variable="rough", of="bumped", over_s=20.0, kind=RateKind.SHARE)
TRUE = Observation(variable="bumped", value=True, evidence_s=100.0)


def bool_history(*phases: tuple[float, bool | None, float]) -> list[Reading[Value]]:
    """Return readings by the instant of their evidence, their value, and the end of their validity."""
    return [
        Reading(
            name="bumped",
            content=content,
            reason=None if content is not None else Reason.FAILED,
            evidence_s=instant_s,
            expires_s=expires_s,
        )
        for instant_s, content, expires_s in phases
    ]


@given(
    st.lists(
        st.tuples(st.integers(0, 400), st.sampled_from([True, False, None]), st.integers(1, 100)),
        min_size=1,
        max_size=12,
        unique_by=lambda phase: phase[0],
    ),
    st.integers(0, 500),
)
def test_a_share_is_the_part_of_the_known_instants_at_which_the_bool_was_true(
    phases: list[tuple[int, bool | None, int]], now: int
) -> None:
    """The plain model looks at the middle of every tenth of a second in the window."""
    readings = bool_history(
        *((at / 10, content, (at + valid) / 10) for at, content, valid in sorted(phases) if at <= now)
    )
    contents = []
    for tenth in range(now - 200, now):
        instant_s = tenth / 10 + 0.05
        reading = next((reading for reading in reversed(readings) if reading.evidence_s <= instant_s), None)
        contents.append(None if reading is None else reading.at(instant_s).content)
    known = [content for content in contents if content is not None]
    observed = observe_rate(BUMPY, readings, TRUE, now / 10)
    expected = sum(known) / len(known) if len(known) >= 100 else None
    assert observed.value == (None if expected is None else pytest.approx(expected))


def test_a_share_is_unknown_while_its_variable_is_and_states_how_long_it_was_known() -> None:
    unknown = Observation(variable="bumped", because="stale")
    assert observe_rate(BUMPY, bool_history((90.0, True, 99.0)), unknown, 100.0).because == "bumped is unknown"
    observed = observe_rate(BUMPY, bool_history((95.0, True, 200.0)), TRUE, 100.0)
    assert (observed.value, observed.because) == (None, "bumped is known for 5 s, but must be for 10 s")


def derived_history(
    *derivations: tuple[float, float | bool, float], is_overridden: bool = False
) -> list[Reading[Value]]:
    """Return readings by the instant of the derivation, their value, and the instant of the evidence."""
    return [
        Reading(
            name="derived",
            content=content,
            evidence_s=evidence_s,
            start_s=BEFORE_ALL_S if is_overridden else evidence_s,
            identified_s=derived_s,
            source=DERIVED,
        )
        for derived_s, content, evidence_s in derivations
    ]


def override(content: Value, since_s: float) -> Reading[Value]:
    """Return the present override of a variable."""
    beneath: Reading[Value] = Reading(name="level")
    return Override(name="level", content=content, evidence_s=since_s, source=OPERATOR, beneath=beneath)


def test_readings_of_a_derived_variable_count_from_their_derivation() -> None:
    bools = derived_history((80.0, True, 2.0), (90.0, False, 90.0), (94.0, True, 2.0))
    assert observe_rate(BUMPY, bools, TRUE, 100.0).value == pytest.approx(16 / 20)
    numbers = derived_history((80.0, 50.0, 0.0), (90.0, 49.0, 0.0), (100.0, 48.0, 0.0))
    observed_rate = observe_rate(DRAIN, numbers, KNOWN, 100.0)
    assert observed_rate.value == pytest.approx(6.0)
    assert observed_rate.evidence_s == 0.0


@pytest.mark.parametrize(("now_s", "rate"), [(9.9, None), (10.1, 0.0), (1_000.0, 0.0)])
def test_a_derived_value_that_stays_constant_has_the_rate_0(now_s: float, rate: float | None) -> None:
    observed_rate = observe_rate(DRAIN, derived_history((0.0, 50.0, 0.0)), KNOWN, now_s)
    assert observed_rate.value == rate
    assert rate == 0.0 or observed_rate.until_s == pytest.approx(10.0, abs=1e-5)


def test_a_derived_value_counts_at_both_ends_of_the_window() -> None:
    """Its values at 80, 90 and 100 s are 50, 49 and 49."""
    observed_rate = observe_rate(DRAIN, derived_history((0.0, 50.0, 0.0), (90.0, 49.0, 90.0)), KNOWN, 100.0)
    assert observed_rate.value == pytest.approx(3.0)


def test_an_overridden_variable_has_no_rate_and_no_share() -> None:
    present = Observation.of(override(20.0, 90.0))
    levels = [*history(*((at_s, 80.0) for at_s in range(80, 90))), override(20.0, 90.0)]
    observed_rate = observe_rate(DRAIN, levels, present, 100.0)
    assert (observed_rate.value, observed_rate.because) == (None, "level is overridden")
    bools = [*bool_history((70.0, False, 200.0)), override(True, 90.0)]
    observed_share = observe_rate(BUMPY, bools, Observation.of(bools[-1]), 100.0)
    assert (observed_share.value, observed_share.because) == (None, "bumped is overridden")


def test_values_that_are_derived_from_an_override_are_gaps() -> None:
    numbers = [
        *derived_history((70.0, 90.0, 70.0)),
        *derived_history((84.0, 10.0, 84.0), is_overridden=True),
        *derived_history((86.0, 50.0, 86.0), (100.0, 49.0, 100.0)),
    ]
    assert observe_rate(DRAIN, numbers, KNOWN, 100.0).value == pytest.approx(60.0 / 14)
    bools = [
        *derived_history((70.0, False, 70.0)),
        *derived_history((84.0, True, 84.0), is_overridden=True),
        *derived_history((94.0, True, 94.0)),
    ]
    assert observe_rate(BUMPY, bools, TRUE, 100.0).value == pytest.approx(6 / 10)


# Held bools

LONG = RateModel(variable="bumped_long", of="bumped", over_s=5.0, kind=RateKind.HELD)
PHASES = st.lists(
    st.tuples(st.integers(0, 200), st.sampled_from([True, True, False, None]), st.integers(1, 90)),
    min_size=1,
    max_size=10,
    unique_by=lambda phase: phase[0],
)
"""The instants of readings, their values and for how long these are valid, in eighths of a second."""


def readings_until(phases: list[tuple[int, bool | None, int]], now_s: float) -> list[Reading[Value]]:
    """Return the readings of the phases that have begun at an instant."""
    readings = bool_history(*((at / 8, content, (at + valid) / 8) for at, content, valid in sorted(phases)))
    return [reading for reading in readings if reading.evidence_s <= now_s]


def content_at(readings: list[Reading[Value]], instant_s: float) -> Value | None:
    """Return the value of a variable at an instant."""
    reading = next((reading for reading in reversed(readings) if reading.evidence_s <= instant_s), None)
    return None if reading is None else reading.at(instant_s).content


@given(PHASES, st.integers(0, 250))
def test_a_held_bool_is_the_conjunction_over_all_instants_of_its_time(
    phases: list[tuple[int, bool | None, int]], now: int
) -> None:
    """The plain model looks at every sixteenth of a second of the last 5 s."""
    readings = readings_until(phases, now / 8)
    contents = [content_at(readings, now / 8 - sixteenth / 16) for sixteenth in range(81)]
    conjunction = False if False in contents else None if None in contents else True
    expected = None if contents[0] is None else conjunction
    present = Observation(variable="bumped", value=contents[0])
    assert observe_rate(LONG, readings, present, now / 8).value == expected


@example([(56, True, 65)], 120, BUMPY)
@given(PHASES, st.integers(0, 250), st.sampled_from([LONG, BUMPY]))
def test_an_observation_changes_by_itself_at_the_instant_that_it_states(
    phases: list[tuple[int, bool | None, int]], now: int, model: RateModel
) -> None:
    """A share can stay unknown, because a time at which the bool was known leaves the window; it then says so again."""
    readings = readings_until(phases, now / 8)
    if not readings or content_at(readings, now / 8) is None:
        return
    readings[-1] = replace(readings[-1], expires_s=FOREVER_S)
    present = Observation(variable="bumped", value=readings[-1].content)
    observed = observe_rate(model, readings, present, now / 8)

    def state_at(instant_s: float) -> object:
        later = observe_rate(model, readings, present, instant_s)
        return later.value if model is LONG else later.value is None

    state = state_at(now / 8)
    for later_s in (now / 8 + step / 7 for step in range(40)):
        assert later_s >= observed.until_s - 2 * JUST_AFTER_S or state_at(later_s) == state
    assert observed.until_s > now / 8
    if model is LONG and observed.until_s < FOREVER_S:
        assert state_at(observed.until_s) != state


def test_the_time_of_a_held_bool_begins_anew_with_an_override() -> None:
    evidence = bool_history((80.0, True, 200.0))
    assert observe_rate(LONG, evidence, TRUE, 90.0).value is True
    overridden = [*evidence, override(True, 90.0)]
    present = Observation.of(overridden[-1])
    assert [observe_rate(LONG, overridden, present, now_s).value for now_s in (90.0, 94.9, 95.0)] == [None, None, True]
    derived = [
        *derived_history((80.0, True, 80.0)),
        *derived_history((84.0, True, 84.0), is_overridden=True),
        *derived_history((90.0, True, 90.0)),
    ]
    assert [observe_rate(LONG, derived, TRUE, now_s).value for now_s in (94.9, 95.0)] == [None, True]


def test_a_held_bool_states_for_how_long_its_bool_is_known_to_be_true() -> None:
    observed = observe_rate(LONG, bool_history((97.0, True, 200.0)), TRUE, 100.0)
    assert (observed.because, observed.until_s) == ("bumped is known to be true for 3 s, but must be for 5 s", 102.0)


@pytest.mark.parametrize("model", [DRAIN, BUMPY, LONG])
def test_evidence_beyond_the_validity_of_a_rate_does_not_count(model: RateModel) -> None:
    model = replace(model, valid_for_s=5.0)
    bools = bool_history((40.0, True, 200.0), (60.0, True, 200.0))
    levels = history(*((float(at_s), 50.0) for at_s in range(40, 61)))
    readings = levels if model.kind is RateKind.RATE else bools
    assert observe_rate(model, readings, KNOWN, 64.9).until_s == 65.0 - RENEWAL_S
    assert observe_rate(model, readings, KNOWN, 65.0 - RENEWAL_S).until_s == 65.0
    stale = observe_rate(model, readings, KNOWN, 65.0)
    assert (stale.value, stale.because) == (None, "stale")
