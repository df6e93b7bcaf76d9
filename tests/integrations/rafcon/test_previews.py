"""The preview of a skill has the same answer in every form: call, py_trees, RAFCON, messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pytest
from py_trees.common import Status
from py_trees.trees import BehaviourTree
from rafcon.core.states.library_state import LibraryState

from codra_dsl.integrations.py_trees import PreviewHolds
from codra_dsl.integrations.rafcon import Answers, register, run_in_simulated_time
from codra_dsl.logic import Value
from codra_dsl.runtime import Kind, PreviewAnswer, SimClock
from codra_dsl.runtime.remote import VERSION, open_session
from codra_dsl.runtime.remote.protocol import preview_of
from tests.integrations.rafcon.machines import machine_of
from tests.runtime.cycler import HOLDS, Manager, cycler

UNKNOWN_ROTOR = {**HOLDS, "rotor_in_pos_1": None}
SITUATIONS: Mapping[str, tuple[Mapping[str, Value | None], str]] = {
    "all known": (HOLDS, "holds"),
    "one of five unknown": (
        UNKNOWN_ROTOR,
        "unknown: rotor_in_pos_1 (never_observed: only main_execution may write it)",
    ),
    "one unknown, one violated": ({**UNKNOWN_ROTOR, "battery": 10.0}, "violated: battery > 20 percent"),
    "two violated": ({**HOLDS, "locked": True, "gap": 0.1}, 'violated: locked == false, level == "high" or gap < 3 cm'),
    "an unknown that is not needed": ({**HOLDS, "level": None}, "holds"),
}
RAFCON_OUTCOMES = {"success": "unknown", "holds": "holds", "violated": "violated"}
"""The outcome 0 of the root state, which every state has, is its success."""


def called(manager: Manager, _: SimClock) -> tuple[str, str]:
    answer = manager.preview("open_cycler")
    return str(answer.outcome), str(answer)


def ticked(manager: Manager, clock: SimClock) -> tuple[str, str]:
    tree = BehaviourTree(PreviewHolds("open?", "open_cycler", unknown=Status.INVALID))
    tree.setup(codra=manager, clock=clock)
    tree.tick()
    outcomes = {Status.SUCCESS: "holds", Status.FAILURE: "violated", Status.INVALID: "unknown"}
    return outcomes[tree.root.status], tree.root.feedback_message


def preview_state() -> LibraryState:
    register()
    state = LibraryState("codra", "preview", name="open?", state_id="LIBRARY")
    state.set_input_runtime_value(0, "open_cycler")
    state.set_use_input_runtime_value(0, True)
    return state


def run_by_rafcon(manager: Manager, clock: SimClock) -> tuple[str, str]:
    state = preview_state()
    with machine_of(state) as machine:
        ended = run_in_simulated_time(machine, manager, clock)
        return RAFCON_OUTCOMES[ended.outcome], state.output_data["reason"]


def asked_by_message(manager: Manager, _: SimClock) -> tuple[str, str]:
    received: list[dict[str, Any]] = []
    session = open_session(manager, received.append)
    session.receive({"codra": VERSION, "id": 1, "ask": "preview", "skill": "open_cycler"})
    plain = received[-1]["answer"]["preview"]
    answer: PreviewAnswer = preview_of(plain)
    return plain["outcome"], str(answer)


@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("form", [called, ticked, run_by_rafcon, asked_by_message])
def test_every_form_gives_the_same_answer_and_records_one_decision(
    form: Callable[[Manager, SimClock], tuple[str, str]], situation: str
) -> None:
    values, expected = SITUATIONS[situation]
    with cycler(values) as (manager, clock):
        assert form(manager, clock) == (expected.partition(":")[0], expected)
        (event,) = manager.record.of(Kind.PREVIEW)
    assert event.what == ("unanswered" if expected.startswith("unknown") else "answered")


def test_in_shadow_mode_the_state_machine_looks_as_without_context() -> None:
    state = preview_state()
    with cycler() as (manager, clock), machine_of(state) as machine:
        assert run_in_simulated_time(machine, manager, clock, answers=Answers.SHADOW).outcome == "success"
        assert not manager.record.of(Kind.PREVIEW)
