"""Rates of change over histories, and possible values of unknown inputs."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime import Reading, Reason
from codra_dsl.runtime.loops.declarations import InputModel, RateModel
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds
from codra_dsl.runtime.loops.observations import Observation, number_of, possible_values, rate, share, value_of
from codra_dsl.runtime.values.declarations import DERIVED

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
    observed_rate = rate(DRAIN, history(*((at_s, 7.0 + slope * at_s) for at_s in instants_s)), KNOWN, 20.0)
    assert observed_rate.value == pytest.approx(-60.0 * slope, abs=1e-6)
    assert observed_rate.evidence_s == 20.0


@pytest.mark.parametrize(("span_s", "is_known"), [(9.9, False), (10.0, True)])
def test_a_rate_is_unknown_until_half_of_its_window_is_known(span_s: float, is_known: bool) -> None:
    observed_rate = rate(DRAIN, history((100.0 - span_s, 50.0), (100.0, 49.0)), KNOWN, 100.0)
    assert (observed_rate.value is not None) is is_known
    assert is_known or observed_rate.because == "level is known for 9.9 s only"


def test_readings_before_a_gap_do_not_count() -> None:
    observed_rate = rate(DRAIN, history((0.0, 90.0), (8.0, None), (9.0, 50.0), (20.0, 50.0)), KNOWN, 20.0)
    assert observed_rate.value == 0.0


def test_readings_before_the_window_do_not_count() -> None:
    observed_rate = rate(DRAIN, history((0.0, 90.0), (80.0, 50.0), (100.0, 48.0)), KNOWN, 100.0)
    assert observed_rate.value == pytest.approx(6.0)


def test_the_rate_of_an_unknown_variable_is_unknown() -> None:
    observed_rate = rate(
        DRAIN, history((80.0, 50.0), (100.0, 48.0)), Observation(variable="level", because="stale"), 100.0
    )
    assert (observed_rate.value, observed_rate.because) == (None, "level is unknown")


def test_two_readings_of_one_instant_have_no_rate() -> None:
    model = RateModel(variable="drain", of="level", over_s=0.0)
    assert rate(model, history((100.0, 50.0), (100.0, 48.0)), KNOWN, 100.0).value is None


def test_members_count_from_zero_and_an_unknown_one_is_one_of_them() -> None:
    load = InputModel(variable="load", range=Bounds(0.0, 2.0), members=("empty", "loading", "full"))
    assert [number_of(load, member) for member in load.members] == [0.0, 1.0, 2.0]
    assert [value_of(load, number) for number in (0.0, 1.0, 2.0)] == list(load.members)
    assert possible_values(load, math.nan) == (Bounds(0.0, 0.0), Bounds(1.0, 1.0), Bounds(2.0, 2.0))
    bumped = InputModel(variable="bumped", range=Bounds(0.0, 1.0), members=("false", "true"))
    assert [value_of(bumped, number_of(bumped, value)) for value in (False, True)] == [False, True]


BUMPY = RateModel(variable="rough", of="bumped", over_s=20.0, is_share=True)
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
    observed = share(BUMPY, readings, TRUE, now / 10)
    expected = sum(known) / len(known) if len(known) >= 100 else None
    assert observed.value == (None if expected is None else pytest.approx(expected))


def test_a_share_is_unknown_while_its_variable_is_and_tells_how_long_it_was_known() -> None:
    unknown = Observation(variable="bumped", because="stale")
    assert share(BUMPY, bool_history((90.0, True, 99.0)), unknown, 100.0).because == "bumped is unknown"
    observed = share(BUMPY, bool_history((95.0, True, 200.0)), TRUE, 100.0)
    assert (observed.value, observed.because) == (None, "bumped is known for 5 s only")


def derived_history(*derivations: tuple[float, float | bool, float]) -> list[Reading[Value]]:
    """Return readings by the instant of the derivation, their value, and the instant of the evidence."""
    return [
        Reading(name="derived", content=content, evidence_s=evidence_s, identified_s=derived_s, source=DERIVED)
        for derived_s, content, evidence_s in derivations
    ]


def test_readings_of_a_derived_variable_count_from_their_derivation() -> None:
    bools = derived_history((80.0, True, 2.0), (90.0, False, 90.0), (94.0, True, 2.0))
    assert share(BUMPY, bools, TRUE, 100.0).value == pytest.approx(16 / 20)
    numbers = derived_history((80.0, 50.0, 0.0), (90.0, 49.0, 0.0), (100.0, 48.0, 0.0))
    observed_rate = rate(DRAIN, numbers, KNOWN, 100.0)
    assert observed_rate.value == pytest.approx(6.0)
    assert observed_rate.evidence_s == 0.0
