from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime import EventLog
from codra_dsl.runtime.journal import Event, Kind
from codra_papers.experiments.lab.scoring import (
    Piece,
    held_pieces,
    overlaps,
    pieces,
    score,
    source_pieces,
    value_known_by,
)


def variable_event(instant_s: float, value: bool | None, source: str = "look", is_present: bool = True) -> Event:
    event_name = "unknown" if value is None else "identified"
    return Event(
        instant_s, Kind.VARIABLE, "open", event_name, {"value": value, "source": source, "present": is_present}
    )


def record_of(*events: Event) -> EventLog:
    record = EventLog()
    for event in events:
        record.add(event)
    return record


def test_right_wrong_and_unknown_seconds_follow_from_held_values_and_the_truth() -> None:
    record = record_of(variable_event(2.0, True), variable_event(6.0, False), variable_event(9.0, None))
    truth = [Piece(0.0, 4.0, True), Piece(4.0, 10.0, False)]

    lid_score = score("open", held_pieces(record, ["open"], 10.0)["open"], truth, record)

    assert (lid_score.right_s, lid_score.wrong_s, lid_score.unknown_s) == (5.0, 2.0, 3.0)
    assert lid_score.ratio == 5.0 / 7.0
    assert (lid_score.identified, lid_score.first_s) == (2, 2.0)


def test_a_value_of_the_main_execution_is_held_but_does_not_count_as_identified_by_an_observer() -> None:
    record = record_of(variable_event(1.0, True, source="main_execution"))

    lid_score = score("open", held_pieces(record, ["open"], 2.0)["open"], [Piece(0.0, 2.0, True)], record)

    assert (lid_score.right_s, lid_score.identified, lid_score.first_s) == (1.0, 0, None)


def test_evidence_that_only_went_into_the_history_was_never_held() -> None:
    record = record_of(variable_event(1.0, True, is_present=False))

    assert held_pieces(record, ["open"], 3.0)["open"] == (Piece(0.0, 3.0, None),)


def test_an_event_after_the_end_of_a_run_is_ignored() -> None:
    record = record_of(variable_event(1.0, True), variable_event(3.5, None))

    assert held_pieces(record, ["open"], 3.0)["open"] == (Piece(0.0, 1.0, None), Piece(1.0, 3.0, True))


def test_the_source_of_a_held_value_is_the_writer_of_its_latest_evidence() -> None:
    record = record_of(
        variable_event(1.0, True, source="angle"),
        variable_event(2.0, False, source="angle"),
        variable_event(3.0, False, source="rotor"),
        variable_event(4.0, None, source="rotor"),
        variable_event(5.0, True, source="rotor", is_present=False),
    )

    assert source_pieces(record, "open", 6.0) == (
        Piece(0.0, 1.0, None),
        Piece(1.0, 3.0, "angle"),
        Piece(3.0, 4.0, "rotor"),
        Piece(4.0, 6.0, None),
    )


@pytest.mark.parametrize(("instant_s", "expected"), [(0.5, None), (1.0, True), (2.0, False), (2.5, None), (3.0, None)])
def test_a_value_that_is_invalidated_when_a_decision_was_based_on_it_was_known(
    instant_s: float, expected: bool | None
) -> None:
    record = record_of(
        variable_event(1.0, True), variable_event(2.0, False), variable_event(2.0, None), variable_event(3.0, None)
    )

    assert value_known_by(record, "open", instant_s) is expected


def test_without_a_new_value_the_one_just_before_the_instant_was_known() -> None:
    record = record_of(variable_event(1.0, True), variable_event(2.0, None))

    assert value_known_by(record, "open", 2.0) is True


def test_a_variable_that_was_never_held_has_no_ratio() -> None:
    record = record_of()

    assert score("open", [Piece(0.0, 3.0, None)], [Piece(0.0, 3.0, True)], record).ratio is None


changes = st.lists(st.tuples(st.floats(0.0, 99.0), st.sampled_from([True, False, None])), min_size=1).map(
    lambda changes_of_value: [(0.0, None), *sorted(changes_of_value, key=lambda change: change[0])]
)


@given(changes, changes)
def test_right_wrong_and_unknown_add_up_to_the_run(held: list[tuple[float, bool | None]], truth: list) -> None:
    lid_score = score("open", pieces(held, 100.0), pieces(truth, 100.0), EventLog())

    assert abs(lid_score.right_s + lid_score.wrong_s + lid_score.unknown_s - 100.0) < 1e-6


@given(changes)
def test_pieces_cover_the_run_without_gaps_and_neighbours_differ(
    changes_of_value: list[tuple[float, bool | None]],
) -> None:
    made = pieces(changes_of_value, 100.0)

    assert made[0].start_s == 0.0
    assert made[-1].end_s == 100.0
    for left, right in pairwise(made):
        assert left.end_s == right.start_s
        assert left.value is not right.value


def test_overlaps_are_in_order_of_time() -> None:
    left = [Piece(0.0, 5.0, True), Piece(5.0, 9.0, False)]
    right = [Piece(0.0, 2.0, True), Piece(2.0, 7.0, False), Piece(7.0, 9.0, True)]

    assert [duration_s for _, _, duration_s in overlaps(left, right)] == [2.0, 3.0, 2.0, 2.0]
