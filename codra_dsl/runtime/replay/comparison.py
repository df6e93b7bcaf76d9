"""What a replay derives beside what its journal holds, event by event."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.head import Head
from codra_dsl.runtime.journal.record import Record
from codra_dsl.runtime.outline import Outline
from codra_dsl.runtime.outline_changes import Change


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Where a replay first differs from its journal; None stands for no event in that place.

    Attributes:
        position: of the event among all that are compared, from 1.
        because: what the journal names in vain, if that is why it cannot be followed any more.
        changes: what the package says otherwise than what ran, what is nearest to the event first.
    """

    position: int
    recorded: Event | None
    replayed: Event | None
    because: str = ""
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """What came of a replay.

    Attributes:
        compared: how many events are equal.
        derived: how many events of each kind were derived.
        absent: kinds of events that the journal does not hold, and that were therefore not compared.
        difference: the first, if there is one.
    """

    compared: int
    derived: Mapping[Kind, int]
    absent: tuple[Kind, ...]
    difference: Difference | None


class Comparison(Record):
    """Takes the events of a replay and compares them, one by one, with those of the journal.

    Attributes:
        may_go_on: whether events may follow on what is expected.
        outline: what the spec says of which events are derived.
    """

    def __init__(self, expected: Sequence[Event], copy: Record | None) -> None:
        super().__init__(limit=1)
        self.may_go_on = False
        self.outline: Outline | None = None
        self.takes_inputs = copy is not None
        self.position = 0
        self.derived: dict[Kind, int] = {}
        self.difference: Difference | None = None
        self._expected = expected
        self._kinds = frozenset(event.kind for event in expected)
        self._copy = copy

    @property
    def is_over(self) -> bool:
        """Return whether there is nothing left to compare."""
        return self.difference is not None or self.position == len(self._expected)

    def begin(self, head: Callable[[], Head]) -> None:
        """Take what the spec says."""
        about = head()
        self.outline = about.outline
        if self._copy is not None:
            self._copy.begin(lambda: about)

    def add(self, event: Event) -> None:
        """Compare an event with the next one of the journal."""
        if self._copy is not None:
            self._copy.add(event)
        if event.kind is not Kind.INPUT:
            self.derived[event.kind] = self.derived.get(event.kind, 0) + 1
            if event.kind in self._kinds and self.difference is None:
                self._compare(event)

    def end(self) -> None:
        """Take note that nothing more follows."""
        if self._copy is not None:
            self._copy.end()

    def miss(self, because: str = "") -> None:
        """Take note that nothing more follows, although more was recorded."""
        if not self.is_over:
            recorded = self._expected[self.position]
            self.difference = Difference(position=self.position + 1, recorded=recorded, replayed=None, because=because)

    def absent(self) -> tuple[Kind, ...]:
        """Return the kinds of events that were derived and not recorded."""
        return tuple(kind for kind in self.derived if kind not in self._kinds)

    def _compare(self, event: Event) -> None:
        recorded = self._expected[self.position] if self.position < len(self._expected) else None
        if recorded is None and self.may_go_on:
            return
        if recorded is None or recorded.kind is not event.kind or message_of(recorded) != message_of(event):
            self.difference = Difference(position=self.position + 1, recorded=recorded, replayed=event)
        else:
            self.position += 1
