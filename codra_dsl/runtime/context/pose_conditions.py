"""Context-variables that follow from the knowledge graph: `distance(a, b) < 0.9 m`, a distance, or a count of paths.

Poses change all the time, but the value of a condition on them changes rarely. So the variable gets a reading only
when its value changes, and only these readings reach trees, the journal and `why`. The number of a distance is rounded,
so that it changes rarely, too.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
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
        graph_variables = [
            _GraphVariable(variable, variable.pose_condition, knowledge, clock, store)
            for variable in variables
            if variable.pose_condition is not None
        ]
        counts = [variable for variable in graph_variables if variable.counts_paths]
        conditions = [variable for variable in graph_variables if not variable.counts_paths]
        self._graph_variables = (*conditions, *counts)
        self._deferred = store.derivations.deferred
        if graph_variables:
            knowledge.on_change = self._evaluate_affected_variables
        for variable in (*counts, *conditions):
            variable.evaluate(self._take_snapshot())

    def _evaluate_affected_variables(self, changed_subjects: Collection[ChangeSubject]) -> None:
        """Compute the variables that a change of the graph may affect."""
        change = _Change(
            changed_subjects,
            frames=frozenset(name for kind, name in changed_subjects if kind == "frame"),
            has_nodes=any(kind == "node" for kind, _ in changed_subjects),
        )
        snapshot = self._take_snapshot()
        with self._deferred():
            for variable in self._graph_variables:
                if variable.depends_on(change):
                    variable.evaluate(snapshot, change.frames)


class _Change(NamedTuple):
    """A change of the graph: all changed subjects, the frames among them, and whether there are nodes among them."""

    subjects: Collection[ChangeSubject]
    frames: frozenset[str]
    has_nodes: bool


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


class _Counts(NamedTuple):
    """The numbers of matches of paths, by their names in a term."""

    numbers: Mapping[str, int]

    def value(self, name: str) -> Value | None:
        """Return a number."""
        return self.numbers.get(name)

    def age_s(self, name: str) -> float | None:
        """Return no age: the paths are counted now."""
        return 0.0 if name in self.numbers else None


class _GraphVariable:
    """One variable that follows from poses, or from the number of matches of a path, which is always known.

    Attributes:
        counts_paths: whether the variable follows from the number of matches of a path.
    """

    def __init__(self, variable: VariableModel, term: Term, knowledge: Knowledge, clock: Clock, store: Store) -> None:
        names = term.variables()
        paths = {f"count({path})": path for path in knowledge.model.counts}
        self._name = variable.name
        self._term = term
        self._resolution_m = variable.resolution_m
        self._take_snapshot = knowledge.step_snapshot
        self._clock = clock
        self._store = store
        self._paths = {name: _distinguishing(path) for name, path in paths.items() if name in names}
        self.counts_paths = bool(self._paths)
        snapshot = knowledge.step_snapshot()
        self._subjects = {subject for path in self._paths.values() for subject in snapshot.subjects_of(path)}
        self._frames: frozenset[str] | None = None
        self._timer: Timer | None = None

    def depends_on(self, change: _Change) -> bool:
        """Return whether a change of the graph can change the variable."""
        if self.counts_paths:
            return any(not self._subjects.isdisjoint({(kind, name), (kind, ANY)}) for kind, name in change.subjects)
        has_moved = bool(change.frames) and (self._frames is None or not self._frames.isdisjoint(change.frames))
        return change.has_nodes or has_moved

    def evaluate(self, snapshot: Snapshot, moved_frames: frozenset[str] = frozenset()) -> None:
        """Compute the variable, and store a reading if its value or reason has changed.

        Args:
            snapshot: the snapshot of the present step.
            moved_frames: the frames whose poses have changed.
        """
        status = _inputs_status(snapshot, self._term)
        content = _rounded(self._value(snapshot), self._resolution_m)
        before, now_s = self._store.cells[self._name].observed, snapshot.instant_s
        self._frames = status.frames
        reason = None if content is not None else _reason(before, status)
        is_explained = content is not None or before.detail == status.detail
        is_same = before.content == content and before.reason is reason and is_explained
        if not is_same or before.evidence_s == BEFORE_ALL_S:
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

    def _value(self, snapshot: Snapshot) -> Value | None:
        if not self.counts_paths:
            return term_value(snapshot, self._term)
        return self._term.evaluate(_Counts({name: len(snapshot.match(path)) for name, path in self._paths.items()}))

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


def _distinguishing(path: Path) -> Path:
    """Return a path with as many matches as it has nodes and edges: matches differ in edges and named places."""
    first = path.places[0]
    return path if path.links or first.called else replace(path, places=(replace(first, called="_"),))


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
