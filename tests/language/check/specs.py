"""A spec without errors, edits that add errors, and the findings of `check`."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.language.check import CheckedSpec, check
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_text

HERE = Path(__file__).parent

DOOR = """\
codra: 1
name: house
context:
  robot_is_localized: {type: bool, source: main_execution, valid_for: forever}
  near_door: {type: bool, when_unobservable: forget}
  door_state: {type: enum, values: [open, closed, ajar], valid_for: 1 min}
  door_gap: {type: float, unit: cm, range: [0, 120]}
  door_locked: {type: bool}
  people: {type: int, source: [observer, page]}
resources:
  camera: {}
  base: {}
  vision: {slots: 1}
agents:
  page: {}
perception:
  measure_distance:
    call: house.perception:measure_distance
    uses: {base: read}
    returns: {distance: {type: float, unit: m}}
    observable_when: [robot_is_localized]
    identifies: {near_door: distance < 2 m}
  look_at_door:
    call: house.perception:look_at_door
    with: {gain: 3}
    uses: {camera: read, vision: slot}
    given: [robot_is_localized]
    returns:
      angle: {type: float, unit: rad, optional: true}
      width: {type: float, unit: mm}
      markers: {type: int, range: [0, 12]}
      handle: {type: enum, values: [up, level]}
      faces: {type: int}
      latched: {type: bool}
    observable_when:
      - near_door
    accept_when:
      - markers >= 2
    identifies:
      door_state: {open: angle > 1 rad, ajar: angle > 5 deg, closed: angle <= 5 deg}
      door_gap: width
      door_locked: latched and handle == "level"
      people: faces
skills:
  pass_door:
    preview: [door_state, door_gap]
    monitor: [door_locked, people]
    changes: [door_state]
observers:
  door: {identifies: [door_state, door_gap, door_locked, people], period: 2 s}
"""


def check_text(text: str) -> tuple[CheckedSpec | None, tuple[Diagnostic, ...]]:
    """Return the result of `check` for a text that `load` reads without findings."""
    spec, diagnostics = load_text(text, "spec.yaml", HERE)
    assert spec is not None
    assert diagnostics == ()
    return check(spec)


def findings(text: str) -> tuple[Diagnostic, ...]:
    return check_text(text)[1]


def check_sound_text(text: str) -> CheckedSpec:
    spec, diagnostics = check_text(text)
    assert diagnostics == ()
    assert spec is not None
    return spec


def edit_spec(*edits: tuple[str, str], text: str = DOOR) -> str:
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def marked_text(text: str, finding: Diagnostic) -> str:
    """Return the text that a finding points to."""
    span = finding.place.span
    assert span.line == span.end_line
    return text.splitlines()[span.line - 1][span.column - 1 : span.end_column - 1]


def finding_texts(text: str) -> list[tuple[str, str, str, str]]:
    """Return the rule, the marked text, the message and the help of each finding."""
    return [
        (finding.rule.name, marked_text(text, finding), finding.message, finding.help) for finding in findings(text)
    ]
