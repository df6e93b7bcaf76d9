"""What all tests share: their options, how hypothesis draws, and what the run says at its end."""

from __future__ import annotations

import os
import sys

import pytest
from hypothesis import settings

os.environ.pop("CI", None)  # what tests show is the same everywhere; with it there is no cache

# The same draws in every run, and no deadline: no test of ours judges by the time that it took.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--renew-cases",
        action="store_true",
        help="write what the cases print now as what they are expected to print; read the diff before you commit it",
    )


@pytest.fixture(scope="session")
def renew_cases(pytestconfig: pytest.Config) -> bool:
    return bool(pytestconfig.getoption("--renew-cases"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    camera = sys.modules.get("codra_dsl.worlds.lab.camera")
    if camera is not None:
        terminalreporter.write_sep("-", f"{camera.frames_rendered()} frames of the lab rendered")
