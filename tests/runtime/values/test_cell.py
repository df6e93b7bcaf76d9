"""The present reading and the history of a variable: the newest evidence wins, the history is bounded."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import (
    MAX_PINNED_READINGS,
    MIN_KEPT_READINGS,
    Cell,
    Reading,
    Reason,
    UnknownValueError,
)


def reading(evidence_s: float, content: Value | None = True, expires_s: float = math.inf) -> Reading[Value]:
    reason = Reason.FAILED if content is None else None
    return Reading(name="x", content=content, reason=reason, evidence_s=evidence_s, expires_s=expires_s)


def filled(*stamps_s: float, history: int = 100) -> Cell:
    cell = Cell("x", history)
    for stamp_s in stamps_s:
        cell.write(reading(stamp_s))
    return cell


def test_a_cell_that_was_never_observed_is_unknown() -> None:
    cell = Cell("x", 100)
    assert not cell.reading.known
    assert cell.reading.reason is Reason.NEVER_OBSERVED
    assert cell.at(5.0).reason is Reason.NEVER_OBSERVED
    assert cell.history() == ()


def test_older_evidence_goes_into_the_history_only() -> None:
    cell = Cell("x", 100)
    assert cell.write(reading(2.0, True))
    assert not cell.write(reading(1.0, False))
    assert cell.reading.content is True
    assert [past_reading.content for past_reading in cell.history()] == [False, True]
    assert cell.at(1.5).content is False


def test_of_two_readings_of_one_instant_the_later_written_counts() -> None:
    cell = Cell("x", 100)
    cell.write(reading(2.0, True))
    assert cell.write(reading(2.0, False))
    assert cell.at(2.0).content is False


def test_validity_ends_exactly() -> None:
    cell = Cell("x", 100)
    cell.write(reading(1.0, True, expires_s=3.0))
    before, after = math.nextafter(3.0, 0.0), 3.0
    assert cell.at(before).known
    assert cell.at(after).reason is Reason.STALE
    assert not cell.expire(before)
    assert cell.expire(after)
    assert (cell.reading.reason, cell.reading.evidence_s, cell.reading.identified_s) == (Reason.STALE, 1.0, 3.0)


def test_evidence_that_is_newer_than_a_stale_value_replaces_it() -> None:
    cell = Cell("x", 100)
    cell.write(reading(1.0, True, expires_s=3.0))
    cell.expire(9.0)
    assert cell.write(reading(2.0, False))
    assert cell.reading.content is False


@given(st.lists(st.integers(0, 400), max_size=300), st.integers(0, 150))
def test_the_history_is_a_ring_that_drops_the_oldest_evidence(stamps: list[int], history: int) -> None:
    cell = filled(*stamps, history=history)
    assert [past_reading.evidence_s for past_reading in cell.history()] == sorted(stamps)[
        max(0, len(stamps) - history) :
    ]
    assert cell.reading.evidence_s == max(stamps, default=-math.inf)


def test_a_short_history_is_still_long_enough_to_judge_evidence() -> None:
    cell = filled(*range(200), history=1)
    assert len(cell.history()) == 1
    assert cell.complete_from_s == 200 - MIN_KEPT_READINGS
    assert cell.at(150.5).evidence_s == 150


def test_an_instant_before_the_start_of_the_history_is_unknown() -> None:
    cell = filled(*range(200))
    assert cell.complete_from_s == 100
    assert cell.at(50).reason is Reason.NEVER_OBSERVED
    assert filled(*range(100)).complete_from_s == -math.inf


def test_a_pin_keeps_the_reading_at_its_instant_and_all_later_ones() -> None:
    cell = filled(*range(100))
    cell.pin(95.5)
    for stamp in range(100, 1000):
        cell.write(reading(stamp))
    assert cell.complete_from_s == 95
    assert len(cell.between(95.5, 2000)) == 904
    assert len(cell.history()) == 100
    cell.unpin(95.5)
    cell.write(reading(1000))
    assert cell.complete_from_s == 901


def test_a_pin_keeps_a_bounded_number_of_readings() -> None:
    cell = filled(0)
    cell.pin(0.5)
    for stamp in range(1, MAX_PINNED_READINGS + 500):
        cell.write(reading(stamp))
    assert len(cell.between(-1, math.inf)) == MAX_PINNED_READINGS + 100
    assert cell.complete_from_s > 0.5


def test_an_unknown_reading_has_no_value_and_no_truth_value() -> None:
    unknown: Reading[bool] = Reading(name="lid_open", reason=Reason.INVALIDATED, detail="open_lid")
    with pytest.raises(UnknownValueError, match=r"lid_open is unknown \(invalidated: open_lid\)"):
        _ = unknown.value
    with pytest.raises(TypeError, match="no truth value"):
        _ = not unknown


def test_evidence_that_was_being_taken_at_an_invalidation_is_not_admitted() -> None:
    cell = Cell("x", 100)
    assert cell.admits(0.0, 1.0)
    cell.invalidated_s = 5.0
    assert [cell.admits(*interval) for interval in [(4, 4.5), (4, 6), (4, 5), (5, 6), (5.1, 6)]] == [
        *(True, False, False, False, True)
    ]
