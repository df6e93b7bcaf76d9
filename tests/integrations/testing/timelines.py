"""Timelines from texts, for the compiled specs of this repository."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from codra_dsl.integrations.testing.reading import read_timeline
from codra_dsl.integrations.testing.run import Run
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.runtime import SimClock

PATH = Path(__file__).parents[3] / "tests" / "case.timeline.yaml"
HEAD = "codra: 1\ntimeline: kitchen\n"


def findings(text: str) -> tuple[Diagnostic, ...]:
    return read_timeline(PATH, {"tests/case.timeline.yaml": text.encode()})[2]


def kitchen_run(text: str, resources: Mapping[str, object] | None = None, start_s: float = 0.0) -> Run:
    """Return the only story of a timeline for the kitchen; the text has no head."""
    return run_of_only_story(HEAD + text, resources, start_s)


def run_of_only_story(text: str, resources: Mapping[str, object] | None = None, start_s: float = 0.0) -> Run:
    """Return the only story of a timeline."""
    timeline, package, diagnostics = read_timeline(PATH, {"tests/case.timeline.yaml": text.encode()})
    assert timeline is not None, diagnostics
    assert package is not None
    (story,) = timeline.stories
    return Run(timeline, package, story, clock=SimClock(start_s), resources=resources or {})
