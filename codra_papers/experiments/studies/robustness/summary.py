"""Sentences that answer the questions of the protocol, whatever the results are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from codra_papers.experiments.campaign.cells import interval, percent
from codra_papers.experiments.campaign.statistics import Estimate, Share, ratio_of_sums
from codra_papers.experiments.lab.arms import NAIVE, NEED, NEED_ON_EVENT, PRECONDITIONS
from codra_papers.experiments.studies.robustness.findings import (
    PCR_CYCLER_LID_ALGORITHMS,
    VARIABLES,
    Comparison,
    Runs,
    fewer_triggers,
    label,
)
from codra_papers.experiments.studies.robustness.frames import RepeatedDetection
from codra_papers.experiments.studies.robustness.mistakes import Mistake

HOPED_RATIO = 0.985
"""The hoped-for ratio of `centrifuge_open`, as P1 counts. Each arm with preconditions is compared with this ratio."""

HOPED_REDUCTION = 0.9
"""The hoped-for reduction of triggers by the arm with need and on event, relative to the naive arm."""

CONTEXT_DRIVEN_ARMS = (PRECONDITIONS.name, NEED.name, NEED_ON_EVENT.name)


def ratio_sentences(runs: Runs, comparisons: Sequence[Comparison]) -> Iterator[str]:
    """Answer whether context makes observers more stable."""
    yield _ratio_hope_sentence(runs)
    for arm in CONTEXT_DRIVEN_ARMS:
        for comparison in comparisons:
            if (comparison.variable, comparison.arm, comparison.other_arm) == ("centrifuge_open", arm, NAIVE.name):
                yield (
                    f"centrifuge_open, {arm} against {NAIVE.name} over {_count(comparison.runs, 'further run')}: ratio "
                    f"{interval(comparison.paper_difference)}, {_difference_text(comparison.paper_difference)}; strict "
                    f"ratio {interval(comparison.strict_difference)}, {_difference_text(comparison.strict_difference)}."
                )
    for arm in CONTEXT_DRIVEN_ARMS:
        for comparison in comparisons:
            if (comparison.variable, comparison.arm, comparison.other_arm) == ("pcr_cycler_open", arm, NAIVE.name):
                yield (
                    f"PCR-cycler_open, {arm} against {NAIVE.name} over {_count(comparison.runs, 'further run')}: ratio "
                    f"{interval(comparison.paper_difference)}, {_not_worse_text(comparison.paper_difference)}; strict"
                    f" ratio {interval(comparison.strict_difference)}, {_not_worse_text(comparison.strict_difference)}."
                )


def _ratio_hope_sentence(runs: Runs) -> str:
    totals_by_truth = {arm: runs.total_by_truth("centrifuge_open", arm) for arm in runs.arms}
    arm_totals = {arm: by_truth.all for arm, by_truth in totals_by_truth.items()}
    ratios = ", ".join(
        f"{_number(ratio_of_sums([arm_seconds.paper_share]))} "
        f"(strict {_number(ratio_of_sums([arm_seconds.strict_share]))}, balanced "
        f"{_number(totals_by_truth[arm].balanced_ratio)}, constant answer "
        f"{_number(ratio_of_sums([totals_by_truth[arm].constant_share]))}) with {arm}"
        for arm, arm_seconds in arm_totals.items()
    )
    outcomes = "; ".join(
        f"{arm} {_hope_text(ratio_of_sums([arm_totals[arm].paper_share]))}" for arm in CONTEXT_DRIVEN_ARMS
    )
    return (
        f"centrifuge_open over {_count(len(runs.outcomes), 'run')}: ratio {ratios}. "
        f"Hoped for: at least {HOPED_RATIO}; {outcomes}."
    )


def _hope_text(ratio: float | None) -> str:
    return "gives no ratio" if ratio is None else "reaches it" if ratio >= HOPED_RATIO else "does not reach it"


def _difference_text(difference: Estimate) -> str:
    if difference.is_positive:
        return "better, with the interval above zero"
    if difference.is_negative:
        return "worse, with the interval below zero"
    return "not shown to differ"


def _not_worse_text(difference: Estimate) -> str:
    return (
        _difference_text(difference)
        if difference.is_positive or difference.is_negative
        else "not shown to be worse or better"
    )


def trigger_sentences(runs: Runs, slot_algorithms: Sequence[str]) -> Iterator[str]:
    """Answer how many triggers each arm with preconditions saves, and which algorithm has most remaining triggers."""
    for arm in CONTEXT_DRIVEN_ARMS:
        lid_share, vision_share = (
            fewer_triggers(runs, arm, NAIVE.name, names) for names in (PCR_CYCLER_LID_ALGORITHMS, slot_algorithms)
        )
        yield (
            f"{arm} triggers the PCR-cycler's lid {_less_often_text(lid_share)} than {NAIVE.name} (P1: 79.4 % less "
            f"often), and all perception that needs the vision slot {_less_often_text(vision_share)}."
        )
    yield _trigger_hope_sentence(runs, slot_algorithms)


def _less_often_text(saved_share: Estimate) -> str:
    if saved_share.value is not None and saved_share.value < 0.0:
        return f"{percent(-saved_share)} % more often"
    return f"{percent(saved_share)} % less often"


def _trigger_hope_sentence(runs: Runs, slot_algorithms: Sequence[str]) -> str:
    arm = NEED_ON_EVENT.name
    saved_share = fewer_triggers(runs, arm, NAIVE.name, slot_algorithms).value
    counts = {name: sum(runs.triggers(arm, (name,))) for name in slot_algorithms}
    top_algorithm = max(counts, key=lambda name: counts[name])
    if saved_share is not None and saved_share >= HOPED_REDUCTION:
        return f"Hoped for: {100 * HOPED_REDUCTION:.0f} % fewer triggers with need and on event; this is reached."
    return (
        f"Hoped for: {100 * HOPED_REDUCTION:.0f} % fewer triggers with need and on event; this is not reached. Of the "
        f"{sum(counts.values())} remaining triggers, {counts[top_algorithm]} are of {top_algorithm}."
    )


def cause_sentences(runs: Runs) -> Iterator[str]:
    """Report why held values were wrong, as far as the evidence shows the reason."""
    for variable in ("centrifuge_open", "pcr_cycler_open"):
        duration_texts = []
        for arm in runs.arms:
            causes = runs.causes((variable,), arm)
            wrong_from_start_s, changed_later_s = causes.seen_wrongly_s, causes.changed_since_s
            duration_texts.append(
                f"{arm} {wrong_from_start_s + changed_later_s:.0f} s ({wrong_from_start_s:.0f} s seen wrongly,"
                f" {changed_later_s:.0f} s changed since)"
            )
        yield f"Seconds with a wrong {label(variable)}: {'; '.join(duration_texts)}."
        yield _ratio_without_lag_sentence(runs, variable)


def _ratio_without_lag_sentence(runs: Runs, variable: str) -> str:
    """Report the ratio that would result if no value were wrong except those that were seen wrongly.

    Such values are the errors of perception itself.
    """
    ratios = []
    for arm in runs.arms:
        wrong_s, right_s = runs.causes((variable,), arm).seen_wrongly_s, runs.whole_run_seconds(variable, arm).right_s
        ratios.append(f"{_number(ratio_of_sums([Share(right_s, right_s + wrong_s)]))} with {arm}")
    lag_s = {arm: runs.lags(variable, arm).quantile_s(0.5) for arm in runs.arms}
    lags_text = ", ".join("never" if median_s is None else f"{median_s:.0f} s" for median_s in lag_s.values())
    return (
        f"If no value were wrong except those that were seen wrongly, the ratio of {label(variable)} over complete "
        f"runs would be {', '.join(ratios)}. The median lags after a change, in the same order, are {lags_text}."
    )


def decision_sentences(runs: Runs, wrong_values: Sequence[Mistake]) -> Iterator[str]:
    """Report how often a decision would have been made on a wrong value."""
    counts = {
        arm: tuple(
            sum(mistake.arm == arm and mistake.purpose == purpose for mistake in wrong_values)
            for purpose in ("preview", "monitoring")
        )
        for arm in runs.arms
    }
    decision_count = sum(decision.variable in VARIABLES for outcome in runs.outcomes for decision in outcome.decisions)
    counts_text = ", ".join(f"{arm} {sum(arm_counts)} ({arm_counts[0]} previews)" for arm, arm_counts in counts.items())
    yield f"Of {decision_count} decisions on the fourteen variables, an arm held a wrong value at: {counts_text}."


def frame_sentences(runs: Runs, repeated_detections: Sequence[RepeatedDetection]) -> Iterator[str]:
    """Report whether the detections in stored frames can be reproduced."""
    counts = [(outcome.frames, outcome.perceived) for outcome in runs.outcomes]
    rendered_count, perceived_count = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    is_equal = all(left == right for left, right in counts)
    yield (
        f"{rendered_count} frames were rendered and {perceived_count} perceived, "
        f"{'equal in each run' if is_equal else 'not equal in each run'}. Tags were detected again in "
        f"{_count(len(repeated_detections), 'stored frame')}, from the files alone: "
        f"{sum(frame.agrees for frame in repeated_detections)} gave exactly the recorded evidence."
    )


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.3f}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'' if number == 1 else 's'}"
