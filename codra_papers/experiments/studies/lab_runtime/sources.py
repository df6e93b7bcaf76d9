"""How much of the saving follows from the duration of looks, and how much from answers that were ready in time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from codra_dsl.runtime import Reason
from codra_papers.experiments.campaign.document import Cell, Section, Table, Words
from codra_papers.experiments.lab.outcomes import BEFORE_THE_ACTION, Decision
from codra_papers.experiments.studies.lab_runtime.executions import Execution, Task
from codra_papers.experiments.studies.lab_runtime.finding import Finding, percent, rounded
from codra_papers.experiments.studies.lab_runtime.paper import CONTEXT_CHECK_S
from codra_papers.experiments.studies.lab_runtime.runs import DECISION_S, Pair
from codra_papers.experiments.studies.lab_runtime.savings import (
    AT_P1S_CHECK,
    WITHOUT_KNOWLEDGE,
    Saving,
    saving,
    scenarios,
)
from codra_papers.lab.mission import WAIT_S

_DecisionSelector = Callable[[Execution], Sequence[Decision]]

_TERMS: Mapping[str, Callable[[Saving], float]] = {
    "perception without observers": lambda saving_parts: saving_parts.without_s,
    "+ looks that context replaced, each counted as a mean look": lambda saving_parts: saving_parts.spared_s,
    "- waiting for observers": lambda saving_parts: -saving_parts.waiting_s,
    "- asking": lambda saving_parts: -saving_parts.asking_s,
    "+ looks still done, compared with mean looks": lambda saving_parts: saving_parts.other_looks_s,
    "+ perception tasks that did not come up": lambda saving_parts: saving_parts.fewer_s,
    "= saved": lambda saving_parts: saving_parts.saved_s,
}

WHAT_IT_SHOWS = (
    "The duration of a look is one of the world's durations, which are fitted to P1's Table 3. So it is an input from"
    " P1, not our finding, that context is faster than a look. Whether context has the right answer in time is our"
    " finding: it depends on frames, perception and the spec. The saved share is the difference of two shares. The"
    " first is the share of answers in time, which does not depend on the duration of looks. The second is the time"
    " of asking and waiting as a share of the time of looks, which depends on the duration of looks."
)


def judge_sources(pairs: Sequence[Pair]) -> Finding:
    """Split the saving of all openings and closings into its parts."""
    columns = _columns(pairs)
    total_saving = columns["all"]
    return Finding(
        section=Section(
            title="Where the saving comes from",
            parts=[
                Words(text=WHAT_IT_SHOWS),
                parts_table(
                    columns, "Seconds of perception saved, in parts that add up, over all executions and seeds."
                ),
                _scenario_table(columns),
                _reasons_table(_unanswered_checks(pairs)),
            ],
        ),
        summary=[_sentence(total_saving)],
        results={
            "saving": {name: saving_as_data(saving_parts) for name, saving_parts in columns.items()},
            "scenarios": {name: _scenarios_as_data(saving_parts) for name, saving_parts in columns.items()},
            "unanswered": {
                " ".join(reason): count for reason, count in sorted(reasons(_unanswered_checks(pairs)).items())
            },
        },
    )


def parts_table(columns: Mapping[str, Saving], caption: str) -> Table:
    """Return a table with one column for each saving and one row for each part. The parts of a saving add up."""
    rows: list[Sequence[Cell]] = [
        ("perception tasks without observers", *(saving_parts.without for saving_parts in columns.values())),
        ("perception tasks with observers", *(saving_parts.checks for saving_parts in columns.values())),
        ("of these answered by context", *(saving_parts.answered for saving_parts in columns.values())),
        ("answered by context in %", *(percent(answered_share(saving_parts)) for saving_parts in columns.values())),
        ("a mean look without observers in s", *(rounded(saving_parts.look_s) for saving_parts in columns.values())),
    ]
    rows += [
        (f"{name}, in s", *(rounded(term(saving_parts)) for saving_parts in columns.values()))
        for name, term in _TERMS.items()
    ]
    rows.append(("saved in %", *(percent(saving_parts.share) for saving_parts in columns.values())))
    return Table(caption=caption, header=("", *columns), rows=rows)


def answered_share(saving_parts: Saving) -> float | None:
    """Return the share of perception tasks with observers that context answered; None if there are no such tasks."""
    return saving_parts.answered / saving_parts.checks if saving_parts.checks else None


def reasons(fell_back: Sequence[Decision]) -> Counter[tuple[str, str, str]]:
    """Return how often context had no answer. The key consists of variable, situation and reason."""
    return Counter(
        (decision.variable, "preview" if decision.is_preview else "monitoring", decision.unanswered)
        for decision in fell_back
    )


def reason_rows(fell_back: Sequence[Decision]) -> Sequence[Sequence[Cell]]:
    """Return the rows of a table of reasons: variable, situation, reason in words, and how often."""
    texts = {BEFORE_THE_ACTION: "it was known only from before the action"}
    return [
        (variable, situation, texts.get(reason) or Reason(reason).meaning, count)
        for (variable, situation, reason), count in sorted(reasons(fell_back).items())
    ]


def saving_as_data(saving_parts: Saving) -> Mapping[str, Any]:
    """Return a saving and its parts as plain data."""
    terms = ("without_s", "spared_s", "other_looks_s", "fewer_s", "saved_s", "share")
    return {**asdict(saving_parts), **{name: getattr(saving_parts, name) for name in terms}}


def _columns(pairs: Sequence[Pair]) -> Mapping[str, Saving]:
    selectors: Mapping[str, tuple[Sequence[Task], _DecisionSelector]] = {
        **{task.value: ([task], lambda execution: execution.checks) for task in Task},
        "previews": (list(Task), lambda execution: execution.previews),
        "monitoring": (list(Task), lambda execution: execution.monitors),
        "all": (list(Task), lambda execution: execution.checks),
    }
    return {name: saving(*_decisions(pairs, tasks, select)) for name, (tasks, select) in selectors.items()}


def _decisions(
    pairs: Sequence[Pair], tasks: Sequence[Task], select: _DecisionSelector
) -> tuple[list[Decision], list[Decision]]:
    """Return the perception tasks without observers, and those with observers."""
    executions_by_pair = [pair.executions_of(task) for pair in pairs for task in tasks]
    return (
        [decision for without, _ in executions_by_pair for execution in without for decision in select(execution)],
        [decision for _, observed in executions_by_pair for execution in observed for decision in select(execution)],
    )


def _unanswered_checks(pairs: Sequence[Pair]) -> Sequence[Decision]:
    _, observed = _decisions(pairs, list(Task), lambda execution: execution.checks)
    return [decision for decision in observed if decision.has_looked]


def _scenario_table(columns: Mapping[str, Saving]) -> Table:
    scenarios_by_column = {name: scenarios(columns[name]) for name in (*Task, "all")}
    return Table(
        caption=(
            "The saved share of perception in %, if one assumption were different and everything else were the same."
            " The answers that observers have in time stay as measured. In P1, a check with observers takes"
            f" {CONTEXT_CHECK_S:.2f} s (Table 3). Here, asking takes {DECISION_S:g} s, and the robot waits at most"
            f" {WAIT_S:g} s after an action."
            " If observers know nothing, the robot asks and waits without getting an answer."
        ),
        header=("", *(f"{name}: saved in %" for name in scenarios_by_column)),
        rows=[
            (cases[0].name, *(percent(case.share) for case in cases))
            for cases in zip(*scenarios_by_column.values(), strict=True)
        ],
    )


def _reasons_table(fell_back: Sequence[Decision]) -> Table:
    return Table(
        caption=(
            f"Why context had no answer in {len(fell_back)} perception tasks. The reason states why the variable was"
            " unknown when the robot began to look."
        ),
        header=("variable", "situation", "reason", "times"),
        rows=reason_rows(fell_back),
    )


def _scenarios_as_data(measured: Saving) -> Sequence[Mapping[str, Any]]:
    return [{**asdict(case), "saved_s": case.saved_s, "share": case.share} for case in scenarios(measured)]


def _sentence(total_saving: Saving) -> str:
    if not total_saving.without_s or not total_saving.checks:
        return "No perception task was completed, so no saving can be attributed."
    shares = {case.name: percent(case.share) for case in scenarios(total_saving)}
    cost = percent((total_saving.waiting_s + total_saving.asking_s) / total_saving.without_s)
    return (
        f"Over all seeds, {percent(total_saving.share)} % of the perception time is saved. Context answered"
        f" {percent(answered_share(total_saving))} % of {total_saving.checks} perception tasks in time, from the"
        f" knowledge of the observers; asking and waiting cost {cost} %."
        f" The mean duration of a look, {total_saving.look_s:.1f} s, follows from P1. With looks half as long,"
        f" {shares['looks take half as long']} % would be saved; with looks twice as long,"
        f" {shares['looks take twice as long']} %. At P1's {CONTEXT_CHECK_S:.2f} s for each check,"
        f" {shares[AT_P1S_CHECK]} % would be saved. Observers that know nothing would save"
        f" {shares[WITHOUT_KNOWLEDGE]} %; a negative share is lost time."
    )
