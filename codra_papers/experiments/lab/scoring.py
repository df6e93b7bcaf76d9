"""Compare the values that an arm held with the truth: how long they were right, wrong and unknown.

P1 does so in section 4.1 and Table 2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.runtime import MAIN
from codra_dsl.runtime.journal import EventLog, Kind
from codra_dsl.runtime.values.conditions import Value


@dataclass(frozen=True, slots=True)
class Piece:
    """A half-open span of time in which a variable has one value; None means that the value is unknown."""

    start_s: float
    end_s: float
    value: Value | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """How well an arm knew a variable over a run.

    Attributes:
        name: the variable.
        right_s: how long the held value equalled the truth: P1's agreement time.
        wrong_s: how long the held value was known and differed from the truth: P1's disagreement time.
        unknown_s: how long no value was held.
        identified: how often an observer gave the variable a value.
        first_s: when an observer first gave the variable a value; None if no observer did.
    """

    name: str
    right_s: float
    wrong_s: float
    unknown_s: float
    identified: int
    first_s: float | None

    @property
    def ratio(self) -> float | None:
        """Return right / (right + wrong), as P1's Table 2 does; None if no value was ever held."""
        held_s = self.right_s + self.wrong_s
        return self.right_s / held_s if held_s else None


def held_pieces(record: EventLog, names: Sequence[str], end_s: float) -> Mapping[str, tuple[Piece, ...]]:
    """Return the values of each variable that a context manager held from 0 s to the end of a run.

    Args:
        record: the event log of the context manager.
        names: the variables.
        end_s: the end of the run.
    """
    changes: dict[str, list[tuple[float, Value | None]]] = {name: [(0.0, None)] for name in names}
    for event in record.of(Kind.VARIABLE):
        if event.details.get("present") and event.name in changes and event.instant_s < end_s:
            changes[event.name].append((event.instant_s, event.details["value"]))
    return {name: pieces(variable_changes, end_s) for name, variable_changes in changes.items()}


def source_pieces(record: EventLog, name: str, end_s: float) -> tuple[Piece, ...]:
    """Return, from 0 s to the end of a run, the source of the value of a variable that a context manager held.

    The source is the name of an algorithm or of another writer; None while the value is unknown.
    """
    changes: list[tuple[float, Value | None]] = [(0.0, None)]
    for event in record.of(Kind.VARIABLE, name):
        if event.details.get("present") and event.instant_s < end_s:
            is_known = event.details["value"] is not None
            changes.append((event.instant_s, event.details["source"] if is_known else None))
    return pieces(changes, end_s)


def value_known_by(record: EventLog, name: str, instant_s: float) -> Value | None:
    """Return the value of a variable that a context manager held just before an instant, or got at this instant.

    A value that an action invalidates at the same instant counts: a main execution has based its decision on it.
    """
    events = [event for event in record.of(Kind.VARIABLE, name) if event.details.get("present")]
    new_values: list[Value | None] = [event.details["value"] for event in events if event.instant_s == instant_s]
    earlier_values: list[Value | None] = [event.details["value"] for event in events if event.instant_s < instant_s]
    return ([value for value in new_values if value is not None] or earlier_values or [None])[-1]


def pieces(changes: Sequence[tuple[float, Value | None]], end_s: float) -> tuple[Piece, ...]:
    """Return the pieces between `changes`, which must be in order of time.

    Neighbouring pieces with equal values are merged.
    """
    merged_pieces: list[Piece] = []
    starts = [start_s for start_s, _ in changes]
    for (start_s, value), next_s in zip(changes, [*starts[1:], end_s], strict=True):
        if merged_pieces and merged_pieces[-1].value == value:
            merged_pieces[-1] = Piece(merged_pieces[-1].start_s, next_s, value)
        elif next_s > start_s:
            merged_pieces.append(Piece(start_s, next_s, value))
    return tuple(merged_pieces)


def score(name: str, held: Sequence[Piece], truth: Sequence[Piece], record: EventLog) -> Score:
    """Return the score of a variable, over the time that the held values and the truth both cover."""
    seconds = {"right": 0.0, "wrong": 0.0, "unknown": 0.0}
    for piece, fact, duration_s in overlaps(held, truth):
        verdict = "unknown" if piece.value is None else "right" if piece.value == fact.value else "wrong"
        seconds[verdict] += duration_s
    identified_events = [
        event
        for event in record.of(Kind.VARIABLE, name)
        if event.what == "identified" and event.details["source"] != MAIN
    ]
    return Score(
        name=name,
        right_s=seconds["right"],
        wrong_s=seconds["wrong"],
        unknown_s=seconds["unknown"],
        identified=len(identified_events),
        first_s=identified_events[0].instant_s if identified_events else None,
    )


def overlaps(left: Sequence[Piece], right: Sequence[Piece]) -> list[tuple[Piece, Piece, float]]:
    """Return the pairs of pieces that overlap, with the duration of their overlap in s, in order of time."""
    overlapping_pieces: list[tuple[Piece, Piece, float]] = []
    position = 0
    for piece in left:
        while position < len(right) and right[position].end_s <= piece.start_s:
            position += 1
        for index in range(position, len(right)):  # a slice would copy all remaining pieces
            other = right[index]
            if other.start_s >= piece.end_s:
                break
            overlapping_pieces.append((piece, other, min(piece.end_s, other.end_s) - max(piece.start_s, other.start_s)))
    return overlapping_pieces
