"""The store with agents as processes; `tests.campaigns.agents` runs whole missions."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

from codra_papers.store.simulator.store import Store
from tests.cli.test_commands import ROOT, codra
from tests.papers.experiments.agent_processes import KilledRun, Situation, StoreSettings, executor_at_work

STORE = str(ROOT / "specs/store.yaml")


def test_a_killed_agent_is_started_again_and_the_robot_drives_on(tmp_path: Path) -> None:
    """The robot stops when its driver is lost, and the next request of the tree finds a new one."""

    def kill(shop: Store, _: float) -> str:
        is_driving = executor_at_work(shop) == "navigation" and shop.world.state().robot.speed_m_s > 0.1
        return "navigation" if is_driving else ""

    def is_over(shop: Store, killed: Mapping[str, float]) -> bool:
        handover = shop.knowledge.snapshot().handover("navigating")
        return bool(killed) and handover.stage == "is" and handover.since_s > killed["navigation"]

    run = KilledRun(tmp_path / "run.mcap", StoreSettings(seed=3, situation=Situation.ORDINARY), 120.0, kill, is_over)

    assert "executor_lost" in run.ends("navigating")
    assert run.restart_count >= 1
    assert run.run.duration_s < 120.0
    written = ("speed", "front_gap", "pose_spread", "loaded", "person_distance")
    sources = [run.shop.knowledge.get("robot", name).source for name in written]
    assert sources == ["navigation", "lasers", "localisation", "fork", "person_detection"]


def test_the_command_runs_the_agents_as_processes_and_ends_with_all_of_them(tmp_path: Path) -> None:
    run = codra("run", STORE, "--world", "store", "--processes", "--for", "1 s", "--situation", "hidden", cwd=tmp_path)

    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("1.0 s\norders              1 ")


def test_a_spec_that_lacks_what_an_agent_writes_ends_the_command_with_the_reason(tmp_path: Path) -> None:
    spec = (ROOT / "specs/store.yaml").read_text("utf-8").replace("source: lasers, ", "source: camera_agent, ")
    shutil.copytree(ROOT / "specs/trees", tmp_path / "trees")
    (tmp_path / "store.yaml").write_text(spec, "utf-8")

    run = codra("run", "store.yaml", "--world", "store", "--processes", "--for", "1 s", cwd=tmp_path)

    assert (run.returncode, run.stdout) == (1, "")
    assert "codra: 'store' does not run in the store: the processes of its agents end again and again" in run.stderr
    assert "Traceback" not in run.stderr
