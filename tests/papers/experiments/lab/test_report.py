"""The pictures of a run in the laboratory, from a run that is written down here."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from codra_dsl.runtime import EventLog
from codra_dsl.runtime.journal import Event, Kind
from codra_papers.experiments.lab.fanout import AskedDecision, SkillSpan
from codra_papers.experiments.lab.pictures import WRONG_COLOUR, draw_timeline
from codra_papers.experiments.lab.report import frame_notes
from codra_papers.experiments.lab.run import ArmRun, LabRun
from codra_papers.experiments.lab.scoring import Piece, held_pieces
from codra_papers.lab.detection.drawing import draw_detections
from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.layout import INTRINSICS
from codra_papers.lab.perception.poses import Pose

TRUTH = {"lid_open": (Piece(0.0, 10.0, False),)}


def arm_of(name: str, value: bool) -> ArmRun:
    """Return an arm that measured a lid in a frame of 4 s, and held a value from 5 s on."""
    record = EventLog()
    record.add(Event(5.0, Kind.JOB, "look", "returned", {"values": {"lid_angle": 0.68416}, "evidence_s": [4.0, 4.0]}))
    identified = {"value": value, "source": "look", "present": True, "evidence_s": 4.0}
    record.add(Event(5.0, Kind.VARIABLE, "lid_open", "identified", identified))
    held = held_pieces(record, ["lid_open"], 10.0)
    return ArmRun(name=name, record=record, held=held, scores=[], jobs={}, spent={})


def decision_at(instant_s: float, has_looked: bool) -> AskedDecision:
    return AskedDecision(
        instant_s=instant_s,
        variable="lid_open",
        skill="open_lid",
        since_s=0.0,
        held={},
        answer=False,
        answered_s=instant_s,
        waited_s=0.0,
        looked_s=0.0,
        last_reading=None,
        has_looked=has_looked,
    )


def run_of(*arms: ArmRun) -> LabRun:
    return LabRun(
        duration_s=10.0,
        loops=1,
        error=None,
        interruptions=(),
        frames=1,
        perceived=1,
        looks_s=(),
        arms=arms,
        truth=TRUTH,
        asked_decisions=(decision_at(6.0, has_looked=False), decision_at(8.0, has_looked=True)),
        skills=(SkillSpan(name="open_lid", start_s=2.0, end_s=9.0),),
        decisions={},
        pictures={},
    )


def frame_at(stamp_s: float) -> Frame:
    return Frame(
        pixels=np.full((INTRINSICS.height, INTRINSICS.width, 3), 128, dtype=np.uint8),
        intrinsics=INTRINSICS,
        believed_map_from_camera=Pose(rotation=np.eye(3), translation_m=np.zeros(3)),
        stamp_s=stamp_s,
    )


def test_a_timeline_names_each_lane_and_skill_and_colours_only_wrong_values_as_wrong(tmp_path: Path) -> None:
    texts = {}
    for name, value in (("right", False), ("wrong", True)):
        path = tmp_path / f"{name}.svg"
        draw_timeline(path, run_of(arm_of("naive", value)), {"lid_open": "lid is open"})
        texts[name] = path.read_text("utf-8")

    assert all(
        f"<!-- {words} -->" in texts["right"] for words in ("truth", "naive", "skills", "open_lid", "lid is open")
    )
    assert texts["wrong"].count(WRONG_COLOUR) > texts["right"].count(WRONG_COLOUR)


def test_the_notes_of_a_frame_have_what_was_measured_the_held_value_and_the_truth() -> None:
    arm = arm_of("naive", value=True)

    notes = list(frame_notes(arm, frame_at(4.0), run_of(arm)))

    assert notes == ["look measured: lid_angle 0.684", "lid_open: held true, true value false: WRONG"]


def test_a_frame_from_which_nothing_was_measured_has_no_notes() -> None:
    arm = arm_of("naive", value=True)

    assert not list(frame_notes(arm, frame_at(3.0), run_of(arm)))


def test_a_right_value_is_not_noted_as_wrong() -> None:
    arm = arm_of("naive", value=False)

    notes = list(frame_notes(arm, frame_at(4.0), run_of(arm)))

    assert notes[1] == "lid_open: held false, true value false"


def test_notes_are_written_below_the_frame(tmp_path: Path) -> None:
    draw_detections(frame_at(4.0), tmp_path / "plain.png")
    draw_detections(frame_at(4.0), tmp_path / "noted.png", ["lid_open: held true"])

    plain, noted = (cv2.imread(str(tmp_path / f"{name}.png")) for name in ("plain", "noted"))
    assert plain is not None
    assert noted is not None

    assert np.array_equal(noted[: plain.shape[0]], plain)
    assert (noted[plain.shape[0] :] < 100).any()
