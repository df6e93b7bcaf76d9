"""The tables that are printed after a run in the laboratory, and the pictures of the run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from codra_dsl.runtime import Cost
from codra_dsl.runtime.journal import Kind
from codra_papers.experiments.lab.metrics import seconds_by_truth
from codra_papers.experiments.lab.pictures import draw_timeline
from codra_papers.experiments.lab.run import OBSERVED, ArmRun, LabRun
from codra_papers.experiments.lab.tables import score_table, text_table, values_text
from codra_papers.lab.detection.drawing import draw_detections
from codra_papers.lab.perception.frame import Frame

_CAMERA_JOBS, _DISTANCE_POLLS = "all that look at frames", "all distance polls"
_JOB_ENDS = ("accepted", "rejected", "voided", "failed", "cancelled")
_TIME_LABELS = MappingProxyType({"waiting_s": "waiting s", "perception_s": "perception s", "slot_s": "slot-seconds"})
_ANSWER_LABELS = MappingProxyType(
    {"answered": "from context", OBSERVED: "of these, by observers", "fell_back": "fell back"}
)

_EXPLANATIONS = """\
right/held     right seconds as a share of the seconds with a known value
balanced       the mean of this share over the true values; constant: the share of the most frequent true value
identified     how often an observer gave the variable a value; first at s: when this first happened
jobs           accepted gave a value to at least one variable, rejected to none; voided: the evidence does not count,
               because a precondition failed while it was taken; cancelled: no longer needed
waiting s      seconds in which jobs waited for slots; slot-seconds: the seconds of jobs, times the slots they held
from context   decisions that context answered; of these, by observers: those on the evidence of an observer, not on
               an earlier look of the robot; fell back: the robot looked by itself
"""


def run_text(run: LabRun, camera_algorithms: Sequence[str]) -> str:
    """Return the tables of a run, and what their heads mean.

    Args:
        run: the run.
        camera_algorithms: the algorithms that look at frames.
    """
    tables = (_jobs_text(run, camera_algorithms), _costs_text(run), _decisions_text(run), _EXPLANATIONS)
    return "\n".join((_summary(run), *(_scores_text(arm, run) for arm in run.arms), *tables))


def write_pictures(run: LabRun, folder: Path, labels: Mapping[str, str]) -> Iterator[Path]:
    """Write the event log of each arm, the frames with the detected tags drawn into them, and the timeline.

    Yield the path of each file after the file was written.

    Args:
        run: the run to show.
        folder: the folder for the files, which is created if it does not exist.
        labels: the label of each variable.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for arm in run.arms:
        path = folder / f"record-{arm.name}.jsonl"
        path.write_text(arm.record.text(), encoding="utf-8")
        yield path
    for name, frame in run.pictures.items():
        path = folder / f"frame-{name}.png"
        arms = [arm for arm in run.arms if name.startswith(f"{arm.name}-")]
        draw_detections(frame, path, [note for arm in arms for note in frame_notes(arm, frame, run)])
        yield path
    path = folder / "timeline.png"
    draw_timeline(path, run, labels)
    yield path


def frame_notes(arm: ArmRun, frame: Frame, run: LabRun) -> Iterator[str]:
    """Yield what an arm measured in a frame, and the values that it identified from the frame, with the true values."""
    for event in arm.record.of(Kind.JOB):
        if event.what == "returned" and event.details["evidence_s"][1] == frame.stamp_s:
            yield f"{event.name} measured: {values_text(event.details['values'])}"
    for event in arm.record.of(Kind.VARIABLE):
        if event.what == "identified" and event.details["evidence_s"] == frame.stamp_s and event.name in run.truth:
            value = event.details["value"]
            facts = [piece.value for piece in run.truth[event.name] if piece.start_s <= frame.stamp_s < piece.end_s]
            verdict = ": WRONG" if facts and facts[0] != value else ""
            true_text = ", ".join(str(fact).lower() for fact in facts)
            yield f"{event.name}: held {str(value).lower()}, true value {true_text}{verdict}"


def _summary(run: LabRun) -> str:
    loops = f"{run.loops} sample-processing loop{'' if run.loops == 1 else 's'}"
    end_text = f", ended by: {run.error}" if run.error else ""
    return f"{run.duration_s:.1f} s, {loops}, {run.frames} frames rendered{end_text}\n"


def _scores_text(arm: ArmRun, run: LabRun) -> str:
    by_truth = {name: seconds_by_truth(arm.held[name], truth) for name, truth in run.truth.items()}
    return f"{arm.name}\n{score_table(arm.scores, by_truth)}"


def _jobs_text(run: LabRun, camera_algorithms: Sequence[str]) -> str:
    """Return the table of started jobs. Jobs that look at frames are added up apart from distance polls."""
    names = sorted({name for arm in run.arms for name in arm.jobs})
    rows = [(name, *(str(arm.jobs.get(name, 0)) for arm in run.arms)) for name in names]
    camera_counts = [sum(arm.jobs.get(name, 0) for name in camera_algorithms) for arm in run.arms]
    poll_counts = [
        sum(arm.jobs.values()) - camera_count for arm, camera_count in zip(run.arms, camera_counts, strict=True)
    ]
    totals = [
        (title, *map(str, counts)) for title, counts in ((_CAMERA_JOBS, camera_counts), (_DISTANCE_POLLS, poll_counts))
    ]
    return text_table(("jobs started", *(arm.name for arm in run.arms)), [*rows, *totals])


def _costs_text(run: LabRun) -> str:
    costs = run.arms[0].spent.values()
    totals = {
        _CAMERA_JOBS: sum((cost for cost in costs if cost.slot_s > 0.0), Cost()),
        _DISTANCE_POLLS: sum((cost for cost in costs if cost.slot_s == 0.0), Cost()),
    }
    rows = [
        (
            name,
            *(str(getattr(cost, job_end)) for job_end in _JOB_ENDS),
            *(f"{getattr(cost, time_name):.1f}" for time_name in _TIME_LABELS),
        )
        for name, cost in {**run.arms[0].spent, **totals}.items()
    ]
    return text_table((f"spent by {run.arms[0].name}", *_JOB_ENDS, *_TIME_LABELS.values()), rows)


def _decisions_text(run: LabRun) -> str:
    counts_by_variable = {**run.decisions, "all": sum(run.decisions.values(), Counter())}
    rows = [(name, *(str(counts[answer]) for answer in _ANSWER_LABELS)) for name, counts in counts_by_variable.items()]
    return text_table(("decisions", *_ANSWER_LABELS.values()), rows)
