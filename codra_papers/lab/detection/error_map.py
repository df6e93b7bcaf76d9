"""The map of detection error: the accuracy of tag and lid measurements by distance, viewing angle and number of tags.

The map is measured, not fitted: `python -m codra_papers.lab.detection.error_map FOLDER` draws frames, measures in these
frames, and writes the map as a table and as a picture. The robot is at rest in ordinary light, so the map shows the
best case. `docs/papers/protocol.md` shows the checked-in map, and a test measures it again.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields
from itertools import product
from math import atan2, cos, pi, sin
from pathlib import Path
from random import Random

import numpy as np

from codra_papers.lab.detection.rows import MapRow
from codra_papers.lab.perception.frame import Frame, StillCamera
from codra_papers.lab.perception.functions import localize_lid
from codra_papers.lab.perception.layout import MACHINES, Machine, Part, Tag
from codra_papers.lab.perception.poses import Array, Pose, looking_at
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.simulator.camera import FrameSource
from codra_papers.lab.simulator.geometric_camera import GeometricCamera, TagInView
from codra_papers.lab.simulator.scene import ROOM_M
from codra_papers.lab.simulator.world import JointKey, LabState, LabWorld, Quantity

SEED = 77
DISTANCES_M = (0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0)
ANGLES_DEG = (0, 15, 30, 45, 60, 75)
VIEWS_PER_CELL = 20
"""Number of frames for each machine, distance and angle."""

WRONG_SIDE_RAD = 0.3
"""If a lid's angle is wrong by more than this, the pose of a tag was confused with its mirror image."""

RANGES_M = ((0.0, 0.9), (0.9, 1.8), (1.8, 9.0))
"""Ranges of distance that group the lid measurements."""

_PLACEMENT_TRIES = 400
_BASE_BEHIND_CAMERA_M = 0.7


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Measurements in one frame: of the tag in front of which the camera was placed, and of the lid.

    Attributes:
        machine: the name of the machine.
        distance_m: the distance of the camera from the tag.
        angle_deg: the viewing angle of the tag.
        is_whole: whether the tag is completely in the image and not hidden.
        corner_error_px: the error of the worst corner; None if the tag was not detected.
        lid_error_rad: the error of the lid's angle; None if the angle could not be measured.
        lid_marker_count: the number of tags on base and lid from which the lid's angle is computed.
    """

    machine: str
    distance_m: float
    angle_deg: int
    is_whole: bool
    corner_error_px: float | None
    lid_error_rad: float | None
    lid_marker_count: int


@dataclass(frozen=True, slots=True)
class _TimelessJob:
    """The argument `job` of perception functions that take no time."""

    random: Random = field(default_factory=lambda: Random(SEED))
    index: int = 0
    cancelled: bool = False

    def now_s(self) -> float:
        return 0.0

    def sleep(self, duration_s: float) -> None:
        """Do nothing."""

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Do nothing."""


def views(cells: Iterable[tuple[str, float, int]], views_per_cell: int = VIEWS_PER_CELL) -> list[View]:
    """Draw frames, measure in these frames, and return the measurements.

    Args:
        cells: the name of the machine, the distance in metres and the viewing angle in degrees of each cell.
        views_per_cell: how many frames are drawn for each cell.
    """
    measured_views: list[View] = []
    geometry = GeometricCamera()
    for machine, distance_m, angle_deg in cells:
        random = Random(f"{SEED} {machine} {distance_m} {angle_deg}")
        world = LabWorld(SEED)
        with FrameSource(world) as frames:
            for number in range(views_per_cell):
                tag = _place_camera(world, random, MACHINES[machine], distance_m, angle_deg, at_s=2.0 * number)
                if tag is not None:
                    instant_s = 2.0 * number + 1.0
                    tags_by_id = {view.tag_id: view for view in geometry.tags_in_view(world.state(instant_s))}
                    frame, state = frames.frame_at(instant_s), world.state(instant_s)
                    measured_views.append(
                        _view(frame, state, machine, (distance_m, angle_deg), tags_by_id.get(tag.tag_id))
                    )
    return measured_views


def _place_camera(
    world: LabWorld, random: Random, machine: Machine, distance_m: float, angle_deg: int, *, at_s: float
) -> Tag | None:
    """Turn the machine's lid and place the camera in front of one of the machine's tags.

    Return the tag, or None if the room has no space for the camera.
    """
    tags = [tag for tag in machine.tags if tag.part in (Part.BASE, Part.LID)]
    for _ in range(_PLACEMENT_TRIES):
        lid_rad = random.uniform(*machine.joint(Part.LID).range_rad)
        tag = random.choice(tags)
        map_from_tag = machine.map_from_part(tag.part, lid_rad) @ tag.part_from_tag
        eye_m = map_from_tag.apply(_direction(random, angle_deg) * distance_m)
        if not _has_room(machine, eye_m):
            continue
        offset_m = distance_m * np.array([random.uniform(-0.4, 0.4), random.uniform(-0.3, 0.3), 0.0])
        target_m = map_from_tag.translation_m + looking_at(eye_m, map_from_tag.translation_m).rotation @ offset_m
        _place_robot(world, eye_m, target_m, at_s)
        world.schedule(at_s, [world.moves_to(at_s, JointKey(machine.name, Part.LID), (lid_rad,), 0.0)])
        return tag
    return None


def _direction(random: Random, angle_deg: int) -> Array:
    """Return a unit vector in a tag's frame, at an angle to the tag's normal and in a random direction around it."""
    angle_rad, side_rad = angle_deg * pi / 180, random.uniform(-pi, pi)
    return np.array([sin(angle_rad) * cos(side_rad), sin(angle_rad) * sin(side_rad), cos(angle_rad)])


