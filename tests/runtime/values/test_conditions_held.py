"""Functions that return from histories whether a condition held without a break."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Term, Value, age, known, value
from codra_dsl.runtime.values.cell import Cell, Reading, Reason
from codra_dsl.runtime.values.conditions_held import ObservabilityMonitor, first_loss_s, has_held
from codra_dsl.runtime.values.derived import ContextAt

History = list[tuple[float, Value | None]]


def cells(valid_for_s: float = math.inf, **histories: History) -> Mapping[str, Cell]:
    made = {}
    for name, history in histories.items():
        made[name] = Cell(name, 100)
        for evidence_s, content in history:
            made[name].write(
                Reading(
                    name=name,
                    content=content,
                    reason=Reason.FAILED if content is None else None,
                    evidence_s=evidence_s,
                    expires_s=math.inf if content is None else evidence_s + valid_for_s,
                )
            )
    return made


A, B = value("a"), value("b")


@pytest.mark.parametrize(
    ("history", "expected"),
    [
        ([(0, True)], True),
        ([(2, True)], True),
        ([(2.5, True)], False),
        ([(0, False), (2, True)], True),
        ([(0, True), (4, False)], False),
        ([(0, True), (4.1, False)], True),
        ([(0, True), (3, False), (3.5, True)], False),
        ([(0, True), (3, False), (3, True)], False),
        ([(0, True), (3, None), (3, True)], False),
        ([(0, True), (3, True), (3.5, True)], True),
        ([], False),
    ],
    ids=repr,
)
def test_a_condition_holds_from_two_to_four(history: History, expected: bool) -> None:
    assert has_held(A, cells(a=history), 2, 4) is expected


def test_an_instant_is_an_interval_too() -> None:
    flips = cells(a=[(0, True), (2, False), (4, True)])
    assert [has_held(A, flips, at_s, at_s) for at_s in (1, 2, 3, 4)] == [True, False, False, True]


def test_one_of_two_variables_may_take_over_from_the_other_at_one_instant() -> None:
    assert has_held(A | B, cells(a=[(0, True), (3, False)], b=[(0, False), (3, True)]), 2, 4)
    assert not has_held(A | B, cells(a=[(0, True), (3, False)], b=[(0, False), (3.1, True)]), 2, 4)


def test_the_end_of_validity_breaks_it_unless_newer_evidence_is_there() -> None:
    assert not has_held(A, cells(1.0, a=[(1.5, True)]), 2, 4)
    assert has_held(A, cells(1.0, a=[(1.5, True), (2.5, True), (3.2, True)]), 2, 4)
    assert not has_held(A, cells(1.0, a=[(1.5, True), (2.6, True), (3.2, True)]), 2, 4)
    assert has_held(A, cells(1.0, a=[(1.5, True)]), 2, 2.4)
    assert not has_held(A, cells(1.0, a=[(1.5, True)]), 2, 2.5)


def test_an_interval_before_the_end_of_validity_is_judged_the_same_after_it() -> None:
    readings = cells(valid_for_s=5.0, a=[(0, True)])
    assert has_held(A, readings, 1, 2) is True
    assert readings["a"].expire(5.0)
    assert has_held(A, readings, 1, 2) is True
    assert has_held(A, readings, 4, 5) is False


def test_an_age_that_passes_its_limit_breaks_it() -> None:
    fresh = age("a") < 2.0
    assert has_held(fresh, cells(a=[(1, 1), (2.5, 1)]), 2, 4)
    assert not has_held(fresh, cells(a=[(1, 1)]), 2, 4)
    assert not has_held(fresh, cells(a=[(1, 1), (3.5, 1)]), 2, 4)
    assert has_held(~known("a") | (age("a") > 2.0), cells(a=[(1, 1)]), 3.5, 9)
    assert not has_held(~known("a") | (age("a") > 2.0), cells(a=[(1, 1), (5, 1)]), 3.5, 9)


def test_a_condition_is_lost_when_it_first_fails() -> None:
    history = cells(a=[(0, True), (3, False), (4, True), (5, False)])
    assert first_loss_s(A, history, 1, 9) == 3
    assert first_loss_s(A, history, 4, 9) == 5
    assert first_loss_s(A, history, 3, 9) == 3
    assert first_loss_s(A, history, 3, 9, has_held_before=False) == 5
    assert first_loss_s(A, history, 1, 2) is None


def test_a_history_that_does_not_reach_back_counts_as_a_break() -> None:
    """This is the safe side: while evidence is being taken, histories keep the readings that are needed."""
    flooded = cells(a=[(stamp / 100, True) for stamp in range(300)])
    assert has_held(A, flooded, 2.0, 2.99)
    assert not has_held(A, flooded, 1.9, 2.99)
    assert not has_held(~known("a"), flooded, 1.9, 1.99)


Stamps = st.lists(st.tuples(st.integers(0, 12), st.sampled_from([True, False, None])), max_size=8)
CONDITIONS = [A & ~B, A | B, known("a") & (~known("b") | B), (age("a") < 2.0) | B, age("b") > 1.5]


@given(
    Stamps,
    Stamps,
    st.sampled_from(CONDITIONS),
    st.tuples(st.integers(0, 12), st.integers(0, 6)),
    st.sampled_from([1.0, 2.5, math.inf]),
)
def test_a_condition_held_exactly_if_it_holds_at_every_sampled_instant(
    a: History, b: History, term: Term, interval_s: tuple[int, int], valid_for_s: float
) -> None:
    """There is one reading per instant; the samples are 1/32 s apart."""
    start_s, length_s = interval_s
    made = cells(valid_for_s, a=list(dict(a).items()), b=list(dict(b).items()))
    grid = [start_s + step / 32 for step in range(length_s * 32 + 1)]
    everywhere = all(term.holds(ContextAt(made, instant_s)) for instant_s in grid)
    assert has_held(term, made, start_s, start_s + length_s) is everywhere


def watched(term: Term, history: History) -> tuple[ObservabilityMonitor, Mapping[str, Cell]]:
    return ObservabilityMonitor(term), cells(a=history)


def own(evidence_s: float) -> Reading[Value]:
    return Reading(name="x", content=True, evidence_s=evidence_s, source="eye")


def test_a_watch_finds_a_loss_between_two_checks() -> None:
    watch, history = watched(A, [(0, True), (2, False), (2.5, True)])
    assert watch.loss_s(history, own(1), is_own=True, now_s=1.5) is None
    assert watch.loss_s(history, own(1), is_own=True, now_s=3) == 2
    assert watch.loss_s(history, own(2.7), is_own=True, now_s=4) is None


def test_a_watch_over_a_history_that_no_longer_reaches_back_relies_on_its_last_check() -> None:
    """A value may be old although its precondition gets new evidence a hundred times a second."""
    watch, history = watched(A, [(0, True)])
    for second in range(1, 60):
        for part in range(100):
            history["a"].write(Reading(name="a", content=True, evidence_s=second + part / 100))
        assert watch.loss_s(history, own(0.5), is_own=True, now_s=second + 0.99) is None
    history["a"].write(Reading(name="a", content=False, evidence_s=60.0))
    assert watch.loss_s(history, own(0.5), is_own=True, now_s=60.0) == 60.0


def test_a_watch_over_a_value_of_another_writer_waits_until_the_condition_has_held() -> None:
    watch, history = watched(A, [(0, False)])
    reading: Reading[Value] = Reading(name="x", content=True, evidence_s=1.0, source="main_execution")
    assert watch.loss_s(history, reading, is_own=False, now_s=2) is None
    history["a"].write(Reading(name="a", content=True, evidence_s=3.0))
    assert watch.loss_s(history, reading, is_own=False, now_s=4) is None
    history["a"].write(Reading(name="a", content=False, evidence_s=5.0))
    assert watch.loss_s(history, reading, is_own=False, now_s=6) == 5
