"""A run in the laboratory: the mission with its observers, beside it the naive arm, scored against ground truth."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from random import Random
from typing import Any

from codra_dsl.experiments.limited_time import LimitedClock, TimeIsUp
from codra_dsl.experiments.scoring import Piece, Score, held_pieces, pieces, score
from codra_dsl.runtime import Clock, ContextManager, Journal, Record, SimClock, Spent, WallClock
from codra_dsl.runtime.context import MAIN
from codra_dsl.runtime.journal import Kind
from codra_dsl.worlds.lab.camera import ArmCamera, FrameSource
from codra_dsl.worlds.lab.eyes import Eyes
from codra_dsl.worlds.lab.frame import Frame
from codra_dsl.worlds.lab.mission import Expect, Mission, MissionError
from codra_dsl.worlds.lab.robot import Localization, Robot
from codra_dsl.worlds.lab.truth import GroundTruth, TruthSpan
from codra_dsl.worlds.lab.world import LabWorld

Start = Callable[..., ContextManager[Any, Any]]

CONTEXT_DRIVEN = "context-driven"
NAIVE = "naive"

OBSERVED = "observed"

PICTURED = ("centrifuge_open", "centrifuge_locked", "pcr_cycler_open", "pcr_cycler_locked")
"""The variables whose first misjudged frame is shown."""


class Pace(StrEnum):
    """How time passes."""

    FAST = "fast"
    REAL = "real"


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """What one arm held and did.

    Attributes:
        held: by context-variable.
        jobs: how many jobs of each algorithm were started.
    """

    name: str
    record: Record
    held: Mapping[str, Sequence[Piece]]
    scores: Sequence[Score]
    jobs: Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class LabRun:
    """All that a run showed.

    Attributes:
        loops: how many sample-processing loops were completed.
        ended_by: why the run ended.
        error: the main execution's unrecoverable error, if that ended it.
        decisions: how many decisions were `answered` from context, by what an observer saw (`OBSERVED`) or what the
            main execution itself had found out before, and how many `fell_back`, by variable.
        spent: what each observer of the first arm cost and brought.
        pictures: frames at telling moments, by a name that tells the moment.
    """

    duration_s: float
    loops: int
    error: str | None
    frames: int
    arms: Sequence[Arm]
    truth: Mapping[str, Sequence[Piece]]
    decisions: Mapping[str, Counter[str]]
    spent: Mapping[str, Spent]
    pictures: Mapping[str, Frame]


@dataclass(frozen=True, slots=True, kw_only=True)
class LabSettings:
    """How to run.

    Attributes:
        seed: of everything that chance decides.
        duration_s: how long; None for one whole loop.
        expect: whether the main execution says beforehand what comes next.
        progress: is told the present instant now and then.
        journal: where the journal of the main execution's own observers goes, if anywhere; that of the naive arm goes
            beside it, with the arm's name in its own.
    """

    seed: int = 1
    duration_s: float | None = None
    pace: Pace = Pace.FAST
    expect: Expect = Expect.ONE_AHEAD
    progress: Callable[[float], None] = lambda _: None
    journal: Path | None = None


def run_lab(start: Start, settings: LabSettings, start_naive: Start | None = None) -> LabRun:
    """Run the sample-processing workflow.

    Args:
        start: of the compiled spec.
        settings: how to run.
        start_naive: of the same spec without conditions: an arm with slots of its own on the same frames, ignored by
            the main execution.
    """
    with ExitStack() as stack:
        world = LabWorld(settings.seed)
        frames = stack.enter_context(FrameSource(world))
        clock = _clock(settings, stack)  # last of all that takes long: in real time it runs from here
        robot = Robot(world, clock, Random(f"{settings.seed} robot"))
        camera = ArmCamera(frames, clock)
        starts = {CONTEXT_DRIVEN: start} | ({NAIVE: start_naive} if start_naive is not None else {})
        resources = {"camera": camera, "base": Localization(world, clock)}
        managers = {
            name: stack.enter_context(
                begin(clock=clock, resources=resources, seed=settings.seed, record=_record(name, settings))
            )
            for name, begin in starts.items()
        }
        if NAIVE in managers:
            _declare_all(managers[NAIVE])
        codra = managers[CONTEXT_DRIVEN]
        eyes = Eyes(robot, camera, codra, clock, seed=settings.seed)
        mission = Mission(robot, eyes, codra, clock, settings.expect)
        error = _execute(mission, settings)
        end_s = clock.now_s()
        for manager in managers.values():
            manager.close()  # in real time jobs would go on while the run is judged
        truth = _truth_pieces(GroundTruth(world).over(0.0, end_s), codra.modelled())
        arms = [_arm(name, manager.record, truth, end_s) for name, manager in managers.items()]
        return LabRun(
            duration_s=end_s,
            loops=mission.loops,
            error=error,
            frames=frames.rendered,
            arms=arms,
            truth=truth,
            decisions=_decisions(codra.record),
            spent=codra.spent(),
            pictures={name: frames.frame_at(instant_s) for name, instant_s in _moments(arms, truth).items()},
        )


def _clock(settings: LabSettings, stack: ExitStack) -> LimitedClock:
    clock: Clock = SimClock() if settings.pace is Pace.FAST else stack.enter_context(WallClock(start_s=0.0))
    end_s = math.inf if settings.duration_s is None else settings.duration_s
    return LimitedClock(clock, end_s, settings.progress)


def _record(arm: str, settings: LabSettings) -> Record:
    """Return what takes the events of an arm: all of them, since they are scored in the end."""
    if settings.journal is None:
        return Record(math.inf)
    return Journal(settings.journal if arm == CONTEXT_DRIVEN else beside(settings.journal, arm), math.inf)


def beside(journal: Path, arm: str) -> Path:
    """Return where the journal of another arm goes."""
    return journal.with_name(f"{journal.stem}.{arm}{journal.suffix}")


def _declare_all(manager: ContextManager[Any, Any]) -> None:
    for name in manager.modelled():
        manager.declare(name)


def _execute(mission: Mission, settings: LabSettings) -> str | None:
    """Let the main execution run to its end; return its unrecoverable error, if it had one."""
    try:
        mission.run_loop()
        while settings.duration_s is not None:
            mission.run_loop()
    except TimeIsUp:
        return None
    except MissionError as error:
        return str(error)
    return None


def _truth_pieces(spans: Sequence[TruthSpan], modelled: Sequence[str]) -> Mapping[str, Sequence[Piece]]:
    """Return what was true, by variable, of those that the spec models."""
    names = [name for name in (spans[0].values if spans else ()) if name in modelled]
    return {name: pieces([(span.start_s, span.values[name]) for span in spans], spans[-1].end_s) for name in names}


def _arm(name: str, record: Record, truth: Mapping[str, Sequence[Piece]], end_s: float) -> Arm:
    held = held_pieces(record, tuple(truth), end_s)
    started = (event.name for event in record.of(Kind.JOB) if event.what == "started")
    scores = [score(variable, held[variable], truth[variable], record) for variable in truth]
    return Arm(name=name, record=record, held=held, scores=scores, jobs=dict(sorted(Counter(started).items())))


def _decisions(record: Record) -> Mapping[str, Counter[str]]:
    counts: dict[str, Counter[str]] = {}
    for event in record.of(Kind.DECISION):
        counted = counts.setdefault(event.name, Counter())
        counted[event.what] += 1
        if event.what == "answered" and event.details["source"] != MAIN:
            counted[OBSERVED] += 1
    return dict(sorted(counts.items()))


def _moments(arms: Sequence[Arm], truth: Mapping[str, Sequence[Piece]]) -> Mapping[str, float]:
    """Return instants worth a picture, by a name that tells why."""
    moments: dict[str, float] = {}
    for arm in arms:
        moments |= {f"{arm.name}-{name}": instant_s for name, instant_s in _most_markers(arm).items()}
        moments |= {f"{arm.name}-wrong-{name}": instant_s for name, instant_s in _misjudged(arm, truth).items()}
    return moments


def _most_markers(arm: Arm) -> Mapping[str, float]:
    """Return, by algorithm, when the evidence was taken that rests on the most markers."""
    best: dict[str, tuple[int, float]] = {}
    for event in arm.record.of(Kind.JOB):
        markers = event.details.get("values", {}).get("markers")
        if event.what == "returned" and isinstance(markers, int):
            best[event.name] = max(best.get(event.name, (-1, 0.0)), (markers, event.details["evidence_s"][1]))
    return {name: instant_s for name, (_, instant_s) in sorted(best.items())}


def _misjudged(arm: Arm, truth: Mapping[str, Sequence[Piece]]) -> Mapping[str, float]:
    """Return, by variable, when evidence was first taken that gave it a value that was not true at that instant."""
    found: dict[str, float] = {}
    for event in arm.record.of(Kind.VARIABLE):
        if event.what == "identified" and event.name in PICTURED and event.name not in found:
            evidence_s = event.details["evidence_s"]
            facts = (piece.value for piece in truth[event.name] if piece.start_s <= evidence_s < piece.end_s)
            if next(facts, None) not in (None, event.details["value"]):
                found[event.name] = evidence_s
    return found
