"""Shadow mode: how often context agrees with the perception that it is to replace."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.why.values import instant_text, value_text

MAX_SHOWN_DISAGREEMENTS = 5
"""The text shows at most this many disagreements of each row, the newest ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """A decision for which the value in context differed from the value that the robot saw.

    Attributes:
        instant_s: when the robot reported the value that it saw.
        held: the value in context.
        seen: the value that the robot saw.
        source: the source of the value in context.
    """

    instant_s: float
    held: Value
    seen: Value
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowRow:
    """All decisions in shadow mode on one variable within one skill.

    Attributes:
        variable: the variable of the decisions.
        skill: the skill that was running; empty if there was none.
        agreed: how often context had the value that the robot saw.
        disagreements: the decisions for which context had another value than the robot.
        unknown: for each reason, how often context had no answer. The reason is `too_old` if context had an answer that
            was too old for the decision.
        unseen: how often the look of the robot gave no value although context had an answer.
    """

    variable: str
    skill: str
    agreed: int
    disagreements: tuple[Disagreement, ...]
    unknown: Mapping[str, int]
    unseen: int

    @property
    def decisions(self) -> int:
        """Return the number of decisions."""
        return self.compared + self.unseen + sum(self.unknown.values())

    @property
    def compared(self) -> int:
        """Return how often both context and the robot had an answer."""
        return self.agreed + len(self.disagreements)

    @property
    def agreement(self) -> float | None:
        """Return the share of answers that agree, from 0 to 1; None if no answers were compared."""
        return self.agreed / self.compared if self.compared else None

    @property
    def largest_difference(self) -> float | None:
        """Return the largest difference between numbers in disagreements; None if there are no such numbers."""
        differences = (
            abs(disagreement.held - disagreement.seen)
            for disagreement in self.disagreements
            if isinstance(disagreement.held, (int, float)) and isinstance(disagreement.seen, (int, float))
            if not isinstance(disagreement.held, bool)
        )
        return max(differences, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowReport:
    """The results of decisions in shadow mode; `str` returns them as readable text.

    Attributes:
        rows: one row per variable and skill, in the order of their first decisions.
    """

    rows: tuple[ShadowRow, ...]

    def __str__(self) -> str:
        return "\n".join(_lines(self.rows)) if self.rows else "no decision was taken in shadow mode"


def shadow_report(events: Iterable[Event]) -> ShadowReport:
    """Return the results of decisions in shadow mode, from the events of a run."""
    groups: dict[tuple[str, str], list[Event]] = {}
    for event in events:
        if event.kind is Kind.DECISION and (event.what == "shadowed" or event.details.get("shadow")):
            groups.setdefault((event.name, event.details.get("skill") or ""), []).append(event)
    return ShadowReport(rows=tuple(_make_row(variable, skill, group) for (variable, skill), group in groups.items()))


def _make_row(variable: str, skill: str, events: Iterable[Event]) -> ShadowRow:
    unknown: Counter[str] = Counter()
    agreed = unseen = 0
    disagreements: list[Disagreement] = []
    for event in events:
        details = event.details
        if event.what != "shadowed":
            unknown[str(details.get("reason") or "too_old")] += 1
        elif details.get("found") is None:
            unseen += 1
        elif details["agrees"]:
            agreed += 1
        else:
            held, seen = details["value"], details["found"]
            disagreements.append(
                Disagreement(instant_s=event.instant_s, held=held, seen=seen, source=str(details["source"]))
            )
    return ShadowRow(
        variable=variable,
        skill=skill,
        agreed=agreed,
        disagreements=tuple(disagreements),
        unknown=dict(sorted(unknown.items())),
        unseen=unseen,
    )


def _lines(rows: Iterable[ShadowRow]) -> Iterator[str]:
    for row in rows:
        skill_text = f" in {row.skill}" if row.skill else ""
        share_text = "" if row.agreement is None else f" ({100 * row.agreement:.0f} %)"
        yield f"{row.variable}{skill_text}: context agreed in {row.agreed} of {row.compared}{share_text}"
        if row.decisions > row.compared:
            yield f"  of {row.decisions} decisions: {', '.join(_uncompared_texts(row))}"
        if row.largest_difference is not None:
            yield f"  differs by {row.largest_difference:.6g} at most"
        hidden_count = len(row.disagreements) - MAX_SHOWN_DISAGREEMENTS
        if hidden_count > 0:
            yield f"  {hidden_count} earlier disagreements"
        for disagreement in row.disagreements[-MAX_SHOWN_DISAGREEMENTS:]:
            context_text = f"context held {value_text(disagreement.held)} ({disagreement.source})"
            yield (
                f"  {instant_text(disagreement.instant_s)}: {context_text}, "
                f"the robot saw {value_text(disagreement.seen)}"
            )


def _uncompared_texts(row: ShadowRow) -> Iterator[str]:
    if row.unseen:
        yield f"{row.unseen} in which the robot found nothing"
    yield from (f"{count} in which context was {reason}" for reason, count in row.unknown.items())
