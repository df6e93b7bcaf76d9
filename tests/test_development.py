"""The commands of the Makefile that set up a machine, choose tests, or choose the examples of property tests."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from tests.changed import select

ROOT = Path(__file__).parents[1]


def test_missing_system_packages_are_named_and_not_installed_without_apt() -> None:
    command = ["make", "prerequisites", "test-prerequisites", "--keep-going", "APT=no", "PYTHON=false"]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)

    assert process.returncode != 0
    install_lines = [line.strip() for line in process.stderr.splitlines() if "apt-get install" in line]
    assert [line.removeprefix("sudo ").split()[:4] for line in install_lines] == [
        ["apt-get", "install", "--no-install-recommends", "libosmesa6"],
        ["apt-get", "install", "--no-install-recommends", "chromium"],
    ]
    assert process.stderr.count("APT=no: install these packages first") == 2


def test_a_changed_module_selects_the_tests_that_import_it_and_those_of_its_folder() -> None:
    texts = {
        "tests/runtime/why/test_why.py": "",
        "tests/runtime/test_clock.py": "from codra_dsl.runtime.why import explanation",
        "tests/cli/test_why.py": "import codra_dsl.runtime.why.explanation",
        "tests/cli/test_run.py": "from codra_dsl.runtime import why",
        "tests/language/test_units.py": "from codra_dsl.language.units import convert",
    }

    selected_tests = select(["codra_dsl/runtime/why/explanation.py", "README.md"], texts)

    assert selected_tests == ["tests/cli/test_why.py", "tests/runtime/test_clock.py", "tests/runtime/why/test_why.py"]


def test_a_changed_test_selects_itself() -> None:
    assert select(["tests/test_a.py"], {"tests/test_a.py": "", "tests/test_b.py": ""}) == ["tests/test_a.py"]


_PROPERTIES = """
from pathlib import Path

from hypothesis import given, settings, strategies
from hypothesis.stateful import RuleBasedStateMachine, rule

OUTPUT = Path(__file__).with_suffix(".txt")


def test_without_examples():
    OUTPUT.write_text("ran")


@settings(max_examples=100)
@given(number=strategies.integers())
def test_property(number):
    with OUTPUT.open("a") as output:
        print(number, file=output)


class Machine(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        with OUTPUT.with_suffix(".machine").open("a") as output:
            print("run", file=output)

    @rule()
    def step(self):
        pass


TestMachine = Machine.TestCase
TestMachine.settings = settings(max_examples=100, stateful_step_count=2)
"""


def project_with_properties(folder: Path) -> Path:
    """Return the folder of a repository with one commit, our settings, and two files of property tests."""
    (folder / "tests").mkdir()
    shutil.copy(ROOT / "tests" / "conftest.py", folder / "tests")
    (folder / "tests" / "test_a.py").write_text(_PROPERTIES, "utf-8")
    (folder / "tests" / "test_b.py").write_text(f"import robot\n{_PROPERTIES}", "utf-8")
    (folder / "robot.py").write_text(f"LIMITS = {tuple(range(1000, 1500))}\n", "utf-8")
    git = ("git", "-c", "user.name=a", "-c", "user.email=a@b")
    subprocess.run((*git, "init", "--quiet"), cwd=folder, check=True)
    subprocess.run((*git, "commit", "--quiet", "--allow-empty", "--message=first"), cwd=folder, check=True)
    return folder


def run_properties(project: Path, *arguments: str, ci: str = "") -> tuple[str, list[str]]:
    """Return the header of a run about property tests, and the examples that each file tried."""
    for path in (project / "tests").glob("test_*.txt"):
        path.unlink()
    command = (sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-m", "hypothesis", *arguments)
    environment = {**os.environ, "CI": ci}
    process = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stdout + process.stderr
    (header,) = re.findall("^property tests: (.*)$", process.stdout, re.MULTILINE)
    return header, [path.read_text("utf-8") for path in sorted((project / "tests").glob("test_*.txt"))]


def test_in_ci_the_commit_determines_the_examples_and_the_printed_option_draws_them_again(tmp_path: Path) -> None:
    project = project_with_properties(tmp_path)
    commit = subprocess.run(("git", "rev-parse", "HEAD"), cwd=project, capture_output=True, text=True, check=True)

    header, examples = run_properties(project, "--numprocesses=2", ci="true")
    option = header.split()[-1]

    assert option == f"--hypothesis-seed={int(commit.stdout[:8], 16)}"
    assert run_properties(project, option, "tests/test_a.py") == (header, examples[:1])
    assert run_properties(project, "tests/test_a.py")[1] != examples[:1]


def test_the_number_of_examples_is_multiplied_in_property_tests_and_state_machines(tmp_path: Path) -> None:
    project = project_with_properties(tmp_path)

    header, (examples, _) = run_properties(project, "--examples-factor=0.3", "--hypothesis-seed=5")

    assert header.endswith("--hypothesis-seed=5")
    assert len(examples.splitlines()) == 30
    assert len((project / "tests" / "test_a.machine").read_text("utf-8").splitlines()) >= 30
