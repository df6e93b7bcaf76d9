"""The options of all tests, the settings of hypothesis, and the summary at the end of a run.

Tests of the laboratory use its real components: its frames are rendered, its tags are detected in them, and its
processes are processes of the operating system. The summary has the number of rendered frames.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Generator
from typing import Any

import pytest
from hypothesis import settings

os.environ.pop("CI", None)  # so that tests behave the same everywhere; in CI the cache is not used

# The same draws in every run, and no deadline: none of our tests measures its own time.
settings.register_profile("repeatable", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("repeatable")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--renew-cases",
        action="store_true",
        help="write the present output of the cases as the expected output; read the diff before you commit it",
    )


@pytest.fixture(scope="session")
def renew_cases(pytestconfig: pytest.Config) -> bool:
    return bool(pytestconfig.getoption("--renew-cases"))


_FRAMES = "frames_rendered"


def _frames_rendered() -> int:
    camera = sys.modules.get("codra_papers.lab.simulator.camera")
    return 0 if camera is None else int(camera.drawn_frame_count())


class FramesOfWorkers:
    """Adds up the frames that the processes of a parallel run rendered."""

    def __init__(self) -> None:
        self.frames = 0

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        self.frames += getattr(node, "workeroutput", {}).get(_FRAMES, 0)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if frames := self.frames + _frames_rendered():
            terminalreporter.write_sep("-", f"{frames} frames of the lab rendered")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(FramesOfWorkers())


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Keep the garbage collector from traversing thousands of collected tests, all of which stay until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_sessionfinish(session: pytest.Session) -> None:
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput[_FRAMES] = _frames_rendered()
