"""A day at the fair (P1, section 4.2): perception tasks that context replaced in seven hours, and the saved time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from codra_papers.experiments.campaign.document import Cell, Section, Table, Words
from codra_papers.experiments.lab.outcomes import Decision, Outcome
from codra_papers.experiments.studies.lab_runtime.executions import needs_the_camera, spent_s
from codra_papers.experiments.studies.lab_runtime.finding import Finding, mean, percent, rounded
from codra_papers.experiments.studies.lab_runtime.paper import DAY_CHECKS, DAY_S, DAY_SAVED_MIN, DAY_SAVED_PER_CHECK_S
from codra_papers.experiments.studies.lab_runtime.runs import OBSERVED, REPAIR_S, WITHOUT, Pair
from codra_papers.experiments.studies.lab_runtime.savings import Saving, saving
from codra_papers.experiments.studies.lab_runtime.sources import answered_share, parts_table, reasons, saving_as_data

_PARTS = (
    "Seconds of perception saved, in parts that add up. The values without observers are computed: as many looks as"
    " there were perception tasks, each a mean look of the day without observers."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """The result of a day.

    Attributes:
        saving: the perception time of the checks with observers, compared with that of the same number of looks, each
            with the mean duration of the looks on the day without observers.
        answered_s: the mean time of a check that context answered; None if it answered no check.
        fell_back: the checks that context did not answer.
    """

    saving: Saving
    answered_s: float | None
    fell_back: Sequence[Decision]

    @property
    def per_check_s(self) -> float | None:
        """Return the time that a check saves if context answers it, as P1 counts it."""
        return None if self.answered_s is None else self.saving.look_s - self.answered_s

    @property
    def replaced_s(self) -> float:
        """Return the time saved by all checks that context answered, as P1 counts it: the mean saving for each."""
        return self.saving.answered * (self.per_check_s or 0.0)


def judge_day(pair: Pair) -> Finding:
    """Report the result of a day."""
    result = day_result(pair)
    return Finding(
        section=Section(
            title="A day of seven hours",
            parts=[
                Words(
                    text="The robot processes samples for seven hours, once with and once without observers, with the"
                    f" same seed. After an unrecoverable error someone repairs the situation in {REPAIR_S:g} s and the"
                    " work starts again. The amount of work differs: a robot that saves time gets more done. So savings"
                    " are counted on the perception tasks of the day with observers: each is compared with a mean look"
                    " of the day without."
                ),
                _comparison(pair, result),
                parts_table({"the day with observers": result.saving}, _PARTS),
                _reasons_table(result),
                _interruptions_table(pair),
            ],
        ),
        summary=[_sentence(pair, result)],
        results={"day": _results(pair, result)},
    )


def day_result(pair: Pair) -> Day:
    """Return the result of a day."""
    without, observed = _checks(pair.without), _checks(pair.observed)
    checks_saving = saving(without, observed)
    answered_checks = [decision for decision in observed if not decision.has_looked]
    return Day(
        saving=replace(checks_saving, without=checks_saving.checks),
        answered_s=mean([spent_s([decision]) for decision in answered_checks]),
        fell_back=[decision for decision in observed if decision.has_looked],
    )


def _checks(outcome: Outcome) -> Sequence[Decision]:
    return [decision for decision in outcome.decisions if needs_the_camera(decision)]


def _comparison(pair: Pair, result: Day) -> Table:
    parts, without, observed = result.saving, pair.without, pair.observed
    looks = sum(decision.has_looked for decision in _checks(without))
    rows: list[Sequence[Cell]] = [
        ("hours", DAY_S / 3600, _hours(without), _hours(observed)),
        ("loops completed", None, without.loops, observed.loops),
        ("interruptions", None, len(without.interruptions), len(observed.interruptions)),
        ("perception tasks", None, looks, parts.checks),
        ("answered by context", DAY_CHECKS, 0, parts.answered),
        ("mean seconds of a perception task by looking", None, rounded(parts.look_s), _own_look_s(parts)),
        ("mean seconds of a task that context answered", None, None, rounded(result.answered_s)),
        ("saved per answered task in s", DAY_SAVED_PER_CHECK_S, None, rounded(result.per_check_s)),
        ("saved by answered tasks in min, as P1 counts", DAY_SAVED_MIN, None, rounded(result.replaced_s / 60, 1)),
        ("saved by all tasks in min, including unsuccessful waiting", None, None, rounded(parts.saved_s / 60, 1)),
        (f"the same for P1's {DAY_CHECKS} tasks in min", DAY_SAVED_MIN, None, _for_as_many_as_p1_min(result)),
    ]
    return Table(
        caption="The day, and P1's. This robot only processes samples, so it makes more decisions than P1's robot.",
        header=("", "P1", "without observers", "with observers"),
        rows=rows,
    )


def _hours(outcome: Outcome) -> float:
    return round(outcome.duration_s / 3600, 2)


def _own_look_s(parts: Saving) -> float | None:
    return rounded(parts.own_looks_s / parts.fell_back) if parts.fell_back else None


def _for_as_many_as_p1_min(result: Day) -> float | None:
    return None if result.per_check_s is None else rounded(DAY_CHECKS * result.per_check_s / 60, 1)


def _reasons_table(result: Day) -> Table:
    return Table(
        caption=f"Why context had no answer, {len(result.fell_back)} times of {result.saving.checks}.",
        header=("variable", "situation", "reason", "times"),
        rows=[(*reason, count) for reason, count in sorted(reasons(result.fell_back).items())],
    )


def _interruptions_table(pair: Pair) -> Table:
    return Table(
        caption="What interrupted the day.",
        header=("run", "at s", "error"),
        rows=[
            (condition, rounded(instant_s, 1), text)
            for condition, outcome in ((WITHOUT, pair.without), (OBSERVED, pair.observed))
            for instant_s, text in outcome.interruptions
        ],
    )


def _sentence(pair: Pair, result: Day) -> str:
    parts = result.saving
    return (
        f"In {_hours(pair.observed)} h with observers context answered {parts.answered} of {parts.checks} perception"
        f" tasks ({percent(answered_share(parts))} %; P1: {DAY_CHECKS} replaced), which saved"
        f" {rounded(result.replaced_s / 60, 1)} min by P1's counting (P1: {DAY_SAVED_MIN:g} min;"
        f" {_for_as_many_as_p1_min(result)} min for as many tasks as P1's), and {rounded(parts.saved_s / 60, 1)} min"
        f" with all waiting and looking counted. {pair.observed.loops} loops were completed with observers,"
        f" {pair.without.loops} without."
    )


def _results(pair: Pair, result: Day) -> Mapping[str, Any]:
    return {
        "p1": {"checks": DAY_CHECKS, "saved_min": DAY_SAVED_MIN, "saved_per_check_s": DAY_SAVED_PER_CHECK_S},
        "repair_s": REPAIR_S,
        **{
            condition: _outcome_as_data(outcome)
            for condition, outcome in ((WITHOUT, pair.without), (OBSERVED, pair.observed))
        },
        "saving": saving_as_data(result.saving),
        "answered_check_s": result.answered_s,
        "saved_per_check_s": result.per_check_s,
        "saved_as_p1_counts_min": result.replaced_s / 60,
        "unanswered": {" ".join(reason): count for reason, count in sorted(reasons(result.fell_back).items())},
    }


def _outcome_as_data(outcome: Outcome) -> Mapping[str, Any]:
    return {
        "seed": outcome.seed,
        "duration_s": outcome.duration_s,
        "loops": outcome.loops,
        "interruptions": [{"instant_s": instant_s, "error": text} for instant_s, text in outcome.interruptions],
        "checks": len(_checks(outcome)),
    }
