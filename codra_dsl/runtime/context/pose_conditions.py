"""What comparisons with poses come to: `distance(a, b) < 0.9 m` as a context-variable that follows from the graph.

Poses change all the time, what they come to changes seldom: so a variable gets a reading when it comes to something
else, and trees, the journal and `why` are told no more than that.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from typing import Any, NamedTuple

from codra_dsl.logic import Term
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.geometry import FrameError, Outcome
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_dsl.runtime.knowledge.change_set import Touched
from codra_dsl.runtime.knowledge.matching import asked_of, truth
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, FOREVER_S, Reading, Reason, known_reading
from codra_dsl.runtime.values.declarations import POSES
from codra_dsl.runtime.values.model import VariableModel


class PoseConditions:
    """Works out what variables that follow from poses come to. Whoever calls it is in a step."""

    def __init__(self, variables: Iterable[VariableModel], knowledge: Knowledge, clock: Clock, store: Store) -> None:
        """Work all of them out, and again whenever the graph or time may make them something else.

        Args:
            variables: of the context.
            knowledge: the graph.
            clock: whose events are steps.
            store: takes the readings.
        """
        self._take = knowledge.in_step
        self._posed = tuple(
            _Posed(each.name, each.posed, self._take, clock, store) for each in variables if each.posed is not None
        )
        if self._posed:
            knowledge.moved = self._moved
        for each in self._posed:
            each.look(self._take())

    def _moved(self, touched: Collection[Touched]) -> None:
        """Work out what a change of the graph may have changed."""
        frames = frozenset(name for kind, name in touched if kind == "frame")
        has_nodes = any(kind == "node" for kind, _ in touched)
        snapshot = self._take()
        for each in self._posed if frames or has_nodes else ():
            if has_nodes or each.rests_on(frames):
                each.look(snapshot, frames)


class _Seen(NamedTuple):
    """What a comparison rests on.

    Attributes:
        frames: whose poses can make it something else; None if any can.
        next_s: when it is to be worked out again though nobody says anything.
        reason: why it may be unknown.
    """

    frames: frozenset[str] | None
    next_s: float
    reason: Reason = Reason.NEVER_OBSERVED
    detail: str = ""


class _Posed:
    """One variable."""

    def __init__(self, name: str, term: Term, take: Callable[[], Snapshot], clock: Clock, store: Store) -> None:
        self._name = name
        self._term = term
        self._take = take
        self._clock = clock
        self._store = store
        self._frames: frozenset[str] | None = None
        self._timer: Timer | None = None

    def rests_on(self, frames: frozenset[str]) -> bool:
        """Return whether poses of some frames can make it something else."""
        return self._frames is None or not self._frames.isdisjoint(frames)

    def look(self, snapshot: Snapshot, moved: frozenset[str] = frozenset()) -> None:
        """Work it out, and take the reading if it is another.

        Args:
            snapshot: of the present step.
            moved: the frames whose poses have changed.
        """
        seen, content = _seen(snapshot, self._term), truth(snapshot, self._term)
        before, now_s = self._store.cells[self._name].reading, snapshot.instant_s
        self._frames = seen.frames
        reason = None if content is not None else _reason(before, seen)
        if before.content != content or before.reason is not reason or before.evidence_s == BEFORE_ALL_S:
            evidence_s = max(before.evidence_s, self._evidence_s(snapshot, moved))
            if content is not None:
                reading = known_reading(self._name, content, evidence_s, evidence_s, now_s, FOREVER_S, POSES)
            else:
                reading = Reading(
                    name=self._name,
                    reason=reason,
                    detail=seen.detail,
                    evidence_s=evidence_s,
                    start_s=evidence_s,
                    identified_s=now_s,
                    source=POSES,
                )
            self._store.write(reading)
        self._wake_at(seen.next_s)

    def _evidence_s(self, snapshot: Snapshot, moved: frozenset[str]) -> float:
        """Return when that was measured which makes it what it is; now, where time alone does."""
        rests_on = moved & self._frames if self._frames is not None else frozenset[str]()
        return max((snapshot.measured_s(name) for name in rests_on), default=snapshot.instant_s)

    def _wake_at(self, instant_s: float) -> None:
        """Work it out again at an instant, unless that is done before anyway: then it is asked once more."""
        if instant_s == FOREVER_S or (self._timer is not None and self._timer.instant_s <= instant_s):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._clock.call_at(instant_s, self._wake)

    def _wake(self) -> None:
        self._timer = None
        self.look(self._take())


def _seen(snapshot: Snapshot, term: Term) -> _Seen:
    """Return what a comparison rests on, and why it is unknown if it is."""
    frames: set[str] = set()
    seen = _Seen(None, FOREVER_S)
    is_whole = True
    for first, second in asked_of(term):
        try:
            found = snapshot.transform(first, second)
        except FrameError:
            is_whole = False
            seen = seen._replace(reason=Reason.FORGOTTEN, detail=f"nothing says where {second!r} stands to {first!r}")
            continue
        frames.update(snapshot.frames_between(first, second))
        if found.outcome is Outcome.STALE:
            detail = f"the pose of {found.weakest!r} is too old"
            seen = seen if seen.detail else seen._replace(reason=Reason.STALE, detail=detail)
        else:
            seen = seen._replace(next_s=min(seen.next_s, snapshot.next_s(first, second)))
    return seen._replace(frames=frozenset(frames)) if is_whole else seen


def _reason(before: Reading[Any], seen: _Seen) -> Reason:
    """Return why a comparison is unknown: what never was known was not forgotten."""
    was_never = before.reason is Reason.NEVER_OBSERVED and seen.reason is Reason.FORGOTTEN
    return Reason.NEVER_OBSERVED if was_never else seen.reason
