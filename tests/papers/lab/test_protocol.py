"""The basis of the experiments: views of machines during handling, the cost of looking, the error map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from statistics import fmean
from typing import Any

import numpy as np
import pytest

from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.emit import emit
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.language.check import check
from codra_dsl.language.load import load_spec
from codra_dsl.runtime import ContextManager, SimClock
from codra_papers.lab.detection.error_map import read_table, table, views, write_table
from codra_papers.lab.detection.rows import MapRow
from codra_papers.lab.mission import Mission
from codra_papers.lab.perception.layout import MACHINES, Machine, Part
from codra_papers.lab.robot import Localization, Robot, Station
from codra_papers.lab.sequential_perception import SequentialPerception
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource
from codra_papers.lab.simulator.durations import DURATIONS, Phase
from codra_papers.lab.simulator.geometric_camera import GeometricCamera
from codra_papers.lab.simulator.world import LabWorld
from tests.papers.lab.perception.placing import SteadyHand

ROOT = Path(__file__).parents[3]
CENTRIFUGE, PCR_CYCLER = "centrifuge", "pcr_cycler"
SEEDS = range(201, 213)
Start = Callable[..., ContextManager[Any, Any]]


# Views of a machine during handling


@dataclass
class Visit:
    """A robot that handles a machine. Every two seconds, the complete tags in view are counted."""

    machine: str
    world: LabWorld = field(default_factory=lambda: LabWorld(1))
    clock: SimClock = field(default_factory=SimClock)

    def __post_init__(self) -> None:
        self.robot = Robot(self.world, self.clock, SteadyHand(1))
        self.robot.drive_to(Station(self.machine))
        self.start_s = self.clock.now_s()

    def handle(self, *actions: str) -> None:
        for action in actions:
            getattr(self.robot, action)(self.machine)

    def complete_tags(self) -> list[dict[Part, int]]:
        """Return how many complete tags of each part are in view at each count."""
        geometry, counts = GeometricCamera(), []
        for t_s in np.arange(self.start_s, self.clock.now_s(), 2.0).tolist():
            complete_ids = {view.tag_id for view in geometry.tags_in_view(self.world.state(t_s)) if view.is_resolved()}
            counts.append(
                {part: sum(tag.tag_id in complete_ids for tag in MACHINES[self.machine].tags_on(part)) for part in Part}
            )
        return counts


def shows_enough(tags: dict[Part, int]) -> bool:
    return tags[Part.BASE] >= 1 and tags[Part.LID] >= 1 and sum(tags.values()) >= 4


def share(counts_of_views: Sequence[dict[Part, int]], has_property: Callable[[dict[Part, int]], bool]) -> float:
    return fmean(has_property(tags) for tags in counts_of_views)


@pytest.mark.parametrize("before", [(), ("unlock",)])
def test_the_compact_machine_shows_four_tags_or_more_while_its_lever_and_its_lid_are_moved(
    before: tuple[str, ...],
) -> None:
    """P1, section 4.1: usually more markers will be visible and the whole instrument can be seen in a single image."""
    visit = Visit(PCR_CYCLER)
    visit.handle(*before)
    visit.start_s = visit.clock.now_s()
    visit.handle(*(("open_lid", "close_lid") if before else ("unlock", "lock")))

    assert share(visit.complete_tags(), shows_enough) >= 0.9


def test_over_two_visits_the_compact_machine_shows_four_tags_or_more_nearly_all_the_time() -> None:
    visit = Visit(PCR_CYCLER)
    visit.handle("unlock", "open_lid", "take_samples", "close_lid", "lock")
    visit.handle("unlock", "open_lid", "bring_samples", "close_lid", "lock")

    assert share(visit.complete_tags(), shows_enough) >= 0.85


def test_the_large_machine_shows_its_lid_or_its_base_not_at_all_much_of_the_time() -> None:
    visit = Visit(CENTRIFUGE)
    visit.handle("unlock", "open_lid", "take_samples", "bring_samples", "close_lid", "lock")
    counts = visit.complete_tags()

    assert share(counts, lambda tags: tags[Part.BASE] == 0 or tags[Part.LID] == 0) > 0.5
    assert share(counts, lambda tags: 1 <= sum(tags.values()) <= 2) > 0.05


# The cost of looking


class TimedEyes(SequentialPerception):
    """Sequential perception that records the duration of each perception task."""

    tasks_s: list[float]

    def look_for(self, variable: str) -> bool | None:
        start_s = self._job.clock.now_s()
        answer = super().look_for(variable)
        if not variable.endswith("_distance"):
            self.tasks_s.append(self._job.clock.now_s() - start_s)
        return answer


@dataclass(frozen=True)
class Sequential:
    """The duration of one task without observers."""

    total_s: float
    tasks_s: tuple[float, ...]


@pytest.fixture(scope="module")
def without_observers(tmp_path_factory: pytest.TempPathFactory) -> Start:
    """The laboratory's spec without previews and monitoring: no observer runs, so every decision looks."""
    spec, _ = load_spec(ROOT / "specs" / "lab.yaml", ROOT / "specs")
    assert spec is not None
    skills = tuple(replace(skill, preview=(), monitor=(), changes=()) for skill in spec.skills)
    checked_spec, _ = check(replace(spec, skills=skills))
    assert checked_spec is not None
    return load_start(emit(plan(checked_spec)), spec.name, tmp_path_factory.mktemp("compiled"))


