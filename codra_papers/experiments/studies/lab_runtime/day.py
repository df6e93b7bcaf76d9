"""A day at the fair (P1, section 4.2): the perception tasks that context replaced in seven hours, and the savings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from codra_papers.experiments.campaign.document import Cell, Section, Table, Words
from codra_papers.experiments.lab.outcomes import Decision, Outcome
from codra_papers.experiments.studies.lab_runtime.executions import needs_the_camera, spent_s
from codra_papers.experiments.studies.lab_runtime.finding import Finding, mean, percent, rounded
from codra_papers.experiments.studies.lab_runtime.paper import DAY_CHECKS, DAY_S, DAY_SAVED_MIN, DAY_SAVED_PER_CHECK_S
from codra_papers.experiments.studies.lab_runtime.runs import REPAIR_S, WITH_OBSERVERS, WITHOUT_OBSERVERS, Pair
from codra_papers.experiments.studies.lab_runtime.savings import Saving, saving
from codra_papers.experiments.studies.lab_runtime.sources import (
    answered_share,
    parts_table,
    reason_rows,
    reasons,
    saving_as_data,
)

_PARTS = (
    "Saved seconds of perception, in parts that add up. The values without observers are computed for the same number"
    " of perception tasks, each with a look of the mean duration on the day without observers."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """The result of a day.

    Attributes:
        saving: the saved perception time of the checks with observers. They are compared with the same number of looks
            of the mean duration on the day without observers.
        answered_s: the mean time of a check that context answered; None if context answered no check.
        fell_back: the checks that context did not answer.
    """

    saving: Saving
    answered_s: float | None
    fell_back: Sequence[Decision]

    @property
    def per_check_s(self) -> float | None:
        """Return the time that P1 counts as saved by a check that context answered; None if there is no such check."""
        return None if self.answered_s is None else self.saving.look_s - self.answered_s

    @property
    def replaced_s(self) -> float:
        """Return the time that P1 counts as saved by all checks that context answered: the mean saving for each."""
        return self.saving.answered * (self.per_check_s or 0.0)


def judge_day(pair: Pair) -> Finding:
    """Report the result of a day."""
    day = day_result(pair)
    return Finding(
        section=Section(
            title="A day of seven hours",
            parts=[
                Words(
                    text="The robot processes samples for seven hours, once with and once without observers, with the"
                    f" same seed. After an unrecoverable error someone repairs the situation in {REPAIR_S:g} s, and the"
                    " work starts again. The amount of work differs, because a robot that saves time does more work. So"
                    " savings are computed for the perception tasks of the day with observers. Each task is compared"
                    " with a look of the mean duration on the day without observers."
                ),
                _comparison(pair, day),
                parts_table({"the day with observers": day.saving}, _PARTS),
                _reasons_table(day),
                _interruptions_table(pair),
            ],
        ),
        summary=[_sentence(pair, day)],
        results={"day": _results(pair, day)},
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


def _comparison(pair: Pair, day: Day) -> Table:
    day_saving, without, observed = day.saving, pair.without, pair.observed
    looks = sum(decision.has_looked for decision in _checks(without))
    rows: list[Sequence[Cell]] = [
        ("hours", DAY_S / 3600, _hours(without), _hours(observed)),
        ("loops completed", None, without.loops, observed.loops),
        ("interruptions", None, len(without.interruptions), len(observed.interruptions)),
        ("perception tasks", None, looks, day_saving.checks),
        ("answered by context", DAY_CHECKS, 0, day_saving.answered),
        ("mean seconds of a perception task by looking", None, rounded(day_saving.look_s), _own_look_s(day_saving)),
        ("mean seconds of a task that context answered", None, None, rounded(day.answered_s)),
        ("saved per answered task in s", DAY_SAVED_PER_CHECK_S, None, rounded(day.per_check_s)),
        ("saved by answered tasks in min, as P1 counts", DAY_SAVED_MIN, None, rounded(day.replaced_s / 60, 1)),
        ("saved by all tasks in min, including unsuccessful waiting", None, None, rounded(day_saving.saved_s / 60, 1)),
        (f"the same for P1's {DAY_CHECKS} tasks in min", DAY_SAVED_MIN, None, _saved_for_p1_checks_min(day)),
    ]
    return Table(
        caption="This day and P1's day. This robot only processes samples, so it makes more decisions than P1's robot.",
        header=("", "P1", "without observers", "with observers"),
        rows=rows,
    )


def _hours(outcome: Outcome) -> float:
    return round(outcome.duration_s / 3600, 2)


def _own_look_s(day_saving: Saving) -> float | None:
    return rounded(day_saving.own_looks_s / day_saving.fell_back) if day_saving.fell_back else None


def _saved_for_p1_checks_min(day: Day) -> float | None:
    return None if day.per_check_s is None else rounded(DAY_CHECKS * day.per_check_s / 60, 1)


def _reasons_table(day: Day) -> Table:
    return Table(
        caption=f"Why context had no answer in {len(day.fell_back)} of {day.saving.checks} perception tasks.",
        header=("variable", "situation", "reason", "times"),
        rows=reason_rows(day.fell_back),
    )


def _interruptions_table(pair: Pair) -> Table:
    return Table(
        caption="What interrupted the day.",
        header=("run", "at s", "error"),
        rows=[
            (condition, rounded(instant_s, 1), text)
            for condition, outcome in ((WITHOUT_OBSERVERS, pair.without), (WITH_OBSERVERS, pair.observed))
            for instant_s, text in outcome.interruptions
        ],
    )


def _sentence(pair: Pair, day: Day) -> str:
    day_saving = day.saving
    return (
        f"In {_hours(pair.observed)} h with observers, context answered {day_saving.answered} of {day_saving.checks}"
        f" perception tasks ({percent(answered_share(day_saving))} %; P1: {DAY_CHECKS} tasks). As P1 counts, this saved"
        f" {rounded(day.replaced_s / 60, 1)} min (P1: {DAY_SAVED_MIN:g} min;"
        f" {_saved_for_p1_checks_min(day)} min for as many tasks as P1's). With all waiting and looking,"
        f" {rounded(day_saving.saved_s / 60, 1)} min were saved. {pair.observed.loops} loops were completed with"
        f" observers, {pair.without.loops} without observers."
    )


def _results(pair: Pair, day: Day) -> Mapping[str, Any]:
    return {
        "p1": {"checks": DAY_CHECKS, "saved_min": DAY_SAVED_MIN, "saved_per_check_s": DAY_SAVED_PER_CHECK_S},
        "repair_s": REPAIR_S,
        **{
            condition: _outcome_as_data(outcome)
            for condition, outcome in ((WITHOUT_OBSERVERS, pair.without), (WITH_OBSERVERS, pair.observed))
        },
        "saving": saving_as_data(day.saving),
        "answered_check_s": day.answered_s,
        "saved_per_check_s": day.per_check_s,
        "saved_as_p1_counts_min": day.replaced_s / 60,
        "unanswered": {" ".join(reason): count for reason, count in sorted(reasons(day.fell_back).items())},
    }


def _outcome_as_data(outcome: Outcome) -> Mapping[str, Any]:
    return {
        "seed": outcome.seed,
        "duration_s": outcome.duration_s,
        "loops": outcome.loops,
        "interruptions": [{"instant_s": instant_s, "error": text} for instant_s, text in outcome.interruptions],
        "checks": len(_checks(outcome)),
    }
