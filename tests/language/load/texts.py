"""Helpers to load specs from texts, for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.language.diagnostics import Diagnostic, Place, Span
from codra_dsl.language.load import load_text
from codra_dsl.language.model import Algorithm, Condition, Spec, Variable

NOWHERE = Path(__file__).parent

ALGORITHM = """
codra: 1
name: kitchen
context: {near: {type: bool}}
perception:
  look:
    call: kitchen.perception:look
    returns: {x: {type: float}, state: {type: str}}
    identifies: {near: x > 3}
"""


def loaded(text: str | bytes) -> tuple[Spec | None, tuple[Diagnostic, ...]]:
    return load_text(text, "-", NOWHERE)


def spec_of(text: str) -> Spec:
    """Return a spec that must give no finding."""
    spec, findings = loaded(text)
    assert findings == ()
    assert spec is not None
    return spec


def findings_of(text: str | bytes) -> tuple[Diagnostic, ...]:
    return loaded(text)[1]


def rules_of(text: str | bytes) -> list[str]:
    return [finding.rule.name for finding in findings_of(text)]


def variable_of(keys: str) -> Variable:
    """Return a context-variable with these keys, written as a flow mapping."""
    return spec_of(f"codra: 1\nname: kitchen\ncontext: {{near: {{{keys}}}}}\n").context[0]


def algorithm_of(keys: str) -> Algorithm:
    """Return a perception algorithm with the required keys and these, each on a line indented by four."""
    return spec_of(ALGORITHM + keys).perception[0]


def condition_of(keys: str) -> Condition:
    """Return the one condition under `accept_when`."""
    (condition,) = algorithm_of(keys).accept_when
    return condition


def marked(text: str, place: Place | Span) -> str:
    """Return the text at a place."""
    span = place if isinstance(place, Span) else place.span
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")[span.line - 1 : span.end_line]
    lines[-1] = lines[-1][: span.end_column - 1]
    lines[0] = lines[0][span.column - 1 :]
    return "\n".join(lines)
