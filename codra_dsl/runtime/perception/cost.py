"""The costs and results of an observer's jobs."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """The costs and results of an observer.

    Each job that has ended is in exactly one of the counts `accepted` to `cancelled`.

    Attributes:
        jobs: jobs that have started.
        accepted: results that gave at least one variable a value.
        rejected: results that gave no variable a value.
        voided: jobs whose evidence was discarded, because a precondition failed while the evidence was taken.
        failed: jobs that raised, timed out, or returned an invalid result.
        cancelled: jobs that were no longer needed, because their observer stopped or a precondition failed.
        waiting_s: the total time in which jobs waited for slots, from the request of each job to its start.
        perception_s: the total time from the start of each job to its end.
        slot_s: the same total, with the time of each job multiplied by the number of slots that the job held.
    """

    jobs: int = 0
    accepted: int = 0
    rejected: int = 0
    voided: int = 0
    failed: int = 0
    cancelled: int = 0
    waiting_s: float = 0.0
    perception_s: float = 0.0
    slot_s: float = 0.0

    def __add__(self, other: Cost) -> Cost:
        own_values, other_values = asdict(self), asdict(other)
        return Cost(**{name: own_values[name] + other_values[name] for name in own_values})


class CostMeter:
    """Adds up the costs and results of one algorithm.

    Attributes:
        evaluated_count: the number of results that were evaluated.
        accepted_count: the number of evaluated results that gave a variable a value.
        voided_count: the number of jobs whose evidence was discarded.
        failed_count: the number of jobs that raised, timed out, or returned an invalid result.
        cancelled_count: the number of jobs that were no longer needed.
    """

    def __init__(self) -> None:
        self.evaluated_count = self.accepted_count = self.voided_count = self.failed_count = self.cancelled_count = 0
        self._job_count = 0
        self._waiting_s = self._perception_s = self._slot_s = 0.0

    def begin(self, waiting_s: float) -> None:
        """Count a job that starts."""
        self._job_count += 1
        self._waiting_s += waiting_s

    def end(self, duration_s: float, slot_count: int) -> None:
        """Add the time of a job that ends."""
        self._perception_s += duration_s
        self._slot_s += duration_s * slot_count

    def cost(self) -> Cost:
        """Return the costs and results so far."""
        return Cost(
            jobs=self._job_count,
            accepted=self.accepted_count,
            rejected=self.evaluated_count - self.accepted_count,
            voided=self.voided_count,
            failed=self.failed_count,
            cancelled=self.cancelled_count,
            waiting_s=self._waiting_s,
            perception_s=self._perception_s,
            slot_s=self._slot_s,
        )
