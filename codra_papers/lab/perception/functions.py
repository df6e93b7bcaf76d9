"""The perception functions of the laboratory's observers and its main execution, to which `specs/lab.yaml` refers.

A function uses its handles (a camera's frames, the base's own localisation) and the layout. The layout lists the places
of tags on parts, but not the angles of joints. No function knows the simulator or its caller.

A function takes its evidence at one instant, reports this instant, and then spends the time that such processing takes
on a robot. In P1, naive observers, which look again as soon as they have looked, made 5006 triggers in ten hours
(section 4.1). This is 7.2 s for each trigger. In this laboratory, a naive observer makes five vision calls per trigger:
`find_in_view` and `localize_lid` for each of the two machines, and `localize_rotor`. The mean times below add up to the
same duration: 2 x 0.4 s + 2 x 2.4 s + 1.6 s = 7.2 s.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import pi
from typing import Any

import numpy as np

from codra_dsl.runtime.perception import Job
from codra_papers.lab.perception.frame import Base, Camera, Frame, Intrinsics
from codra_papers.lab.perception.layout import Joint, Machine, Part, Tag, machine_named
from codra_papers.lab.perception.part_pose import PartPose, part_pose
from codra_papers.lab.perception.processing import processing_s
from codra_papers.lab.perception.sharpness import sharpness
from codra_papers.lab.perception.tags import detect

MEASURE_DISTANCE_S = 0.25
"""Mean time of `measure_distance`, which asks the localisation."""

FIND_IN_VIEW_S = 0.4
"""Mean time of `find_in_view`, which searches for tags once."""

LOCALIZE_LID_S = 2.4
"""Mean time of `localize_lid`, which fits the poses of two parts and a latch and updates the object's pose."""

LOCALIZE_ROTOR_S = 1.6
"""Mean time of `localize_rotor`."""

_POSE_CACHE_SIZE = 32
"""Number of poses that are cached. Observers of several arms use the same frame at nearly the same time, so a few poses
per part are enough."""


def measure_distance(*, machine: str, base: Base, job: Job) -> Mapping[str, Any]:
    """Measure the distance of the robot from a machine. Only the robot's localisation is used.

    Returns:
        `distance`: the horizontal distance in metres from the origin of the robot's base, at its believed pose, to the
        origin of the machine's base in the map.
    """
    start_s = job.now_s()
    distance_m = machine_named(machine).distance_m(base.believed_map_from_base())
    job.evidence(start_s, job.now_s())
    job.sleep(processing_s(job.random, MEASURE_DISTANCE_S))
    return {"distance": distance_m}


def find_in_view(*, machine: str, camera: Camera, job: Job) -> Mapping[str, Any]:
    """Measure how much of a machine is in the camera's view.

    Returns:
        `base_share`, `lid_share`: the percentage of the corners of the part's tags that the frame shows (see
        `_share_in_view`).
        `sharpness`: the quality of the frame (see `sharpness.sharpness`). In a sharp frame, an undetected tag is really
        not in view.
    """
    frame = _take_frame(camera, job)
    surveyed_machine = machine_named(machine)
    job.sleep(camera.processing_s(FIND_IN_VIEW_S))
    return {
        "base_share": _share_in_view(surveyed_machine, Part.BASE, frame),
        "lid_share": _share_in_view(surveyed_machine, Part.LID, frame),
        "sharpness": sharpness(frame),
    }


def localize_lid(*, machine: str, camera: Camera, job: Job) -> Mapping[str, Any]:
    """Measure the joint angles of a machine's lid and latch.

    Returns:
        `markers`: the number of tags on base and lid from which the poses are computed.
        `lid_angle`: the hinge's angle in rad; None unless base and lid were both localised. With few markers the angle
        may be far off (P1, section 4.1: too few visible markers for reliable localisation).
        `latched`: whether the lever is nearer to its locked than to its open end; None unless base and lever were
        localised.
    """
    return _lid_measurement(machine, camera, job, unseen_lid_rad=None)


def localize_lid_always(*, machine: str, camera: Camera, job: Job) -> Mapping[str, Any]:
    """Measure the same as `localize_lid`, but never without an answer about the lid of a machine whose base is seen.

    If the base is localised and the lid is not, the angle is that of a closed lid. P1's naive observer made this error
    (section 4.1): it "incorrectly identified that the centrifuge lid was closed multiple times".
    """
    return _lid_measurement(machine, camera, job, unseen_lid_rad=machine_named(machine).joint(Part.LID).range_rad[0])


