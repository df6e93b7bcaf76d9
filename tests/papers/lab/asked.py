"""Arguments for perception functions: a job that records its calls, cameras with one frame, a base at rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from random import Random

from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.poses import Pose
from codra_papers.lab.perception.processing import Computer


@dataclass(slots=True)
class RecordedJob:
    """A job in simulated time that records, in order, the calls that a perception function makes."""

    random: Random = field(default_factory=lambda: Random(1))
    start_s: float = 20.0
    cancelled: bool = False
    record: list[tuple[str, float, float]] = field(default_factory=list)

    def now_s(self) -> float:
        return self.start_s + sum(after_s - before_s for what, before_s, after_s in self.record if what == "slept")

    def sleep(self, duration_s: float) -> None:
        self.record.append(("slept", self.now_s(), self.now_s() + duration_s))

    def evidence(self, start_s: float, stamp_s: float) -> None:
        self.record.append(("evidence", start_s, stamp_s))


@dataclass(frozen=True, slots=True)
class OneFrameCamera:
    """A camera that always returns the same frame."""

    frame: Frame

    def capture(self) -> Frame:
        return self.frame

    def processing_s(self, mean_s: float) -> float:
        return mean_s


@dataclass(frozen=True, slots=True)
class CameraWithComputer:
    """A camera that always returns the same frame, with a computer whose work takes time."""

    frame: Frame
    job: RecordedJob
    computer: Computer = field(default_factory=lambda: Computer(2))

    def capture(self) -> Frame:
        return self.frame

    def processing_s(self, mean_s: float) -> float:
        return self.computer.processing_s(self.job.now_s(), mean_s)


@dataclass(frozen=True, slots=True)
class FixedBase:
    """A mobile base with a fixed believed pose."""

    pose: Pose

    def believed_map_from_base(self) -> Pose:
        return self.pose
