"""A run in the laboratory: one main execution, and arms that see the same frames and are scored against the truth."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

from codra_dsl.runtime import MAIN, Clock, Cost, EventLog, Journal, SimClock, WallClock
from codra_dsl.runtime.journal import Kind
from codra_papers.experiments.interrupts import noted_interrupt
from codra_papers.experiments.lab.arms import Need, Observers
from codra_papers.experiments.lab.fanout import AskedDecision, Fanout, Manager, SkillSpan
from codra_papers.experiments.lab.scoring import Piece, Score, held_pieces, pieces, score
from codra_papers.experiments.limited_time import LimitedClock, TimeIsUp
from codra_papers.experiments.pacing import Pace
from codra_papers.lab.mission import Expect, Mission, MissionError
from codra_papers.lab.perception.frame import Camera, Frame
from codra_papers.lab.perception.layout import surveyed
from codra_papers.lab.robot import Localization, Robot
from codra_papers.lab.sequential_perception import SequentialPerception
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource
from codra_papers.lab.simulator.disturbances import disturb
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory, Mount
from codra_papers.lab.simulator.truth import GroundTruth, TruthSpan
from codra_papers.lab.simulator.world import LabWorld

OBSERVED = "observed"

PICTURED_VARIABLES = ("centrifuge_open", "centrifuge_locked", "pcr_cycler_open", "pcr_cycler_locked")
"""For each of these variables, the first frame that was judged wrongly is shown."""

Work = Callable[[Mission], None]
"""The work of the main execution. It is a frozen value, so that it can be sent to a process and described in a
report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmRun:
    """The values that one arm held in a run, its jobs and their costs.

    Attributes:
        record: the event log of the arm.
        held: the held values of each context-variable.
        scores: the score of each context-variable.
        jobs: how many jobs of each algorithm were started.
        spent: the costs of each observer, and how its jobs ended.
    """

    name: str
    record: EventLog
    held: Mapping[str, Sequence[Piece]]
    scores: Sequence[Score]
    jobs: Mapping[str, int]
    spent: Mapping[str, Cost]


@dataclass(frozen=True, slots=True, kw_only=True)
class LabRun:
    """The results of a run.

    Attributes:
        loops: how many sample-processing loops were completed.
        error: the unrecoverable error that ended the main execution, or None.
        interruptions: the instants and texts of unrecoverable errors after which the main execution started again.
        frames: how many frames were rendered.
        perceived: the number of instants at which perception functions took frames.
        looks_s: the instants of the frames that the main execution took by itself.
        truth: the true values of each variable.
        asked_decisions: the decisions of the main execution.
        skills: when each skill of the main execution was running.
        decisions: for each variable, how many decisions were `answered` from context, and how many `fell_back`.
            `OBSERVED` is the number of answers that came from an observer's evidence, and not from an earlier look of
            the main execution. Empty if no arm answers.
        pictures: frames at notable moments. The key is a name that describes the moment.
    """

    duration_s: float
    loops: int
    error: str | None
    interruptions: Sequence[tuple[float, str]]
    frames: int
    perceived: int
    looks_s: Sequence[float]
    arms: Sequence[ArmRun]
    truth: Mapping[str, Sequence[Piece]]
    asked_decisions: Sequence[AskedDecision]
    skills: Sequence[SkillSpan]
    decisions: Mapping[str, Counter[str]]
    pictures: Mapping[str, Frame]


@dataclass(frozen=True, slots=True)
class OneLoop:
    """Process one batch of samples.

    Attributes:
        leaves_lid_open: whether the lid of the centrifuge stays open between the two visits to it.
    """

    leaves_lid_open: bool = False

    def __call__(self, mission: Mission) -> None:
        """Process one batch."""
        mission.run_loop(leave_lid_open=self.leaves_lid_open)


ONE_LOOP = OneLoop()


@dataclass(frozen=True, slots=True)
class Loops:
    """Process batch after batch, until the time of the run is up."""

    def __call__(self, mission: Mission) -> None:
        """Process batches without end."""
        while True:
            mission.run_loop()


def notable_moments(run: LabRun) -> Mapping[str, float]:
    """Return the instants of the frames that are worth a picture. The key is a name that gives the reason."""
    moments: dict[str, float] = {}
    for arm in run.arms:
        moments |= {f"{arm.name}-{name}": instant_s for name, instant_s in _most_marker_instants(arm).items()}
        moments |= {
            f"{arm.name}-wrong-{name}": instant_s for name, instant_s in _misjudged_instants(arm, run.truth).items()
        }
    return moments


def _most_marker_instants(arm: ArmRun) -> Mapping[str, float]:
    """Return, for each algorithm, the instant of the evidence with the most markers."""
    best_by_algorithm: dict[str, tuple[int, float]] = {}
    for event in arm.record.of(Kind.JOB):
        markers = event.details.get("values", {}).get("markers")
        if event.what == "returned" and isinstance(markers, int):
            best_by_algorithm[event.name] = max(
                best_by_algorithm.get(event.name, (-1, 0.0)), (markers, event.details["evidence_s"][1])
            )
    return {name: instant_s for name, (_, instant_s) in sorted(best_by_algorithm.items())}


