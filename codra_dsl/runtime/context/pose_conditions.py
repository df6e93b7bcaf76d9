"""Context-variables that follow from the knowledge graph: `distance(a, b) < 0.9 m`, a distance, or a count of paths.

Poses change all the time, but the value of a condition on them changes rarely. So the variable gets a reading only
when its value changes, and only these readings reach trees, the journal and `why`. The number of a distance is rounded,
so that it changes rarely, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from codra_dsl.logic import Term, Value
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.geometry import FrameError, Outcome
from codra_dsl.runtime.knowledge import Knowledge, Path, Snapshot
from codra_dsl.runtime.knowledge.change_set import ChangeSubject
from codra_dsl.runtime.knowledge.matching import ANY, relative_pose_pairs, term_value
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, FOREVER_S, Reading, Reason, known_reading
from codra_dsl.runtime.values.declarations import POSES
from codra_dsl.runtime.values.model import VariableModel

_DECIMAL_PLACES = 9
"""The decimal places of a rounded distance, so that 3 times 0.1 m is 0.3 m."""


class PoseConditions:
    """Computes the variables that follow from poses. Every computation runs within a step of `LockedClock`."""

    def __init__(self, variables: Iterable[VariableModel], knowledge: Knowledge, clock: Clock, store: Store) -> None:
        """Compute the variables now, and again whenever a change of the graph or the passing of time may change them.

        Args:
            variables: the variables of the context.
            knowledge: the graph.
            clock: a clock that runs each of its timers as a step.
            store: stores the readings.
        """
        self._take_snapshot = knowledge.step_snapshot
        graph_variables = [variable for variable in variables if variable.pose_condition is not None]
        paths = {f"count({path})": path for path in knowledge.model.counts}
        self._counts = tuple(
            _PathCount(variable, path, knowledge, store)
            for variable in graph_variables
            for name, path in paths.items()
            if variable.pose_condition is not None and name in variable.pose_condition.variables()
        )
        counted_names = {count.name for count in self._counts}
        self._conditions = tuple(
            _PoseCondition(variable, self._take_snapshot, clock, store)
            for variable in graph_variables
            if variable.name not in counted_names
        )
        self._together = store.derivations.together
        if graph_variables:
            knowledge.on_change = self._evaluate_affected_variables
        for count in self._counts:
            count.evaluate(self._take_snapshot())
        for condition in self._conditions:
            condition.evaluate(self._take_snapshot())

    def _evaluate_affected_variables(self, changed_subjects: Collection[ChangeSubject]) -> None:
        """Compute the variables that a change of the graph may affect."""
        with self._together():
            self._evaluate_affected_conditions(changed_subjects)
            for count in self._counts:
                if count.depends_on(changed_subjects):
                    count.evaluate(self._take_snapshot())

    def _evaluate_affected_conditions(self, changed_subjects: Collection[ChangeSubject]) -> None:
        frames = frozenset(name for kind, name in changed_subjects if kind == "frame")
        has_nodes = any(kind == "node" for kind, _ in changed_subjects)
        snapshot = self._take_snapshot()
        for condition in self._conditions if frames or has_nodes else ():
            if has_nodes or condition.depends_on(frames):
                condition.evaluate(snapshot, frames)


class _InputsStatus(NamedTuple):
    """The inputs of a condition, and the reason if the condition is unknown.

    Attributes:
        frames: the frames whose poses can change the condition; None if any frame can change it.
        next_update_s: when the condition must be computed again even if the graph does not change.
        reason: why the condition is unknown, if it is unknown.
    """

    frames: frozenset[str] | None
    next_update_s: float
    reason: Reason = Reason.NEVER_OBSERVED
    detail: str = ""


class _PathCount:
    """One variable that follows from the number of matches of a path. This number is always known."""

    def __init__(self, variable: VariableModel, path: Path, knowledge: Knowledge, store: Store) -> None:
        first = path.places[0]
        is_single = not path.links and not first.called
        self.name = variable.name
        self._term = _term_of(variable)
        # matches differ in their edges and named places, so a single node needs a name
        self._path = replace(path, places=(replace(first, called="_"),)) if is_single else path
        self._count_name = f"count({path})"
        self._subjects = knowledge.step_snapshot().subjects_of(path)
        self._store = store

    def depends_on(self, changed_subjects: Collection[ChangeSubject]) -> bool:
        """Return whether changes of some subjects can change the number."""
        return any((kind, name) in self._subjects or (kind, ANY) in self._subjects for kind, name in changed_subjects)

    def evaluate(self, snapshot: Snapshot) -> None:
        """Count, and store a reading if the value has changed."""
        count = len(snapshot.match(self._path))
        content = self._term.evaluate(_CountScope(self._count_name, count))
        before, now_s = self._store.cells[self.name].observed, snapshot.instant_s
        if content is not None and before.content != content:
            self._store.write(known_reading(self.name, content, now_s, now_s, now_s, FOREVER_S, POSES))


class _CountScope(NamedTuple):
    """The number of matches of one path."""

    name: str
    number: int

    def value(self, name: str) -> Value | None:
        """Return the number."""
        return self.number if name == self.name else None

    def age_s(self, name: str) -> float | None:
        """Return no age: the number is counted now."""
        return 0.0 if name == self.name else None


class _PoseCondition:
    """One variable that follows from poses."""

    def __init__(
        self, variable: VariableModel, take_snapshot: Callable[[], Snapshot], clock: Clock, store: Store
    ) -> None:
        self._name = variable.name
        self._term = _term_of(variable)
        self._resolution_m = variable.resolution_m
        self._take_snapshot = take_snapshot
        self._clock = clock
        self._store = store
        self._frames: frozenset[str] | None = None
        self._timer: Timer | None = None

    def depends_on(self, frames: frozenset[str]) -> bool:
        """Return whether the poses of some frames can change the condition."""
        return self._frames is None or not self._frames.isdisjoint(frames)

    def evaluate(self, snapshot: Snapshot, moved_frames: frozenset[str] = frozenset()) -> None:
        """Compute the condition, and store a reading if its value or reason has changed.

        Args:
            snapshot: the snapshot of the present step.
            moved_frames: the frames whose poses have changed.
        """
        status = _inputs_status(snapshot, self._term)
        content = _rounded(term_value(snapshot, self._term), self._resolution_m)
        before, now_s = self._store.cells[self._name].observed, snapshot.instant_s
        self._frames = status.frames
        reason = None if content is not None else _reason(before, status)
        if before.content != content or before.reason is not reason or before.evidence_s == BEFORE_ALL_S:
            evidence_s = max(before.evidence_s, self._evidence_s(snapshot, moved_frames))
            if content is not None:
                reading = known_reading(self._name, content, evidence_s, evidence_s, now_s, FOREVER_S, POSES)
            else:
                reading = Reading(
                    name=self._name,
                    reason=reason,
                    detail=status.detail,
                    evidence_s=evidence_s,
                    start_s=evidence_s,
                    identified_s=now_s,
                    source=POSES,
                )
            self._store.write(reading)
        self._schedule_evaluation(status.next_update_s)

    def _evidence_s(self, snapshot: Snapshot, moved_frames: frozenset[str]) -> float:
        """Return when the newest pose of the condition's moved frames was measured; now, if none of them moved."""
        moved_input_frames = moved_frames & self._frames if self._frames is not None else frozenset[str]()
        return max((snapshot.measured_s(name) for name in moved_input_frames), default=snapshot.instant_s)

    def _schedule_evaluation(self, instant_s: float) -> None:
        """Compute the condition again at an instant.

        If there is a timer for this or an earlier instant, the timer is kept: at its instant, the condition is
        computed, and the next timer is set.
        """
        if instant_s == FOREVER_S or (self._timer is not None and self._timer.instant_s <= instant_s):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._clock.call_at(instant_s, self._evaluate_now)

    def _evaluate_now(self) -> None:
        self._timer = None
        self.evaluate(self._take_snapshot())


