"""Opening and closing the PCR-cycler, compared with P1: Table 3, Figure 8 and its footnote (section 4.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from codra_papers.experiments.campaign.document import Cell, Drawing, Part, Section, Table, Words
from codra_papers.experiments.campaign.statistics import Share, Welch, ratio_interval, welch
from codra_papers.experiments.studies.lab_runtime.drawing import Bars, figure_8
from codra_papers.experiments.studies.lab_runtime.executions import Execution, Task, spent_s
from codra_papers.experiments.studies.lab_runtime.finding import (
    Finding,
    estimate_as_data,
    interval_text,
    mean,
    percent,
    rounded,
    spread_text,
)
from codra_papers.experiments.studies.lab_runtime.paper import CHECK_COUNT, PAPER, PaperTask
from codra_papers.experiments.studies.lab_runtime.runs import WITH_OBSERVERS, WITHOUT_OBSERVERS, Pair

DurationFunction = Callable[[Execution], float]
"""A duration of an execution."""

WHOLE_TASK, PERCEPTION = "whole task", "perception"
LEVELS: Mapping[str, DurationFunction] = {
    WHOLE_TASK: lambda execution: execution.duration_s,
    PERCEPTION: lambda execution: execution.perception_s,
}

_PaperDurations = Callable[[PaperTask], tuple[float, float]]
_SITUATIONS: Mapping[str, tuple[DurationFunction, _PaperDurations]] = {
    "preview": (lambda execution: spent_s(execution.previews), lambda paper: paper.preview_s),
    "monitoring": (lambda execution: spent_s(execution.monitors), lambda paper: paper.monitoring_s),
}


def judge_tending(pairs: Sequence[Pair]) -> Finding:
    """Compare opening and closing with and without observers.

    Args:
        pairs: the pair of P1's sample, followed by the pairs of the further seeds.
    """
    first_pairs, further_pairs = pairs[:1], pairs[1:]
    bars = [_bars(task, first_pairs) for task in Task]
    parts: list[Part] = [
        Words(text=_slips_sentence(pairs)),
        _table_3(first_pairs, "Table 3 of P1 and of this run: mean seconds of an execution (n = 5), first seed."),
        Drawing(caption="Figure 8 of P1: mean durations with standard deviation, first seed.", svg=figure_8(bars)),
        _figure_8_table(first_pairs, "Figure 8 in numbers, first seed."),
        _welch_table(pairs),
    ]
    if further_pairs:
        parts[3:3] = [_table_3(further_pairs, f"The same as Table 3, over {len(further_pairs)} further seeds.")]
        parts += [
            _figure_8_table(further_pairs, f"Figure 8 in numbers, over {len(further_pairs)} further seeds."),
            _intervals(further_pairs),
        ]
    return Finding(
        section=Section(title="Opening and closing the PCR-cycler", parts=parts),
        summary=[_sentence(task, pairs) for task in Task],
        results={"tasks": {task: _results(task, pairs) for task in Task}},
    )


def reduction(task: Task, pairs: Sequence[Pair], duration_of: DurationFunction) -> float | None:
    """Return the share of the mean duration that observers save.

    Return None if there are no executions without observers, or none with observers.
    """
    without, observed = (mean(durations) for durations in _durations(task, pairs, duration_of))
    return None if without is None or observed is None or not without else (without - observed) / without


def _durations(task: Task, pairs: Sequence[Pair], duration_of: DurationFunction) -> tuple[list[float], list[float]]:
    """Return the durations of all executions without observers, and of all executions with observers."""
    completed_executions = [pair.executions_of(task) for pair in pairs]
    return (
        [duration_of(execution) for without, _ in completed_executions for execution in without],
        [duration_of(execution) for _, observed in completed_executions for execution in observed],
    )


def _checks(task: Task, pairs: Sequence[Pair]) -> tuple[list[float], list[float]]:
    """Return the durations of all perception tasks without observers, and of all perception tasks with observers."""
    completed_executions = [pair.executions_of(task) for pair in pairs]
    return (
        [
            spent_s([check])
            for without, _ in completed_executions
            for execution in without
            for check in execution.checks
        ],
        [
            spent_s([check])
            for _, observed in completed_executions
            for execution in observed
            for check in execution.checks
        ],
    )


def _saved_per_check_s(task: Task, pairs: Sequence[Pair]) -> float | None:
    without, observed = (mean(durations) for durations in _checks(task, pairs))
    return None if without is None or observed is None else without - observed


# Words


def _slips_sentence(pairs: Sequence[Pair]) -> str:
    completed_executions = [
        execution
        for pair in pairs
        for task in Task
        for task_executions in pair.executions_of(task)
        for execution in task_executions
    ]
    checks = [len(execution.checks) for execution in completed_executions]
    more_count, fewer_count = sum(count > CHECK_COUNT for count in checks), sum(count < CHECK_COUNT for count in checks)
    return (
        f"{len(completed_executions)} executions were completed, each task with and without observers. A task consists"
        " of its perception tasks, the decisions that need no camera, and acting, which is all the rest. With the same"
        " seed, the durations of acting are the same with and without observers."
        f" {more_count} executions have more than {CHECK_COUNT} perception tasks, because a lever or lid slipped and"
        f" was tried again; {fewer_count} have fewer, because a condition was already true."
    )


def _sentence(task: Task, pairs: Sequence[Pair]) -> str:
    paper, first_pairs = PAPER[task], pairs[:1]
    shares = (
        percent(reduction(task, first_pairs, duration_of)) for duration_of in (LEVELS[PERCEPTION], LEVELS[WHOLE_TASK])
    )
    perception, task_share = ("-" if share is None else f"{share} %" for share in shares)
    saved_s = rounded(_saved_per_check_s(task, first_pairs))
    return (
        f"{task.capitalize()} the PCR-cycler: perception takes {perception} less time with observers (P1:"
        f" {100 * paper.perception_share:.0f} %), the whole task {task_share} less (P1:"
        f" {100 * paper.task_share:.0f} %), and a perception task {saved_s} s less (P1: {paper.saved_per_check_s} s)."
        f"{_further_seeds_text(task, pairs[1:])}"
    )


def _further_seeds_text(task: Task, pairs: Sequence[Pair]) -> str:
    if not pairs:
        return ""
    perception, task_share = (
        interval_text(ratio_interval(_shares(task, pairs, LEVELS[level])), scale=100, digits=1)
        for level in (PERCEPTION, WHOLE_TASK)
    )
    return (
        f" Over {len(pairs)} further seeds, perception takes {perception} % less time, and the whole task"
        f" {task_share} % less."
    )


# Tables


def _table_3(pairs: Sequence[Pair], caption: str) -> Table:
    return Table(
        caption=caption,
        header=(
            "situation",
            "observers",
            *(f"{task}, {source}" for task in Task for source in ("P1 in s", "here in s")),
        ),
        rows=[
            (situation, "yes" if observed else "no", *_cells(pairs, duration_of, paper_durations, observed))
            for situation, (duration_of, paper_durations) in _SITUATIONS.items()
            for observed in (0, 1)
        ],
    )


def _cells(
    pairs: Sequence[Pair], duration_of: DurationFunction, paper_durations: _PaperDurations, observed: int
) -> Iterator[Cell]:
    for task in Task:
        yield paper_durations(PAPER[task])[observed]
        yield rounded(mean(_durations(task, pairs, duration_of)[observed]))


def _figure_8_table(pairs: Sequence[Pair], caption: str) -> Table:
    rows: list[Sequence[Cell]] = []
    for task in Task:
        paper_shares = {WHOLE_TASK: PAPER[task].task_share, PERCEPTION: PAPER[task].perception_share}
        for level, duration_of in LEVELS.items():
            without, observed = _durations(task, pairs, duration_of)
            share = percent(reduction(task, pairs, duration_of))
            rows.append((task, level, spread_text(without), spread_text(observed), share, percent(paper_shares[level])))
    saved_texts = [f"{task}: {rounded(_saved_per_check_s(task, pairs))} s" for task in Task]
    paper_saved_texts = [f"{task}: {PAPER[task].saved_per_check_s} s" for task in Task]
    return Table(
        caption=f"{caption} Saved per perception task: {', '.join(saved_texts)} (P1: {', '.join(paper_saved_texts)}).",
        header=("task", "part", "without in s", "with observers in s", "less in %", "P1: less in %"),
        rows=rows,
    )


def _welch_table(pairs: Sequence[Pair]) -> Table:
    rows: list[Sequence[Cell]] = []
    for sample, sample_pairs in _pairs_by_sample(pairs).items():
        for task in Task:
            for level, duration_of in LEVELS.items():
                without, observed = _durations(task, sample_pairs, duration_of)
                test_result = _welch_result(without, observed)
                cells = ("none", None, None, "none", "none") if test_result is None else _welch_cells(test_result)
                rows.append((sample, task, level, len(without) + len(observed), *cells))
    return Table(
        caption=(
            "Two-sided Welch's t-test of the durations without observers against those with observers (P1, footnote 4:"
            " p < 0.01, n = 10), with 95 % intervals by Welch and Satterthwaite, and with Hedges' g. The test treats"
            " the samples as independent. Here, actions with the same seed are equal in both samples, which makes the"
            " test of the whole task conservative. Each of the five executions of a seed is a value of a sample."
        ),
        header=("sample", "task", "part", "n", "difference in s", "t", "degrees of freedom", "p", "Hedges' g"),
        rows=rows,
    )


def _pairs_by_sample(pairs: Sequence[Pair]) -> Mapping[str, Sequence[Pair]]:
    pairs_by_sample = {"first seed": pairs[:1], "further seeds": pairs[1:]}
    return {name: sample_pairs for name, sample_pairs in pairs_by_sample.items() if sample_pairs}


def _welch_result(without: Sequence[float], observed: Sequence[float]) -> Welch | None:
    return welch(without, observed) if min(len(without), len(observed)) > 1 else None


def _welch_cells(test_result: Welch) -> tuple[Cell, ...]:
    return (
        interval_text(test_result.difference),
        rounded(test_result.t),
        rounded(test_result.degrees, 1),
        f"{test_result.p:.1e}",
        interval_text(test_result.hedges_g),
    )


def _intervals(pairs: Sequence[Pair]) -> Table:
    return Table(
        caption=(
            f"By how much durations are shorter with observers, over {len(pairs)} further seeds: the ratio of sums with"
            " its 95 % interval. Seeds are resampled, each seed with both of its runs."
        ),
        header=("task", *(f"{level}: less in %" for level in LEVELS), "P1: whole task", "P1: perception"),
        rows=[
            (
                task,
                *(
                    interval_text(ratio_interval(_shares(task, pairs, LEVELS[level])), scale=100, digits=1)
                    for level in LEVELS
                ),
                percent(PAPER[task].task_share),
                percent(PAPER[task].perception_share),
            )
            for task in Task
        ],
    )


def _shares(task: Task, pairs: Sequence[Pair], duration_of: DurationFunction) -> list[Share]:
    """Return, for each seed, the mean saved time as a share of the mean time without observers.

    Seeds without executions in one of the two runs are left out.
    """
    means = [tuple(map(mean, _durations(task, [pair], duration_of))) for pair in pairs]
    return [
        Share(without_s - observed_s, without_s)
        for without_s, observed_s in means
        if without_s is not None and observed_s is not None
    ]


# Pictures


def _bars(task: Task, pairs: Sequence[Pair]) -> Bars:
    durations = {level: _durations(task, pairs, duration_of) for level, duration_of in LEVELS.items()}
    shares = {level: reduction(task, pairs, duration_of) for level, duration_of in LEVELS.items()}
    return Bars(
        task=task,
        task_s=durations[WHOLE_TASK],
        perception_s=durations[PERCEPTION],
        task_share=shares[WHOLE_TASK],
        perception_share=shares[PERCEPTION],
    )


# Data


def _results(task: Task, pairs: Sequence[Pair]) -> Mapping[str, Any]:
    return {
        "p1": asdict(PAPER[task]),
        **{
            sample.replace(" ", "_"): _sample(task, sample_pairs)
            for sample, sample_pairs in _pairs_by_sample(pairs).items()
        },
        "executions": [
            _execution(pair.seed, condition, execution)
            for pair in pairs
            for condition, task_executions in zip(
                (WITHOUT_OBSERVERS, WITH_OBSERVERS), pair.executions_of(task), strict=True
            )
            for execution in task_executions
        ],
    }


def _sample(task: Task, pairs: Sequence[Pair]) -> Mapping[str, Any]:
    levels = {level.replace(" ", "_"): duration_of for level, duration_of in LEVELS.items()}
    welch_results = {
        level: _welch_result(*_durations(task, pairs, duration_of)) for level, duration_of in levels.items()
    }
    return {
        "saved_per_check_s": _saved_per_check_s(task, pairs),
        "less_share": {level: reduction(task, pairs, duration_of) for level, duration_of in levels.items()},
        "less_share_over_seeds": {
            level: estimate_as_data(ratio_interval(_shares(task, pairs, duration_of)))
            for level, duration_of in levels.items()
        },
        "welch": {
            level: None if test_result is None else _welch_as_data(test_result)
            for level, test_result in welch_results.items()
        },
    }


def _welch_as_data(test_result: Welch) -> Mapping[str, Any]:
    return {
        "difference_s": estimate_as_data(test_result.difference),
        "t": test_result.t,
        "degrees_of_freedom": test_result.degrees,
        "p": test_result.p,
        "hedges_g": estimate_as_data(test_result.hedges_g),
    }


def _execution(seed: int, condition: str, execution: Execution) -> Mapping[str, Any]:
    return {
        "seed": seed,
        "condition": condition,
        "start_s": execution.start_s,
        "duration_s": execution.duration_s,
        "preview_s": spent_s(execution.previews),
        "previews": len(execution.previews),
        "monitoring_s": spent_s(execution.monitors),
        "monitors": len(execution.monitors),
        "other_decisions_s": spent_s(execution.other_decisions),
        "acting_s": execution.acting_s,
    }
