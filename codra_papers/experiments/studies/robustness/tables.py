"""The tables of `lab-robustness`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from codra_papers.experiments.campaign.cells import interval, mark_below, percent, plain_table, ratio, rounded
from codra_papers.experiments.campaign.document import Cell, Table
from codra_papers.experiments.campaign.statistics import Share, ratio_of_sums
from codra_papers.experiments.lab.arms import Arm
from codra_papers.experiments.lab.metrics import causes_in_window
from codra_papers.experiments.studies.robustness import paper
from codra_papers.experiments.studies.robustness.findings import (
    LATE_NOTE,
    LIDS,
    MEASURES,
    MEASURES_NOTE,
    PCR_CYCLER_LID_ALGORITHMS,
    VARIABLES,
    Comparison,
    Runs,
    fewer_triggers,
    label,
)

_MARKED_NOTE = f"Ratios below {paper.LOW_RATIO} are marked."


# Runs and arms


def arms_table(arms: Sequence[Arm]) -> Table:
    """Return a table that describes the arms."""
    rows = ((arm.name, arm.need.value, ", ".join(map(str, arm.edits)) or "unchanged") for arm in arms)
    return plain_table(
        "The arms. Observes: the variables whose observers run. The spec: the changes to the spec under test. Each arm "
        "has a vision slot of its own.",
        ("arm", "observes", "the spec"),
        rows,
    )


def runs_table(runs: Runs) -> Table:
    """Return the table of runs. It shows whether the numbers of rendered and of perceived frames are equal."""
    outcomes = runs.outcomes
    rows: list[Sequence[Cell]] = [
        (
            outcome.seed,
            round(outcome.duration_s, 1),
            outcome.loops,
            outcome.error or "",
            outcome.frames,
            outcome.perceived,
        )
        for outcome in outcomes
    ]
    counts = (sum(outcome.frames for outcome in outcomes), sum(outcome.perceived for outcome in outcomes))
    rows.append(("all", round(runs.duration_s, 1), sum(outcome.loops for outcome in outcomes), "", *counts))
    return plain_table(
        "The runs. Each run ends with the loop, or with an unrecoverable error of the main execution. The robot and "
        "all arms look at the frames that were rendered.",
        ("seed", "lasted s", "loops", "error", "frames rendered", "frames perceived"),
        rows,
    )


# Table 2


def table_2(runs: Runs, variable: str) -> Table:
    """Return P1's Table 2 for a variable and all arms, with the strict ratio in a row below P1's ratio."""
    header = ("arm", "", *(f"Run {number}" for number in range(1, len(runs.outcomes) + 1)), "Total")
    rows = [row for arm in runs.arms for row in _arm_rows(runs, variable, arm)]
    caption = (
        f"{label(variable)}, as in P1's Table 2: seconds of agreement and disagreement with the truth, from the "
        f"instant at which the last arm has identified the variable. Ratio: agreement as a share of the seconds with "
        f"any value; strict ratio: agreement as a share of all seconds. {MEASURES_NOTE} {LATE_NOTE} {_MARKED_NOTE} A "
        "dash: there is no such ratio, or the arm never identified the variable in this run, and is left out of the "
        "window of this run."
    )
    ratio_rows = [index for index, row in enumerate(rows) if row[1] in ("ratio", "strict ratio")]
    return mark_below(plain_table(caption, header, rows), paper.LOW_RATIO, ratio_rows)


def _arm_rows(runs: Runs, variable: str, arm: str) -> Iterator[Sequence[Cell]]:
    columns = [*runs.by_truth(variable, arm), runs.total_by_truth(variable, arm)]
    causes_by_column = [
        *(causes_in_window(outcome, variable, arm) for outcome in runs.outcomes),
        runs.causes_in_windows(variable, arm),
    ]
    all_seconds = [None if column is None else column.all for column in columns]
    yield arm, "right s", *(None if cell is None else round(cell.right_s, 2) for cell in all_seconds)
    yield arm, "wrong s", *(None if cell is None else round(cell.wrong_s, 2) for cell in all_seconds)
    yield (
        arm,
        "of these, late s",
        *(
            None if cell is None else round(causes.changed_since_s, 2)
            for cell, causes in zip(all_seconds, causes_by_column, strict=True)
        ),
    )
    yield arm, "unknown s", *(None if cell is None else round(cell.unknown_s, 2) for cell in all_seconds)
    for name, measure in MEASURES.items():
        yield arm, name, *(None if column is None else rounded(measure(column), 3) for column in columns)


def table_2_of_the_paper(variable: str) -> Table:
    """Return P1's rows for a variable, with corrections."""
    printed_rows = [row for row in paper.TABLE_2 if row.variable == variable]
    rows = [line for row in printed_rows for line in _paper_rows(row)]
    header = ("arm", "", *(f"Run {number}" for number in range(1, 11)), "Total")
    caption = (
        f"{label(variable)} in P1's Table 2. These are the runs of a real robot, so its run 1 is not our run 1. P1 "
        "does not state how long the lid was open, so balanced ratios and the ratio of a constant answer are unknown. "
        f"{_MARKED_NOTE}"
    )
    if variable == "centrifuge_open":
        caption += (
            " Two misprints of the context-driven row are corrected. The seconds of run 4 give a ratio of 0.978 "
            f"(printed: {paper.PRINTED_RUN_4_RATIO:.3f}). The row adds up to its total with 3589.61 s of agreement "
            f"in run 9 (printed: {paper.PRINTED_RUN_9_AGREEMENT_S})."
        )
    ratio_rows = range(2, len(rows), 3)
    return mark_below(plain_table(caption, header, rows), paper.LOW_RATIO, ratio_rows)


