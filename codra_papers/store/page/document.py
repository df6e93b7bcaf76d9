"""The page's HTML: a template, a style sheet and a script from the package, and a map drawn from the layout."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from math import degrees

from jinja2 import Environment, PackageLoader, StrictUndefined

from codra_papers.store.geometry import Box, Pose2D
from codra_papers.store.knowledge import named_floor_poses
from codra_papers.store.layout import (
    AREAS,
    BODY_BACK_M,
    BODY_FRONT_M,
    BODY_WIDTH_M,
    CONTAINER_M,
    DEPTH_M,
    FIXED_BOXES,
    FORK_TIP_M,
    FORK_WIDTH_M,
    LENGTH_M,
    PICKING_AREAS,
    Area,
)
from codra_papers.store.simulator.people import PERSON_RADIUS_M
from codra_papers.store.simulator.state import Load

PACKAGE = "codra_papers.store.page"
MARGIN_M = 0.3
LABEL_DISTANCE_M = 0.63
"""Distance between the middle of a container's place and a label beside it."""


@cache
def static_text(name: str) -> str:
    """Return the text of a static file of the page."""
    return files(PACKAGE).joinpath("files", name).read_text("utf-8")


@cache
def page_html() -> str:
    """Return the page without values from the graph. On the map, x points east and -y points north, in metres."""
    environment = Environment(
        loader=PackageLoader(PACKAGE, "files"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    template = environment.get_template("page.html.j2")
    return template.render(
        areas={name: display_name(name) for name in PICKING_AREAS},
        loads=[load.value for load in Load],
        box=f"{-MARGIN_M} {-DEPTH_M - MARGIN_M} {LENGTH_M + 2 * MARGIN_M} {DEPTH_M + 2 * MARGIN_M}",
        shelves=[_points_text(box) for box in FIXED_BOXES],
        places=[_points_text(Box(place, CONTAINER_M, CONTAINER_M)) for area in AREAS.values() for place in area.places],
        poses=[
            _pose_mark(name, pose) for name, pose in named_floor_poses().items() if "_pose_" in name or "_" not in name
        ],
        names=[(display_name(area.name), *_map_coordinates(_label_pose(area))) for area in AREAS.values()],
        body=(BODY_BACK_M, -BODY_WIDTH_M / 2, BODY_FRONT_M - BODY_BACK_M, BODY_WIDTH_M),
        fork=(FORK_TIP_M, -FORK_WIDTH_M / 2, BODY_BACK_M - FORK_TIP_M, FORK_WIDTH_M),
        container=(-CONTAINER_M / 2, CONTAINER_M),
        person_radius=PERSON_RADIUS_M,
    )


def display_name(name: str) -> str:
    """Return a name of the map as text for people."""
    return name.replace("_", " ").capitalize()


def _label_pose(area: Area) -> Pose2D:
    """Return the position of an area's label: between the places of containers, or beside the only place."""
    first, last = area.places[0], area.places[-1]
    y_m = (first.y_m + last.y_m) / 2 if len(area.places) > 1 else first.y_m + LABEL_DISTANCE_M
    return Pose2D(first.x_m + 0.2, y_m)


def _points_text(box: Box) -> str:
    return " ".join(f"{x_m:.3f},{-y_m:.3f}" for x_m, y_m in box.corners())


def _map_coordinates(pose: Pose2D) -> tuple[float, float]:
    return round(pose.x_m, 3), round(-pose.y_m, 3)


def _pose_mark(name: str, pose: Pose2D) -> tuple[str, float, float, float]:
    """Return the label, place and angle of a named pose."""
    label = name.rpartition("_")[2] if "_pose_" in name else display_name(name)
    return (label, *_map_coordinates(pose), round(-degrees(pose.heading_rad), 1))
