"""The drawn laboratory: the detector detects the tags at the places that the layout lists."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from math import pi

import numpy as np
import pytest

from codra_papers.lab.gaze import observation_gaze
from codra_papers.lab.perception.layout import MACHINES, Part, machine_named
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.simulator import gl
from codra_papers.lab.simulator.camera import FrameSource
from codra_papers.lab.simulator.scene import Stage
from codra_papers.lab.simulator.world import LabWorld, Quantity
from tests.papers.lab.perception.placing import place_robot_before, put, set_joint

OPEN_RAD = 1.35
UNLOCKED_RAD = 1.0
KNOWN_IDS = {tag.tag_id for machine in MACHINES.values() for tag in machine.tags}


class DrawnLab:
    """A laboratory that changes at once. Its source of frames is shared, because to begin to draw takes long."""

    def __init__(self) -> None:
        self.world = LabWorld(1)
        self.source = FrameSource(self.world)
        self.now_s = 0.0

    def look_at(self, machine: str, part: Part) -> None:
        self.now_s += 10.0
        place_robot_before(self.world, machine, observation_gaze(machine, part), at_s=self.now_s)

    def turn(self, machine: str, **angles_rad: float) -> None:
        """Turn some parts of a machine; the names are those of the parts."""
        self.now_s += 10.0
        for part, angle_rad in angles_rad.items():
            set_joint(self.world, machine, Part(part), angle_rad, at_s=self.now_s)

    def detected_ids(self) -> set[int]:
        return {detection.tag_id for detection in detect(self.source.frame_at(self.now_s + 1.0))}


@pytest.fixture(scope="module")
def lab() -> Iterator[DrawnLab]:
    drawn_lab = DrawnLab()
    yield drawn_lab
    drawn_lab.source.close()


def ids_on(machine: str, *parts: Part) -> set[int]:
    return {tag.tag_id for part in parts for tag in machine_named(machine).tags_on(part)}


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("part", [Part.LID, Part.LATCH])
@pytest.mark.parametrize(("lid_rad", "latch_rad"), [(0.0, 0.0), (0.0, UNLOCKED_RAD), (OPEN_RAD, UNLOCKED_RAD)])
def test_base_lid_and_latch_show_all_their_tags_from_where_the_robot_looks(
    lab: DrawnLab, machine: str, part: Part, lid_rad: float, latch_rad: float
) -> None:
    lab.look_at(machine, part)
    lab.turn(machine, lid=lid_rad, latch=latch_rad)

    tag_ids = lab.detected_ids()

    assert tag_ids >= ids_on(machine, Part.BASE, Part.LID, Part.LATCH)
    assert tag_ids <= KNOWN_IDS


@pytest.mark.parametrize("rotor_rad", [0.0, pi])
def test_the_rotor_shows_its_tags_through_the_open_lid_only(lab: DrawnLab, rotor_rad: float) -> None:
    lab.look_at("centrifuge", Part.ROTOR)
    lab.turn("centrifuge", lid=0.0, rotor=rotor_rad)
    ids_behind_lid = lab.detected_ids()
    lab.turn("centrifuge", lid=OPEN_RAD)
    ids_through_open_lid = lab.detected_ids()

    assert not ids_behind_lid & ids_on("centrifuge", Part.ROTOR)
    assert ids_through_open_lid >= ids_on("centrifuge", Part.ROTOR)


def test_a_look_around_the_room_shows_no_unknown_tag() -> None:
    world = LabWorld(1)
    for step in range(12):
        put(world, Quantity.BASE, 3.0, 3.0, step * pi / 6, at_s=float(step))

    with FrameSource(world) as source:
        tag_ids = {detection.tag_id for step in range(12) for detection in detect(source.frame_at(step + 0.5))}

    assert tag_ids <= KNOWN_IDS


def test_tags_are_unique_in_the_laboratory() -> None:
    ids = [tag.tag_id for machine in MACHINES.values() for tag in machine.tags]

    assert len(ids) == len(set(ids))


def test_the_large_machine_carries_fewer_tags_and_farther_apart_than_the_compact_one() -> None:
    compared_tags = {
        name: [tag for tag in machine.tags if tag.part in {Part.BASE, Part.LID}] for name, machine in MACHINES.items()
    }
    width_m = {
        name: np.ptp([tag.part_from_tag.translation_m[1] for tag in tags]) for name, tags in compared_tags.items()
    }

    assert len(compared_tags["centrifuge"]) < len(compared_tags["pcr_cycler"])
    assert width_m["centrifuge"] > 2 * width_m["pcr_cycler"]


def test_a_ray_ends_on_the_first_body_in_its_way() -> None:
    stage = Stage()
    world = LabWorld(1)
    stage.place(world.state(0.0))
    over_the_lid = machine_named("centrifuge").map_from_base.apply(np.array([0.0, 0.0, 1.0]))
    rotor = machine_named("centrifuge").map_from_part(Part.ROTOR, 0.0).translation_m
    lid_top = machine_named("centrifuge").map_from_base.apply(np.array([0.0, 0.0, 0.455]))

    to_lid, to_rotor = stage.first_hit(over_the_lid, np.array([lid_top, rotor]))

    assert to_lid == pytest.approx(1.0)
    assert to_rotor == pytest.approx((1.0 - 0.455) / (1.0 - 0.28))


def test_the_layout_knows_no_other_machine() -> None:
    with pytest.raises(ValueError, match="no machine 'fridge' in the laboratory; its machines are centrifuge, pcr_"):
        machine_named("fridge")


def test_the_backend_that_was_chosen_draws_and_is_named_to_mujoco() -> None:
    backend = gl.choose_backend()

    context = gl.make_context(backend, 8, 8)
    context.make_current()
    context.free()

    assert os.environ["MUJOCO_GL"] == backend


ENVIRONMENT_WITHOUT_GRAPHICS = {
    "MUJOCO_GL": "egl",
    "__EGL_VENDOR_LIBRARY_FILENAMES": "/dev/null",
    "PYTHONPATH": os.pathsep.join(sys.path),
}
"""The environment of a machine without graphics."""


def output_without_graphics(program: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | ENVIRONMENT_WITHOUT_GRAPHICS,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_without_graphics_the_error_names_packages_to_install() -> None:
    program = """
from codra_papers.lab.simulator import gl
try:
    gl.choose_backend()
except gl.GraphicsUnavailableError as error:
    print(error)
"""

    output = output_without_graphics(program)

    assert "apt-get install libosmesa6" in output
    assert "egl: " in output


def test_a_backend_that_drew_for_another_process_is_not_tried_again() -> None:
    program = """
import os
from codra_papers.lab.simulator import gl
gl.use_backend("osmesa")
print(gl.choose_backend(), os.environ["MUJOCO_GL"])
"""

    assert output_without_graphics(program) == "osmesa osmesa\n"
