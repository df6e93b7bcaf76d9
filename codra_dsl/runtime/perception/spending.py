"""What the jobs of an observer cost, and what they brought."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Spent:
    """What an observer has spent, and what that brought; each job that has ended is in exactly one of the counts.

    Attributes:
        jobs: that have begun.
        accepted: results that brought at least one variable a value.
        rejected: results that brought none.
        voided: jobs whose evidence does not count, because it turned out that a precondition broke while it was taken.
        failed: jobs that raised, timed out, or returned what they should not.
        cancelled: jobs that nobody waited for any more, because their observer stopped or a precondition failed.
        waiting_s: between request and beginning of jobs: for slots.
        perception_s: between beginning and end of jobs.
        slot_s: the same, times the number of slots that the job held.
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

    def __add__(self, other: Spent) -> Spent:
        mine, others = asdict(self), asdict(other)
        return Spent(**{name: mine[name] + others[name] for name in mine})


class Account:
    """Counts what one algorithm spends and brings.

    Attributes:
        judged: results that were judged.
        accepted: those of them that brought a value.
    """

    def __init__(self) -> None:
        self.judged = self.accepted = self.voided = self.failed = self.cancelled = 0
        self._jobs = 0
        self._waiting_s = self._perception_s = self._slot_s = 0.0

    def begin(self, waited_s: float) -> None:
        """Count a job that begins."""
        self._jobs += 1
        self._waiting_s += waited_s

    def end(self, taken_s: float, slots: int) -> None:
        """Count the time of a job that ends."""
        self._perception_s += taken_s
        self._slot_s += taken_s * slots

    def spent(self) -> Spent:
        """Return what it comes to."""
        return Spent(
            jobs=self._jobs,
            accepted=self.accepted,
            rejected=self.judged - self.accepted,
            voided=self.voided,
            failed=self.failed,
            cancelled=self.cancelled,
            waiting_s=self._waiting_s,
            perception_s=self._perception_s,
            slot_s=self._slot_s,
        )