def _has_room(machine: Machine, eye_m: Array) -> bool:
    """Return whether an arm's camera can be at a point: in the room, in front of the machine, and 0.5 to 1.6 m high."""
    eye_in_machine_m = machine.map_from_base.inverse().apply(eye_m)
    is_in_room = bool(np.all(eye_m[:2] > 0.2) and np.all(eye_m[:2] < np.array(ROOM_M) - 0.2))
    return is_in_room and 0.5 < eye_m[2] < 1.6 and bool(eye_in_machine_m[0] > 0.2 and eye_in_machine_m[2] > 0.0)


def _place_robot(world: LabWorld, eye_m: Array, target_m: Array, at_s: float) -> None:
    """Move the robot instantly, such that its camera is at `eye_m` and looks at `target_m`."""
    heading_rad = atan2(target_m[1] - eye_m[1], target_m[0] - eye_m[0])
    base = (
        eye_m[0] - _BASE_BEHIND_CAMERA_M * cos(heading_rad),
        eye_m[1] - _BASE_BEHIND_CAMERA_M * sin(heading_rad),
        heading_rad,
    )
    robot_from_map = Pose.planar(*base).inverse()
    gaze = np.concatenate((robot_from_map.apply(eye_m), robot_from_map.apply(target_m)))
    jumps = {Quantity.BASE: base, Quantity.GAZE: tuple(gaze.tolist())}
    world.schedule(at_s, [world.moves_to(at_s, channel, values, 0.0) for channel, values in jumps.items()])


def _view(frame: Frame, state: LabState, machine: str, cell: tuple[float, int], tag: TagInView | None) -> View:
    corners_by_tag = {detection.tag_id: detection.corners_px for detection in detect(frame)}
    lid = localize_lid(machine=machine, camera=StillCamera(frame), job=_TimelessJob())
    true_rad = state.joints_rad[JointKey(machine, Part.LID)]
    is_whole = tag is not None and tag.margin_px >= 4.0 and tag.covered == 0.0
    corner_error_px = None
    if tag is not None and tag.tag_id in corners_by_tag:
        corner_error_px = float(np.linalg.norm(corners_by_tag[tag.tag_id] - tag.corners_px, axis=1).max())
    return View(
        machine=machine,
        distance_m=cell[0],
        angle_deg=cell[1],
        is_whole=is_whole,
        corner_error_px=corner_error_px,
        lid_error_rad=None if lid["lid_angle"] is None else abs(lid["lid_angle"] - true_rad),
        lid_marker_count=lid["markers"],
    )


def table(measured_views: Sequence[View]) -> list[MapRow]:
    """Return the rows of the map: one row for each cell that has measurements."""
    return [*_tag_rows(measured_views), *_lid_rows(measured_views)]


def _tag_rows(measured_views: Sequence[View]) -> Iterator[MapRow]:
    for machine, distance_m, angle_deg in dict.fromkeys((v.machine, v.distance_m, v.angle_deg) for v in measured_views):
        cell_views = [
            v for v in measured_views if (v.machine, v.distance_m, v.angle_deg) == (machine, distance_m, angle_deg)
        ]
        complete_views = [view for view in cell_views if view.is_whole]
        errors = [view.corner_error_px for view in complete_views if view.corner_error_px is not None]
        yield MapRow(
            about="tag",
            machine=machine,
            distance_m=f"{distance_m:g}",
            angle_deg=angle_deg,
            markers=None,
            samples=len(complete_views),
            found_share=round(len(errors) / len(complete_views), 3) if complete_views else None,
            error_median=_quantile(errors, 0.5),
            error_p95=_quantile(errors, 0.95),
            wrong_side_share=None,
        )


def _lid_rows(measured_views: Sequence[View]) -> Iterator[MapRow]:
    machines = dict.fromkeys(view.machine for view in measured_views)
    for machine, (from_m, to_m), markers in product(machines, RANGES_M, range(2, 8)):
        errors = [
            view.lid_error_rad
            for view in measured_views
            if view.machine == machine and from_m <= view.distance_m < to_m and view.lid_marker_count == markers
            if view.lid_error_rad is not None
        ]
        if errors:
            yield MapRow(
                about="lid",
                machine=machine,
                distance_m=f"{from_m:g} to {min(to_m, max(DISTANCES_M)):g}",
                angle_deg=None,
                markers=markers,
                samples=len(errors),
                found_share=None,
                error_median=_quantile(errors, 0.5),
                error_p95=_quantile(errors, 0.95),
                wrong_side_share=round(sum(error > WRONG_SIDE_RAD for error in errors) / len(errors), 3),
            )


def _quantile(errors: Sequence[float], share: float) -> float | None:
    return round(float(np.quantile(errors, share)), 3) if errors else None


def write_table(rows: Sequence[MapRow], path: Path) -> None:
    """Write the map as CSV. The first line has the names of the columns."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(column.name for column in fields(MapRow))
        writer.writerows(["" if value is None else value for value in astuple(row)] for row in rows)


def read_table(path: Path) -> list[Mapping[str, str]]:
    """Return the rows of a map that was written as CSV. The keys of a row are the names of the columns."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def main(folder: Path) -> None:
    """Measure the complete map and write it into a folder: `detection-map.csv` and `detection-map.svg`."""
    from codra_papers.lab.detection.error_picture import draw  # it needs matplotlib

    rows = table(views(product(MACHINES, DISTANCES_M, ANGLES_DEG)))
    write_table(rows, folder / "detection-map.csv")
    draw(rows, folder / "detection-map.svg")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