def _misjudged_instants(arm: ArmRun, truth: Mapping[str, Sequence[Piece]]) -> Mapping[str, float]:
    """Return, for each variable, the instant of the first evidence for a value that was not true at this instant."""
    evidence_s_by_variable: dict[str, float] = {}
    for event in arm.record.of(Kind.VARIABLE):
        if event.what == "identified" and event.name in PICTURED_VARIABLES and event.name not in evidence_s_by_variable:
            evidence_s = event.details["evidence_s"]
            facts = (piece.value for piece in truth[event.name] if piece.start_s <= evidence_s < piece.end_s)
            if next(facts, None) not in (None, event.details["value"]):
                evidence_s_by_variable[event.name] = evidence_s
    return evidence_s_by_variable


@dataclass(frozen=True, slots=True, kw_only=True)
class LabSettings:
    """The settings of a run.

    Attributes:
        seed: the seed of all random numbers.
        laboratory: the laboratory in which the robot works.
        duration_s: the maximum duration; None if the run lasts as long as the work takes.
        work: the work of the main execution.
        answering_arm: the arm that answers the main execution's decisions; None if the robot looks for each decision.
        decision_s: how long it takes the main execution to ask the arm that answers.
        repair_s: how long someone takes to repair the situation after an unrecoverable error; after the repair, the
            work starts again. None if such an error ends the run (P1, section 4.1). If you set `repair_s`, set
            `duration_s` as well.
        pace: whether simulated time runs as fast as possible or like real time.
        expect: whether the main execution announces the skill that comes next.
        moments: a function that returns a mapping from names to the instants of the frames in `LabRun.pictures`.
        progress: a function that is called repeatedly with the present instant.
        journal: the journal of the answering arm; None for no journal. The journals of other arms are in the same
            folder, with the name of the arm in the file name.
    """

    seed: int = 1
    laboratory: Laboratory = LABORATORY
    duration_s: float | None = None
    work: Work = ONE_LOOP
    answering_arm: str | None = None
    decision_s: float = 0.0
    repair_s: float | None = None
    pace: Pace = Pace.FAST
    expect: Expect = Expect.ONE_AHEAD
    moments: Callable[[LabRun], Mapping[str, float]] = notable_moments
    progress: Callable[[float], None] = lambda _: None
    journal: Path | None = None


def run_lab(observers: Sequence[Observers], settings: LabSettings) -> LabRun:
    """Let the robot work while all arms watch the same frames, each arm with its own slots.

    Args:
        observers: the observers of the arms, whose names must differ.
        settings: the settings of the run.
    """
    with ExitStack() as stack:
        stack.enter_context(surveyed(settings.laboratory.machines))
        world = LabWorld(settings.seed, settings.laboratory)
        frames = stack.enter_context(FrameSource(world))
        own_frames = frames
        if settings.laboratory.camera is not Mount.WRIST:
            own_frames = stack.enter_context(FrameSource(world.seen_by(Mount.WRIST)))
        clock = _clock(settings, stack)  # after all slow preparations, because a clock in real time starts here
        camera, own_camera = (WatchedCamera(ArmCamera(source, clock)) for source in (frames, own_frames))
        resources = {"camera": camera, "base": Localization(world, clock)}
        managers = {
            arm_observers.arm.name: stack.enter_context(
                arm_observers.start(
                    clock=clock,
                    resources=resources,
                    seed=settings.seed,
                    record=_make_event_log(arm_observers.arm.name, settings),
                )
            )
            for arm_observers in observers
        }
        fanout = _make_fanout(clock, managers, observers, settings)
        robot = Robot(world, clock, Random(f"{settings.seed} robot"))
        perception = SequentialPerception(robot, own_camera, fanout, clock, seed=settings.seed)
        mission = Mission(robot, perception, fanout, clock, settings.expect)
        disturb(world, clock)
        interruptions: list[tuple[float, str]] = []
        error = _execute(mission, settings, clock, interruptions)
        end_s = clock.now_s()
        for manager in managers.values():
            manager.close()  # in real time, jobs would otherwise continue while the run is scored
        truth = _truth_pieces(GroundTruth(world).over(0.0, end_s), list(managers.values()))
        arms = [_arm(name, manager, truth, end_s) for name, manager in managers.items()]
        answering_manager = managers.get(settings.answering_arm or "")
        run = LabRun(
            duration_s=end_s,
            loops=mission.loops,
            error=error,
            interruptions=interruptions,
            frames=sum(source.rendered for source in {frames, own_frames}),
            perceived=len(
                {(frames, instant_s) for instant_s in camera.instants_s}
                | {(own_frames, instant_s) for instant_s in own_camera.instants_s}
            ),
            looks_s=sorted(own_camera.instants_s),
            arms=arms,
            truth=truth,
            asked_decisions=tuple(fanout.asked_decisions),
            skills=tuple(fanout.skills),
            decisions={} if answering_manager is None else _count_decisions(answering_manager.record),
            pictures={},
        )
        return replace(
            run,
            pictures={
                name: (own_frames if instant_s in own_camera.instants_s else frames).frame_at(instant_s)
                for name, instant_s in settings.moments(run).items()
            },
        )


