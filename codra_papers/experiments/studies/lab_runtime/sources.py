"""How much of what is saved follows from how long looks take, and how much from what observers knew in time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from codra_papers.experiments.campaign.document import Cell, Section, Table, Words
from codra_papers.experiments.lab.outcomes import Decision
from codra_papers.experiments.studies.lab_runtime.executions import Execution, Task
from codra_papers.experiments.studies.lab_runtime.finding import Finding, percent, rounded
from codra_papers.experiments.studies.lab_runtime.paper import CONTEXT_CHECK_S
from codra_papers.experiments.studies.lab_runtime.runs import DECISION_S, Pair
from codra_papers.experiments.studies.lab_runtime.savings import (
    AT_P1S_CHECK,
    KNOWING_NOTHING,
    Saving,
    saving,
    scenarios,
)
from codra_papers.lab.mission import WAIT_S

_Part = Callable[[Execution], Sequence[Decision]]

_TERMS: Mapping[str, Callable[[Saving], float]] = {
    "perception without observers": lambda found: found.without_s,
    "+ looks in whose place context answered, each a mean look": lambda found: found.spared_s,
    "- waiting for observers": lambda found: -found.waiting_s,
    "- asking": lambda found: -found.asking_s,
    "+ looks still done, against mean ones": lambda found: found.other_looks_s,
    "+ perception tasks that did not come up": lambda found: found.fewer_s,
    "= saved": lambda found: found.saved_s,
}

WHAT_IT_SHOWS = (
    "How long a look takes stands in the world's durations, which are fitted to P1's Table 3: that context is quicker"
    " than a look is P1's finding put in, not ours. Whether context has the right answer in time is not put in: it"
    " comes from frames, perception and the spec. As a share, what is saved is the share of answers in time, which no"
    " duration of looks enters, less the time spent on asking and waiting as a share of the looks, which they do enter."
)


def sources(pairs: Sequence[Pair]) -> Finding:
    """Take the saving of all openings and closings apart."""
    columns = _columns(pairs)
    whole = columns["all"]
    return Finding(
        section=Section(
            title="Where the saving comes from",
            parts=[
                Words(text=WHAT_IT_SHOWS),
                parts_table(
                    columns, "Seconds of perception saved, in parts that add up, over all executions and seeds."
                ),
                _scenario_table(columns),
                _reasons_table(_fell_back(pairs)),
            ],
        ),
        summary=[_sentence(whole)],
        results={
            "saving": {name: plain(found) for name, found in columns.items()},
            "scenarios": {name: _plain_scenarios(found) for name, found in columns.items()},
            "unanswered": {" ".join(reason): count for reason, count in sorted(reasons(_fell_back(pairs)).items())},
        },
    )


def parts_table(columns: Mapping[str, Saving], caption: str) -> Table:
    """Return savings in parts that add up, each in a column."""
    rows: list[Sequence[Cell]] = [
        ("perception tasks without observers", *(found.without for found in columns.values())),
        ("perception tasks with observers", *(found.checks for found in columns.values())),
        ("of these answered by context", *(found.answered for found in columns.values())),
        ("answered by context in %", *(percent(answered_share(found)) for found in columns.values())),
        ("a mean look without observers in s", *(rounded(found.look_s) for found in columns.values())),
    ]
    rows += [(f"{name}, in s", *(rounded(term(found)) for found in columns.values())) for name, term in _TERMS.items()]
    rows.append(("saved in %", *(percent(found.share) for found in columns.values())))
    return Table(caption=caption, header=("", *columns), rows=rows)


def answered_share(found: Saving) -> float | None:
    """Return the share of the perception tasks with observers that context answered; None if there were none."""
    return found.answered / found.checks if found.checks else None


def reasons(fell_back: Sequence[Decision]) -> Counter[tuple[str, str, str]]:
    """Return how often context had no answer: by variable, situation and reason."""
    return Counter(
        (decision.variable, "preview" if decision.is_preview else "monitoring", decision.unanswered)
        for decision in fell_back
    )


def plain(found: Saving) -> Mapping[str, Any]:
    """Return a saving and its parts as data."""
    terms = ("without_s", "spared_s", "other_looks_s", "fewer_s", "saved_s", "share")
    return {**asdict(found), **{name: getattr(found, name) for name in terms}}


def _columns(pairs: Sequence[Pair]) -> Mapping[str, Saving]:
    parts: Mapping[str, tuple[Sequence[Task], _Part]] = {
        **{task.value: ([task], lambda execution: execution.checks) for task in Task},
        "previews": (list(Task), lambda execution: execution.previews),
        "monitoring": (list(Task), lambda execution: execution.monitors),
        "all": (list(Task), lambda execution: execution.checks),
    }
    return {name: saving(*_decisions(pairs, tasks, part)) for name, (tasks, part) in parts.items()}


def _decisions(pairs: Sequence[Pair], tasks: Sequence[Task], part: _Part) -> tuple[list[Decision], list[Decision]]:
    """Return perception tasks without observers, and with them."""
    made = [pair.of(task) for pair in pairs for task in tasks]
    return (
        [decision for without, _ in made for execution in without for decision in part(execution)],
        [decision for _, observed in made for execution in observed for decision in part(execution)],
    )


def _fell_back(pairs: Sequence[Pair]) -> Sequence[Decision]:
    _, observed = _decisions(pairs, list(Task), lambda execution: execution.checks)
    return [decision for decision in observed if decision.has_looked]


def _scenario_table(columns: Mapping[str, Saving]) -> Table:
    shown = {name: scenarios(columns[name]) for name in (*Task, "all")}
    return Table(
        caption=(
            "What would be saved of perception in %, had one thing been otherwise and all else as it was. What"
            f" observers know in time is kept. P1's time of a check with observers is {CONTEXT_CHECK_S:.2f} s (its"
            f" Table 3); ours is {DECISION_S:g} s to ask, and waiting after an action, {WAIT_S:g} s at most. Observers"
            " that know nothing cost asking and waiting in vain."
        ),
        header=("", *(f"{name}: saved in %" for name in shown)),
        rows=[(cases[0].name, *(percent(case.share) for case in cases)) for cases in zip(*shown.values(), strict=True)],
    )


def _reasons_table(fell_back: Sequence[Decision]) -> Table:
    return Table(
        caption=(
            f"Why context had no answer, {len(fell_back)} times: the reason why the variable was unknown when the robot"
            " began to look."
        ),
        header=("variable", "situation", "reason", "times"),
        rows=[(*reason, count) for reason, count in sorted(reasons(fell_back).items())],
    )


def _plain_scenarios(found: Saving) -> Sequence[Mapping[str, Any]]:
    return [{**asdict(case), "saved_s": case.saved_s, "share": case.share} for case in scenarios(found)]


def _sentence(whole: Saving) -> str:
    if not whole.without_s or not whole.checks:
        return "No perception task was brought to its end, so nothing can be said of where a saving comes from."
    shares = {case.name: percent(case.share) for case in scenarios(whole)}
    cost = percent((whole.waiting_s + whole.asking_s) / whole.without_s)
    return (
        f"Over all seeds {percent(whole.share)} % of perception time is saved: context answered"
        f" {percent(answered_share(whole))} % of {whole.checks} perception tasks in time, which is what the observers"
        f" knew; asking and waiting cost {cost} %."
        f" That a look takes {whole.look_s:.1f} s follows from P1: with looks half as long"
        f" {shares['looks take half as long']} % would be saved, with looks twice as long"
        f" {shares['looks take twice as long']} %. At P1's {CONTEXT_CHECK_S:.2f} s for each check it would be"
        f" {shares[AT_P1S_CHECK]} %; observers that know nothing would save {shares[KNOWING_NOTHING]} %: less than"
        " nothing is time lost."
    )
