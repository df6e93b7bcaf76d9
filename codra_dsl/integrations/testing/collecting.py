"""Timelines in pytest: a file is a collector, and each of its stories is a test item.

Collecting reads only the names of the stories. The compiler and the runtime are imported when the first story runs, so
a run of pytest that only passes timelines stays fast.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from codra_dsl.integrations.testing.story_names import read_story_lines

if TYPE_CHECKING:
    from codra_dsl.integrations.testing.package import Package
    from codra_dsl.integrations.testing.timeline import Timeline


class TimelineFile(pytest.File):
    """A file with the name of a timeline."""

    _timeline_and_package: tuple[Timeline, Package] | None = None
    _is_wrong = False

    def collect(self) -> Iterable[pytest.Item]:
        """Yield the stories of the file.

        Raises:
            CollectError: if the names of the stories cannot be read; the message contains all findings.
        """
        for name, line in (read_story_lines(self.path) or self._complete_story_lines()).items():
            yield StoryItem.from_parent(self, name=name, line=line)

    def timeline_and_package(self) -> tuple[Timeline, Package]:
        """Return the timeline and its compiled spec, which are read once, for the first story that runs.

        Raises:
            CollectError: if something in the file is wrong. The message contains all findings, but only once.
        """
        from codra_dsl.integrations.testing.opening import read_valid_timeline

        if self._is_wrong:
            raise self.CollectError("the timeline has mistakes, which are reported at its first story")
        if self._timeline_and_package is None:
            try:
                self._timeline_and_package = read_valid_timeline(self.path)
            except ValueError as error:
                self._is_wrong = True
                raise self.CollectError(str(error)) from error
        return self._timeline_and_package

    def _complete_story_lines(self) -> Mapping[str, int]:
        timeline, _ = self.timeline_and_package()
        return {story.name: story.place.span.line for story in timeline.stories}


class StoryItem(pytest.Item):
    """One story of a timeline, with the main execution that the story describes."""

    parent: TimelineFile

    def __init__(self, *, line: int, **item_arguments: Any) -> None:
        super().__init__(**item_arguments)
        self._line = line

    def runtest(self) -> None:
        """Run the story on a clock of its own."""
        from codra_dsl.integrations.testing.opening import open_run
        from codra_dsl.runtime import SimClock

        timeline, package = self.parent.timeline_and_package()
        open_run(timeline, package, self.name, clock=SimClock(), resources={}).play()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the message of a failed story, a wrong file or a missing function; otherwise, the traceback."""
        from codra_dsl.integrations.testing.run import StoryFailed
        from codra_dsl.runtime import CallError

        if isinstance(excinfo.value, StoryFailed | CallError | pytest.Collector.CollectError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return file, line and name."""
        return self.path, self._line - 1, self.name