def _term_of(variable: VariableModel) -> Term:
    assert variable.pose_condition is not None
    return variable.pose_condition


def _rounded(content: Value | None, resolution_m: float | None) -> Value | None:
    """Return a distance rounded to a multiple of its resolution; other values are returned unchanged."""
    if resolution_m is None or not isinstance(content, float):
        return content
    steps = content / resolution_m
    if math.isinf(steps):
        return content  # it is too large, or the resolution is too small
    return round(round(steps) * resolution_m, _DECIMAL_PLACES)


def _inputs_status(snapshot: Snapshot, term: Term) -> _InputsStatus:
    """Return the inputs of a condition, and the reason if the condition is unknown."""
    frames: set[str] = set()
    status = _InputsStatus(None, FOREVER_S)
    has_all_poses = True
    for first, second in relative_pose_pairs(term):
        try:
            motion = snapshot.transform(first, second)
        except FrameError:
            has_all_poses = False
            status = status._replace(
                reason=Reason.FORGOTTEN, detail=f"the pose of {second!r} relative to {first!r} is unknown"
            )
            continue
        frames.update(snapshot.frames_between(first, second))
        if motion.outcome is Outcome.STALE:
            detail = f"the pose of {motion.weakest!r} is too old"
            status = status if status.detail else status._replace(reason=Reason.STALE, detail=detail)
        else:
            status = status._replace(next_update_s=min(status.next_update_s, snapshot.next_update_s(first, second)))
    return status._replace(frames=frozenset(frames)) if has_all_poses else status


def _reason(before: Reading[Any], status: _InputsStatus) -> Reason:
    """Return why a condition is unknown. If it was never known, `FORGOTTEN` is replaced by `NEVER_OBSERVED`."""
    was_never_known = before.reason is Reason.NEVER_OBSERVED and status.reason is Reason.FORGOTTEN
    return Reason.NEVER_OBSERVED if was_never_known else status.reason
