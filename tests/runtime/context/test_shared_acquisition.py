"""Variables that are declared while an agent waits for them; waiting begins and ends in any thread."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.compiler import compile_paths
from codra_dsl.integrations.inspection.loading import load_emitted
from codra_dsl.runtime import Journal, SimClock
from codra_dsl.runtime.context.shared_acquisition import SharedAcquisition
from codra_dsl.runtime.replay import replay
from tests.runtime.journal.journals import read

DOOR = """\
codra: 1
name: door
context:
  door_open: {type: bool, valid_for: 10 s}
  lit: {type: bool, source: main_execution}
knowledge:
  types: {thing: {}}
  nodes: {door: thing}
agents:
  speaker: {wakes: door_open == true}
perception:
  look:
    call: tests.runtime.context.test_shared_acquisition:look
    returns: {angle: {type: float, range: [0, 2]}}
    identifies: {door_open: angle > 0.5}
skills:
  leave: {preview: [lit]}
"""


def look(**_: object) -> dict[str, float]:
    return {"angle": 1.0}


@pytest.fixture
def door(tmp_path: Path) -> Any:
    """Return a package in which an agent is woken by an observed variable that no skill needs."""
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "door.yaml").write_text(DOOR)
    compilation = compile_paths([tmp_path / "door.yaml"], tmp_path)
    assert compilation.planned.diagnostics == ()
    return load_emitted(compilation.files, "door", tmp_path / "made")


def test_an_agent_is_woken_by_an_observed_variable_until_it_unsubscribes(door: Any, tmp_path: Path) -> None:
    clock, wake_times_s = SimClock(), list[float]()
    with door.start(clock=clock, resources={}, record=Journal(tmp_path / "run.mcap")) as codra:
        speaker = codra.agent("speaker")
        assert codra.declared() == frozenset()
        subscription = speaker.on_wake(lambda _: wake_times_s.append(clock.now_s()))
        again = speaker.on_wake(lambda _: None)
        clock.sleep(3.0)
        assert (len(wake_times_s), codra.declared()) == (1, {"door_open"})
        assert codra.commands.declarations.names_of("agent speaker") == ("door_open",)
        subscription.unsubscribe()
        subscription.unsubscribe()
        assert codra.declared() == {"door_open"}
        again.unsubscribe()
        assert (codra.declared(), codra.running()) == (frozenset(), frozenset())
    header, events = read(tmp_path / "run.mcap")
    assert replay(header, events, door.MODEL, door.Door, None, knowledge=door.KNOWLEDGE).difference is None


def test_an_agent_with_a_closed_handle_declares_no_variable_even_after_the_context(door: Any) -> None:
    with door.start(clock=SimClock(), resources={}) as codra:
        with codra.agent("speaker").graph as graph:
            del graph
        speaker = codra.agent("speaker")
        speaker.on_wake(lambda _: None)
        speaker.graph.close()
        assert codra.declared() == frozenset()
        late_agent = codra.agent("speaker")
        late_agent.on_wake(lambda _: None)
    late_agent.close()
    assert codra.declared() == frozenset()


@pytest.mark.parametrize("order", sorted(set(itertools.permutations("bbee"))))
def test_in_any_order_of_begin_and_end_all_is_released(order: tuple[str, ...]) -> None:
    calls: list[bool] = []
    acquisition = SharedAcquisition(lambda: calls.append(True), lambda: calls.append(False))
    for step in order:
        (acquisition.begin if step == "b" else acquisition.end)()
    assert calls == [True, False] * (len(calls) // 2)
