"""The commands of the Makefile that set up a machine or choose tests."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tests.changed import select

ROOT = Path(__file__).parents[1]


def test_missing_system_packages_are_named_and_not_installed_without_apt() -> None:
    command = ["make", "prerequisites", "browser", "--keep-going", "APT=no", "PYTHON=false"]
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
