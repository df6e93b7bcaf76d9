"""Timelines from texts, about the compiled specs of this repository."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from codra_dsl.integrations.testing.reading import read_timeline
from codra_dsl.integrations.testing.run import Run
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.runtime import SimClock

PATH = Path(__file__).parents[3] / "tests" / "told.timeline.yaml"
HEAD = "codra: 1\ntimeline: kitchen\n"


def findings(text: str) -> tuple[Diagnostic, ...]:
    return read_timeline(PATH, {"tests/told.timeline.yaml": text.encode()})[2]


def told(text: str, resources: Mapping[str, object] | None = None, start_s: float = 0.0) -> Run:
    """The only story of a timeline about the kitchen, whose head need not be written."""
    return told_of(HEAD + text, resources, start_s)


def told_of(text: str, resources: Mapping[str, object] | None = None, start_s: float = 0.0) -> Run:
    """The only story of a timeline."""
    timeline, package, found = read_timeline(PATH, {"tests/told.timeline.yaml": text.encode()})
    assert timeline is not None, found
    assert package is not None
    (story,) = timeline.stories
    return Run(timeline, package, story, clock=SimClock(start_s), resources=resources or {})
