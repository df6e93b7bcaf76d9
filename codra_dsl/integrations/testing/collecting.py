"""Timelines in pytest: a file is a collector, and each of its stories is a test item."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.integrations.testing.package import Package
from codra_dsl.integrations.testing.reading import read_timeline
from codra_dsl.integrations.testing.run import Run, StoryFailed
from codra_dsl.integrations.testing.timeline import Story, Timeline
from codra_dsl.language.diagnostics import Diagnostic, suggest
from codra_dsl.language.load.yaml.source import MAX_BYTES
from codra_dsl.language.project import root_of
from codra_dsl.regular_files import read_regular_file
from codra_dsl.runtime import CallError, SimClock
from codra_dsl.tooling.report.findings import render_full


class TimelineFile(pytest.File):
    """A file whose name says that it is a timeline."""

    def collect(self) -> Iterable[pytest.Item]:
        """Yield the stories of the file.

        Raises:
            CollectError: if something in the file is wrong; the message contains all findings.
        """
        timeline, package, findings = read_timeline(self.path)
        if timeline is None or package is None:
            raise self.CollectError(_findings_text(findings, self.path))
        for story in timeline.stories:
            yield StoryItem.from_parent(self, name=story.name, story=story, timeline=timeline, package=package)


class StoryItem(pytest.Item):
    """One story of a timeline, with the main execution that the story describes."""

    def __init__(self, *, story: Story, timeline: Timeline, package: Package, **item_arguments: Any) -> None:
        super().__init__(**item_arguments)
        self._story = story
        self._timeline = timeline
        self._package = package

    def runtest(self) -> None:
        """Run the story on a clock of its own."""
        Run(self._timeline, self._package, self._story, clock=SimClock(), resources={}).play()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the message of a failed story or of a missing function; for other exceptions, the traceback."""
        if isinstance(excinfo.value, StoryFailed | CallError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return file, line and name."""
        return self.path, self._story.place.span.line - 1, self.name


def prepare_run(path: Path, story: str | None, *, clock: SimClock, resources: Mapping[str, object]) -> Run:
    """Return a story of a file, ready to run.

    Raises:
        ValueError: if something in the file is wrong, or the file has no such story.
    """
    timeline, package, findings = read_timeline(path)
    if timeline is None or package is None:
        raise ValueError(f"\n{_findings_text(findings, path)}")
    return Run(timeline, package, _choose_story(timeline, story), clock=clock, resources=resources)


def _choose_story(timeline: Timeline, name: str | None) -> Story:
    stories = {story.name: story for story in timeline.stories}
    if name is None and len(stories) == 1:
        return timeline.stories[0]
    if name in stories:
        return stories[name]
    suggestion = suggest(name or "", stories)
    hint = f": did you mean {suggestion!r}?" if suggestion else f": there is {', '.join(map(repr, stories))}"
    problem = "choose a story by its name" if name is None else f"{timeline.source.file} has no story {name!r}"
    raise ValueError(f"{problem}{hint}")


def _findings_text(findings: Iterable[Diagnostic], path: Path) -> str:
    root = root_of(path)

    def text_of(file: str) -> str | None:
        try:
            return read_regular_file(root / file, MAX_BYTES, within=root).decode("utf-8")
        except (OSError, ValueError):
            return None

    return render_full(findings, text_of).rstrip("\n")
