"""State machines with few states, built with RAFCON's API and run by its engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from rafcon.core.state_machine import StateMachine
from rafcon.core.states.execution_state import ExecutionState
from rafcon.core.states.hierarchy_state import HierarchyState
from rafcon.core.states.state import State

from codra_dsl.integrations.rafcon import Answers, Ended, entered, run_in_simulated_time
from codra_dsl.runtime import Kind, SimClock
from tests.runtime.door import Door, Manager, started

CALL = """def execute(self, inputs, outputs, gvm):
    return getattr(gvm.get_variable("robot"), "{method}")()
"""


class Robot:
    """The global variable `robot` of scripts; the result of a method is the outcome of the state.

    It records the called methods, the declarations at each call, and the declarations at the end.
    """

    def __init__(self, clock: SimClock, manager: Manager, door: Door) -> None:
        self.clock, self.manager, self.door = clock, manager, door
        self.called: list[str] = []
        self.declared: list[frozenset[str]] = []
        self.left: frozenset[str] = frozenset()

    def __getattribute__(self, name: str) -> Any:
        value = object.__getattribute__(self, name)
        if callable(value) and not name.startswith("_") and name != "manager":
            self.called.append(name)
            self.declared.append(self.manager.declared())
        return value

    def drive(self) -> str:
        self.clock.sleep(5.0)
        return "success"

    def pull(self) -> str:
        self.clock.sleep(4.8)
        self.door.angle_rad = 1.0
        return "success"

    def look(self) -> str:
        self.clock.sleep(3.0)
        return "true" if (self.door.angle_rad or 0.0) > 0.6 else "false"

    def see_no_value(self) -> str:
        self.clock.sleep(3.0)
        return "success"

    def fail(self) -> str:
        raise ZeroDivisionError("the arm is stuck")


def script(name: str, method: str = "", annotation: Mapping[str, object] | None = None) -> ExecutionState:
    """Return a state that calls the robot; a state that decides has outcomes for true and false."""
    state = ExecutionState(name, state_id=name.upper())
    state.script_text = CALL.format(method=method or name)
    if annotation is not None:
        state.add_semantic_data([], dict(annotation), "codra")
        if "decide" in annotation:
            state.add_outcome("true", 1)
            state.add_outcome("false", 2)
    return state


def sequence(name: str, *states: State, annotation: Mapping[str, object] | None = None) -> HierarchyState:
    """Return a sequence of states; the outcomes of the last state are those of the sequence."""
    hierarchy_state = HierarchyState(name, state_id=name.upper())
    if annotation is not None:
        hierarchy_state.add_semantic_data([], dict(annotation), "codra")
    for state in states:
        hierarchy_state.add_state(state)
    hierarchy_state.set_start_state(states[0])
    last = states[-1]
    for number in (number for number in last.outcomes if number > 0):
        hierarchy_state.add_outcome(last.outcomes[number].name, number)
    for state, after in pairwise(states):
        for number in (number for number in state.outcomes if number >= 0):
            hierarchy_state.add_transition(state.state_id, number, after.state_id, None)
    for number in (number for number in last.outcomes if number >= 0):
        hierarchy_state.add_transition(last.state_id, number, hierarchy_state.state_id, number)
    return hierarchy_state


@contextmanager
def machine_of(*states: State) -> Iterator[StateMachine]:
    with entered(StateMachine(sequence("root", *states))) as machine:
        yield machine


def run(
    *states: State,
    door: Door | None = None,
    before: Callable[[Manager, SimClock], None] = lambda *_: None,
    answers: Answers = Answers.CONTEXT,
) -> tuple[Ended, Robot]:
    """Run states one after the other at a door, in simulated time."""
    door = door or Door()
    with started(door) as (manager, clock), machine_of(*states) as machine:
        before(manager, clock)
        robot = Robot(clock, manager, door)
        ended = run_in_simulated_time(machine, manager, clock, handles={"robot": robot}, answers=answers)
        robot.left = manager.declared()
        return ended, robot


def decisions(robot: Robot) -> list[str]:
    return [event.what for event in robot.manager.record.of(Kind.DECISION)]
