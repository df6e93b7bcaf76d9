"""States of RAFCON with annotations in their semantic data."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from rafcon.core.singleton import global_variable_manager, state_machine_execution_engine
from rafcon.core.state_machine import StateMachine
from rafcon.core.states.barrier_concurrency_state import BarrierConcurrencyState
from rafcon.core.states.library_state import LibraryState
from rafcon.core.states.preemptive_concurrency_state import PreemptiveConcurrencyState
from rafcon.core.states.state import StateExecutionStatus
from rafcon.core.storage.storage import save_state_machine_to_path

from codra_dsl.integrations.rafcon import (
    LIBRARIES,
    AnnotationError,
    Answers,
    MissingLibraryError,
    opened,
    register,
    run_in_real_time,
    run_in_simulated_time,
)
from codra_dsl.runtime import ContextManager, Journal, Kind, SimClock, WallClock
from tests.integrations.rafcon.machines import Robot, decisions, machine_of, run, script, sequence
from tests.runtime.door import MODEL, Door, Manager, started

DECIDE = {"decide": "open"}


def known(value: bool) -> object:
    def before(manager: Manager, _: SimClock) -> None:
        manager.declare("open", value=value)

    return before


# Skills


def test_a_skill_is_declared_while_its_state_runs_and_no_longer() -> None:
    skill = sequence("open", script("pull"), annotation={"skill": "open_door"})
    ended, robot = run(script("drive"), skill, script("look", "drive"))

    assert ended.outcome == "success"
    assert robot.called == ["drive", "pull", "drive"]
    assert robot.declared == [frozenset(), {"open", "near"}, frozenset()]
    assert robot.left == frozenset()


def test_an_aborted_skill_is_withdrawn_and_its_error_is_reported() -> None:
    ended, robot = run(sequence("open", script("fail"), annotation={"skill": "open_door"}))

    assert (ended.outcome, str(ended.error)) == ("aborted", "the arm is stuck")
    assert (robot.declared, robot.left) == ([{"open", "near"}], frozenset())


def test_expected_skills_are_declared_while_the_state_runs() -> None:
    skill = sequence("open", script("pull"), annotation={"skill": "open_door"})
    _, robot = run(script("drive", annotation={"expect": "open_door, drive"}), skill)

    assert robot.declared[0] == {"open", "near"}


def test_acting_makes_the_variables_that_the_skill_changes_unknown() -> None:
    act = script("pull", annotation={"acting": "open_door"})
    _, robot = run(sequence("open", act, annotation={"skill": "open_door"}), before=known(False))
    reasons = [event.details.get("reason") for event in robot.manager.record.of(Kind.VARIABLE) if event.name == "open"]

    assert "invalidated" in reasons


# Decisions


@pytest.mark.parametrize("value", [True, False])
def test_a_state_that_looks_is_skipped_if_context_knows_the_value(value: bool) -> None:
    ended, robot = run(script("look", annotation=DECIDE), before=known(value))

    assert (ended.outcome, robot.called, decisions(robot)) == (str(value).lower(), [], ["answered"])


@pytest.mark.parametrize("angle_rad", [0.0, 1.0])
def test_a_state_looks_if_context_does_not_know_the_value_and_its_result_is_kept(angle_rad: float) -> None:
    look = script("look", annotation=DECIDE)
    door = Door(angle_rad=angle_rad, markers=0)
    ended, robot = run(sequence("open", look, annotation={"skill": "open_door"}), door=door)
    (event,) = robot.manager.record.of(Kind.DECISION)

    assert (ended.outcome, robot.called) == ("true" if angle_rad else "false", ["look"])
    assert (event.what, event.details["found"], event.details["kept"]) == ("fell_back", angle_rad > 0, True)
    assert event.instant_s - event.details["asked_s"] == 3.0


def test_a_hierarchy_state_that_looks_is_skipped_as_well() -> None:
    ended, robot = run(sequence("looks", script("look", annotation={**DECIDE}), annotation=DECIDE), before=known(True))

    assert (ended.outcome, robot.called, decisions(robot)) == ("true", [], ["answered"])


def test_a_library_state_that_looks_is_skipped_as_well() -> None:
    register()
    state = LibraryState("codra", "decide", name="open?", state_id="LIBRARY")
    state.add_semantic_data([], DECIDE, "codra")
    ended, robot = run(state, before=known(False))

    assert (ended.outcome, decisions(robot)) == ("false", ["answered"])


def test_an_outcome_without_a_value_means_that_the_value_is_unknown() -> None:
    ended, robot = run(script("look", "see_no_value", annotation=DECIDE))
    (event,) = robot.manager.record.of(Kind.DECISION)

    assert (ended.outcome, event.details["found"]) == ("success", None)


def test_outcomes_may_have_custom_names() -> None:
    look = script("look", annotation={**DECIDE, "outcomes": {"true": "wide", "false": "shut"}})
    look.outcomes[1].name, look.outcomes[2].name = "wide", "shut"
    ended, _ = run(look, before=known(False))

    assert ended.outcome == "shut"


def test_a_decision_waits_for_observers_for_its_declared_time() -> None:
    look = script("look", annotation={**DECIDE, "wait_up_to_s": "6"})
    ended, robot = run(sequence("open", look, annotation={"skill": "open_door"}), door=Door(angle_rad=1.0))

    assert (ended.outcome, robot.called, decisions(robot)) == ("true", [], ["answered"])
    assert 0.0 < robot.clock.now_s() < 6.0


def test_after_an_action_only_evidence_from_after_its_end_counts() -> None:
    """The lid moves at the end of the action, during which observers have seen it closed."""
    steps = [
        script("pull", annotation={"acting": "open_door"}),
        script("look", annotation={**DECIDE, "wait_up_to_s": "8"}),
    ]
    ended, robot = run(sequence("open", *steps, annotation={"skill": "open_door"}), door=Door(angle_rad=0.0))

    assert (ended.outcome, decisions(robot)) == ("true", ["answered"])
    assert any(reading.content is False for reading in robot.manager.history("open")), "no observer looked meanwhile"


def test_in_shadow_mode_the_state_always_looks() -> None:
    ended, robot = run(script("look", annotation=DECIDE), before=known(True), answers=Answers.SHADOW)
    (event,) = robot.manager.record.of(Kind.DECISION)

    assert (ended.outcome, robot.called) == ("false", ["look"])
    assert (event.what, event.details["agrees"]) == ("shadowed", False)


def test_without_a_bridge_a_state_machine_runs_as_before() -> None:
    with started(Door()) as (manager, clock), machine_of(script("look", annotation=DECIDE)) as machine:
        manager.declare("open", value=True)
        run_in_simulated_time(machine, manager, clock, handles={"robot": Robot(clock, manager, Door())})
        assert machine.root_state.final_outcome.name == "true"

        machine.root_state.states["LOOK"].script_text = "def execute(self, inputs, outputs, gvm):\n    return 'false'\n"
        state_machine_execution_engine.start(machine.state_machine_id)
        state_machine_execution_engine.join()
        assert machine.root_state.final_outcome.name == "false"


# The library


@pytest.mark.parametrize(("value", "outcome"), [(True, "true"), (False, "false"), (None, "unknown")])
def test_the_library_state_for_decisions_has_an_outcome_for_unknown(value: bool | None, outcome: str) -> None:
    register()
    state = LibraryState("codra", "decide", name="open?", state_id="LIBRARY")
    state.set_input_runtime_value(0, "open")
    state.set_use_input_runtime_value(0, True)
    ended, _ = run(state, before=known(value) if value is not None else lambda *_: None)

    assert ended.outcome == ("success" if value is None else outcome), "the root's outcome 0 is its success"


def test_the_library_expects_and_sets() -> None:
    register()
    expect, put = (LibraryState("codra", name, name=name, state_id=name.upper()) for name in ("expect", "set"))
    for state, values in ((expect, ["open_door"]), (put, ["localized", False])):
        for port, value in enumerate(values):
            state.set_input_runtime_value(port, value)
            state.set_use_input_runtime_value(port, True)
    _, robot = run(expect, script("drive"), put, door=Door(markers=0))

    assert robot.declared == [{"open"}]
    assert robot.manager.get("localized").value is False


# Files and time


def test_in_simulated_time_the_same_run_writes_the_same_journal(tmp_path: Path) -> None:
    for path in (tmp_path / "a.mcap", tmp_path / "b.mcap"):
        door, clock = Door(), SimClock()
        with ContextManager[str, str](MODEL, clock=clock, resources={"door": door}, record=Journal(path)) as manager:
            manager.set("localized", True)
            steps = [
                script("pull", annotation={"acting": "open_door"}),
                script("look", annotation={**DECIDE, "wait_up_to_s": "8"}),
            ]
            with machine_of(sequence("open", *steps, annotation={"skill": "open_door"})) as machine:
                robot = Robot(clock, manager, door)
                assert run_in_simulated_time(machine, manager, clock, handles={"robot": robot}).outcome == "true"

    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_concurrent_states_are_refused_in_simulated_time() -> None:
    both = BarrierConcurrencyState("both", state_id="BOTH")
    expected_error = pytest.raises(ValueError, match=r"ROOT/BOTH runs states concurrently.*use run_in_real_time")
    with started(Door()) as (manager, clock), machine_of(both) as machine, expected_error:
        run_in_simulated_time(machine, manager, clock)


def test_a_program_that_is_interrupted_stops_its_state_machine() -> None:
    class Interrupted(Robot):
        def drive(self) -> str:
            raise KeyboardInterrupt

    with started(Door()) as (manager, clock):
        with machine_of(sequence("go", script("drive"), annotation={"skill": "drive"}), script("pull")) as machine:
            robot = Interrupted(clock, manager, Door())
            with pytest.raises(KeyboardInterrupt):
                run_in_simulated_time(machine, manager, clock, handles={"robot": robot})

        assert robot.called == ["drive"]
        assert state_machine_execution_engine.finished_or_stopped()


def test_in_real_time_states_ask_from_threads_of_their_own_and_a_wait_can_be_preempted() -> None:
    look = script("look", annotation={**DECIDE, "wait_up_to_s": "3600"})

    def stop() -> None:
        while look.state_execution_status is not StateExecutionStatus.ACTIVE:
            threading.Event().wait(0.01)
        state_machine_execution_engine.stop()

    with WallClock(start_s=0.0) as clock, machine_of(look) as machine:
        manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()})
        threading.Thread(target=stop, daemon=True).start()
        ended = run_in_real_time(machine, manager, clock)
        (event,) = manager.record.of(Kind.DECISION)
        assert (ended.outcome, event.details["raised"]) == ("preempted", "preempted")

        look.script_text = "def execute(self, inputs, outputs, gvm):\n    return 'true'\n"
        look.semantic_data = {"codra": DECIDE}
        assert run_in_real_time(machine, manager, clock).outcome == "true", "it can be run again"
        manager.close()


# Mistakes


def test_all_wrong_annotations_are_reported_at_once_with_the_paths_of_their_states() -> None:
    no_outcome = script("mute", annotation={"decide": "open"})
    no_outcome.remove_outcome(1)
    with_output = script("loud", annotation={"decide": "open"})
    with_output.add_output_data_port("angle", float, 0.0, 0)
    wrong = [
        script("a", annotation={"skill": "opendoor"}),
        script("b", annotation={"acting": "open_door"}),
        script("c", annotation={"decide": "opem"}),
        script("d", annotation={"desire": "open"}),
        script("e", annotation={"decide": "open", "wait_up_to_s": "a while"}),
        script("f", annotation={"wait_up_to_s": "3"}),
        no_outcome,
        with_output,
    ]
    with started(Door()) as (manager, clock), machine_of(*wrong) as machine:
        with pytest.raises(AnnotationError) as raised:
            run_in_simulated_time(machine, manager, clock)
        assert not any("run" in vars(state) for state in machine.root_state.states.values())

    assert str(raised.value).splitlines() == [
        "ROOT/A (a): the spec has no skill 'opendoor'; it has 'drive', 'open_door'",
        "ROOT/B (b): it acts for 'open_door', but no state around it has this 'skill'",
        "ROOT/C (c): the spec has no variable 'opem': did you mean 'open'?",
        "ROOT/D (d): unknown key 'desire': there are skill, acting, expect, decide, outcomes, wait_up_to_s, max_age_s",
        "ROOT/E (e): 'wait_up_to_s' is a number of seconds, not 'a while'",
        "ROOT/F (f): 'wait_up_to_s' is for a state that decides: add 'decide'",
        "ROOT/MUTE (mute): it has no outcome 'true': add it, or map values to outcomes in 'outcomes'",
        "ROOT/LOUD (loud): it may be skipped, and then its output 'angle' is missing: decide in another state",
    ]


def test_a_closed_context_manager_aborts_the_state_that_asks_it() -> None:
    with started(Door()) as (manager, clock):
        pass
    with machine_of(sequence("open", script("pull"), annotation={"skill": "open_door"})) as machine:
        ended = run_in_simulated_time(machine, manager, clock)

    assert ended.outcome == "aborted"
    assert "closed" in str(ended.error)


def test_a_second_state_machine_is_refused_while_one_runs() -> None:
    class Twice(Robot):
        def drive(self) -> str:
            with machine_of(script("pull")) as second:
                run_in_simulated_time(second, self.manager, self.clock)
            return "success"

    with started(Door()) as (manager, clock), machine_of(script("drive")) as machine:
        ended = run_in_simulated_time(machine, manager, clock, handles={"robot": Twice(clock, manager, Door())})

    assert ended.outcome == "aborted"
    assert "one engine per process" in str(ended.error)


BEGIN = """from contextlib import ExitStack

