"""One run of the shop with a manager, and its outcome."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from codra_dsl.integrations.inspection import compile_and_load
from codra_dsl.runtime.journal import Event, EventLog, Kind
from codra_papers.experiments.store.curves import curves
from codra_papers.experiments.store.run import StoreRun, StoreRunSettings, run_store
from codra_papers.experiments.studies.store_managers.managers import Manager
from codra_papers.experiments.studies.store_managers.shift import Staging, shift_of
from codra_papers.experiments.studies.store_managers.watching import Cause, CauseCall, Span, Watch, calls
from codra_papers.store.simulator.store import Store

COURSE = "course"
FETCHING = "fetching"
DRAIN = "battery_drain"
BATTERY = "battery_level"
SHOWN_VARIABLES = (BATTERY, "safety", "weight_of_pick", "weight_of_deliver", "weight_of_start", "weight_of_dock")
"""The variables that are stored to be drawn."""

Curve = Sequence[tuple[float, float | None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreOutcome:
    """The outcome of a run, as plain data: `from_json` is the inverse of `to_json`.

    Attributes:
        loops: the number of completed missions.
        error: always None, because no error ends a run of the shop early.
        frames: always 0, because the camera's view is computed and not rendered.
        orders: how many orders ended in each state.
        aborts: the number of pick-ups that were aborted.
        courses: the chosen actions, and when they were chosen.
        called: the causes that called for another course.
        unsafe: when the robot moved fast near a person.
        gaps_m: the distance to the nearest person, second by second.
        curves: the metrics and weights for pictures, as pairs of an instant and the value from this instant on; None
            for an unknown value.
        battery_empty_s: when the battery became empty, which ended the work; None if it did not.
        drain_known_s: the first instant at which `battery_drain` was known; None if it never was.
    """

    name: str
    seed: int
    manager: str
    duration_s: float
    loops: int
    orders: Mapping[str, int]
    aborts: int
    bumps: int
    driven_m: float
    unsafe_s: float
    courses: Sequence[tuple[float, str]]
    called: Sequence[CauseCall]
    unsafe: Sequence[Span]
    gaps_m: Curve
    curves: Mapping[str, Curve]
    battery_empty_s: float | None = None
    drain_known_s: float | None = None
    error: str | None = None
    frames: int = 0

    @property
    def switches(self) -> int:
        """Return how often the course changed; the first choice is not a change."""
        return max(len(self.courses) - 1, 0)

    @property
    def empty_min(self) -> float:
        """Return for how many minutes the battery was empty."""
        return 0.0 if self.battery_empty_s is None else (self.duration_s - self.battery_empty_s) / 60.0

    def per_hour(self, count: float) -> float:
        """Return a count of the run as a rate per hour, because shifts have different durations."""
        return count / self.duration_s * 3600.0

    def files(self) -> Sequence[str]:
        """Return an empty sequence, because the outcome is complete without files."""
        return ()

    def to_json(self) -> str:
        """Return the outcome as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"), allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> StoreOutcome:
        """Return the outcome from the JSON text that `to_json` returned."""
        content = json.loads(text)
        content["courses"] = [(at_s, action) for at_s, action in content["courses"]]
        content["called"] = [CauseCall(**{**call, "cause": Cause(call["cause"])}) for call in content["called"]]
        content["unsafe"] = [Span(**span) for span in content["unsafe"]]
        content["gaps_m"] = _pairs(content["gaps_m"])
        content["curves"] = {name: _pairs(curve) for name, curve in content["curves"].items()}
        return cls(**content)


def _pairs(points: Sequence[Sequence[Any]]) -> Curve:
    return [(at_s, value) for at_s, value in points]


class _CountedEvents(EventLog):
    """All events of the names that outcomes are computed from, however long the run."""

    names = frozenset({COURSE, FETCHING, DRAIN, *SHOWN_VARIABLES})

    def __init__(self) -> None:
        super().__init__(limit=math.inf)

    def add(self, event: Event) -> None:
        if event.name in self.names:
            super().add(event)


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreTrial:
    """One run.

    Attributes:
        manager: the manager that decides on the course and the speed.
        duration_s: the duration of the run; None for the duration of the seed's shift.
    """

    name: str
    spec: Path
    seed: int
    manager: Manager
    duration_s: float | None = None

    @property
    def draws_frames(self) -> bool:
        """Return False: trials in the store render no frames of the laboratory."""
        return False

    def run(self, folder: Path) -> StoreOutcome:
        """Run the shop until the shift is over or the battery is empty, and return the outcome. Nothing else is stored.

        Raises:
            SpecError: if the spec has errors, or has no loops.
        """
        del folder
        watches: list[Watch] = []
        shift = shift_of(self.seed)
        duration_s = shift.duration_s if self.duration_s is None else self.duration_s

        def on_opened(store: Store) -> None:
            knowledge = store.knowledge
            Staging(shift, store)
            watches.append(Watch(lambda: knowledge.snapshot().handover(FETCHING).is_open))
            store.world.watch(watches[0].see)

        with tempfile.TemporaryDirectory(prefix="codra-") as build_folder:
            compiled = self.manager.managed_spec(compile_and_load(self.spec, Path(build_folder)).package)
            settings = StoreRunSettings(
                shop=shift.settings(),
                duration_s=duration_s,
                record=_CountedEvents(),
                on_opened=on_opened,
                is_over=lambda: watches[0].battery_empty_s is not None,
            )
            run = run_store(compiled, settings)
        return self._outcome(run, watches[0], duration_s)

    def outcome(self, text: str) -> StoreOutcome:
        """Return the outcome from the JSON text that its `to_json` returned."""
        return StoreOutcome.from_json(text)

    def _outcome(self, run: StoreRun, watch: Watch, duration_s: float) -> StoreOutcome:
        courses = courses_of(run.record)
        return StoreOutcome(
            name=self.name,
            seed=self.seed,
            manager=self.manager.name,
            duration_s=duration_s,
            loops=run.score.missions,
            orders=run.orders,
            aborts=sum(event.what == "aborted" for event in run.record.of(Kind.KNOWLEDGE, FETCHING)),
            bumps=run.score.bumps,
            driven_m=round(run.score.driven_m, 3),
            unsafe_s=run.score.unsafe_s,
            courses=courses,
            called=calls(watch.causes, courses, duration_s),
            unsafe=watch.unsafe,
            gaps_m=watch.gaps_m,
            curves={name: _thin_curve(curve) for name, curve in curves(run.record, SHOWN_VARIABLES).items()},
            battery_empty_s=watch.battery_empty_s,
            drain_known_s=_first_known_s(curves(run.record, [DRAIN])[DRAIN]),
        )


def courses_of(record: EventLog) -> Sequence[tuple[float, str]]:
    """Return the chosen courses, and when they were chosen."""
    chosen_events = [event for event in record.of(Kind.ADAPTATION, COURSE) if event.what == "chosen"]
    return [(event.instant_s, str(event.details["action"])) for event in chosen_events]


def _first_known_s(curve: Sequence[tuple[float, float]]) -> float | None:
    return next((at_s for at_s, value in curve if value == value), None)


def _thin_curve(curve: Sequence[tuple[float, float]]) -> Curve:
    """Return a curve without the points that make no visible change."""
    kept_points: list[tuple[float, float | None]] = []
    for at_s, value in curve:
        rounded_value = None if value != value else round(value, 2)
        if not kept_points or kept_points[-1][1] != rounded_value:
            kept_points.append((round(at_s, 2), rounded_value))
    return kept_points