def _paper_rows(row: paper.TableRow) -> Iterator[Sequence[Cell]]:
    right_s, wrong_s = ((*run_s, sum(run_s)) for run_s in (row.agreement_s, row.disagreement_s))
    yield row.observer, "right s", *(round(run_s, 2) for run_s in right_s)
    yield row.observer, "wrong s", *(round(run_s, 2) for run_s in wrong_s)
    both = zip(right_s, wrong_s, strict=True)
    yield row.observer, "ratio", *(ratio(Share(right, right + wrong)) for right, wrong in both)


# All variables


def ratio_table(runs: Runs, measure: str, caption: str) -> Table:
    """Return a table with a ratio and its balanced counterpart for each variable and arm.

    Args:
        runs: the runs.
        measure: the key of the ratio in `MEASURES`.
        caption: what the ratio is.
    """
    balanced_measure = measure.replace("ratio", "balanced ratio")
    header = ("variable", *(text for arm in runs.arms for text in (arm, f"{arm}: balanced")), "constant answer")
    rows = [
        (
            label(name),
            *(
                rounded(MEASURES[key](runs.total_by_truth(name, arm)), 3)
                for arm in runs.arms
                for key in (measure, balanced_measure)
            ),
            _constant_text(runs, name),
        )
        for name in VARIABLES
    ]
    caption = (
        f"{caption} {MEASURES_NOTE} {_MARKED_NOTE} A dash: the arm was left out of the window of every run, or the "
        "variable never changed."
    )
    return mark_below(plain_table(caption, header, rows), paper.LOW_RATIO, range(len(rows)))


def _constant_text(runs: Runs, variable: str) -> str:
    """Return the ratio of the better constant answer, as text, so that it is never marked."""
    shares = [runs.total_by_truth(variable, arm).constant_share for arm in runs.arms]
    value = ratio_of_sums([max(shares, key=lambda share: share.total)])
    return "none" if value is None else f"{value:.3f}"


def seconds_table(runs: Runs) -> Table:
    """Return how long the values of each arm were right, wrong or unknown, over complete runs."""
    header = ("variable", "arm", "right s", "wrong s", "unknown s", "all s", "runs left out of the window")
    rows: list[Sequence[Cell]] = [
        (
            label(name),
            arm,
            *(
                round(duration_s, 1)
                for duration_s in (
                    arm_seconds.right_s,
                    arm_seconds.wrong_s,
                    arm_seconds.unknown_s,
                    arm_seconds.strict_share.total,
                )
            ),
            runs.left_out(name, arm),
        )
        for name in VARIABLES
        for arm in runs.arms
        for arm_seconds in [runs.whole_run_seconds(name, arm)]
    ]
    marked = frozenset((index, 6) for index, row in enumerate(rows) if row[6])
    caption = (
        "Seconds over complete runs. Right, wrong and unknown seconds add up to the duration of the runs. Marked: arms "
        "that are left out of a window."
    )
    return Table(caption=caption, header=header, rows=rows, marked=marked)


