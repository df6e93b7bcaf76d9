"""How often context agrees with the perception that it is to replace: what decisions in shadow mode came to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.why.values import instant, shown

MOST_SHOWN = 5
"""Disagreements that the text tells of one decision; the newest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """A decision for which context held something else than what the robot saw.

    Attributes:
        instant_s: when the robot had looked.
        held: what context held.
        seen: what the robot saw.
        source: where what context held came from.
    """

    instant_s: float
    held: Value
    seen: Value
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Shadowed:
    """All decisions in shadow mode on one variable within one skill.

    Attributes:
        skill: that was under way; empty if none was.
        agreed: how often context held what the robot saw.
        disagreements: when it held something else.
        unknown: how often it had no answer, by reason; an answer that was too old for the decision counts as `too_old`.
        unseen: how often the robot found nothing when it looked, though context had an answer.
    """

    variable: str
    skill: str
    agreed: int
    disagreements: tuple[Disagreement, ...]
    unknown: Mapping[str, int]
    unseen: int

    @property
    def decisions(self) -> int:
        """Return how many decisions there were."""
        return self.compared + self.unseen + sum(self.unknown.values())

    @property
    def compared(self) -> int:
        """Return how often both context and the robot had an answer."""
        return self.agreed + len(self.disagreements)

    @property
    def agreement(self) -> float | None:
        """Return the share of answers that agree, from 0 to 1; None if there was nothing to compare."""
        return self.agreed / self.compared if self.compared else None

    @property
    def largest_difference(self) -> float | None:
        """Return by how much numbers differ at most; None for what is no number, or where none differ."""
        numbers = (
            abs(each.held - each.seen)
            for each in self.disagreements
            if isinstance(each.held, (int, float)) and isinstance(each.seen, (int, float))
            if not isinstance(each.held, bool)
        )
        return max(numbers, default=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class ShadowReport:
    """What decisions in shadow mode came to; `str` of it is a text for people.

    Attributes:
        rows: one for each variable and skill, in the order in which they first came.
    """

    rows: tuple[Shadowed, ...]

    def __str__(self) -> str:
        return "\n".join(_lines(self.rows)) if self.rows else "no decision was taken in shadow mode"


def shadow_report(events: Iterable[Event]) -> ShadowReport:
    """Return what decisions in shadow mode came to, from the events of a run."""
    groups: dict[tuple[str, str], list[Event]] = {}
    for event in events:
        if event.kind is Kind.DECISION and (event.what == "shadowed" or event.details.get("shadow")):
            groups.setdefault((event.name, event.details.get("skill") or ""), []).append(event)
    return ShadowReport(rows=tuple(_row(variable, skill, group) for (variable, skill), group in groups.items()))


def _row(variable: str, skill: str, events: Iterable[Event]) -> Shadowed:
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
    return Shadowed(
        variable=variable,
        skill=skill,
        agreed=agreed,
        disagreements=tuple(disagreements),
        unknown=dict(sorted(unknown.items())),
        unseen=unseen,
    )


def _lines(rows: Iterable[Shadowed]) -> Iterator[str]:
    for row in rows:
        within = f" in {row.skill}" if row.skill else ""
        share = "" if row.agreement is None else f" ({100 * row.agreement:.0f} %)"
        yield f"{row.variable}{within}: context agreed in {row.agreed} of {row.compared}{share}"
        if row.decisions > row.compared:
            yield f"  of {row.decisions} decisions: {', '.join(_not_compared(row))}"
        if row.largest_difference is not None:
            yield f"  differs by {row.largest_difference:.6g} at most"
        left = len(row.disagreements) - MOST_SHOWN
        if left > 0:
            yield f"  {left} earlier disagreements"
        for each in row.disagreements[-MOST_SHOWN:]:
            held = f"context held {shown(each.held)} ({each.source})"
            yield f"  {instant(each.instant_s)}: {held}, the robot saw {shown(each.seen)}"


def _not_compared(row: Shadowed) -> Iterator[str]:
    if row.unseen:
        yield f"{row.unseen} in which the robot found nothing"
    yield from (f"{count} in which context was {reason}" for reason, count in row.unknown.items())
