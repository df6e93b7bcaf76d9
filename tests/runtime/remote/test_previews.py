"""The preview of a skill for main executions in other processes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.runtime import Kind, NotOfTypeError, PreviewOutcome, SimClock, UnknownNameError, WallClock
from codra_dsl.runtime.remote import RemoteContext, Server, Session, open_session
from codra_dsl.runtime.values.conditions import age, value
from codra_dsl.runtime.values.model import PreviewCondition, SkillModel
from tests.runtime.cycler import HOLDS, MODEL, OBSERVED, Manager, cycler
from tests.runtime.door import Door


class Program:
    """A main execution that uses messages."""

    def __init__(self, codra: Manager) -> None:
        self.received: list[dict[str, Any]] = []
        self.session: Session = open_session(codra, self.received.append)

    def ask(self, ask: str, **fields: object) -> dict[str, Any]:
        """Send a request; return its answer or error, or the last message if the answer comes later."""
        self.session.receive({"codra": 1, "ask": ask, **fields})
        message = self.received[-1]
        return dict(message.get("answer", message.get("error")))


def test_a_program_looks_for_one_variable_after_the_other() -> None:
    with cycler({**HOLDS, "gap": None, "tube": None}) as (codra, _):
        program = Program(codra)
        first = program.ask("preview", skill="open_cycler", looks=True)
        second = program.ask("found", decision=first["decision"], value=0.02)
        third = program.ask("found", decision=first["decision"], value=True)
        again = program.ask("found", decision=first["decision"], value=True)
        (event,) = codra.record.of(Kind.PREVIEW)

    assert (first["answered"], first["look"], first["preview"]["outcome"]) == (False, ["gap"], "unknown")
    assert (second["answered"], second["look"]) == (False, ["tube"])
    assert (third["answered"], third["look"], third["preview"]["outcome"]) == (True, [], "holds")
    assert again["kind"] == "malformed"
    assert (event.what, event.details["looked"]) == ("fell_back", ["gap", "tube"])


def test_a_preview_that_waits_is_answered_when_observers_decide_it() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door(angle_rad=1.0)}) as codra:
        codra.set("localized", True)
        program = Program(codra)
        program.session.receive({"codra": 1, "ask": "hello", "lease_s": 60.0})
        program.session.receive({"codra": 1, "ask": "expect", "skills": ["pass_door"]})
        before = len(program.received)
        program.session.receive({"codra": 1, "id": 7, "ask": "preview", "skill": "pass_door", "wait_up_to_s": 9.0})
        assert len(program.received) == before
        clock.sleep(2.0)
        (message,) = program.received[before:]
    assert (message["id"], message["answer"]["preview"]["outcome"]) == (7, "holds")


@pytest.mark.parametrize(("wait_up_to_s", "answers"), [(30.0, {3.0: "holds"}), (2.0, {2.0: "unknown"})])
def test_a_preview_that_waits_is_answered_when_an_age_decides_it(
    wait_up_to_s: float, answers: dict[float, str]
) -> None:
    condition = PreviewCondition(text="tube or age(gap) > 3 s", condition=value("tube") | (age("gap") > 3.0))
    skill = SkillModel(name="open_cycler", preview=("tube", "gap"), preview_conditions=(condition,))
    clock = SimClock()
    received: dict[float, str] = {}
    with Manager(replace(MODEL, skills=(skill,)), clock=clock, resources={}) as codra:
        codra.set("gap", 0.1)
        session = open_session(
            codra, lambda message: received.update({clock.now_s(): message["answer"]["preview"]["outcome"]})
        )
        session.receive({"codra": 1, "ask": "preview", "skill": "open_cycler", "wait_up_to_s": wait_up_to_s})
        clock.sleep(4.0)
    assert {round(at_s, 3): outcome for at_s, outcome in received.items()} == answers


def test_a_session_that_ends_abandons_its_previews() -> None:
    with cycler({**HOLDS, "gap": None}) as (codra, _):
        program = Program(codra)
        program.ask("preview", skill="open_cycler", looks=True)
        program.ask("leave")
        (event,) = codra.record.of(Kind.PREVIEW)
    assert (event.what, event.details["raised"]) == ("unanswered", "LeaseError")


def test_an_unknown_skill_is_refused_with_a_suggestion() -> None:
    with cycler() as (codra, _):
        error = Program(codra).ask("preview", skill="open_cycle")
    assert (error["kind"], "did you mean 'open_cycler'?" in error["message"]) == ("unknown_name", True)


def test_a_client_gets_the_same_answers_as_the_program_itself(tmp_path: Path) -> None:
    looked: list[str] = []
    with (
        WallClock() as clock,
        Manager(MODEL, clock=clock, resources={}) as codra,
        Server(codra, tmp_path / "codra.sock") as server,
        RemoteContext(server.address) as remote,
    ):
        for name, value in HOLDS.items():
            codra.set(name, value)
        assert remote.preview("open_cycler").holds
        codra.set("battery", 3.0)
        assert remote.preview("open_cycler") == codra.preview("open_cycler")
        codra.set("battery", 80.0)
        assert remote.preview("open_cycler", max_age_s=0.0, wait_up_to_s=0.01).outcome is PreviewOutcome.UNKNOWN

        later_s = clock.now_s() + 1000.0
        found = {**HOLDS, "tube": None}
        answer = remote.preview("open_cycler", lambda name: looked.append(name) or found[name], since_s=later_s)
        assert [variable.name for variable in answer.unknown] == ["tube"]
        with pytest.raises(ZeroDivisionError):
            remote.preview("open_cycler", lambda _: 1 // 0, since_s=later_s)
        with pytest.raises(NotOfTypeError):
            remote.preview("open_cycler", lambda _: "red", since_s=later_s)
        with pytest.raises(UnknownNameError):
            remote.preview("close_cycler")
    assert looked == ["locked", "battery", "rotor_in_pos_1", "level", "gap", "tube"]
    with pytest.raises(ConnectionError):
        remote.preview("open_cycler")
