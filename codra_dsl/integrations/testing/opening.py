"""Open a story: read the complete file, report its mistakes, and prepare the run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from codra_dsl.integrations.testing.package import Package
from codra_dsl.integrations.testing.reading import read_timeline
from codra_dsl.integrations.testing.run import Run
from codra_dsl.integrations.testing.timeline import Story, Timeline
from codra_dsl.language.diagnostics import Diagnostic, suggest
from codra_dsl.language.load.yaml.source import MAX_BYTES
from codra_dsl.language.project import root_of
from codra_dsl.regular_files import read_regular_file
from codra_dsl.runtime import SimClock
from codra_dsl.tooling.report.findings import render_full


def prepare_run(path: Path, story: str | None, *, clock: SimClock, resources: Mapping[str, object]) -> Run:
    """Return a story of a file, ready to run.

    Raises:
        ValueError: if something in the file is wrong, or the file has no such story.
    """
    try:
        timeline, package = read_valid_timeline(path)
    except ValueError as error:
        raise ValueError(f"\n{error}") from error
    return open_run(timeline, package, story, clock=clock, resources=resources)


def read_valid_timeline(path: Path) -> tuple[Timeline, Package]:
    """Return the timeline of a file with its compiled spec.

    Raises:
        ValueError: if something in the file is wrong; the message contains all findings.
    """
    timeline, package, findings = read_timeline(path)
    if timeline is None or package is None:
        raise ValueError(_findings_text(findings, path))
    return timeline, package


def open_run(
    timeline: Timeline, package: Package, story: str | None, *, clock: SimClock, resources: Mapping[str, object]
) -> Run:
    """Return a story of a timeline, ready to run; None means the only story.

    Raises:
        ValueError: if the timeline has no such story.
    """
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