def _lid_measurement(machine: str, camera: Camera, job: Job, *, unseen_lid_rad: float | None) -> Mapping[str, Any]:
    frame = _take_frame(camera, job)
    surveyed_machine = machine_named(machine)
    base, lid, latch = (_localized_part(surveyed_machine, part, frame) for part in (Part.BASE, Part.LID, Part.LATCH))
    latch_angle_rad = _joint_angle_rad(surveyed_machine.joint(Part.LATCH), base, latch)
    job.sleep(camera.processing_s(LOCALIZE_LID_S))
    return {
        "markers": _marker_count(base) + _marker_count(lid),
        "lid_angle": unseen_lid_rad
        if base is not None and lid is None
        else _joint_angle_rad(surveyed_machine.joint(Part.LID), base, lid),
        "latched": None
        if latch_angle_rad is None
        else latch_angle_rad < sum(surveyed_machine.joint(Part.LATCH).range_rad) / 2,
    }


def localize_rotor(*, machine: str, camera: Camera, job: Job) -> Mapping[str, Any]:
    """Measure the rotor angle of a centrifuge.

    Returns:
        `markers`: the number of tags from which the rotor's pose is computed.
        `rotor_angle`: the angle in rad, from -pi / 2 to 3 / 2 pi, so that neither of the two positions, 0 and pi, lies
        at an end of this range; None unless base and rotor were both localised.
    """
    frame = _take_frame(camera, job)
    surveyed_machine = machine_named(machine)
    base, rotor = (_localized_part(surveyed_machine, part, frame) for part in (Part.BASE, Part.ROTOR))
    angle_rad = _joint_angle_rad(surveyed_machine.joint(Part.ROTOR), base, rotor)
    job.sleep(camera.processing_s(LOCALIZE_ROTOR_S))
    return {
        "markers": _marker_count(rotor),
        "rotor_angle": None if angle_rad is None else (angle_rad + pi / 2) % (2 * pi) - pi / 2,
    }


def _take_frame(camera: Camera, job: Job) -> Frame:
    frame = camera.capture()
    job.evidence(frame.stamp_s, frame.stamp_s)
    return frame


@lru_cache(maxsize=_POSE_CACHE_SIZE)
def _localized_part(machine: Machine, part: Part, frame: Frame) -> PartPose | None:
    return part_pose(machine.tags_on(part), detect(frame), frame.intrinsics)


def _marker_count(pose: PartPose | None) -> int:
    return 0 if pose is None else len(pose.tag_ids)


def _joint_angle_rad(joint: Joint, base: PartPose | None, moving: PartPose | None) -> float | None:
    """Return the joint's angle, in (-pi, pi], that fits the poses of its two parts best; None if a pose is unknown."""
    if base is None or moving is None:
        return None
    base_from_moving = base.camera_from_part.inverse() @ moving.camera_from_part
    joint_rotation = joint.base_from_part.rotation.T @ base_from_moving.rotation
    axis = np.array(joint.axis)
    sine = axis @ (joint_rotation[[2, 0, 1], [1, 2, 0]] - joint_rotation[[1, 2, 0], [2, 0, 1]])
    cosine = np.trace(joint_rotation) - axis @ joint_rotation @ axis
    return float(np.arctan2(sine, cosine))


def _share_in_view(machine: Machine, part: Part, frame: Frame) -> float:
    """Return the percentage of the corners of a part's tags that a frame shows; 0 if the part could not be localised.

    A detected tag is shown with all four corners. A tag that the edge of the image cuts cannot be detected. The pose
    from the other tags determines which corners of a cut tag are inside the image, and these corners are shown. All
    other undetected tags are taken to be hidden or to face away. In 500 views, the share lies on the correct side of
    50 % in 93 of 100 cases. In one of 100 cases the share is too large. In six of 100 cases the share is too small;
    these are parts whose tags are seen at a slant.
    """
    pose = _localized_part(machine, part, frame)
    if pose is None:
        return 0.0
    tags = machine.tags_on(part)
    corner_counts = [
        4 if tag.tag_id in pose.tag_ids else _cut_tag_corner_count(tag, pose, frame.intrinsics) for tag in tags
    ]
    return 100.0 * sum(corner_counts) / (4 * len(tags))


def _cut_tag_corner_count(tag: Tag, pose: PartPose, intrinsics: Intrinsics) -> int:
    """Return how many corners of an undetected tag lie inside the image, if at least one corner lies outside.

    Return 0 for a tag that is completely inside the image, because the tag could have been detected. Also return 0 for
    a tag that faces away from the camera or is behind it.
    """
    camera_from_tag = pose.camera_from_part @ tag.part_from_tag
    corners_m = pose.camera_from_part.apply(tag.corners_m())
    faces_away = camera_from_tag.rotation[:, 2] @ camera_from_tag.translation_m >= 0.0
    if faces_away or corners_m[:, 2].min() <= 0.0:
        return 0
    corners_px = intrinsics.project(corners_m)
    last_px = np.array([intrinsics.width - 1.0, intrinsics.height - 1.0])
    inside_count = int(((corners_px >= 0.0) & (corners_px <= last_px)).all(axis=1).sum())
    return inside_count if inside_count < len(corners_px) else 0
