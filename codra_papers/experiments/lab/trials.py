"""One run of an experiment in the laboratory, described so completely that it can be repeated."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from codra_dsl.collector import paused_collector
from codra_dsl.integrations.inspection import read_spec
from codra_dsl.language.model import Spec
from codra_dsl.runtime import EventLog, Reading
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.lab.algorithms import alternatives, plain_preconditions
from codra_papers.experiments.lab.arms import Arm, observers
from codra_papers.experiments.lab.fanout import AskedDecision
from codra_papers.experiments.lab.outcomes import (
    BEFORE_THE_ACTION,
    OWN_LOOK,
    ArmOutcome,
    Basis,
    Decision,
    KeptFrame,
    Outcome,
    WrongSpan,
)
from codra_papers.experiments.lab.run import ONE_LOOP, ArmRun, LabRun, LabSettings, Work, run_lab
from codra_papers.experiments.lab.scoring import Piece, overlaps, source_pieces, value_known_by
from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One run of an experiment in the laboratory.

    Attributes:
        name: the name of the trial, which is unique in its experiment and is also the name of its record.
        spec: the file of the experiment's spec.
        seed: the seed of all random numbers.
        arms: the arms, which all see the same frames.
        laboratory: the laboratory in which the robot works.
        answering_arm: the arm that answers the main execution's decisions; None if the robot looks for each decision.
        decision_s: how long it takes to ask the arm that answers.
        repair_s: how long a repair takes after an unrecoverable error; None if such an error ends the run.
        work: the work of the main execution.
        duration_s: the maximum duration; None if the run lasts as long as the work takes.
        frames_kept: how many frames are stored to be analysed again, besides those of wrong decisions.
    """

    name: str
    spec: Path
    seed: int
    arms: tuple[Arm, ...]
    laboratory: Laboratory = LABORATORY
    answering_arm: str | None = None
    decision_s: float = 0.0
    repair_s: float | None = None
    work: Work = ONE_LOOP
    duration_s: float | None = None
    frames_kept: int = 0

    @property
    def draws_frames(self) -> bool:
        """Return True: every trial in the laboratory renders frames."""
        return True

    def run(self, folder: Path) -> Outcome:
        """Run the trial and write the stored frames into the folder."""
        return run_trial(self, folder)

    def outcome(self, text: str) -> Outcome:
        """Return the outcome from the JSON text that its `to_json` returned."""
        return Outcome.from_json(text)


@paused_collector()  # nothing refers back to a completed job, so the job's memory is freed without the collector
def run_trial(trial: Trial, folder: Path, progress: Callable[[float], None] = lambda _: None) -> Outcome:
    """Run a trial. Store the frames of wrong decisions, and frames that are to be analysed again.

    Args:
        trial: the trial to run.
        folder: the folder for frames, which is created if there are any frames.
        progress: a function that is called repeatedly with the present simulated instant.

    Raises:
        SpecError: if the spec, or the edited spec of an arm, has errors.
    """
    spec = read_spec(trial.spec)
    settings = LabSettings(
        seed=trial.seed,
        laboratory=trial.laboratory,
        duration_s=trial.duration_s,
        work=trial.work,
        answering_arm=trial.answering_arm,
        decision_s=trial.decision_s,
        repair_s=trial.repair_s,
        moments=lambda run: _moments(run, trial),
        progress=progress,
    )
    with tempfile.TemporaryDirectory(prefix="codra-") as code_folder:
        arms = [observers(arm, spec, Path(code_folder) / str(number)) for number, arm in enumerate(trial.arms)]
        run = run_lab(arms, settings)
    for name, frame in run.pictures.items():
        store_frame(frame, folder / name)
    return _outcome(trial, run, spec)