def open_and_close(start: Start, seed: int) -> tuple[Sequential, Sequential]:
    """Let the main execution open and close the PCR-cycler."""
    clock, world = SimClock(), LabWorld(seed)
    robot = Robot(world, clock, Random(f"{seed} robot"))
    robot.drive_to(Station.PCR_CYCLER)
    with FrameSource(world) as frames:
        camera = ArmCamera(frames, clock)
        with start(clock=clock, resources={"camera": camera, "base": Localization(world, clock)}, seed=seed) as codra:
            eyes = TimedEyes(robot, camera, codra, clock, seed=seed)
            mission = Mission(robot, eyes, codra, clock, wait_s=0.0)
            return timed_task(eyes, clock, mission.open_machine), timed_task(eyes, clock, mission.close_machine)


def timed_task(eyes: TimedEyes, clock: SimClock, task: Callable[[str], None]) -> Sequential:
    start_s, eyes.tasks_s = clock.now_s(), []
    task(PCR_CYCLER)
    return Sequential(clock.now_s() - start_s, tuple(eyes.tasks_s))


@pytest.fixture(scope="module")
def runs(without_observers: Start) -> list[tuple[Sequential, Sequential]]:
    return [open_and_close(without_observers, seed) for seed in SEEDS]


@pytest.mark.parametrize(("task", "total_s", "perception_s"), [(0, 351.0, 73.0), (1, 282.0, 76.0)])
def test_without_observers_opening_and_closing_take_as_long_as_in_the_paper(
    runs: list[tuple[Sequential, Sequential]], task: int, total_s: float, perception_s: float
) -> None:
    """P1, section 4.2 and Table 3, by arithmetic. Tasks with a slip and a second try are left out."""
    runs_without_slip = [run[task] for run in runs if len(run[task].tasks_s) == 4]

    assert len(runs_without_slip) >= 9
    assert fmean(run_without_slip.total_s for run_without_slip in runs_without_slip) == pytest.approx(total_s, rel=0.05)
    assert fmean(sum(run_without_slip.tasks_s) for run_without_slip in runs_without_slip) == pytest.approx(
        perception_s, rel=0.05
    )


def test_opening_and_closing_take_four_perception_tasks_and_more_only_after_a_slip(
    runs: list[tuple[Sequential, Sequential]],
) -> None:
    """P1, section 4.2: two tasks of situation preview and two of situation monitoring."""
    tasks = [len(task.tasks_s) for run in runs for task in run]

    assert min(tasks) == 4
    assert sorted(tasks)[len(tasks) * 3 // 4] == 4


# The map of detection error

CELLS = ((PCR_CYCLER, 0.8, 30), (PCR_CYCLER, 2.0, 45), (CENTRIFUGE, 1.3, 60), (CENTRIFUGE, 3.0, 15))


def test_the_declared_map_of_detection_error_agrees_with_new_measurements(tmp_path: Path) -> None:
    declared = read_table(ROOT / "docs" / "papers" / "detection-map.csv")
    measured = [row for row in table(views(CELLS)) if row.about == "tag"]
    write_table(measured, tmp_path / "part.csv")

    assert len(measured) == len(CELLS)
    for row in read_table(tmp_path / "part.csv"):
        assert row in declared


def test_the_map_has_a_row_for_every_distance_and_angle_with_space_in_the_room() -> None:
    declared = read_table(ROOT / "docs" / "papers" / "detection-map.csv")
    tags = [row for row in declared if row["about"] == "tag"]

    assert set(declared[0]) == set(MapRow.__dataclass_fields__)
    assert {row["machine"] for row in tags} == set(MACHINES)
    assert len(tags) > 100
    assert all(int(row["samples"]) > 0 for row in tags)


# The page


def rows_of_the_page() -> list[list[str]]:
    page = (ROOT / "docs" / "papers" / "protocol.md").read_text(encoding="utf-8")
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("|")]


@pytest.mark.parametrize("phase", Phase)
def test_the_page_lists_all_durations(phase: Phase) -> None:
    spread = DURATIONS[phase]
    row = next(row for row in rows_of_the_page() if row[0] == f"`{phase.name.lower()}`")

    assert row[2:] == [f"{spread.mean_s:g}", f"{spread.deviation_s:g}"]


@pytest.mark.parametrize("machine", MACHINES.values(), ids=lambda machine: machine.name)
def test_the_page_lists_the_places_of_all_tags(machine: Machine) -> None:
    for tag in machine.tags:
        place_mm = np.round(1000 * tag.part_from_tag.translation_m).astype(int)
        row = next(row for row in rows_of_the_page() if row[0] == str(tag.tag_id))

        expected = [machine.name, tag.part, f"{1000 * tag.size_m:.0f}", ", ".join(map(str, place_mm))]
        assert row[1:5] == expected
