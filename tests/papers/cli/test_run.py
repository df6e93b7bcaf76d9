"""`codra run` in real processes: which requests it refuses, how it ends, and which failures it survives."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.cli.test_commands import DOOR, ROOT, codra, environment

LAB = str(ROOT / "specs/lab.yaml")
FAILING_PERCEPTION = """\
import time


def raises(*, machine, base, job):
    raise RuntimeError("no localisation")


def sleeps(*, machine, camera, job):
    camera.capture()
    time.sleep(60.0)


def errs(*, machine, camera, job):
    return {"markers": "many"}
"""


@pytest.fixture
def project_with_failing_perception(tmp_path: Path) -> Path:
    """Return the laboratory's spec with failing perception functions, which are in a module next to the specs."""
    shutil.copytree(ROOT / "specs", tmp_path / "specs")
    part = tmp_path / "specs/parts/machine.yaml"
    text = part.read_text()
    for name, failing_function in (
        ("measure_distance", "raises"),
        ("find_in_view", "sleeps"),
        ("localize_lid", "errs"),
    ):
        text = text.replace(f"codra_papers.lab.perception.functions:{name}", f"unruly:{failing_function}")
    part.write_text(text.replace("timeout: 3 s", "timeout: 1 s"))
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "unruly.py").write_text(FAILING_PERCEPTION)
    return tmp_path


def reasons(record: Path) -> Iterator[tuple[str, Any]]:
    """Yield the reasons why variables became unknown while the run lasted."""
    for line in record.read_text().splitlines():
        event = json.loads(line)
        if event["kind"] == "variable" and event["instant_s"] < 6.0:
            yield event["name"], event.get("reason")


def test_perception_that_raises_hangs_or_errs_costs_only_its_own_variables(
    project_with_failing_perception: Path,
) -> None:
    settings = ("--naive", "--for", "6 s", "--pace", "real", "--out", f"{project_with_failing_perception}/out")
    process = subprocess.Popen(
        [sys.executable, "-m", "codra_dsl", "run", f"{project_with_failing_perception}/specs/lab.yaml", *settings],
        cwd=ROOT,
        env=environment(),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        output, errors = process.communicate(timeout=50.0)  # before the function that hangs would return
    finally:
        process.kill()
    reason_by_name = dict(reasons(project_with_failing_perception / "out/record-naive.jsonl"))

    assert (process.returncode, "Traceback" in errors) == (0, False)
    assert re.match(r"6\.\d s, 0 sample-processing loops", output)
    assert re.search(r"^centrifuge_distance +0 +0 +0 +[1-9]", output, re.MULTILINE), "all of its jobs fail"
    assert {
        reason_by_name["centrifuge_in_observable_distance"],
        reason_by_name["pcr_cycler_in_manipulation_distance"],
    } == {"failed"}
    assert "timed_out" in {reason_by_name.get("centrifuge_lid_in_FOV"), reason_by_name.get("pcr_cycler_lid_in_FOV")}
    assert "failed" in {reason_by_name.get("centrifuge_open"), reason_by_name.get("pcr_cycler_open")}
    assert (
        dict(reasons(project_with_failing_perception / "out/record-context-driven.jsonl"))["robot_is_localized"] is None
    )


def _heed_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def test_an_interrupted_run_exits_with_130(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "codra_dsl", "run", LAB, "--pace", "real", "--out", f"{tmp_path}/out"],
        cwd=tmp_path,
        env=environment(),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=_heed_interrupts,  # a shell makes jobs in the background ignore them  # noqa: PLW1509
    )
    while not (tmp_path / "out").exists() and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=50.0)

    assert (process.returncode, output, errors) == (130, "", "")


def test_a_spec_without_the_needs_of_the_lab_is_refused_with_a_list(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(DOOR)

    completed_process = codra("run", "door.yaml", "--out", "out", cwd=tmp_path)

    assert completed_process.returncode == 1
    assert completed_process.stderr.startswith(
        "codra: 'door' does not run in the lab, whose main execution needs:\n  skill 'drive_to"
    )
    assert "  context-variable 'centrifuge_open' of type bool\n" in completed_process.stderr
    assert completed_process.stderr.endswith("  resource 'vision' with slots\n")
    assert not (tmp_path / "out").exists()


def test_a_missing_function_is_named(project_with_failing_perception: Path) -> None:
    (project_with_failing_perception / "unruly.py").unlink()

    completed_process = codra("run", "specs/lab.yaml", "--for", "5 s", cwd=project_with_failing_perception)

    assert completed_process.returncode == 1
    assert "'lab' does not run in the lab: perception" in completed_process.stderr
    assert "No module named 'unruly'" in completed_process.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--for", "soon"], "'soon' is not a duration"),
        (["--for", "forever"], "'forever' is not a duration"),
        (["--out", "taken"], "cannot write to 'taken': File exists"),
        (["--out", "taken/below"], "cannot write to 'taken/below': Not a directory"),
    ],
)
def test_an_impossible_run_is_refused_before_it_begins(tmp_path: Path, arguments: list[str], message: str) -> None:
    (tmp_path / "taken").write_text("")

    completed_process = codra("run", LAB, *arguments, cwd=tmp_path)

    assert (completed_process.returncode, completed_process.stdout) == (2, "")
    assert message in completed_process.stderr


def test_any_integer_is_a_seed(tmp_path: Path) -> None:
    completed_process = codra("run", LAB, "--seed", "-3", "--for", "500 ms", cwd=tmp_path)

    assert completed_process.returncode == 0
    assert "runs/lab-seed--3/timeline.png" in completed_process.stderr
