"""Slow perception functions whose results are accepted and identify their variables as true."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass
class SlowHandle:
    """The handle that all looks read: how long the first looks of each algorithm take; later ones take no time."""

    durations_s: Mapping[str, float]
    needed_look_counts: Mapping[str, int] = field(default_factory=dict)
    look_counts: Counter[str] = field(default_factory=Counter)

    def look(self, name: str, job: Any) -> None:
        self.look_counts[name] += 1
        job.evidence(job.now_s(), job.now_s())
        if self.look_counts[name] <= self.needed_look_counts.get(name, 1):
            job.sleep(self.durations_s[name])


def see(*, name: str, eyes: SlowHandle, job: Any, **_: object) -> dict[str, object]:
    eyes.look(name, job)
    return {"seen": True}


def measure_distance(*, machine: str, base: SlowHandle, job: Any) -> dict[str, object]:
    base.look(f"measure_{machine}_distance", job)
    return {"distance": 0.5}


def find_in_view(*, machine: str, camera: SlowHandle, job: Any) -> dict[str, object]:
    camera.look(f"find_{machine}_in_view", job)
    return {"base_share": 100.0, "lid_share": 100.0, "sharpness": 1.0}


def localize_lid(*, machine: str, camera: SlowHandle, job: Any) -> dict[str, object]:
    camera.look(f"localize_{machine}_lid", job)
    return {"markers": 6, "lid_angle": 1.5, "latched": True}


def localize_rotor(*, machine: str, camera: SlowHandle, job: Any) -> dict[str, object]:
    camera.look(f"localize_{machine}_rotor", job)
    return {"markers": 4, "rotor_angle": 0.0}
