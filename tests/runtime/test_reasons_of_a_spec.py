"""From the text of a spec to the readings of a program: every reason why a variable can be unknown."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.compiler import compile_paths
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.runtime import Outcome, Reason, SimClock

SPEC = """\
codra: 1
name: gate
context:
  near: {type: bool, source: main_execution, valid_for: 1 h}
  open: {type: bool, valid_for: 10 s}
  free: {type: bool, when_unobservable: forget}
  steady: {type: bool, refresh: on_event}
resources:
  eye: {}
perception:
  look:
    call: tests.runtime.test_reasons_of_a_spec:look
    uses: {eye: read}
    timeout: 2 s
    returns:
      gap: {type: float, unit: m, optional: true}
      sharpness: {type: float, range: [0, 1]}
    observable_when: [near]
    accept_when: [sharpness >= 0.5]
    identifies:
      open: {enter: gap > 60 cm, leave: gap < 50 cm}
      free: gap > 1 m
  peer:
    call: tests.runtime.test_reasons_of_a_spec:look
    uses: {eye: read}
    returns:
      gap: {type: float, unit: m, optional: true}
      sharpness: {type: float, range: [0, 1]}
    identifies:
      steady: {enter: gap > 60 cm, confirm: 2 of 3}
skills:
  push:
    preview: [steady]
    monitor: [open becomes true within 20 s, free stays true]
    changes: [open]
"""


@dataclass
class Eye:
    """The result and the behaviour of every look."""

    gap_m: float | None = 2.0
    sharpness: float = 0.9
    takes_s: float = 0.1
    error: Exception | None = None
    calls: list[float] = field(default_factory=list)


def look(*, eye: Eye, job: Any) -> object:
    eye.calls.append(job.now_s())
    job.sleep(eye.takes_s)
    if eye.error is not None:
        raise eye.error
    return {"gap": eye.gap_m, "sharpness": eye.sharpness}


@pytest.fixture
def gate(tmp_path: Path) -> Any:
    (tmp_path / "gate.yaml").write_text(SPEC, "utf-8")
    compilation = compile_paths([tmp_path / "gate.yaml"], tmp_path)
    assert compilation.planned.diagnostics == ()
    clock, eye = SimClock(), Eye()
    with load_start(compilation.files, "gate", tmp_path / "generated")(clock=clock, resources={"eye": eye}) as codra:
        yield codra, clock, eye


def why_unknown(codra: Any, name: str) -> tuple[Reason, str]:
    reading = codra.get(name)
    return reading.reason, reading.detail


def test_every_reason_is_reached_and_reported(gate: Any) -> None:
    codra, clock, eye = gate
    reasons_and_details: list[tuple[Reason, str]] = []
    codra.declare("open")
    reasons_and_details.append(why_unknown(codra, "open"))
    codra.set("near", True)
    clock.sleep(0.5)
    assert (codra.get("open").value, codra.get("free").value) == (True, True)
    with codra.skill("push") as skill, skill.acting():
        reasons_and_details.append(why_unknown(codra, "open"))
    clock.sleep(1.0)
    codra.set("near", False)
    clock.sleep(0.0)
    reasons_and_details.append(why_unknown(codra, "free"))
    clock.sleep(11.0)
    reasons_and_details.append(why_unknown(codra, "open"))
    eye.sharpness = 0.1
    codra.set("near", True)
    clock.sleep(0.5)
    reasons_and_details.append(why_unknown(codra, "open"))
    eye.sharpness, eye.error = 0.9, ValueError("no picture")
    clock.sleep(1.0)
    reasons_and_details.append(why_unknown(codra, "open"))
    eye.error, eye.takes_s = None, 3.0
    clock.sleep(4.0)
    reasons_and_details.append(why_unknown(codra, "open"))
    eye.takes_s = 0.1
    clock.sleep(3.0)
    codra.withdraw("open")
    reasons_and_details.append(why_unknown(codra, "free"))
    codra.declare("steady")
    clock.sleep(0.5)
    reasons_and_details.append(why_unknown(codra, "steady"))
    codra.override("near", None, for_s=5.0, reason="the scale is broken")
    reasons_and_details.append(why_unknown(codra, "near"))

    assert reasons_and_details == [
        (Reason.NEVER_OBSERVED, "near"),
        (Reason.INVALIDATED, "push"),
        (Reason.FORGOTTEN, "near"),
        (Reason.STALE, "near"),
        (Reason.REJECTED, "not sharpness >= 0.5"),
        (Reason.FAILED, "ValueError: no picture"),
        (Reason.TIMED_OUT, "no result within 2 s"),
        (Reason.WITHDRAWN, "look"),
        (Reason.UNCONFIRMED, "true in 1 of the last 3 results, 2 are needed"),
        (Reason.OVERRIDDEN, "the scale is broken"),
    ]
    assert {reason for reason, _ in reasons_and_details} == set(Reason) - {Reason.UNREACHABLE}, "which needs a host"


def test_between_enter_and_leave_a_gate_is_what_it_was(gate: Any) -> None:
    codra, clock, eye = gate
    codra.set("near", True)
    codra.declare("open")
    states = []
    for gap_m in (0.55, 0.65, 0.55, 0.45, 0.55):
        eye.gap_m = gap_m
        clock.sleep(0.9)
        states.append(codra.get("open").content)
    assert states == [None, True, True, False, False]


def test_between_enter_and_leave_an_overridden_gate_is_what_was_observed(gate: Any) -> None:
    codra, clock, eye = gate
    codra.set("near", True)
    codra.declare("open")
    clock.sleep(0.9)
    codra.override("open", False, for_s=5.0, reason="closed by hand")
    eye.gap_m = 0.55
    clock.sleep(2.0)
    assert codra.get("open").value is False
    codra.clear_override("open")
    assert (codra.get("open").value, codra.get("open").source) == (True, "look")


def test_a_variable_that_is_observed_on_events_is_not_observed_once_it_is_confirmed(gate: Any) -> None:
    codra, clock, eye = gate
    codra.declare("steady")
    clock.sleep(60.0)
    assert eye.calls == [0.0, 1.0]
    with codra.skill("push") as skill, skill.acting():
        clock.sleep(1.0)
    codra.withdraw("steady")
    clock.sleep(60.0)
    assert eye.calls == [0.0, 1.0]


def test_the_expectations_of_the_spec_are_judged(gate: Any) -> None:
    codra, clock, eye = gate
    codra.set("near", True)
    eye.gap_m = 0.2
    with codra.skill("push") as skill:
        with skill.acting():
            clock.sleep(2.5)
            assert skill.verify().violated[0].expected == "free stays true"
            eye.gap_m = 1.5
        verdicts = skill.verify(wait_up_to_s=20.0).verdicts
    assert [(verdict.expected, verdict.outcome) for verdict in verdicts] == [
        ("open becomes true within 20 s", Outcome.MET),
        ("free stays true", Outcome.VIOLATED),
    ]