def store_frame(frame: Frame, path: Path) -> None:
    """Write a frame's pixels as PNG.

    Raises:
        OSError: if the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _, data = cv2.imencode(".png", cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2BGR))
    path.write_bytes(data.tobytes())


# Which frames are stored


def _moments(run: LabRun, trial: Trial) -> Mapping[str, float]:
    """Return the instants of the frames to store. The key is the name of the frame's file.

    These are the frames with the evidence for wrong decisions, and frames that are evenly spread over the run.
    """
    instants = {
        basis.evidence_s
        for decision in _decisions(run, trial)
        for basis in (*decision.wrong.values(), decision.wrong_answer)
        if basis is not None and basis.frame
    }
    instants |= {kept.evidence_s for kept in _evenly_spread_evidence(run, trial.frames_kept)}
    return {_frame_file(instant_s): instant_s for instant_s in sorted(instants)}


def _frame_file(instant_s: float) -> str:
    return f"{instant_s!r}.png"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Evidence:
    """The values that a job of an arm returned for one frame."""

    arm: str
    algorithm: str
    evidence_s: float
    values: Mapping[str, Any]


def _evenly_spread_evidence(run: LabRun, count: int) -> Sequence[_Evidence]:
    """Return `count` pieces of evidence from frames, evenly spread over a run and from all arms."""
    evidence = [
        _Evidence(arm=arm.name, algorithm=event.name, evidence_s=event.details["evidence_s"][1], values=values)
        for arm in run.arms
        for event in arm.record.of(Kind.JOB)
        if event.what == "returned" and "distance" not in (values := event.details["values"])
    ]
    evidence.sort(key=lambda entry: (entry.evidence_s, entry.arm, entry.algorithm))
    return [evidence[len(evidence) * index // count] for index in range(count)] if evidence else []


# The outcome


def _outcome(trial: Trial, run: LabRun, spec: Spec) -> Outcome:
    return Outcome(
        name=trial.name,
        seed=trial.seed,
        duration_s=run.duration_s,
        loops=run.loops,
        error=run.error,
        interruptions=list(run.interruptions),
        frames=run.frames,
        perceived=run.perceived,
        truth=run.truth,
        arms={arm.name: _arm_outcome(arm, run, spec) for arm in run.arms},
        decisions=_decisions(run, trial),
        skills=[(span.name, span.start_s, span.end_s) for span in run.skills],
        kept=list(_kept_frames(run, trial.frames_kept)),
    )


def _arm_outcome(arm: ArmRun, run: LabRun, spec: Spec) -> ArmOutcome:
    return ArmOutcome(
        held=arm.held,
        wrong=wrong_spans(arm.record, run.truth),
        first_s={score.name: score.first_s for score in arm.scores},
        triggers=arm.jobs,
        observable_triggers=_observable_triggers(arm.record, run.truth, plain_preconditions(spec)),
        slot_s=sum(cost.slot_s for cost in arm.spent.values()),
        sources={name: source_pieces(arm.record, name, run.duration_s) for name in alternatives(spec)},
    )


def _observable_triggers(
    record: EventLog, truth: Mapping[str, Sequence[Piece]], preconditions: Mapping[str, Sequence[str]]
) -> Mapping[str, int]:
    counts = dict.fromkeys(preconditions, 0)
    for event in record.of(Kind.JOB):
        if event.what == "started" and event.name in counts:
            facts = (value_at(truth.get(name, ()), event.instant_s) for name in preconditions[event.name])
            counts[event.name] += all(fact is True for fact in facts)
    return counts


def wrong_spans(record: EventLog, truth: Mapping[str, Sequence[Piece]]) -> Mapping[str, Sequence[WrongSpan]]:
    """Return, for each variable, the spans in which the held value was not true.

    Each span states whether the value was true at the instant of its evidence.

    Args:
        record: the event log of a context manager.
        truth: the true values of each variable, from 0 s to the end of the run.
    """
    events_by_name: dict[str, list[Event]] = {name: [] for name in truth}
    for event in record.of(Kind.VARIABLE):
        if event.details.get("present") and event.name in events_by_name:
            events_by_name[event.name].append(event)
    return {name: _wrong_spans_of(events, truth[name]) for name, events in events_by_name.items()}


def _wrong_spans_of(events: Sequence[Event], truth: Sequence[Piece]) -> tuple[WrongSpan, ...]:
    spans: list[WrongSpan] = []
    ends = (*(event.instant_s for event in events[1:]), truth[-1].end_s)
    for event, end_s in zip(events, ends, strict=False):  # if there are no events, there is still one end
        value = event.details["value"]
        held = Piece(event.instant_s, end_s, value)
        for _, fact, duration_s in overlaps([held], truth):
            if value is None or fact.value == value or duration_s == 0.0:
                continue
            start_s, was_true = max(held.start_s, fact.start_s), value_at(truth, event.details["evidence_s"]) == value
            if spans and spans[-1].end_s == start_s and spans[-1].was_true == was_true:
                start_s = spans.pop().start_s
            spans.append(WrongSpan(start_s, min(held.end_s, fact.end_s), was_true))
    return tuple(spans)


def _kept_frames(run: LabRun, count: int) -> Iterator[KeptFrame]:
    for evidence in _evenly_spread_evidence(run, count):
        name = _frame_file(evidence.evidence_s)
        believed_pose = run.pictures[name].believed_map_from_camera
        yield KeptFrame(
            file=name,
            arm=evidence.arm,
            algorithm=evidence.algorithm,
            evidence_s=evidence.evidence_s,
            values=dict(evidence.values),
            believed_map_from_camera=(believed_pose.rotation.tolist(), believed_pose.translation_m.tolist()),
        )


def _decisions(run: LabRun, trial: Trial) -> Sequence[Decision]:
    values_by_arm = {arm.name: _returned_values(arm) for arm in run.arms}
    answering_values = values_by_arm.get(trial.answering_arm or "", {})
    return [
        _decision(
            asked_decision,
            truth,
            run.arms,
            values_by_arm,
            _wrong_answer(asked_decision, truth, answering_values, run.looks_s),
        )
        for asked_decision in run.asked_decisions
        if (truth := run.truth.get(asked_decision.variable)) is not None
    ]


_ReturnedValues = Mapping[tuple[str, float], Mapping[str, Any]]
"""The values that jobs returned. The key is the algorithm and the end of the evidence in s."""


def _returned_values(arm: ArmRun) -> _ReturnedValues:
    return {
        (event.name, event.details["evidence_s"][1]): event.details["values"]
        for event in arm.record.of(Kind.JOB)
        if event.what == "returned"
    }


def _decision(
    asked_decision: AskedDecision,
    truth: Sequence[Piece],
    arms: Sequence[ArmRun],
    returned_values: Mapping[str, _ReturnedValues],
    wrong_answer: Basis | None,
) -> Decision:
    true_value = value_at(truth, asked_decision.instant_s)
    held = {arm: reading.content for arm, reading in asked_decision.held.items()}
    return Decision(
        instant_s=asked_decision.instant_s,
        variable=asked_decision.variable,
        skill=asked_decision.skill,
        is_preview=asked_decision.since_s <= 0.0,
        truth=true_value,
        held=held,
        fresh={
            arm: reading.known and reading.evidence_s >= asked_decision.since_s
            for arm, reading in asked_decision.held.items()
        },
        held_after_wait={**held, **_held_after_wait(asked_decision, arms)},
        answer=asked_decision.answer,
        answered_s=asked_decision.answered_s,
        source=_source(asked_decision),
        waited_s=asked_decision.waited_s,
        looked_s=asked_decision.looked_s,
        has_looked=asked_decision.has_looked,
        unanswered=_unanswered_reason(asked_decision),
        wrong={
            arm: _basis(reading, truth, returned_values[arm])
            for arm, reading in asked_decision.held.items()
            if reading.known and reading.content != true_value
        },
        wrong_answer=wrong_answer,
    )


def _held_after_wait(asked_decision: AskedDecision, arms: Sequence[ArmRun]) -> Mapping[str, Value | None]:
    """Return the value that each arm held at the end of the wait for observers; nothing if there was no wait."""
    end_s = asked_decision.answered_s - asked_decision.looked_s
    waited_arms = arms if asked_decision.waited_s else ()
    return {arm.name: value_known_by(arm.record, asked_decision.variable, end_s) for arm in waited_arms}


def _source(asked_decision: AskedDecision) -> str:
    reading = asked_decision.last_reading
    return "" if asked_decision.has_looked or reading is None else reading.source


def _unanswered_reason(asked_decision: AskedDecision) -> str:
    if not asked_decision.has_looked or asked_decision.last_reading is None:
        return ""
    return BEFORE_THE_ACTION if asked_decision.last_reading.reason is None else asked_decision.last_reading.reason.value


def _wrong_answer(
    asked_decision: AskedDecision, truth: Sequence[Piece], returned_values: _ReturnedValues, looks_s: Sequence[float]
) -> Basis | None:
    """Return the basis of an answer that was not true when it was given; None if the answer was true or missing."""
    if asked_decision.answer is None or asked_decision.answer == value_at(truth, asked_decision.answered_s):
        return None
    if asked_decision.last_reading is not None and not asked_decision.has_looked:
        return _basis(asked_decision.last_reading, truth, returned_values)
    own_looks_s = [
        instant_s for instant_s in looks_s if asked_decision.instant_s <= instant_s <= asked_decision.answered_s
    ]
    evidence_s = own_looks_s[-1] if own_looks_s else asked_decision.answered_s
    return Basis(
        algorithm=OWN_LOOK,
        evidence_s=evidence_s,
        values={},
        was_true=value_at(truth, evidence_s) == asked_decision.answer,
        frame=_frame_file(evidence_s) if own_looks_s else "",
    )


def _basis(reading: Reading[Any], truth: Sequence[Piece], returned_values: _ReturnedValues) -> Basis:
    values = returned_values.get((reading.source, reading.evidence_s))
    is_from_frame = values is not None and "distance" not in values
    return Basis(
        algorithm=reading.source,
        evidence_s=reading.evidence_s,
        values=dict(values or {}),
        was_true=value_at(truth, reading.evidence_s) == reading.content,
        frame=_frame_file(reading.evidence_s) if is_from_frame else "",
    )


def value_at(pieces: Sequence[Piece], instant_s: float) -> Value | None:
    """Return the value at an instant. From the end of the last piece on, return the value of the last piece."""
    for piece in pieces:
        if instant_s < piece.end_s:
            return piece.value
    return pieces[-1].value if pieces else None