class WatchedCamera:
    """A camera that records the instants at which frames are taken.

    Attributes:
        instants_s: the instants at which frames were taken until now.
    """

    def __init__(self, camera: Camera) -> None:
        self.instants_s: set[float] = set()
        self._camera = camera

    def capture(self) -> Frame:
        """Take a frame now."""
        frame = self._camera.capture()
        self.instants_s.add(frame.stamp_s)
        return frame

    def processing_s(self, mean_s: float) -> float:
        """Return the duration of work that the camera's computer begins now, given its mean duration."""
        return self._camera.processing_s(mean_s)


def _make_fanout(
    clock: Clock, managers: Mapping[str, Manager], observers: Sequence[Observers], settings: LabSettings
) -> Fanout:
    """Declare the variables that arms always need, and connect the main execution to all arms."""
    for arm_observers in observers:
        manager, need = managers[arm_observers.arm.name], arm_observers.arm.need
        for name in manager.modelled():
            if need is Need.EVERYTHING or (need is Need.LIDS and name.endswith("_open")):
                manager.declare(name)
    return Fanout(
        clock,
        managers,
        following_arms=[
            arm_observers.arm.name for arm_observers in observers if arm_observers.arm.need is Need.ANNOUNCED
        ],
        answering_arm=settings.answering_arm,
        decision_s=settings.decision_s,
    )


def _clock(settings: LabSettings, stack: ExitStack) -> LimitedClock:
    end_s = math.inf if settings.duration_s is None else settings.duration_s
    if settings.pace is Pace.REAL:
        return LimitedClock(stack.enter_context(WallClock(start_s=0.0)), end_s, settings.progress)
    return LimitedClock(SimClock(), end_s, settings.progress, stack.enter_context(noted_interrupt()))


def _make_event_log(arm: str, settings: LabSettings) -> EventLog:
    """Return a new event log for an arm. The log keeps all events, because they are scored at the end."""
    if settings.journal is None:
        return EventLog(math.inf)
    return Journal(
        settings.journal if arm == settings.answering_arm else arm_journal_path(settings.journal, arm), math.inf
    )


def arm_journal_path(journal: Path, arm: str) -> Path:
    """Return the path of the journal of another arm, next to the journal of the answering arm."""
    return journal.with_name(f"{journal.stem}.{arm}{journal.suffix}")


def _execute(
    mission: Mission, settings: LabSettings, clock: Clock, interruptions: list[tuple[float, str]]
) -> str | None:
    """Run the main execution to its end. Return the unrecoverable error that ended it, or None."""
    try:
        while True:
            try:
                settings.work(mission)
                return None
            except MissionError as error:
                if settings.repair_s is None:
                    return str(error)
                interruptions.append((clock.now_s(), str(error)))
                clock.sleep(settings.repair_s)
    except TimeIsUp:
        return None


def _truth_pieces(spans: Sequence[TruthSpan], managers: Sequence[Manager]) -> Mapping[str, Sequence[Piece]]:
    """Return the true values of the variables that at least one arm's spec models; without arms, of all variables."""
    all_names = tuple(spans[0].values) if spans else ()
    modelled_names = {name for manager in managers for name in manager.modelled()} if managers else set(all_names)
    names = [name for name in all_names if name in modelled_names]
    return {name: pieces([(span.start_s, span.values[name]) for span in spans], spans[-1].end_s) for name in names}


def _arm(name: str, manager: Manager, truth: Mapping[str, Sequence[Piece]], end_s: float) -> ArmRun:
    record = manager.record
    held = held_pieces(record, tuple(truth), end_s)
    started_algorithms = (event.name for event in record.of(Kind.JOB) if event.what == "started")
    return ArmRun(
        name=name,
        record=record,
        held=held,
        scores=[score(variable, held[variable], truth[variable], record) for variable in truth],
        jobs=dict(sorted(Counter(started_algorithms).items())),
        spent=manager.spent(),
    )


def _count_decisions(record: EventLog) -> Mapping[str, Counter[str]]:
    counts_by_variable: dict[str, Counter[str]] = {}
    for event in record.of(Kind.DECISION):
        variable_counts = counts_by_variable.setdefault(event.name, Counter())
        variable_counts[event.what] += 1
        if event.what == "answered" and event.details["source"] != MAIN:
            variable_counts[OBSERVED] += 1
    return dict(sorted(counts_by_variable.items()))