from codra_dsl.integrations.rafcon import Bridge
from codra_dsl.runtime import ContextManager, Kind, WallClock
from tests.runtime.door import MODEL, Door


def execute(self, inputs, outputs, gvm):
    stack = ExitStack()
    clock = stack.enter_context(WallClock())
    codra = stack.enter_context(ContextManager(MODEL, clock=clock, resources={"door": Door()}))
    stack.enter_context(Bridge(codra, clock).attached(self.get_state_machine()))
    codra.declare("open", value=True)
    gvm.set_variable("at_the_end", stack, per_reference=True)
    return "success"
"""
END = """def execute(self, inputs, outputs, gvm):
    gvm.get_variable("at_the_end").close()
    return "success"
"""


def test_a_state_can_attach_the_bridge_and_another_close_it_when_rafcon_itself_starts_the_machine() -> None:
    begin, look, end = script("begin"), script("look", annotation=DECIDE), script("end")
    begin.script_text, end.script_text = BEGIN, END
    with machine_of(begin, look, end) as machine:
        state_machine_execution_engine.start(machine.state_machine_id)
        state_machine_execution_engine.join()

        assert machine.root_state.final_outcome.name == "success"
        assert look.final_outcome.name == "true", "without a robot, it was certainly skipped"
        assert "run" not in vars(look)


WAIT = """def execute(self, inputs, outputs, gvm):
    self.preemptive_wait(60)
    return "success"
