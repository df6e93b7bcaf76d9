"""The pytest plugin: it collects timelines as tests, and has fixtures that open them.

Every run of pytest loads this plugin if codra is installed, so slow imports are made only when they are needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from codra_dsl.integrations.testing.run import OpenStory, Run
    from codra_dsl.runtime import SimClock

ENDINGS = (".timeline.yaml", ".timeline.yml")
"""The endings of files that pytest collects as tests."""


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect the stories of a timeline as tests."""
    if not file_path.name.endswith(ENDINGS):
        return None
    from codra_dsl.integrations.testing.collecting import TimelineFile

    return TimelineFile.from_parent(parent, path=file_path)


@pytest.fixture
def codra_clock() -> SimClock:
    """Return a simulated clock at 0 s; the stories of `codra_story` run on this clock."""
    from codra_dsl.runtime import SimClock

    return SimClock()


@pytest.fixture
def codra_story(request: pytest.FixtureRequest, codra_clock: SimClock) -> OpenStory:
    """Return a function that opens stories.

    Use a story in a `with` statement. Inside the statement, call your program with the story's `codra` and `clock`.
    """
    from codra_dsl.integrations.testing.opening import prepare_run

    folder = request.path.parent

    def open_story(path: str, story: str | None = None, *, resources: Mapping[str, object] | None = None) -> Run:
        return prepare_run(folder / path, story, clock=codra_clock, resources=resources or {})

    return open_story
