"""Build the state machine with RAFCON's API and save it: `python -m examples.rafcon_lab.drawing`.

RAFCON's editor can also open the saved folder `tend_pcr_cycler`. RAFCON 2.5.2 cannot save on Python 3.13.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from rafcon.core.state_machine import StateMachine
from rafcon.core.states.execution_state import ExecutionState
from rafcon.core.states.hierarchy_state import HierarchyState
from rafcon.core.states.library_state import LibraryState
from rafcon.core.states.state import State
from rafcon.core.storage.storage import save_state_machine_to_path

from codra_dsl.integrations.rafcon import register

FOLDER = Path(__file__).parent / "tend_pcr_cycler"
MACHINE = "pcr_cycler"
DONE, GAVE_UP = "success", "gave up"

LOOK = '''def execute(self, inputs, outputs, gvm):
    """Look as the robot did before there were observers: about 14 seconds a look."""
    seen = gvm.get_variable("eyes").look_for(inputs["variable"])
    return {True: "true", False: "false", None: "not seen"}[seen]
'''
ACT = """def execute(self, inputs, outputs, gvm):
    getattr(gvm.get_variable("robot"), inputs["action"])(inputs["machine"])
    return "success"
"""
DRIVE = """from codra_papers.lab.robot import Station


def execute(self, inputs, outputs, gvm):
    gvm.get_variable("robot").drive_to(Station(inputs["station"]))
    return "success"
"""
FEEL = """def execute(self, inputs, outputs, gvm):
    outputs["localized"] = gvm.get_variable("robot").is_localized()
    return "success"
"""
RELOCALIZE = """def execute(self, inputs, outputs, gvm):
    gvm.get_variable("robot").relocalize()
    return "success"
