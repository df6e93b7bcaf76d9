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

CONSOLE_SCRIPT = Path(sys.executable).with_name("codra")
TINY = "tiny:EXPERIMENT"
KEPT = ["seed 301.json", "seed 302.json", "seed 303.json"]
SOON_S = 60.0


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
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project whose experiment was run by two processes without interruption."""
    folder = project_in(tmp_path_factory.mktemp("undisturbed"))
    done = codra("experiment", TINY, "--processes", "2", cwd=folder)

    assert done.returncode == 0, done.stderr
    (folder / "stdout").write_text(done.stdout)
    (folder / "stderr").write_text(done.stderr)
    return folder


def records(project: Path) -> dict[str, Path]:
    return {path.name: path for path in sorted((project / "runs/tiny/trials").glob("*.json"))}


def results(project: Path) -> Any:
    return json.loads((project / "runs/tiny/results.json").read_text())


def begun(project: Path, *arguments: str, **streams: Any) -> subprocess.Popen[str]:
    """Start the experiment by the console script. As at a terminal, the process leads a process group."""
    return subprocess.Popen(
        [CONSOLE_SCRIPT, "experiment", TINY, *arguments],
        cwd=project,
        env=environment(),
        text=True,
        process_group=0,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
        **({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams),
    )


def wait_for(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + SOON_S
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


# A complete run


def test_a_run_prints_the_summary_and_the_paths_of_page_and_data(undisturbed: Path) -> None:
    frames = results(undisturbed)["results"]["frames"]

    assert (undisturbed / "stdout").read_text() == f"In 3 trials {sum(frames.values())} frames were rendered.\n"
    assert (undisturbed / "stderr").read_text() == "runs/tiny/report.html\nruns/tiny/results.json\n"
    assert {path.name for path in (undisturbed / "runs/tiny").iterdir()} == {"report.html", "results.json", "trials"}


def test_the_data_has_the_published_form(undisturbed: Path) -> None:
    schema = json.loads((Path(codra_papers.experiments.__file__).parent / "campaign/results.schema.json").read_text())
    report = results(undisturbed)

    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(report)
    assert report["experiment"] == "tiny"
    assert report["command"] == "codra experiment tiny:EXPERIMENT --processes 2"
    assert report["seeds"] == [301, 302, 303]
    assert report["trials"]["seed 302"] == {"seed": 302, "duration_s": 20.0, "loops": 0, "error": None}
    assert list(report["results"]["frames"]) == ["seed 301", "seed 302", "seed 303"]
    assert not jsonschema.Draft202012Validator(schema).is_valid(report | {"more": 1})


def test_the_page_shows_a_frame_of_every_trial(undisturbed: Path) -> None:
    page = (undisturbed / "runs/tiny/report.html").read_text()

    assert page.count("data:image/jpeg;base64,") == 3
    assert "codra experiment tiny:EXPERIMENT --processes 2" in page


def test_one_process_and_another_folder_give_the_same_results(undisturbed: Path, project: Path) -> None:
    done = codra("experiment", TINY, "--processes", "1", "--out", "else", "--seeds", "2", cwd=project)

    assert (done.returncode, done.stderr) == (0, "else/report.html\nelse/results.json\n")
    for name in KEPT[:2]:
        assert (project / "else/trials" / name).read_bytes() == records(undisturbed)[name].read_bytes()


# A run that is stopped


def test_a_killed_run_leaves_no_process_and_continues_where_it_stopped(undisturbed: Path, project: Path) -> None:
    process = begun(project, "--processes", "1")
    wait_for(lambda: len(records(project)) == 1 and len(children(process)) >= 1)
    workers = children(process)
    process.kill()
    process.communicate()
    wait_for(lambda: not any(map(lives, workers)))
    before = {name: path.stat().st_ino for name, path in records(project).items()}

    assert codra("experiment", TINY, cwd=project).returncode == 0
    assert {name: path.stat().st_ino for name, path in records(project).items() if name in before} == before
    assert len(before) < 3
    assert list(records(project)) == KEPT
    assert results(project)["results"] == results(undisturbed)["results"]
    for name, path in records(project).items():
        assert path.read_bytes() == records(undisturbed)[name].read_bytes()


def test_an_interrupted_run_reports_the_kept_trials_and_leaves_no_process(undisturbed: Path, project: Path) -> None:
    process = begun(project, "--processes", "1")
    wait_for(lambda: len(records(project)) == 1 and len(children(process)) >= 1)
    workers = children(process)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=SOON_S)

    assert (process.returncode, output) == (130, "")
    assert re.fullmatch(
        r"codra: interrupted; [012] of 3 trials are kept: run the same command again to continue\n", errors
    )
    wait_for(lambda: not any(map(lives, workers)))
    assert [path.name for path in (project / "runs/tiny").iterdir()] == ["trials"]
    assert not list((project / "runs/tiny/trials").glob(".*"))

    assert codra("experiment", TINY, cwd=project).returncode == 0
    assert results(project)["results"] == results(undisturbed)["results"]


@pytest.mark.parametrize("delay_s", [0.3, 0.8, 1.3, 1.8])
def test_an_interrupt_at_the_start_ends_quietly_too(project: Path, delay_s: float) -> None:
    process = begun(project)
    time.sleep(delay_s)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=SOON_S)

    assert (process.returncode, output) == (130, "")
    assert "Traceback" not in errors


def test_a_second_run_in_the_same_folder_is_refused(project: Path) -> None:
    process = begun(project, "--processes", "1")
    wait_for(lambda: len(children(process)) >= 1)
    second = codra("experiment", TINY, cwd=project)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=SOON_S)

    assert (second.returncode, second.stdout) == (1, "")
    assert second.stderr == "codra: another program runs trials in 'runs/tiny/trials'\n"


def test_a_terminal_shows_the_progress_of_the_trials(undisturbed: Path, project: Path) -> None:
    shutil.copytree(undisturbed / "runs/tiny/trials", project / "runs/tiny/trials")
    records(project)["seed 302.json"].unlink()
    terminal, end = pty.openpty()
    process = begun(project, stderr=end, stdout=subprocess.DEVNULL)
    os.close(end)
    shown = b""
    with contextlib.suppress(OSError):  # Linux raises it when the other end is closed
        while data := os.read(terminal, 4096):
            shown += data
    os.close(terminal)
    process.communicate(timeout=SOON_S)

    assert process.returncode == 0
    assert b"2/3" in shown
    assert b"trials, 2 kept from before" in shown


# Refused requests and failures


def test_without_a_name_all_experiments_are_listed(tmp_path: Path) -> None:
    done = codra("experiment", cwd=tmp_path)

    assert (done.returncode, done.stderr) == (0, "")
    listed = dict(re.split(r"  +", line, maxsplit=1) for line in done.stdout.splitlines())
    assert listed == {name: experiment.question for name, experiment in experiments().items()}


def test_an_unknown_name_is_refused_with_a_suggestion_or_a_list(project: Path) -> None:
    done = codra("experiment", "nothing-like-it", cwd=project)

    assert (done.returncode, done.stdout) == (2, "")
    assert "there is no experiment 'nothing-like-it': known are lab-ablation, " in done.stderr
    for known in experiments():
        slip = CliRunner().invoke(app, ["experiment", f"{known}x"], env={"COLUMNS": "200"})

        assert (slip.exit_code, slip.stdout) == (2, "")
        assert f"there is no experiment '{known}x': did you mean '{known}'?" in slip.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([TINY, "--spec", "none.yaml"], "'none.yaml' does not exist"),
        ([TINY, "--out", "tiny.py"], "cannot write to 'tiny.py': File exists"),
        ([TINY, "--trial", "seed 30"], "there is no trial 'seed 30': did you mean 'seed 30"),
        ([TINY, "--trial", "?"], "there is no trial '?': there are 3, such as 'seed 301'"),
        ([TINY, "--processes", "0"], "--processes"),
        (["nowhere:EXPERIMENT"], "'nowhere:EXPERIMENT' cannot be imported: No module named 'nowhere'"),
        (["tiny:NOTHING"], "'tiny:NOTHING' cannot be imported: module 'tiny' has no attribute 'NOTHING'"),
        (["tiny:judge"], "'tiny:judge' is not an Experiment"),
    ],
)
def test_an_impossible_request_is_refused_before_it_begins(project: Path, arguments: list[str], message: str) -> None:
    done = codra("experiment", *arguments, cwd=project)

    assert (done.returncode, done.stdout) == (2, "")
    assert message in " ".join(done.stderr.split())


def test_a_spec_with_errors_is_reported_as_by_compile(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT)

    done = codra("experiment", TINY, "--spec", "specs/door.yaml", cwd=project)

    assert (done.returncode, done.stdout.startswith(MONITER)) == (1, True)
    assert not (project / "runs").exists()


def test_a_spec_to_which_no_machine_can_be_added_is_refused_in_a_line(project: Path) -> None:
    spec = project / "specs/lab.yaml"
    text = spec.read_text()
    uses = text[text.index("use:\n") : text.index("perception:\n")]
    inline = ", ".join(line.split("#")[0].strip() for line in uses.splitlines()[1:] if line.strip())
    spec.write_text(text.replace(uses, f"use: {{{inline}}}\n\n"))
    done = codra("experiment", "lab-transfer", cwd=project)

    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("codra: the spec has no block of lines under 'use'")
    assert "Traceback" not in done.stderr


def test_a_spec_without_the_needs_of_the_lab_is_refused_with_a_list(project: Path) -> None:
    (project / "specs/door.yaml").write_text(DOOR)

    done = codra("experiment", TINY, "--spec", "specs/door.yaml", cwd=project)

    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("codra: 'door' does not run in the lab, whose main execution needs:\n")


@pytest.mark.parametrize("missing", ["mujoco", "cv2", "matplotlib", "scipy"])
def test_a_missing_extra_is_named(tmp_path: Path, missing: str) -> None:
    program = (
        f"import sys; sys.modules[{missing!r}] = None; sys.argv = ['codra', 'experiment']\n"
        "from codra_dsl.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment(), text=True, capture_output=True, check=False
    )

    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"codra: 'experiment' needs {missing}: {pip_install('codra-papers', 'lab')}\n"


def test_a_trial_that_raises_is_reported_in_a_line_with_the_command_to_run_it_alone(project: Path) -> None:
    path = project / "tiny.py"
    text = path.read_text().replace("from __future__ import annotations\n", "from __future__ import annotations\n", 1)
    work = "class Fails:\n    def __call__(self, mission):\n        raise ValueError('no arm')\n"
    path.write_text(text.replace("Loops()", "Fails()").replace("def trials", f"@dataclass\n{work}\n\ndef trials", 1))
    path.write_text(
        path.read_text().replace("from codra_papers", "from dataclasses import dataclass\n\nfrom codra_papers", 1)
    )
    done = codra("experiment", TINY, "--processes", "1", cwd=project)

    assert (done.returncode, done.stdout) == (1, "")
    message, _, alone = done.stderr.removesuffix("\n").partition("; to run it alone: ")
    assert re.fullmatch(
        r"codra: trial 'seed 301' \(seed 301\): ValueError: no arm \(\S+tiny.py:\d+\); "
        r"the traceback is in 'runs/tiny/trials/seed 301.error'",
        message,
    )
    assert "Traceback" in (project / "runs/tiny/trials/seed 301.error").read_text()
    again = codra(*shlex.split(alone)[1:], cwd=project)
    assert (again.returncode, again.stderr) == (1, f"{message}; to run it alone: {alone}\n")


def test_a_trial_alone_is_kept_and_no_report_is_written(project: Path) -> None:
    done = codra("experiment", TINY, "--trial", "seed 302", cwd=project)

    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "trial 'seed 302' (seed 302): 20.0 s, 0 loops\n"
    assert [path.name for path in (project / "runs/tiny").iterdir()] == ["trials"]
    assert list(records(project)) == ["seed 302.json"]


def test_missing_perception_is_named(project: Path) -> None:
    part = project / "specs/parts/machine.yaml"
    part.write_text(part.read_text().replace("codra_papers.lab.perception.functions:find_in_view", "unruly:find"))

    done = codra("experiment", TINY, "--processes", "1", cwd=project)

    assert done.returncode == 1
    assert "trial 'seed 301' (seed 301): perception" in done.stderr
    assert "No module named 'unruly'" in done.stderr


def test_a_full_disk_is_reported_in_a_line(project: Path) -> None:
    limited = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))\n"
        f"sys.argv = ['codra', 'experiment', '{TINY}']\n"
        "from codra_dsl.cli import main\nif __name__ == '__main__': main()"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", limited],
        cwd=project,
        env=environment(),
        text=True,
        capture_output=True,
        check=False,
    )

    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "codra: cannot write to 'runs/tiny': File too large; "
        "0 of 3 trials are kept: run the same command again to continue\n"
    )
    assert list((project / "runs/tiny/trials").iterdir()) == []
