"""One run of the shop with a manager, and what came of it."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.integrations.inspection import SpecError, compile_and_load
from codra_dsl.runtime.journal import EventLog, Kind
from codra_dsl.runtime.loops import Mape
from codra_papers.experiments.store.curves import curves
from codra_papers.experiments.store.run import Compiled, StoreRun, StoreRunSettings, run_store
from codra_papers.experiments.studies.store_managers.managers import Manager
from codra_papers.experiments.studies.store_managers.shift import Staging, shift_of
from codra_papers.experiments.studies.store_managers.watching import Called, Cause, Span, Watch, calls
from codra_papers.store.simulator.store import Store

LASTS_S = 300.0

COURSE = "course"
FETCHING = "fetching"
SHOWN = ("safety", "weight_of_pick", "weight_of_deliver", "weight_of_start", "weight_of_dock")
"""What is kept to be drawn."""

Curve = Sequence[tuple[float, float | None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreOutcome:
    """What came of a run. All of it is plain data: `to_json` and `from_json` are inverse to each other.

    Attributes:
        loops: completed missions.
        error: None; nothing ends a run of the shop early.
        frames: none: what the camera sees is worked out, not rendered.
        orders: how many there were, by what became of them.
        aborts: pick-ups that were broken off.
        courses: what was chosen, and when.
        called: what called for another course.
        unsafe: when the robot moved fast near somebody.
        gaps_m: how near the nearest person was, second by second.
        curves: metrics and weights as far as they are drawn, from each change to the next; None is unknown.
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
    called: Sequence[Called]
    unsafe: Sequence[Span]
    gaps_m: Curve
    curves: Mapping[str, Curve]
    error: str | None = None
    frames: int = 0

    @property
    def switches(self) -> int:
        """Return how often the course changed; the first choice is no change."""
        return max(len(self.courses) - 1, 0)

    def files(self) -> Sequence[str]:
        """Return none: all of it is here."""
        return ()

    def to_json(self) -> str:
        """Return it as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"), allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> StoreOutcome:
        """Return what `to_json` wrote."""
        told = json.loads(text)
        told["courses"] = [(at_s, action) for at_s, action in told["courses"]]
        told["called"] = [Called(**{**each, "cause": Cause(each["cause"])}) for each in told["called"]]
        told["unsafe"] = [Span(**each) for each in told["unsafe"]]
        told["gaps_m"] = _pairs(told["gaps_m"])
        told["curves"] = {name: _pairs(curve) for name, curve in told["curves"].items()}
        return cls(**told)


def _pairs(told: Sequence[Sequence[Any]]) -> Curve:
    return [(at_s, value) for at_s, value in told]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreTrial:
    """One run.

    Attributes:
        manager: who decides.
        duration_s: how long it lasts.
    """

    name: str
    spec: Path
    seed: int
    manager: Manager
    duration_s: float = LASTS_S

    @property
    def draws_frames(self) -> bool:
        """Return that it draws no frames of the laboratory."""
        return False

    def run(self, folder: Path) -> StoreOutcome:
        """Run it; nothing is kept but its outcome.

        Raises:
            SpecError: if the spec has errors, or has no loops.
        """
        del folder
        watches: list[Watch] = []

        def opened(store: Store) -> None:
            knowledge = store.knowledge
            Staging(shift_of(self.seed), store)
            watches.append(Watch(lambda: knowledge.snapshot().handover(FETCHING).is_open))
            store.world.watch(watches[0].see)

        with tempfile.TemporaryDirectory(prefix="codra-") as made:
            compiled = managed(compile_and_load(self.spec, Path(made)).package, self.manager, self.seed)
            settings = StoreRunSettings(shop=shift_of(self.seed).settings(), duration_s=self.duration_s, opened=opened)
            run = run_store(compiled, settings)
        return self._outcome(run, watches[0])

    def outcome(self, text: str) -> StoreOutcome:
        """Return what its outcome's `to_json` wrote."""
        return StoreOutcome.from_json(text)

    def _outcome(self, run: StoreRun, watch: Watch) -> StoreOutcome:
        courses = courses_of(run.record)
        return StoreOutcome(
            name=self.name,
            seed=self.seed,
            manager=self.manager.name,
            duration_s=run.duration_s,
            loops=run.score.missions,
            orders=run.orders,
            aborts=sum(each.what == "aborted" for each in run.record.of(Kind.KNOWLEDGE, FETCHING)),
            bumps=run.score.bumps,
            driven_m=round(run.score.driven_m, 3),
            unsafe_s=run.score.unsafe_s,
            courses=courses,
            called=calls(watch.causes, courses, run.duration_s),
            unsafe=watch.unsafe,
            gaps_m=watch.gaps_m,
            curves={name: _thinned(curve) for name, curve in curves(run.record, SHOWN).items()},
        )


def managed(package: ModuleType, manager: Manager, seed: int) -> Compiled:
    """Return a compiled spec whose loops a manager plans.

    Raises:
        SpecError: if it has no loops.
    """
    if not hasattr(package, "MAPE"):
        raise SpecError("the spec has no loops whose managers could be compared")
    return Compiled(start=package.start, loops=partial(_loops, package.MAPE, manager, seed))


def _loops(model: Any, manager: Manager, seed: int, codra: Any, **given: Any) -> Mape:
    return Mape(codra, model, planner=manager.planners(seed), **given)


def courses_of(record: EventLog) -> Sequence[tuple[float, str]]:
    """Return what was chosen, and when."""
    chosen = [each for each in record.of(Kind.ADAPTATION, COURSE) if each.what == "chosen"]
    return [(each.instant_s, str(each.details["action"])) for each in chosen]


def _thinned(curve: Sequence[tuple[float, float]]) -> Curve:
    """Return a curve without points that change nothing that could be seen."""
    kept: list[tuple[float, float | None]] = []
    for at_s, value in curve:
        shown = None if value != value else round(value, 2)
        if not kept or kept[-1][1] != shown:
            kept.append((round(at_s, 2), shown))
    return kept
