"""The looks of a what-if replay: which recorded look answers which look of the replay.

After the first difference, jobs of the replay need not begin when the jobs of the run began. A job that begins at the
instant of a recorded job has the result of this job. Any other job is shifted: it waits for the first recorded job of
the same algorithm whose evidence begins after the job has begun, and has its result and its evidence. If no recorded
job comes within the period of the observer, or if the run no longer needed its result, the result is not known.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S, Clock
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.perception import Failure, Interval, Result
from codra_dsl.runtime.replay.undetermined import NOT_RECORDED, Undetermined
from codra_dsl.runtime.values.cell import Reason

Outcome = Result | Failure


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedLook:
    """A recorded look that has ended.

    Attributes:
        outcome: its outcome; None if the run no longer needed the result, so the journal does not have it.
        interval: the interval of its evidence; None if it is not known.
    """

    index: int
    start_s: float
    outcome: Outcome | None
    interval: Interval | None


@dataclass(slots=True, kw_only=True)
class OpenLook:
    """A look of the replay whose function has not ended yet.

    Attributes:
        index: the number of the recorded job that has begun at the same instant; None if there is none.
        report: reports the interval of the evidence, at an instant.
        deliver: ends the function with an outcome.
    """

    algorithm: str
    start_s: float
    index: int | None
    report: Callable[[float, Interval], None]
    deliver: Callable[[Outcome], None]
    is_over: bool = False


class Looks:
    """Ends the looks of a what-if replay with the outcomes of recorded looks."""

    def __init__(self, clock: Clock, undetermined: Undetermined, periods_s: Mapping[str, float]) -> None:
        """Begin without looks.

        Args:
            clock: the clock of the replay.
            undetermined: learns which looks are shifted, and which results the run does not have.
            periods_s: the period of each algorithm's observer, by algorithm.
        """
        self._clock = clock
        self._undetermined = undetermined
        self._periods_s = periods_s
        self._recorded_starts_s: dict[str, dict[int, float]] = defaultdict(dict)
        self._repeated_indices: dict[str, set[int]] = defaultdict(set)
        self._open_looks: dict[str, OpenLook] = {}

    def add_recorded_start(self, event: Event) -> None:
        """Add the start of a recorded look, as soon as it is read."""
        self._recorded_starts_s[event.name][int(event.details["index"])] = event.instant_s

    def recorded_index(self, algorithm: str, instant_s: float) -> int | None:
        """Return the number of the recorded look that begins at an instant, and that no look of the replay repeats yet.

        Return None if there is none.
        """
        indices = (
            index
            for index, start_s in self._recorded_starts_s[algorithm].items()
            if abs(start_s - instant_s) <= PUNCTUALITY_TOLERANCE_S and index not in self._repeated_indices[algorithm]
        )
        return next(indices, None)

    def recorded_start_s(self, algorithm: str, index: int) -> float:
        """Return when a recorded look began; negative infinity if it began before the first difference."""
        return self._recorded_starts_s[algorithm].get(index, -math.inf)

    def open_index(self, algorithm: str) -> int | None:
        """Return the number of the recorded look that the open look of an algorithm repeats, if any."""
        open_look = self._open_looks.get(algorithm)
        return None if open_look is None else open_look.index

    def report(self, algorithm: str, report_s: float, interval: Interval) -> None:
        """Repeat a recorded report about evidence in the open look of the algorithm."""
        self._open_looks[algorithm].report(report_s, interval)

    def begin(self, look: OpenLook) -> None:
        """Begin a look of the replay."""
        self._open_looks[look.algorithm] = look
        if look.index is not None:
            self._repeated_indices[look.algorithm].add(look.index)
        else:
            self._undetermined.begin_shifted_look(look.algorithm)
            period_s = self._periods_s.get(look.algorithm, 0.0)
            self._clock.call_at(self._clock.now_s() + period_s, lambda: self._miss(look))

    def cancel(self, algorithm: str) -> None:
        """End the function of a look whose job was cancelled, or has timed out."""
        look = self._open_looks.get(algorithm)
        if look is not None:
            failure = Failure(Reason.FAILED, "it ended because it was cancelled")
            self._clock.call_at(self._clock.now_s(), lambda: self._end(look, failure, is_known=look.index is not None))

    def end_recorded(self, algorithm: str, recorded_look: RecordedLook) -> None:
        """Handle the end of a recorded look: it may end the open look of the algorithm."""
        self._recorded_starts_s[algorithm].pop(recorded_look.index, None)
        self._repeated_indices[algorithm].discard(recorded_look.index)
        look = self._open_looks.get(algorithm)
        if look is None:
            return
        if look.index == recorded_look.index:
            self._end_with(look, recorded_look)
        elif look.index is None and recorded_look.outcome is not None and _begins_after(recorded_look, look.start_s):
            if recorded_look.interval is not None:
                look.report(self._clock.now_s(), recorded_look.interval)
            self._end_with(look, recorded_look)

    def _miss(self, look: OpenLook) -> None:
        if not look.is_over:
            self._undetermined.miss_look(look.algorithm)

    def _end_with(self, look: OpenLook, recorded_look: RecordedLook) -> None:
        failure = Failure(Reason.FAILED, NOT_RECORDED)
        self._end(look, recorded_look.outcome or failure, is_known=recorded_look.outcome is not None)

    def _end(self, look: OpenLook, outcome: Outcome, *, is_known: bool) -> None:
        if look.is_over:
            return
        look.is_over = True
        del self._open_looks[look.algorithm]
        self._undetermined.end_look(look.algorithm, is_known=is_known, is_shifted=look.index is None)
        look.deliver(outcome)


def recorded_look(
    index: int, start_s: float, end_event: Event | None, names: Sequence[str], now_s: float
) -> RecordedLook:
    """Return a recorded look, given the event of its end; None if the run no longer needed the result."""
    if end_event is None:
        return RecordedLook(index=index, start_s=start_s, outcome=None, interval=None)
    details: Mapping[str, Any] = end_event.details
    if end_event.what == "failed":
        outcome: Outcome = Failure(Reason(details["reason"]), str(details.get("message", "")))
        return RecordedLook(index=index, start_s=start_s, outcome=outcome, interval=Interval(start_s, now_s))
    values, evidence_s = details.get("values", {}), details.get("evidence_s", ())
    interval = Interval(*map(float, evidence_s)) if len(evidence_s) == 2 else None
    outcome = Result({name: values.get(name) for name in names})
    return RecordedLook(index=index, start_s=start_s, outcome=outcome, interval=interval)


def _begins_after(recorded_look: RecordedLook, instant_s: float) -> bool:
    evidence_start_s = recorded_look.start_s if recorded_look.interval is None else recorded_look.interval.start_s
    return evidence_start_s >= instant_s - PUNCTUALITY_TOLERANCE_S
