"""The options of all tests, the settings of hypothesis, and the summary at the end of a run.

Tests of the laboratory use its real components: its frames are rendered, its tags are detected in them, and its
processes are processes of the operating system. The summary has the number of rendered frames.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

IN_CI = bool(os.environ.pop("CI", ""))  # removed so that tests behave the same everywhere; in CI the cache is not used

FEWEST_EXAMPLES = 10

# No deadline and no health check of durations: none of our tests measures its own time. No database: what is drawn
# depends on the code and the seed only. An example that failed is kept in the code, as `@example(...)`.
settings.register_profile(
    "repeatable",
    max_examples=50,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("seeded", settings.get_profile("repeatable"), derandomize=False)

# Hypothesis also tries the numbers and texts in the code that is imported at the time, so the examples of a test would
# depend on the tests before it, and on the worker. No setting turns this off.
providers._get_local_constants = providers.Constants


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--renew-cases",
        action="store_true",
        help="write the present output of the cases as the expected output; read the diff before you commit it",
    )
    parser.addoption(
        "--commit-seed",
        action="store_true",
        help="let property tests draw by a seed that follows from the commit, as in CI, instead of the same examples",
    )
    parser.addoption(
        "--examples-factor",
        type=float,
        default=0.5,
        metavar="FACTOR",
        help="let property tests try FACTOR times as many examples as their settings say, but at least ten",
    )


@pytest.hookimpl(tryfirst=True)  # before hypothesis reads the seed
def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput"):
        config.option.hypothesis_seed = config.workerinput["hypothesis_seed"]
    elif config.option.hypothesis_seed is None and (IN_CI or config.getoption("--commit-seed")):
        config.option.hypothesis_seed = str(_seed_of_commit())
    settings.load_profile("repeatable" if config.option.hypothesis_seed is None else "seeded")
    config.pluginmanager.register(Workers())


def _seed_of_commit() -> int:
    """Return the first digits of the commit's hash; 0 outside a git repository."""
    command = ["git", "rev-parse", "HEAD"]
    try:
        process = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return 0
    return int(process.stdout[:8], 16) if process.returncode == 0 else 0


def pytest_report_header(config: pytest.Config) -> str:
    seed = config.option.hypothesis_seed
    if seed is None:
        return "property tests: the same examples in every run; `make explore` draws others"
    return f"property tests: examples of one seed; draw them again with --hypothesis-seed={seed}"


@pytest.hookimpl(trylast=True)  # after hypothesis has marked its tests
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    factor = config.getoption("--examples-factor")
    if factor != 1.0:
        for test in {_with_settings(item) for item in items if item.get_closest_marker("hypothesis")}:
            _multiply_examples(test, factor)


def _with_settings(item: Any) -> Any:
    """Return the object that has the settings of a property test: its function, or the class of a state machine."""
    return item.cls if hasattr(item.cls, "settings") else getattr(item.obj, "__func__", item.obj)


def _multiply_examples(test: Any, factor: float) -> None:
    name = "settings" if hasattr(test, "settings") else "_hypothesis_internal_use_settings"
    own = getattr(test, name)
    fewest = min(own.max_examples, FEWEST_EXAMPLES)
    setattr(test, name, settings(own, max_examples=max(fewest, round(own.max_examples * factor))))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if any("hypothesis" in report.keywords for report in terminalreporter.stats.get("failed", ())):
        terminalreporter.write_line(
            "Keep what a property test found: write its falsifying example above the test as @example(...)."
        )


@pytest.fixture(scope="session")
def renew_cases(pytestconfig: pytest.Config) -> bool:
    return bool(pytestconfig.getoption("--renew-cases"))


_FRAMES = "frames_rendered"


def _frames_rendered() -> int:
    camera = sys.modules.get("codra_papers.lab.simulator.camera")
    return 0 if camera is None else int(camera.drawn_frame_count())


class Workers:
    """Tells the processes of a parallel run the seed, and adds up the frames that they rendered."""

    def __init__(self) -> None:
        self.frames = 0

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        node.workerinput["hypothesis_seed"] = node.config.option.hypothesis_seed

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        self.frames += getattr(node, "workeroutput", {}).get(_FRAMES, 0)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if frames := self.frames + _frames_rendered():
            terminalreporter.write_sep("-", f"{frames} frames of the lab rendered")


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
