"""Detect tags in stored frames again, with the frames' files and the functions of the spec, but without a simulator."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from random import Random
from typing import Any

import cv2
import numpy as np

from codra_dsl.language.model import Algorithm, Spec
from codra_papers.experiments.campaign.campaign import TRIALS
from codra_papers.experiments.lab.outcomes import KeptFrame, Outcome
from codra_papers.lab.perception.frame import Frame, StillCamera
from codra_papers.lab.perception.layout import INTRINSICS
from codra_papers.lab.perception.poses import Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedDetection:
    """A stored frame, and the result of a new detection in this frame.

    Attributes:
        trial: the name of the frame's trial.
        values: the new result; None if the frame's file cannot be read.
    """

    trial: str
    kept: KeptFrame
    values: Mapping[str, Any] | None

    @property
    def agrees(self) -> bool:
        """Return whether every value equals the recorded value exactly."""
        return self.values is not None and dict(self.values) == dict(self.kept.values)


def detect_again(spec: Spec, outcomes: Sequence[Outcome], folder: Path) -> Sequence[RepeatedDetection]:
    """Repeat the detection in all stored frames.

    Args:
        spec: the spec, which determines the function and the parameters of each algorithm.
        outcomes: the outcomes of runs that stored frames.
        folder: the folder of the experiment.
    """
    algorithms = {algorithm.name: algorithm for algorithm in spec.perception}
    return [
        RepeatedDetection(
            trial=outcome.name,
            kept=kept,
            values=_detect(algorithms[kept.algorithm], kept, folder / TRIALS / outcome.name / kept.file),
        )
        for outcome in outcomes
        for kept in outcome.kept
    ]


def _detect(algorithm: Algorithm, kept: KeptFrame, path: Path) -> Mapping[str, Any] | None:
    pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if pixels is None:
        return None
    rotation, translation_m = kept.believed_map_from_camera
    frame = Frame(
        pixels=np.asarray(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), dtype=np.uint8),
        intrinsics=INTRINSICS,
        believed_map_from_camera=Pose(np.array(rotation), np.array(translation_m)),
        stamp_s=kept.evidence_s,
    )
    values = _load_function(algorithm.call)(**dict(algorithm.parameters), camera=StillCamera(frame), job=_PassingJob())
    return dict(values)


def _load_function(call: str) -> Callable[..., Mapping[str, Any]]:
    module, _, name = call.partition(":")
    function: Callable[..., Mapping[str, Any]] = getattr(import_module(module), name)
    return function


@dataclass(slots=True)
class _PassingJob:
    """A job in which sleeping takes no real time, because an algorithm's result does not depend on its duration."""

    random: Random = field(default_factory=lambda: Random(0))
    index: int = 0
    cancelled: bool = False
    _now_s: float = 0.0

    def now_s(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        self._now_s += duration_s

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Ignore the evidence, which is already known."""
