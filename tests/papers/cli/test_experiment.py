"""`codra experiment` in real processes: its output, its failures, and the continuation of stopped runs."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from typer.testing import CliRunner

import codra_papers.experiments
from codra_dsl.cli.app import app
from codra_dsl.tooling.installation import pip_install
from codra_papers.experiments.campaign.registry import experiments
from tests.cli.test_commands import DOOR, MISSPELT, MONITER, ROOT, codra, environment
from tests.command_server import as_text, run_python

CONSOLE_SCRIPT = Path(sys.executable).with_name("codra")
TINY_EXPERIMENT = "tiny:EXPERIMENT"
RECORD_NAMES = ["seed 301.json", "seed 302.json"]
TIMEOUT_S = 300.0


def project_in(folder: Path) -> Path:
    """Return a project with the laboratory's spec and its own experiment."""
    shutil.copytree(ROOT / "specs", folder / "specs")
    shutil.copy(ROOT / "tests/papers/experiments/tiny.py", folder)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    return folder


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return project_in(tmp_path)


@pytest.fixture(scope="module")
def uninterrupted_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project whose experiment was run by two processes without interruption."""
    folder = project_in(tmp_path_factory.mktemp("undisturbed"))
    completed_process = codra("experiment", TINY_EXPERIMENT, "--processes", "2", cwd=folder)

    assert completed_process.returncode == 0, completed_process.stderr
    (folder / "stdout").write_text(completed_process.stdout)
    (folder / "stderr").write_text(completed_process.stderr)
    return folder


def records(project: Path) -> dict[str, Path]:
    return {path.name: path for path in sorted((project / "runs/tiny/trials").glob("*.json"))}


def results(project: Path) -> Any:
    return json.loads((project / "runs/tiny/results.json").read_text())


def started_process(project: Path, *arguments: str, **streams: Any) -> subprocess.Popen[str]:
    """Start the experiment by the console script. As at a terminal, the process leads a process group."""
    return subprocess.Popen(
        [CONSOLE_SCRIPT, "experiment", TINY_EXPERIMENT, *arguments],
        cwd=project,
        env=environment(),
        text=True,
        process_group=0,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
        **({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams),
    )


def wait_for(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def children(process: subprocess.Popen[str]) -> set[int]:
    return {int(number) for number in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()}


def lives(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def has_begun_trials(project: Path) -> bool:
    """Return whether a program runs trials in a project: it has locked their folder and has temporary files there."""
    return any((project / "runs/tiny/trials").glob(".*/*"))


# A complete run


def test_a_run_prints_the_summary_and_the_paths_of_page_and_data(uninterrupted_project: Path) -> None:
    frames = results(uninterrupted_project)["results"]["frames"]

    assert (
        uninterrupted_project / "stdout"
    ).read_text() == f"In 2 trials {sum(frames.values())} frames were rendered.\n"
    assert (uninterrupted_project / "stderr").read_text() == "runs/tiny/report.html\nruns/tiny/results.json\n"
    assert {path.name for path in (uninterrupted_project / "runs/tiny").iterdir()} == {
        "report.html",
        "results.json",
        "trials",
    }


def test_the_data_has_the_published_form(uninterrupted_project: Path) -> None:
    schema = json.loads((Path(codra_papers.experiments.__file__).parent / "campaign/results.schema.json").read_text())
    report = results(uninterrupted_project)

    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(report)
    assert report["experiment"] == "tiny"
    assert report["command"] == "codra experiment tiny:EXPERIMENT --processes 2"
    assert report["seeds"] == [301, 302]
    assert report["trials"]["seed 302"] == {"seed": 302, "duration_s": 4.0, "loops": 0, "error": None}
    assert list(report["results"]["frames"]) == ["seed 301", "seed 302"]
    assert not jsonschema.Draft202012Validator(schema).is_valid(report | {"more": 1})


def test_the_page_shows_a_frame_of_every_trial(uninterrupted_project: Path) -> None:
    page = (uninterrupted_project / "runs/tiny/report.html").read_text()

    assert page.count("data:image/jpeg;base64,") == 2
    assert "codra experiment tiny:EXPERIMENT --processes 2" in page


def test_one_process_and_another_folder_give_the_same_results(uninterrupted_project: Path, project: Path) -> None:
    completed_process = codra(
        "experiment", TINY_EXPERIMENT, "--processes", "1", "--out", "else", "--seeds", "1", cwd=project
    )

    assert (completed_process.returncode, completed_process.stderr) == (0, "else/report.html\nelse/results.json\n")
    (record,) = (project / "else/trials").glob("*.json")
    assert record.read_bytes() == records(uninterrupted_project)[record.name].read_bytes()


# A run that is stopped


def test_a_run_that_is_interrupted_and_then_killed_leaves_no_process_and_continues_where_it_stopped(
    uninterrupted_project: Path, project: Path
) -> None:
    process = started_process(project, "--processes", "1")
    wait_for(lambda: len(records(project)) == 1 and len(children(process)) >= 1)
    workers = children(process)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=TIMEOUT_S)

    assert (process.returncode, output) == (130, "")
    assert re.fullmatch(
        r"codra: interrupted; [01] of 2 trials are kept: run the same command again to continue\n", errors
    )
    wait_for(lambda: not any(map(lives, workers)))
    assert [path.name for path in (project / "runs/tiny").iterdir()] == ["trials"]
    assert not list((project / "runs/tiny/trials").glob(".*"))
    before = {name: path.stat().st_ino for name, path in records(project).items()}
    assert len(before) < 2

    process = started_process(project, "--processes", "1")
    wait_for(lambda: has_begun_trials(project) and len(children(process)) >= 2)  # the trial and the resource tracker
    workers = children(process)
    process.kill()
    process.communicate()
    wait_for(lambda: not any(map(lives, workers)))

    assert codra("experiment", TINY_EXPERIMENT, cwd=project).returncode == 0
    assert {name: path.stat().st_ino for name, path in records(project).items() if name in before} == before
    assert list(records(project)) == RECORD_NAMES
    assert results(project)["results"] == results(uninterrupted_project)["results"]
    for name, path in records(project).items():
        assert path.read_bytes() == records(uninterrupted_project)[name].read_bytes()


@pytest.mark.parametrize("library", ["numpy", "mujoco"])
def test_an_interrupt_while_libraries_are_loaded_ends_quietly_too(project: Path, library: str) -> None:
    process = started_process(project)
    wait_for(lambda: f"/{library}/" in Path(f"/proc/{process.pid}/maps").read_text())
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=TIMEOUT_S)

    assert (process.returncode, output) == (130, "")
    assert "Traceback" not in errors


def test_a_second_run_in_the_same_folder_is_refused(project: Path) -> None:
    process = started_process(project, "--processes", "1")
    wait_for(lambda: has_begun_trials(project))
    process.send_signal(signal.SIGSTOP)  # so that it does not end before the other program begins
    second_process = codra("experiment", TINY_EXPERIMENT, cwd=project)
    process.send_signal(signal.SIGCONT)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=TIMEOUT_S)

    assert (second_process.returncode, second_process.stdout) == (1, "")
    assert second_process.stderr == "codra: another program runs trials in 'runs/tiny/trials'\n"


def test_a_terminal_shows_the_progress_of_the_trials(uninterrupted_project: Path, project: Path) -> None:
    shutil.copytree(uninterrupted_project / "runs/tiny/trials", project / "runs/tiny/trials")
    records(project)["seed 302.json"].unlink()
    terminal, end = pty.openpty()
    process = started_process(project, stderr=end, stdout=subprocess.DEVNULL)
    os.close(end)
    shown_bytes = b""
    with contextlib.suppress(OSError):  # Linux raises it when the other end is closed
        while chunk := os.read(terminal, 4096):
            shown_bytes += chunk
    os.close(terminal)
    process.communicate(timeout=TIMEOUT_S)

    assert process.returncode == 0
    assert b"1/2" in shown_bytes
    assert b"trials, 1 kept from before" in shown_bytes


# Refused requests and failures


def test_without_a_name_all_experiments_are_listed(tmp_path: Path) -> None:
    completed_process = codra("experiment", cwd=tmp_path)

    assert (completed_process.returncode, completed_process.stderr) == (0, "")
    listed = dict(re.split(r"  +", line, maxsplit=1) for line in completed_process.stdout.splitlines())
    assert listed == {name: experiment.question for name, experiment in experiments().items()}


def test_an_unknown_name_is_refused_with_a_suggestion_or_a_list(project: Path) -> None:
    completed_process = codra("experiment", "nothing-like-it", cwd=project)

    assert (completed_process.returncode, completed_process.stdout) == (2, "")
    assert "there is no experiment 'nothing-like-it': known are lab-ablation, " in completed_process.stderr
    for known_name in experiments():
        result_of_misspelt_name = CliRunner().invoke(app, ["experiment", f"{known_name}x"], env={"COLUMNS": "200"})

        assert (result_of_misspelt_name.exit_code, result_of_misspelt_name.stdout) == (2, "")
        assert f"there is no experiment '{known_name}x': did you mean '{known_name}'?" in result_of_misspelt_name.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([TINY_EXPERIMENT, "--spec", "none.yaml"], "'none.yaml' does not exist"),
        ([TINY_EXPERIMENT, "--out", "tiny.py"], "cannot write to 'tiny.py': File exists"),
        ([TINY_EXPERIMENT, "--trial", "seed 30"], "there is no trial 'seed 30': did you mean 'seed 30"),
        ([TINY_EXPERIMENT, "--trial", "?"], "there is no trial '?': there are 2, such as 'seed 301'"),
        ([TINY_EXPERIMENT, "--processes", "0"], "--processes"),
        (["nowhere:EXPERIMENT"], "'nowhere:EXPERIMENT' cannot be imported: No module named 'nowhere'"),
        (["tiny:NOTHING"], "'tiny:NOTHING' cannot be imported: module 'tiny' has no attribute 'NOTHING'"),
        (["tiny:judge"], "'tiny:judge' is not an Experiment"),
    ],
)
def test_an_impossible_request_is_refused_before_it_begins(project: Path, arguments: list[str], message: str) -> None:
    completed_process = codra("experiment", *arguments, cwd=project)

    assert (completed_process.returncode, completed_process.stdout) == (2, "")
    assert message in " ".join(completed_process.stderr.split())


def test_a_spec_with_errors_is_reported_as_by_compile(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    completed_process = codra("experiment", TINY_EXPERIMENT, "--spec", "specs/door.yaml", cwd=project)

    assert (completed_process.returncode, completed_process.stdout.startswith(MONITER)) == (1, True)
    assert not (project / "runs").exists()


def test_a_spec_to_which_no_machine_can_be_added_is_refused_in_a_line(project: Path) -> None:
    spec = project / "specs/lab.yaml"
    text = spec.read_text()
    uses = text[text.index("use:\n") : text.index("perception:\n")]
    uses_on_one_line = ", ".join(line.split("#")[0].strip() for line in uses.splitlines()[1:] if line.strip())
    spec.write_text(text.replace(uses, f"use: {{{uses_on_one_line}}}\n\n"))
    completed_process = codra("experiment", "lab-transfer", cwd=project)

    assert completed_process.returncode == 1
    assert completed_process.stderr.splitlines()[-1].startswith("codra: the spec has no block of lines under 'use'")
    assert "Traceback" not in completed_process.stderr


def test_a_spec_without_the_needs_of_the_lab_is_refused_with_a_list(project: Path) -> None:
    (project / "specs/door.yaml").write_text(DOOR)

    completed_process = codra("experiment", TINY_EXPERIMENT, "--spec", "specs/door.yaml", cwd=project)

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr.startswith("codra: 'door' does not run in the lab, whose main execution needs:\n")


@pytest.mark.parametrize("missing", ["mujoco", "cv2", "matplotlib", "scipy"])
def test_a_missing_extra_is_named(tmp_path: Path, missing: str) -> None:
    program = (
        f"import sys; sys.modules[{missing!r}] = None; sys.argv = ['codra', 'experiment']\n"
        "from codra_dsl.cli import main; main()"
    )
    completed_process = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment(), text=True, capture_output=True, check=False
    )

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr == f"codra: 'experiment' needs {missing}: {pip_install('codra-papers', 'lab')}\n"


def test_a_trial_that_raises_is_reported_in_a_line_with_the_command_to_run_it_alone(project: Path) -> None:
    path = project / "tiny.py"
    text = path.read_text().replace("from __future__ import annotations\n", "from __future__ import annotations\n", 1)
    work = "class Fails:\n    def __call__(self, mission):\n        raise ValueError('no arm')\n"
    path.write_text(text.replace("Loops()", "Fails()").replace("def trials", f"@dataclass\n{work}\n\ndef trials", 1))
    path.write_text(
        path.read_text().replace("from codra_papers", "from dataclasses import dataclass\n\nfrom codra_papers", 1)
    )
    completed_process = codra("experiment", TINY_EXPERIMENT, "--processes", "1", cwd=project)

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    message, _, trial_command = completed_process.stderr.removesuffix("\n").partition("; to run it alone: ")
    assert re.fullmatch(
        r"codra: trial 'seed 301' \(seed 301\): ValueError: no arm \(\S+tiny.py:\d+\); "
        r"the traceback is in 'runs/tiny/trials/seed 301.error'",
        message,
    )
    assert "Traceback" in (project / "runs/tiny/trials/seed 301.error").read_text()
    repeated_process = codra(*shlex.split(trial_command)[1:], cwd=project)
    assert (repeated_process.returncode, repeated_process.stderr) == (
        1,
        f"{message}; to run it alone: {trial_command}\n",
    )


def test_a_trial_alone_is_kept_and_no_report_is_written(project: Path) -> None:
    completed_process = codra("experiment", TINY_EXPERIMENT, "--trial", "seed 302", cwd=project)

    assert (completed_process.returncode, completed_process.stderr) == (0, "")
    assert completed_process.stdout == "trial 'seed 302' (seed 302): 4.0 s, 0 loops\n"
    assert [path.name for path in (project / "runs/tiny").iterdir()] == ["trials"]
    assert list(records(project)) == ["seed 302.json"]


def test_missing_perception_is_named(project: Path) -> None:
    part = project / "specs/parts/machine.yaml"
    part.write_text(part.read_text().replace("codra_papers.lab.perception.functions:find_in_view", "unruly:find"))

    completed_process = codra("experiment", TINY_EXPERIMENT, "--processes", "1", cwd=project)

    assert completed_process.returncode == 1
    assert "trial 'seed 301' (seed 301): perception" in completed_process.stderr
    assert "No module named 'unruly'" in completed_process.stderr


def test_a_full_disk_is_reported_in_a_line(project: Path) -> None:
    limited_program = (
        "import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        "os.environ['PYTHONDONTWRITEBYTECODE'] = '1'\n"
        f"sys.argv = ['codra', 'experiment', '{TINY_EXPERIMENT}', '--processes', '1']\n"
        "from codra_dsl.cli import main\nmain()"
    )
    completed_process = as_text(run_python(("-c", limited_program, "experiment"), project, environment()))

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr == (
        "codra: cannot write to 'runs/tiny': File too large; "
        "0 of 2 trials are kept: run the same command again to continue\n"
    )
    assert list((project / "runs/tiny/trials").iterdir()) == []