"""
BRIEFLY = """def execute(self, inputs, outputs, gvm):
    manager = gvm.get_variable("manager")
    while "open" not in manager.declared():
        self.preemptive_wait(0.01)
    outputs["declared"] = sorted(manager.declared())
    return "success"
"""


def test_of_concurrent_states_in_real_time_the_first_to_end_preempts_the_other_whose_skill_is_withdrawn() -> None:
    wait, briefly = script("wait", annotation={"skill": "open_door"}), script("briefly", annotation={"skill": "drive"})
    wait.script_text, briefly.script_text = WAIT, BRIEFLY
    briefly.add_output_data_port("declared", list, [], 0)
    both = PreemptiveConcurrencyState("both", state_id="BOTH")
    for state in (wait, briefly):
        both.add_state(state)
        both.add_transition(state.state_id, 0, both.state_id, 0)
    with WallClock(start_s=0.0) as clock, machine_of(both) as machine:
        manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()})
        ended = run_in_real_time(machine, manager, clock, handles={"manager": manager})
        declared_names = manager.declared()
        manager.close()

    assert (ended.outcome, wait.final_outcome.name) == ("success", "preempted")
    assert briefly.output_data["declared"] == ["near", "open"]
    assert declared_names == frozenset()


def test_an_action_whose_skill_began_before_the_bridge_was_attached_is_reported() -> None:
    begin, act = script("begin"), script("pull", annotation={"acting": "open_door"})
    begin.script_text = BEGIN
    with machine_of(sequence("open", begin, act, annotation={"skill": "open_door"})) as machine:
        state_machine_execution_engine.start(machine.state_machine_id)
        state_machine_execution_engine.join()
        global_variable_manager.get_variable("at_the_end").close()

        assert act.final_outcome.name == "aborted"
        assert "attach the bridge before it begins" in str(act.output_data["error"])


# Libraries


@pytest.mark.parametrize(
    ("libraries", "reason"),
    [
        ({}, "There are no libraries registered: add its root key and folder to 'libraries', which has none"),
        ({"other": LIBRARIES["codra"]}, "Library 'decide' not found in sub-folder codra: add its root key and folder"),
    ],
)
def test_a_machine_whose_library_is_missing_is_an_error_and_asks_nobody(
    libraries: dict[str, Path], reason: str, tmp_path: Path
) -> None:
    register()
    machine = StateMachine(sequence("root", LibraryState("codra", "decide", name="open?", state_id="LIBRARY")))
    save_state_machine_to_path(machine, str(tmp_path / "machine"))

    for _ in range(2):
        with pytest.raises(MissingLibraryError) as raised, opened(tmp_path / "machine", libraries):
            pass
        assert f"{tmp_path / 'machine'}: " in str(raised.value)
    assert reason in str(raised.value)

    with opened(tmp_path / "machine") as complete:
        assert isinstance(complete.root_state.states["LIBRARY"], LibraryState)