"""

Transitions = Mapping[tuple[str, str], str]
"""A mapping from (name of a state, its outcome) to the name of the next state, or to `DONE` or `GAVE_UP`."""


def script(
    name: str, text: str, inputs: Mapping[str, str], codra: Mapping[str, object] | None = None
) -> ExecutionState:
    """Return a state with a script and with an annotation for context."""
    state = ExecutionState(name, state_id=name.upper().replace(" ", "_").replace("?", "_ASKED"))
    state.script_text = text
    for number, (port, value) in enumerate(inputs.items()):
        state.add_input_data_port(port, str, value, number)
    if codra:
        state.add_semantic_data([], dict(codra), "codra")
    return state


def look(name: str, variable: str, wait_up_to_s: str = "") -> ExecutionState:
    """Return a state that looks for the value of a decision. The state is skipped if context knows the value."""
    wait_setting = {"wait_up_to_s": wait_up_to_s} if wait_up_to_s else {}
    state = script(name, LOOK, {"variable": variable}, {"decide": variable, **wait_setting})
    state.outcomes[0].name = "not seen"
    state.add_outcome("true", 1)
    state.add_outcome("false", 2)
    return state


def act(name: str, action: str, skill: str, expect: str = "") -> ExecutionState:
    """Return a state that moves a part of the machine."""
    expect_setting = {"expect": expect} if expect else {}
    return script(name, ACT, {"action": action, "machine": MACHINE}, {"acting": skill, **expect_setting})


def hierarchy(
    name: str, states: Sequence[State], transitions: Transitions, codra: Mapping[str, object] | None = None
) -> HierarchyState:
    """Return a hierarchy state that begins with the first state; if a state aborts, the hierarchy state aborts."""
    hierarchy_state = HierarchyState(name, state_id=name.upper().replace(" ", "_"))
    hierarchy_state.add_outcome(GAVE_UP, 1)
    if codra:
        hierarchy_state.add_semantic_data([], dict(codra), "codra")
    for state in states:
        hierarchy_state.add_state(state)
    hierarchy_state.add_transition(None, None, states[0].state_id, None, transition_id=0)
    states_by_name = {state.name: state for state in states}
    end_outcome_ids = {DONE: 0, GAVE_UP: 1}
    for transition_id, ((from_name, outcome), to_name) in enumerate(transitions.items(), start=1):
        from_state = states_by_name[from_name]
        outcome_id = next(
            outcome_id for outcome_id, state_outcome in from_state.outcomes.items() if state_outcome.name == outcome
        )
        if to_name in end_outcome_ids:
            hierarchy_state.add_transition(
                from_state.state_id, outcome_id, hierarchy_state.state_id, end_outcome_ids[to_name], transition_id
            )
        else:
            hierarchy_state.add_transition(
                from_state.state_id, outcome_id, states_by_name[to_name].state_id, None, transition_id
            )
    return hierarchy_state


def make_localization_state(name: str) -> HierarchyState:
    """Return the states that write to context whether the robot is localized, and look around if the robot is lost."""
    feel_state = script("Feel", FEEL, {})
    feel_state.add_output_data_port("localized", bool, default_value=False, data_port_id=0)
    tell_state = LibraryState("codra", "set", name="Tell", state_id="TELL")
    tell_state.set_input_runtime_value(0, "robot_is_localized")
    tell_state.set_use_input_runtime_value(0, True)
    look_state = look("Localized?", "robot_is_localized")
    hierarchy_state = hierarchy(
        name,
        [feel_state, tell_state, look_state, script("Look around", RELOCALIZE, {})],
        {
            ("Feel", "success"): "Tell",
            ("Tell", "success"): "Localized?",
            ("Localized?", "true"): DONE,
            ("Localized?", "false"): "Look around",
            ("Localized?", "not seen"): GAVE_UP,
            ("Look around", "success"): "Feel",
        },
    )
    hierarchy_state.add_data_flow(feel_state.state_id, 0, tell_state.state_id, 1, data_flow_id=0)
    return hierarchy_state


def skill(
    name: str, previous_looks: Sequence[tuple[State, str]], action: State, final_look: State, goal: str
) -> HierarchyState:
    """Return a skill: decisions before the action, the action, and a look at the action's result.

    Args:
        name: together with the machine's name, the name of the skill in the spec.
        previous_looks: states that look, each with the outcome with which the skill continues. If the last of these
            states has the other outcome, the skill is already done.
        action: the state that acts.
        final_look: the state that looks whether the action reached its goal. If the action did not, it is repeated.
        goal: the outcome of `final_look` if the goal is reached.
    """
    states = [*(state for state, _ in previous_looks), action, final_look]
    transitions: dict[tuple[str, str], str] = {}
    for number, (state, continuing_outcome) in enumerate(previous_looks):
        is_last = number == len(previous_looks) - 1
        ending_outcome = {"true": "false", "false": "true"}[continuing_outcome]
        transitions[state.name, continuing_outcome] = states[number + 1].name
        transitions[state.name, ending_outcome] = DONE if is_last else GAVE_UP
        transitions[state.name, "not seen"] = GAVE_UP
    transitions[action.name, "success"] = final_look.name
    transitions[final_look.name, goal] = DONE
    transitions[final_look.name, {"true": "false", "false": "true"}[goal]] = action.name
    transitions[final_look.name, "not seen"] = GAVE_UP
    return hierarchy(name, states, transitions, {"skill": f"{name.lower()}_{MACHINE}"})


def state_machine() -> StateMachine:
    """Return the state machine: drive to the machine, then unlock, open, close and lock it."""
    is_within_reach, is_open, is_locked = (
        f"{MACHINE}_{what}" for what in ("in_manipulation_distance", "open", "locked")
    )

    def look_near() -> tuple[State, str]:
        return look("Near?", is_within_reach), "true"

    drive = hierarchy(
        "Drive",
        [
            make_localization_state("Before"),
            script("Go", DRIVE, {"station": MACHINE}, {"expect": f"unlock_{MACHINE}"}),
            make_localization_state("After"),
        ],
        {
            ("Before", DONE): "Go",
            ("Before", GAVE_UP): GAVE_UP,
            ("Go", "success"): "After",
            ("After", DONE): DONE,
            ("After", GAVE_UP): GAVE_UP,
        },
        {"skill": f"drive_to_{MACHINE}"},
    )
    steps = [
        drive,
        skill(
            "Unlock",
            [look_near(), (look("Locked?", is_locked), "true")],
            act("Turn lever", "unlock", f"unlock_{MACHINE}", expect=f"open_{MACHINE}"),
            look("Still locked?", is_locked, "8"),
            "false",
        ),
        skill(
            "Open",
            [look_near(), (look("Locked?", is_locked), "false"), (look("Open?", is_open), "false")],
            act("Pull lid", "open_lid", f"open_{MACHINE}", expect=f"close_{MACHINE}"),
            look("Now open?", is_open, "8"),
            "true",
        ),
        skill(
            "Close",
            [look_near(), (look("Open?", is_open), "true")],
            act("Lower lid", "close_lid", f"close_{MACHINE}", expect=f"lock_{MACHINE}"),
            look("Still open?", is_open, "8"),
            "false",
        ),
        skill(
            "Lock",
            [look_near(), (look("Open?", is_open), "false")],
            act("Turn lever", "lock", f"lock_{MACHINE}"),
            look("Now locked?", is_locked, "8"),
            "true",
        ),
    ]
    transitions = {(step.name, GAVE_UP): GAVE_UP for step in steps}
    transitions |= {(step.name, DONE): next_step.name for step, next_step in pairwise(steps)}
    transitions[steps[-1].name, DONE] = DONE
    return StateMachine(hierarchy("Tend", steps, transitions), creation_time="2000-01-01 00:00:00")


def main(folder: Path = FOLDER) -> None:
    """Save the state machine."""
    register()
    save_state_machine_to_path(state_machine(), str(folder), delete_old_state_machine=True)


if __name__ == "__main__":
    main()
