"""Metrics, compared with a slow oracle that samples the held value and the truth."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime import EventLog
from codra_dsl.runtime.journal import Event, Kind
from codra_papers.experiments.lab.metrics import (
    Answers,
    Causes,
    Lags,
    Seconds,
    answers,
    causes,
    in_window,
    lags,
    seconds,
    seconds_by_truth,
    total,
    window,
)
from codra_papers.experiments.lab.outcomes import ArmOutcome, Basis, Decision, Outcome
from codra_papers.experiments.lab.scoring import Piece, pieces
from codra_papers.experiments.lab.trials import wrong_spans

END = 40
"""Values change only at full seconds, so one sample in the middle of each second is enough."""

Samples = list[bool | None]
true_or_false = st.lists(st.booleans(), min_size=END, max_size=END)
held_samples = st.lists(st.sampled_from([True, False, None]), min_size=END, max_size=END)
instants = st.one_of(st.none(), st.integers(0, END - 1).map(float))


def pieces_of(samples: Samples) -> tuple[Piece, ...]:
    return pieces([(float(second), value) for second, value in enumerate(samples)], float(END))


def outcome_of(truth: Samples, held_samples_by_arm: dict[str, Samples], first_s: dict[str, float | None]) -> Outcome:
    arms = {
        name: ArmOutcome(
            held={"open": pieces_of(samples)},
            wrong={"open": ()},
            first_s={"open": first_s[name]},
            triggers={},
            observable_triggers={},
            slot_s=0.0,
            sources={},
        )
        for name, samples in held_samples_by_arm.items()
    }
    return Outcome(
        name="run-1",
        seed=1,
        duration_s=float(END),
        loops=0,
        error=None,
        frames=0,
        perceived=0,
        truth={"open": pieces_of(truth)},
        arms=arms,
        decisions=[],
        skills=[],
        kept=[],
        interruptions=[],
    )


@given(held_samples, true_or_false, st.integers(0, END))
def test_right_wrong_and_unknown_seconds_equal_those_of_sampling(held: Samples, truth: Samples, start: int) -> None:
    samples = list(zip(held, truth, strict=True))[start:]

    counted_seconds = seconds(pieces_of(held), pieces_of(truth), float(start))

    assert counted_seconds.unknown_s == sum(value is None for value, _ in samples)
    assert counted_seconds.right_s == sum(value == fact for value, fact in samples if value is not None)
    assert counted_seconds.wrong_s == sum(value != fact for value, fact in samples if value is not None)


any_change = st.lists(st.tuples(st.floats(0.0, 99.0), st.sampled_from([True, False, None])), min_size=1).map(
    lambda changes: [(0.0, None), *sorted(changes, key=lambda change: change[0])]
)


@given(any_change, any_change, st.floats(0.0, 100.0))
def test_right_wrong_and_unknown_seconds_add_up_to_the_rest_of_the_run(held: list, truth: list, start_s: float) -> None:
    counted_seconds = seconds(pieces(held, 100.0), pieces(truth, 100.0), start_s)

    assert abs(counted_seconds.strict_share.total - (100.0 - start_s)) < 1e-6
    assert counted_seconds.paper_share.total <= counted_seconds.strict_share.total
    assert counted_seconds.paper_share.part == counted_seconds.strict_share.part == counted_seconds.right_s


@given(held_samples, held_samples, true_or_false, instants, instants)
def test_the_window_begins_when_the_last_arm_that_identifies_the_variable_first_does(
    left_samples: Samples, right_samples: Samples, truth: Samples, left_s: float | None, right_s: float | None
) -> None:
    outcome = outcome_of(truth, {"left": left_samples, "right": right_samples}, {"left": left_s, "right": right_s})
    identified_s = [instant_s for instant_s in (left_s, right_s) if instant_s is not None]
    common_window = window(outcome, "open")

    assert common_window.start_s == (max(identified_s) if identified_s else None)
    assert common_window.left_out == {
        name for name, first_s in (("left", left_s), ("right", right_s)) if first_s is None
    }
    for name, samples, first_s in (("left", left_samples, left_s), ("right", right_samples, right_s)):
        window_seconds = in_window(outcome, "open", name)
        if first_s is None:
            assert window_seconds is None
        else:
            assert window_seconds == seconds(pieces_of(samples), pieces_of(truth), max(identified_s))


@given(held_samples, true_or_false)
def test_a_lag_is_the_number_of_samples_until_the_new_value_is_held(held: Samples, truth: Samples) -> None:
    seen_s: list[float] = []
    unseen_count = 0
    for change in (second for second in range(1, END) if truth[second] != truth[second - 1]):
        next_change = next(
            (sample_index for sample_index in range(change, END) if truth[sample_index] != truth[change]), END
        )
        lag_s = next(
            (
                sample_index - change
                for sample_index in range(change, next_change)
                if held[sample_index] == truth[change]
            ),
            None,
        )
        seen_s += [] if lag_s is None else [float(lag_s)]
        unseen_count += lag_s is None

    assert lags(pieces_of(held), pieces_of(truth)) == Lags(seen_s=tuple(seen_s), unseen=unseen_count)


def test_quantiles_of_lags_use_seen_changes_only() -> None:
    all_lags = Lags(seen_s=(1.0, 2.0), unseen=1) + Lags(seen_s=(3.0,), unseen=2)

    assert (all_lags.quantile_s(0.5), all_lags.quantile_s(1.0), all_lags.unseen) == (2.0, 3.0, 3)
    assert Lags(seen_s=(), unseen=1).quantile_s(0.5) is None


def test_seconds_of_runs_add_up_and_runs_without_any_add_zero() -> None:
    seconds_of_run = Seconds(right_s=6.0, wrong_s=2.0, unknown_s=8.0)

    total_seconds = total([seconds_of_run, None, seconds_of_run])

    assert total_seconds == Seconds(right_s=12.0, wrong_s=4.0, unknown_s=16.0)
    assert (total_seconds.paper_share.part, total_seconds.paper_share.total, total_seconds.strict_share.total) == (
        12.0,
        16.0,
        32.0,
    )


# Balanced ratios, and the constant answer


@given(held_samples, true_or_false)
def test_balanced_ratios_give_both_true_values_the_same_weight(held: Samples, truth: Samples) -> None:
    by_truth = seconds_by_truth(pieces_of(held), pieces_of(truth))
    ratios: list[float | None] = []
    strict_ratios: list[float | None] = []
    for fact in (True, False):
        values = [value for value, true_value in zip(held, truth, strict=True) if true_value is fact]
        known_values = [value for value in values if value is not None]
        ratios.append(known_values.count(fact) / len(known_values) if known_values else None)
        strict_ratios.append(values.count(fact) / len(values) if values else None)

    assert by_truth.all == seconds(pieces_of(held), pieces_of(truth))
    assert by_truth.balanced_ratio == (None if None in ratios else pytest.approx(sum(ratios) / 2))
    assert by_truth.strict_balanced_ratio == (None if None in strict_ratios else pytest.approx(sum(strict_ratios) / 2))


@given(true_or_false)
def test_the_better_constant_answer_has_the_ratio_of_the_more_frequent_value(truth: Samples) -> None:
    by_constant = {value: seconds_by_truth(pieces_of([value] * END), pieces_of(truth)) for value in (True, False)}
    best_part = max(by_truth.all.paper_share.part for by_truth in by_constant.values())

    for by_truth in by_constant.values():
        assert (by_truth.constant_share.part, by_truth.constant_share.total) == (best_part, END)
        assert by_truth.balanced_ratio in (None, 0.5)


# Causes


def identified(instant_s: float, value: bool | None, evidence_s: float) -> Event:
    details = {"value": value, "evidence_s": evidence_s, "present": True}
    return Event(instant_s, Kind.VARIABLE, "open", "unknown" if value is None else "identified", details)


reports = st.lists(st.tuples(st.integers(1, END - 1), st.integers(0, 5), st.sampled_from([True, False, None])))


@given(reports, true_or_false)
def test_the_cause_of_a_wrong_second_follows_from_its_own_evidence(reports_of_variable: list, truth: Samples) -> None:
    record = EventLog()
    value_and_evidence_by_instant: dict[int, tuple[bool | None, int]] = {}
    for instant, age, value in sorted(reports_of_variable, key=lambda report: report[0]):
        record.add(identified(float(instant), value, float(max(instant - age, 0))))
        value_and_evidence_by_instant[instant] = (value, max(instant - age, 0))
    seen_wrongly_count = changed_since_count = 0
    held_value_and_evidence: tuple[bool | None, int] = (None, 0)
    for second in range(END):
        held_value_and_evidence = value_and_evidence_by_instant.get(second, held_value_and_evidence)
        value, evidence = held_value_and_evidence
        if value is not None and value != truth[second]:
            changed_since_count += truth[evidence] == value
            seen_wrongly_count += truth[evidence] != value

    spans = wrong_spans(record, {"open": pieces_of(truth)})["open"]

    assert causes(spans) == Causes(seen_wrongly_s=float(seen_wrongly_count), changed_since_s=float(changed_since_count))
    for left_span, right_span in pairwise(spans):
        assert left_span.end_s < right_span.start_s or (
            left_span.end_s == right_span.start_s and left_span.was_true != right_span.was_true
        )


# Decisions


def decision(held_value: bool | None, true_value: bool, *, is_fresh: bool, was_true: bool = False) -> Decision:
    is_wrong = held_value is not None and held_value != true_value
    basis = Basis(algorithm="look", evidence_s=0.0, values={}, was_true=was_true, frame="")
    return Decision(
        instant_s=1.0,
        variable="open",
        skill="open_it",
        is_preview=False,
        truth=true_value,
        held={"arm": held_value},
        fresh={"arm": is_fresh},
        held_after_wait={"arm": held_value},
        answer=true_value,
        answered_s=2.0,
        looked_s=1.0,
        waited_s=0.0,
        source="",
        has_looked=True,
        unanswered="",
        wrong={"arm": basis} if is_wrong else {},
        wrong_answer=None,
    )


def test_decisions_are_right_wrong_late_or_fall_back_and_fresh_or_not() -> None:
    decisions = [
        decision(True, True, is_fresh=True),
        decision(False, False, is_fresh=False),
        decision(False, True, is_fresh=False),
        decision(False, True, is_fresh=False, was_true=True),
        decision(None, True, is_fresh=False),
    ]

    assert answers(decisions, "arm") == Answers(right=2, wrong=2, late=1, fell_back=1, fresh=1)