def knowledge_table(runs: Runs) -> Table:
    """Return when each arm first knew each variable, and how long after a change it held the new value."""
    header = ("variable", "arm", "first known at s", "changes", "never seen", "lag median s", "lag p90 s", "lag max s")
    rows = [
        (
            label(name),
            arm,
            rounded(_median(runs.first_s(name, arm)), 1),
            len(lag.seen_s) + lag.unseen,
            lag.unseen,
            *(rounded(lag.quantile_s(share), 1) for share in (0.5, 0.9, 1.0)),
        )
        for name in VARIABLES
        for arm in runs.arms
        for lag in [runs.lags(name, arm)]
    ]
    caption = (
        "First known: median over the runs in which the arm identified the variable. Lag: the time from a change of "
        "the truth until the arm held the new value; 0 if the arm already held this value. Never seen: changes that "
        "the arm did not see before the next change or the end of the run."
    )
    return plain_table(caption, header, rows)


def _median(values: Sequence[float]) -> float | None:
    ordered_values = sorted(values)
    if not ordered_values:
        return None
    return (ordered_values[(len(ordered_values) - 1) // 2] + ordered_values[len(ordered_values) // 2]) / 2


def comparison_table(comparisons: Sequence[Comparison]) -> Table:
    """Return the differences between arms for the variables of the two lids, with their intervals."""
    rows = [
        (
            label(comparison.variable),
            comparison.arm,
            comparison.other_arm,
            comparison.runs,
            interval(comparison.paper_difference),
            interval(comparison.strict_difference),
        )
        for comparison in comparisons
        if comparison.variable in LIDS
    ]
    caption = (
        "Differences of the ratios of sums over the further runs: the arm minus the arm with which it is compared. In "
        "brackets: the 95 % interval of a paired bootstrap over runs (10,000 resamples, bias-corrected and "
        "accelerated)."
    )
    return plain_table(caption, ("variable", "arm", "against", "runs", "ratio", "strict ratio"), rows)


# Triggers


def triggers_table(runs: Runs, slot_algorithms: Sequence[str]) -> Table:
    """Return how many jobs of each algorithm each arm started, and how long the arm's slot was in use."""
    algorithms = sorted({name for outcome in runs.outcomes for arm in outcome.arms.values() for name in arm.triggers})
    rows: list[Sequence[Cell]] = [
        (name, *(sum(runs.triggers(arm, (name,))) for arm in runs.arms)) for name in algorithms
    ]
    distance_polls = [name for name in algorithms if name not in slot_algorithms]
    rows.append(("all that need the vision slot", *(sum(runs.triggers(arm, slot_algorithms)) for arm in runs.arms)))
    rows.append(("all distance polls", *(sum(runs.triggers(arm, distance_polls)) for arm in runs.arms)))
    rows.extend(
        (f"share of {name} with true preconditions", *_observable_shares(runs, name)) for name in slot_algorithms
    )
    rows.append(("seconds in the vision slot", *(round(runs.slot_s(arm), 1) for arm in runs.arms)))
    rows.append(("share of the runs", *(rounded(runs.slot_s(arm) / runs.duration_s, 3) for arm in runs.arms)))
    caption = (
        "Jobs started, by algorithm and arm, over all runs. Distance polls look at no frame. True preconditions: those "
        "of the spec, also for arms that have none. A dash: the arm started no such job, or the algorithm has other "
        "preconditions than variables that must be true."
    )
    return plain_table(caption, ("algorithm", *runs.arms), rows)


def _observable_shares(runs: Runs, algorithm: str) -> Iterator[float | None]:
    """Yield, for each arm, the share of an algorithm's jobs that were started while its preconditions were true."""
    for arm in runs.arms:
        share = runs.observable_share(arm, algorithm)
        yield rounded(ratio_of_sums([share]), 3)


def reduction_table(runs: Runs, further_runs: Runs, naive_arms: Sequence[str], slot_algorithms: Sequence[str]) -> Table:
    """Return the reduction of the naive arms' triggers by each arm, and P1's 79.4 %."""
    algorithm_groups = (
        ("the PCR-cycler's lid, as P1 counts", PCR_CYCLER_LID_ALGORITHMS),
        ("all that need the vision slot", slot_algorithms),
    )
    rows = [
        (
            algorithms_name,
            arm,
            other_arm,
            sum(runs.triggers(arm, algorithms)),
            sum(runs.triggers(other_arm, algorithms)),
            percent(fewer_triggers(runs, arm, other_arm, algorithms)),
            percent(fewer_triggers(further_runs, arm, other_arm, algorithms))
            if other_arm in further_runs.arms
            else None,
        )
        for algorithms_name, algorithms in algorithm_groups
        for other_arm in naive_arms
        for arm in runs.arms
        if arm not in naive_arms
    ]
    fewer_percent = 100 * (1 - paper.CONTEXT_DRIVEN_TRIGGERS / paper.NAIVE_TRIGGERS)
    row = (
        paper.CONTEXT_DRIVEN,
        paper.NAIVE,
        paper.CONTEXT_DRIVEN_TRIGGERS,
        paper.NAIVE_TRIGGERS,
        f"{fewer_percent:.1f}",
        None,
    )
    header = ("triggers of", "arm", "against", "arm's", "the other's", "fewer by %", "fewer by %, further runs")
    return plain_table(
        "How many triggers an arm saves. Arm's, the other's: how many triggers the arm and the arm that it is compared "
        "with (against) made in the runs of the tables. Fewer: the share of the other's triggers that the arm saves, "
        "with its 95 % interval over runs.",
        header,
        [("the PCR-cycler's perception in P1", *row), *rows],
    )


# Decisions and causes


def answers_table(runs: Runs) -> Table:
    """Return the values that the arms held at decisions, for each variable on which decisions are made."""
    decided_variables = {decision.variable for outcome in runs.outcomes for decision in outcome.decisions}
    groups = [(label(name), (name,)) for name in VARIABLES if name in decided_variables]
    preview_columns, monitoring_columns = (
        ("preview: right", "wrong", "of these, late", "fell back"),
        ("monitoring: right", "wrong", "of these, late", "fell back"),
    )
    header = ("variable", "arm", *preview_columns, *monitoring_columns, "on fresh evidence")
    rows: list[Sequence[Cell]] = [
        (group, arm, *_answer_cells(runs, names, arm))
        for group, names in [*groups, ("all", VARIABLES)]
        for arm in runs.arms
    ]
    marked = frozenset((row, column) for row, cells in enumerate(rows) for column in (3, 7) if cells[column])
    caption = (
        "The value that each arm held at the instant when the main execution needed the value. Fell back: the value "
        "was unknown, so a main execution would look by itself. A monitoring decision is requested when the action has "
        "just ended. The value held at this instant is mostly from before the action; it is fresh only if its evidence "
        "is from after the action. If an arm answered, a main execution would wait for it. Marked: wrong values. "
        f"{LATE_NOTE}"
    )
    return Table(caption=caption, header=header, rows=rows, marked=marked)


def _answer_cells(runs: Runs, variables: Sequence[str], arm: str) -> Iterator[int]:
    preview_answers, monitoring_answers = (
        runs.answers(variables, arm, previews=previews) for previews in (True, False)
    )
    for arm_answers in (preview_answers, monitoring_answers):
        yield from (arm_answers.right, arm_answers.wrong, arm_answers.late, arm_answers.fell_back)
    yield monitoring_answers.fresh


def causes_table(runs: Runs) -> Table:
    """Return why held values were wrong, for the variables of Table 2 and for all variables."""
    groups = [*((label(name), (name,)) for name in LIDS), ("all fourteen", VARIABLES)]
    rows = [
        (
            group,
            arm,
            round(causes.seen_wrongly_s, 1),
            round(causes.changed_since_s, 1),
            _share(causes.seen_wrongly_s, wrong_s),
        )
        for group, names in groups
        for arm in runs.arms
        for causes in [runs.causes(names, arm)]
        for wrong_s in [causes.seen_wrongly_s + causes.changed_since_s]
    ]
    caption = (
        "Why held values were wrong, in seconds over complete runs. Seen wrongly: the value was not true at the "
        "instant of its evidence. Changed since: the value was true at this instant, and no later evidence was taken "
        "or accepted."
    )
    return plain_table(caption, ("variable", "arm", "seen wrongly s", "changed since s", "share seen wrongly"), rows)


def _share(part_s: float, total_s: float) -> float | None:
    return rounded(part_s / total_s, 3) if total_s else None
