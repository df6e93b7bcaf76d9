"""The map of the shop as a picture: shelves, named poses, people, containers, the robot, and its path."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, degrees, sin
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Wedge

from codra_papers.store.body import CAMERA_FARTHEST_M, CAMERA_POSE, CAMERA_VIEW_RAD
from codra_papers.store.geometry import Box, Point, Pose2D
from codra_papers.store.knowledge import named_floor_poses
from codra_papers.store.layout import AREAS, DEPTH_M, FIXED_BOXES, LENGTH_M
from codra_papers.store.simulator.people import PERSON_RADIUS_M
from codra_papers.store.simulator.state import Load, StoreState

SHELF_COLOUR, ROBOT_COLOUR, PERSON_COLOUR, PATH_COLOUR, POSE_COLOUR = (
    "#9aa5ad",
    "#1f6f8b",
    "#c2452d",
    "#e0a030",
    "#5a6b75",
)
LOAD_COLOURS = {Load.EMPTY: "#ffffff", Load.LOADING: "#cfe3b8", Load.FULL: "#6a9a3b"}


def draw_store(path: Path, state: StoreState, driven_m: Sequence[Point] = ()) -> None:
    """Draw the shop at one instant.

    Args:
        path: the file to write; its suffix (`.png`, `.svg`) selects the format.
        state: the true state.
        driven_m: the path of the robot so far.
    """
    figure = Figure(figsize=(10, 7.8), layout="constrained")
    axes = figure.add_subplot()
    for box in FIXED_BOXES:
        axes.add_patch(Polygon(box.corners(), facecolor=SHELF_COLOUR, edgecolor="none"))
    _draw_poses(axes)
    if driven_m:
        axes.plot(*zip(*driven_m, strict=True), color=PATH_COLOUR, linewidth=1.8, label="driven")
    _draw_robot(axes, state)
    for container in (*state.containers_on_floor(), *filter(None, (state.carried_container(),))):
        _draw_box(axes, container.box(), LOAD_COLOURS[container.load], "#3d5a22")
    for name, at_m in state.people_m:
        axes.add_patch(Circle(at_m, PERSON_RADIUS_M, facecolor=PERSON_COLOUR, edgecolor="none", zorder=5))
        axes.annotate(name, at_m, xytext=(5, 5), textcoords="offset points", fontsize=7, color=PERSON_COLOUR)
    axes.set_xlim(-0.3, LENGTH_M + 0.3)
    axes.set_ylim(-0.3, DEPTH_M + 0.3)
    axes.set_aspect("equal")
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
    axes.set_title(f"the shop at {state.instant_s:.1f} s, battery {state.robot.battery_percent:.1f} %", fontsize=10)
    with mpl.rc_context({"svg.hashsalt": "codra"}):
        figure.savefig(path, dpi=100, metadata={"Date": None} if path.suffix == ".svg" else None)


def _draw_robot(axes: Axes, state: StoreState) -> None:
    robot_pose = state.robot.at
    eye = Pose2D(*robot_pose.point_at(CAMERA_POSE.x_m, CAMERA_POSE.y_m), robot_pose.heading_rad)
    middle, half = degrees(robot_pose.heading_rad), degrees(CAMERA_VIEW_RAD) / 2
    view = Wedge(
        eye.point_m, CAMERA_FARTHEST_M, middle - half, middle + half, facecolor=ROBOT_COLOUR, alpha=0.1, zorder=0
    )
    axes.add_patch(view)
    for part in (state.robot.fork(), state.robot.body()):
        _draw_box(axes, part, ROBOT_COLOUR, "#0d3a4a")


def _draw_box(axes: Axes, box: Box, colour: str, edge: str) -> None:
    axes.add_patch(Polygon(box.corners(), facecolor=colour, edgecolor=edge, linewidth=1.0, zorder=4))


def _draw_poses(axes: Axes) -> None:
    for name, pose in named_floor_poses().items():
        if name.endswith("_approach"):
            continue
        arrow_m = (0.45 * cos(pose.heading_rad), 0.45 * sin(pose.heading_rad))
        axes.arrow(
            *pose.point_m, *arrow_m, color=POSE_COLOUR, width=0.02, head_width=0.16, length_includes_head=True, zorder=2
        )
        label = name.removesuffix("_delivery") if name.endswith("_delivery") else name.split("_pose_")[-1]
        axes.annotate(
            label, pose.point_m, xytext=(4, -9), textcoords="offset points", fontsize=6.5, color=POSE_COLOUR, zorder=2
        )
    for area in AREAS.values():
        for place in area.places:
            half = 0.35
            corners = Box(place, 2 * half, 2 * half).corners()
            axes.add_patch(Polygon(corners, fill=False, edgecolor=POSE_COLOUR, linestyle=":", linewidth=0.8, zorder=1))
