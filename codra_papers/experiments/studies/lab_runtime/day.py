"""A day at the fair (P1, section 4.2): perception tasks replaced in seven hours, and what that saves."""

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
from codra_papers.experiments.studies.lab_runtime.sources import answered_share, parts_table, plain, reasons

_PARTS = (
    "Seconds of perception saved, in parts that add up. What stands here as without observers are as many mean looks of"
    " the day without them."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """What a day came to.

    Attributes:
        found: the perception time of the checks with observers, against as many mean looks of the day without.
        answered_s: the mean time of a check that context answered; None if there was none.
        fell_back: the checks that it did not answer.
    """

    found: Saving
    answered_s: float | None
    fell_back: Sequence[Decision]

    @property
    def per_check_s(self) -> float | None:
        """Return what a check saves that context answers, as P1 counts it."""
        return None if self.answered_s is None else self.found.look_s - self.answered_s

    @property
    def replaced_s(self) -> float:
        """Return what all checks save that context answered, as P1 counts it: each by the mean."""
        return self.found.answered * (self.per_check_s or 0.0)


def judge_day(pair: Pair) -> Finding:
    """Say what a day came to."""
    told = a_day(pair)
    return Finding(
        section=Section(
            title="A day of seven hours",
            parts=[
                Words(
                    text="The robot processes samples for seven hours, once with and once without observers, with the"
                    f" same seed. After an unrecoverable error someone sets things right in {REPAIR_S:g} s and it"
                    " begins anew. Work differs: who saves time gets more done. So savings are counted on the"
                    " perception tasks that came up with observers, each against a mean look without."
                ),
                _comparison(pair, told),
                parts_table({"the day with observers": told.found}, _PARTS),
                _reasons_table(told),
                _interruptions_table(pair),
            ],
        ),
        summary=[_sentence(pair, told)],
        results={"day": _results(pair, told)},
    )


def a_day(pair: Pair) -> Day:
    """Return what a day came to."""
    without, observed = _checks(pair.without), _checks(pair.observed)
    found = saving(without, observed)
    answered = [decision for decision in observed if not decision.has_looked]
    return Day(
        found=replace(found, without=found.checks),
        answered_s=mean([spent_s([decision]) for decision in answered]),
        fell_back=[decision for decision in observed if decision.has_looked],
    )


def _checks(outcome: Outcome) -> Sequence[Decision]:
    return [decision for decision in outcome.decisions if needs_the_camera(decision)]


def _comparison(pair: Pair, told: Day) -> Table:
    found, without, observed = told.found, pair.without, pair.observed
    looks = sum(decision.has_looked for decision in _checks(without))
    rows: list[Sequence[Cell]] = [
        ("hours", DAY_S / 3600, _hours(without), _hours(observed)),
        ("loops completed", None, without.loops, observed.loops),
        ("interruptions", None, len(without.interruptions), len(observed.interruptions)),
        ("perception tasks", None, looks, found.checks),
        ("answered by context", DAY_CHECKS, 0, found.answered),
        ("mean seconds of a perception task by looking", None, rounded(found.look_s), _own_look_s(found)),
        ("mean seconds of one that context answered", None, None, rounded(told.answered_s)),
        ("saved per answered one in s", DAY_SAVED_PER_CHECK_S, None, rounded(told.per_check_s)),
        ("saved by those in min, as P1 counts", DAY_SAVED_MIN, None, rounded(told.replaced_s / 60, 1)),
        ("saved by all in min, waiting in vain included", None, None, rounded(found.saved_s / 60, 1)),
        (f"the same for P1's {DAY_CHECKS} tasks in min", DAY_SAVED_MIN, None, _for_as_many_as_p1_min(told)),
    ]
    return Table(
        caption="The day beside P1's. This robot does nothing but process samples, so it decides more often than P1's.",
        header=("", "P1", "without observers", "with observers"),
        rows=rows,
    )


def _hours(outcome: Outcome) -> float:
    return round(outcome.duration_s / 3600, 2)


def _own_look_s(found: Saving) -> float | None:
    return rounded(found.own_looks_s / found.fell_back) if found.fell_back else None


def _for_as_many_as_p1_min(told: Day) -> float | None:
    return None if told.per_check_s is None else rounded(DAY_CHECKS * told.per_check_s / 60, 1)


def _reasons_table(told: Day) -> Table:
    return Table(
        caption=f"Why context had no answer, {len(told.fell_back)} times of {told.found.checks}.",
        header=("variable", "situation", "reason", "times"),
        rows=[(*reason, count) for reason, count in sorted(reasons(told.fell_back).items())],
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


def _sentence(pair: Pair, told: Day) -> str:
    found = told.found
    return (
        f"In {_hours(pair.observed)} h with observers context answered {found.answered} of {found.checks} perception"
        f" tasks ({percent(answered_share(found))} %; P1: {DAY_CHECKS} replaced), which saved"
        f" {rounded(told.replaced_s / 60, 1)} min by P1's counting (P1: {DAY_SAVED_MIN:g} min;"
        f" {_for_as_many_as_p1_min(told)} min for as many tasks as P1's), and {rounded(found.saved_s / 60, 1)} min with"
        f" all waiting and looking counted. {pair.observed.loops} loops were completed with observers,"
        f" {pair.without.loops} without."
    )


def _results(pair: Pair, told: Day) -> Mapping[str, Any]:
    return {
        "p1": {"checks": DAY_CHECKS, "saved_min": DAY_SAVED_MIN, "saved_per_check_s": DAY_SAVED_PER_CHECK_S},
        "repair_s": REPAIR_S,
        **{condition: _of(outcome) for condition, outcome in ((WITHOUT, pair.without), (OBSERVED, pair.observed))},
        "saving": plain(told.found),
        "answered_check_s": told.answered_s,
        "saved_per_check_s": told.per_check_s,
        "saved_as_p1_counts_min": told.replaced_s / 60,
        "unanswered": {" ".join(reason): count for reason, count in sorted(reasons(told.fell_back).items())},
    }


def _of(outcome: Outcome) -> Mapping[str, Any]:
    return {
        "seed": outcome.seed,
        "duration_s": outcome.duration_s,
        "loops": outcome.loops,
        "interruptions": [{"instant_s": instant_s, "error": text} for instant_s, text in outcome.interruptions],
        "checks": len(_checks(outcome)),
    }
