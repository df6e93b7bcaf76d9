"""A py_trees tree of a user, which acts and decides on context."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.common import ParallelPolicy, Status
from py_trees.composites import Parallel, Selector, Sequence
from py_trees.trees import BehaviourTree

from codra_dsl.integrations.py_trees import Acting, ContextIs, Decide, DuringSkill, Expecting, PreviewHolds
from codra_dsl.logic import Value, value
from codra_dsl.runtime import ContextManager, ContextModel, Kind, SimClock, UnknownNameError
from codra_dsl.runtime.values.model import SkillModel, VariableModel, boolean, real
from tests.runtime.cycler import HOLDS, OBSERVED, cycler
from tests.runtime.door import Door, Manager, started

TICK_S = 0.1


class Takes(Behaviour):
    """An action of the robot that takes time, and ends with a given status."""

    def __init__(
        self,
        name: str,
        clock: SimClock,
        duration_s: float,
        ends: Status = Status.SUCCESS,
        done: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(name)
        self._clock = clock
        self._duration_s = duration_s
        self._ends = ends
        self._done = done
        self._end_s = 0.0

    def initialise(self) -> None:
        self._end_s = self._clock.now_s() + self._duration_s

    def update(self) -> Status:
        if self._clock.now_s() < self._end_s:
            return Status.RUNNING
        self._done()
        return self._ends


class Urgent(Behaviour):
    """A condition of higher priority that a test sets."""

    def __init__(self) -> None:
        super().__init__("urgent")
        self.holds = False

    def update(self) -> Status:
        return Status.SUCCESS if self.holds else Status.FAILURE


def tree_of(root: Behaviour, manager: Manager, clock: SimClock) -> BehaviourTree:
    tree = BehaviourTree(root)
    tree.setup(codra=manager, clock=clock)
    return tree


def tick_until_end(tree: BehaviourTree, clock: SimClock, longest_s: float = 20.0) -> Status:
    """Tick until the tree has ended, and return its status."""
    end_s = clock.now_s() + longest_s
    while clock.now_s() < end_s:
        tree.tick()
        if tree.root.status is not Status.RUNNING:
            return tree.root.status
        clock.sleep(TICK_S)
    return tree.root.status


def decisions(manager: Manager) -> list[tuple[str, dict[str, Any]]]:
    return [(event.what, dict(event.details)) for event in manager.record.of(Kind.DECISION)]


# Conditions


@pytest.mark.parametrize(("angle_rad", "status"), [(1.0, Status.SUCCESS), (0.0, Status.FAILURE)])
def test_a_condition_succeeds_or_fails_by_the_known_value(angle_rad: float, status: Status) -> None:
    with started(Door(angle_rad=angle_rad)) as (manager, clock):
        manager.declare("open")
        clock.sleep(5.0)

        assert tick_until_end(tree_of(ContextIs("open?", "open"), manager, clock), clock) is status
        assert decisions(manager) == []


def test_a_condition_runs_while_the_variable_is_unknown_and_ends_when_it_is_seen() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        manager.declare("open")
        tree = tree_of(ContextIs("open?", "open", wait_up_to_s=10.0), manager, clock)
        tree.tick()

        assert tree.root.status is Status.RUNNING
        assert "never_observed" in tree.root.feedback_message
        assert tick_until_end(tree, clock) is Status.SUCCESS


@pytest.mark.parametrize("chosen", [Status.SUCCESS, Status.FAILURE])
def test_a_condition_that_stays_unknown_ends_after_its_wait_with_the_chosen_status(chosen: Status) -> None:
    with started(Door(markers=0)) as (manager, clock):
        manager.declare("open")
        begun_s = clock.now_s()
        tree = tree_of(ContextIs("open?", "open", wait_up_to_s=3.0, unknown=chosen), manager, clock)

        assert tick_until_end(tree, clock) is chosen
        assert clock.now_s() - begun_s == pytest.approx(3.0)
        assert tree.root.feedback_message.startswith("unknown")


def test_for_a_condition_old_evidence_counts_as_unknown() -> None:
    with started(Door()) as (manager, clock):
        manager.declare("open", value=True)
        manager.withdraw("open")
        clock.sleep(5.0)

        assert tick_until_end(tree_of(ContextIs("open?", "open"), manager, clock), clock) is Status.SUCCESS
        assert (
            tick_until_end(tree_of(ContextIs("open?", "open", max_age_s=4.0), manager, clock), clock) is Status.FAILURE
        )


def test_a_condition_on_a_number_needs_a_predicate() -> None:
    gap = VariableModel(name="gap", type=real(), sources=("main_execution",))
    model = ContextModel(name="gap", variables=(gap,), observers=())
    clock = SimClock()
    with ContextManager[str, str](model, clock=clock, resources={}) as manager:
        manager.set("gap", 0.4)
        tree = tree_of(ContextIs("wide?", "gap", holds=lambda gap: gap > 0.3), manager, clock)
        assert tick_until_end(tree, clock) is Status.SUCCESS

        with pytest.raises(TypeError, match="holds=lambda value"):
            tree_of(ContextIs("wide?", "gap"), manager, clock).tick()


def test_a_condition_may_have_a_predicate_for_its_value() -> None:
    with started(Door()) as (manager, clock):
        manager.declare("open", value=True)
        tree = tree_of(ContextIs("open?", "open", holds=lambda value: value is False), manager, clock)

        assert tick_until_end(tree, clock) is Status.FAILURE


# Skills


def test_a_skill_is_declared_while_its_subtree_runs_and_no_longer() -> None:
    with started(Door()) as (manager, clock):
        tree = tree_of(DuringSkill("open", Takes("pull", clock, 1.0), "open_door"), manager, clock)

        assert manager.declared() == frozenset()
        tree.tick()
        assert manager.declared() == {"open", "near"}
        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert manager.declared() == frozenset()


def test_a_skill_that_fails_is_withdrawn() -> None:
    with started(Door()) as (manager, clock):
        tree = tree_of(DuringSkill("open", Takes("pull", clock, 1.0, Status.FAILURE), "open_door"), manager, clock)

        assert tick_until_end(tree, clock) is Status.FAILURE
        assert manager.declared() == frozenset()
        assert manager.running() == frozenset()


def test_a_higher_priority_withdraws_what_a_skill_declared_and_it_can_run_again() -> None:
    with started(Door()) as (manager, clock):
        urgent = Urgent()
        skill = DuringSkill("open", Acting("act", Takes("pull", clock, 5.0)), "open_door")
        tree = tree_of(Selector("root", memory=False, children=[urgent, skill]), manager, clock)
        tree.tick()
        assert manager.declared() == {"open", "near"}

        urgent.holds = True
        tree.tick()
        assert manager.declared() == frozenset()
        urgent.holds = False
        tree.tick()
        assert manager.declared() == {"open", "near"}
        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert manager.declared() == frozenset()


def test_a_tick_that_raised_leaves_a_skill_declared_once_at_most() -> None:
    class Breaks(Behaviour):
        def update(self) -> Status:
            raise ZeroDivisionError

    with started(Door()) as (manager, clock):
        tree = tree_of(DuringSkill("open", Breaks("breaks"), "open_door"), manager, clock)
        for _ in range(3):
            with pytest.raises(ZeroDivisionError):
                tree.tick()
        tree.interrupt()
        tree.root.stop(Status.INVALID)

        assert manager.declared() == frozenset()


def test_acting_makes_the_variables_that_the_skill_changes_unknown() -> None:
    with started(Door(markers=0)) as (manager, clock):
        manager.declare("open", value=False)
        root = DuringSkill("open", Acting("act", Takes("pull", clock, 5.0)), "open_door")
        tree = tree_of(root, manager, clock)
        tree.tick()

        assert manager.get("open").reason == "invalidated"


def test_acting_outside_of_a_skill_is_reported_before_the_first_tick() -> None:
    with started(Door()) as (manager, clock), pytest.raises(TypeError, match="put a DuringSkill around it"):
        tree_of(Acting("act", Success("pull")), manager, clock)


# Expected skills


def test_an_expected_skill_is_declared_while_the_robot_still_drives() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        drive = Expecting("then open", Takes("drive", clock, 4.0), "open_door")
        decide = Decide("open?", Success("look"), "open", result=lambda: None)
        tree = tree_of(
            Sequence("root", memory=True, children=[drive, DuringSkill("open", decide, "open_door")]), manager, clock
        )
        tree.tick()
        assert manager.declared() == {"open"}

        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert [what for what, _ in decisions(manager)] == ["answered"]
        assert manager.declared() == frozenset()


@pytest.mark.parametrize("how", ["fails", "is interrupted"])
def test_an_expectation_is_withdrawn_if_the_subtree(how: str) -> None:
    with started(Door()) as (manager, clock):
        urgent = Urgent()
        ends = Status.FAILURE if how == "fails" else Status.SUCCESS
        drive = Expecting("then open", Takes("drive", clock, 1.0, ends), "open_door")
        tree = tree_of(Selector("root", memory=False, children=[urgent, drive]), manager, clock)
        tree.tick()
        assert manager.declared() == {"open"}
        urgent.holds = how != "fails"

        tick_until_end(tree, clock)
        assert manager.declared() == frozenset()


def test_a_reset_node_does_not_withdraw_the_expectation_of_another() -> None:
    with started(Door()) as (manager, clock):
        first = Expecting("then open", Success("drive"), "open_door")
        second = Expecting("then drive", Success("wait"), "drive")
        root = Sequence("root", memory=True, children=[first, second])
        assert tick_until_end(tree_of(root, manager, clock), clock) is Status.SUCCESS

        first.stop(Status.INVALID)
        assert manager.declared() == {"near"}


# Decisions


def perception_subtree(
    clock: SimClock, door: Door, ends: Status = Status.SUCCESS
) -> tuple[Behaviour, Callable[[], object]]:
    """Return the robot's own perception as a subtree of three seconds, and a function that returns its result."""
    seen: list[bool] = []
    look = Takes("look", clock, 3.0, ends, lambda: seen.append((door.angle_rad or 0.0) > 0.6))
    return look, lambda: seen[-1]


def test_a_decision_that_context_answers_does_not_tick_the_subtree_that_looks() -> None:
    door = Door(angle_rad=1.0)
    with started(door) as (manager, clock):
        look, read_seen_value = perception_subtree(clock, door)
        manager.declare("open")
        clock.sleep(5.0)
        tree = tree_of(Decide("open?", look, "open", result=read_seen_value), manager, clock)
        tree.tick()

        assert (tree.root.status, look.status) == (Status.SUCCESS, Status.INVALID)
        assert tree.root.feedback_message == "True, from context"


def test_a_decision_that_context_cannot_answer_is_answered_by_the_subtree_and_kept() -> None:
    door = Door(angle_rad=1.0, markers=0)
    with started(door) as (manager, clock):
        look, read_seen_value = perception_subtree(clock, door)
        manager.declare("open")
        begun_s = clock.now_s()
        tree = tree_of(Decide("open?", look, "open", result=read_seen_value), manager, clock)

        assert tick_until_end(tree, clock) is Status.SUCCESS
        ((what, details),) = decisions(manager)
        assert (what, details["found"], details["kept"]) == ("fell_back", True, True)
        assert details["asked_s"] == begun_s
        assert manager.get("open").source == "main_execution"
        assert manager.get("open").start_s == begun_s


def test_a_decision_waits_for_observers_before_the_subtree_looks() -> None:
    door = Door(angle_rad=1.0)
    with started(door) as (manager, clock):
        look, read_seen_value = perception_subtree(clock, door)
        manager.declare("open")
        tree = tree_of(Decide("open?", look, "open", result=read_seen_value, wait_up_to_s=5.0), manager, clock)
        tree.tick()
        assert (tree.root.status, tree.root.feedback_message) == (Status.RUNNING, "waiting for observers")

        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert [what for what, _ in decisions(manager)] == ["answered"]
        assert look.status is Status.INVALID


@pytest.mark.parametrize("chosen", [Status.SUCCESS, Status.FAILURE])
def test_a_subtree_whose_result_is_nan_has_found_no_value(chosen: Status) -> None:
    gap = VariableModel(name="gap", type=real(), sources=("main_execution",))
    clock = SimClock()
    with ContextManager[str, str](
        ContextModel(name="gap", variables=(gap,), observers=()), clock=clock, resources={}
    ) as manager:
        decide = Decide("wide?", Success("look"), "gap", result=lambda: math.nan, holds=bool, unknown=chosen)

        assert tick_until_end(tree_of(decide, manager, clock), clock) is chosen
        assert decide.feedback_message == "unknown: looking gave no value"


@pytest.mark.parametrize("chosen", [Status.SUCCESS, Status.FAILURE])
def test_if_the_subtree_could_not_look_the_decision_has_the_chosen_status(chosen: Status) -> None:
    door = Door(markers=0)
    with started(door) as (manager, clock):
        look, read_seen_value = perception_subtree(clock, door, Status.FAILURE)
        tree = tree_of(Decide("open?", look, "open", result=read_seen_value, unknown=chosen), manager, clock)

        assert tick_until_end(tree, clock) is chosen
        assert [(what, details["found"]) for what, details in decisions(manager)] == [("fell_back", None)]


def test_an_interrupted_decision_is_recorded_and_starts_again() -> None:
    door = Door(angle_rad=1.0, markers=0)
    with started(door) as (manager, clock):
        urgent = Urgent()
        look, read_seen_value = perception_subtree(clock, door)
        decide = Decide("open?", look, "open", result=read_seen_value)
        tree = tree_of(Selector("root", memory=False, children=[urgent, decide]), manager, clock)
        tree.tick()
        assert look.status is Status.RUNNING
        urgent.holds = True
        tree.tick()
        urgent.holds = False

        assert look.status is Status.INVALID
        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert [details.get("raised") for _, details in decisions(manager)] == ["interrupted", None]


def test_in_shadow_mode_the_subtree_always_looks_and_the_event_log_records_whether_context_agrees() -> None:
    door = Door(angle_rad=1.0)
    with started(door) as (manager, clock):
        look, read_seen_value = perception_subtree(clock, door)
        manager.declare("open")
        clock.sleep(5.0)
        tree = tree_of(Decide("open?", look, "open", result=read_seen_value, shadow=True), manager, clock)

        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert [(what, details["agrees"]) for what, details in decisions(manager)] == [("shadowed", True)]


def test_after_an_action_a_decision_uses_only_evidence_from_after_its_end() -> None:
    """The lid moves at the end of the action: an observer that looked during the action has seen it closed."""
    door = Door(angle_rad=0.0)
    with started(door) as (manager, clock):
        look, read_seen_value = perception_subtree(clock, door)
        pull = Takes("pull", clock, 6.0, done=lambda: setattr(door, "angle_rad", 1.0))
        steps = [Acting("act", pull), Decide("open?", look, "open", result=read_seen_value, wait_up_to_s=8.0)]
        skill = DuringSkill("open", Sequence("steps", memory=True, children=list(steps)), "open_door")
        tree = tree_of(skill, manager, clock)
        clock.sleep(3.0)

        assert tick_until_end(tree, clock) is Status.SUCCESS
        ((what, details),) = decisions(manager)
        assert (what, details["value"]) == ("answered", True)
        assert any(reading.content is False for reading in manager.history("open")), (
            "no observer looked during the action"
        )


def test_two_branches_may_run_different_skills_at_the_same_time() -> None:
    with started(Door()) as (manager, clock):
        drive = DuringSkill("drive", Takes("wheels", clock, 2.0), "drive")
        pull = DuringSkill("open", Takes("arm", clock, 1.0), "open_door")
        both = Parallel("both", policy=ParallelPolicy.SuccessOnAll(), children=[drive, pull])
        tree = tree_of(both, manager, clock)
        tree.tick()
        assert manager.declared() == {"near", "open"}
        clock.sleep(1.0)
        tree.tick()

        assert manager.declared() == {"near"}
        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert manager.declared() == frozenset()


# Mistakes


def test_a_name_that_the_spec_lacks_is_reported_before_the_first_tick() -> None:
    with started(Door()) as (manager, clock):
        with pytest.raises(UnknownNameError, match="did you mean 'open'"):
            tree_of(ContextIs("open?", "opem"), manager, clock)
        with pytest.raises(UnknownNameError, match="open_door"):
            tree_of(DuringSkill("open", Success("pull"), "opendoor"), manager, clock)


def test_the_error_of_a_tree_without_a_context_manager_explains_setup() -> None:
    with pytest.raises(TypeError, match=r"call tree.setup\(codra=codra, clock=clock\)"):
        BehaviourTree(ContextIs("open?", "open")).setup()
    with pytest.raises(RuntimeError, match=r"call tree.setup\(codra=codra, clock=clock\)"):
        BehaviourTree(ContextIs("open?", "open")).tick()


# Any tree

WHOSE = {"drive": {"near"}, "open_door": {"open", "near"}}
"""The variables that each skill previews and monitors."""

Shape = tuple[object, ...]
LEAVES = st.tuples(
    st.just("takes"), st.sampled_from([0.0, 0.3, 1.0]), st.sampled_from([Status.SUCCESS, Status.FAILURE])
)
WITHIN_SKILLS = st.recursive(
    LEAVES | st.just(("urgent",)) | st.just(("is",)),
    lambda shapes: st.one_of(
        st.tuples(
            st.sampled_from(["sequence", "selector", "parallel", "reactive"]), st.lists(shapes, min_size=1, max_size=3)
        ),
        st.tuples(st.sampled_from(["skill drive", "skill open_door", "acting", "decide"]), shapes),
    ),
    max_leaves=8,
)


def build_behaviour(shape: Shape, clock: SimClock, urgent: list[Urgent]) -> Behaviour:
    """Return the tree of a shape; its `Urgent` nodes are added to the list."""
    what, *rest = shape
    match what:
        case "takes":
            return Takes("takes", clock, *rest)
        case "urgent":
            urgent.append(Urgent())
            return urgent[-1]
        case "is":
            return ContextIs("is", "open", wait_up_to_s=0.5)
        case "acting":
            return Acting("acting", build_behaviour(rest[0], clock, urgent))
        case "decide":
            return Decide(
                "decide", build_behaviour(rest[0], clock, urgent), "open", result=lambda: True, wait_up_to_s=0.2
            )
        case "skill drive" | "skill open_door":
            return DuringSkill(what, build_behaviour(rest[0], clock, urgent), what.removeprefix("skill "))
    children = [build_behaviour(child, clock, urgent) for child in rest[0]]
    if what == "parallel":
        return Parallel(what, policy=ParallelPolicy.SuccessOnAll(synchronise=False), children=children)
    composite = Selector if what == "selector" else Sequence
    return composite(what, memory=what != "reactive", children=children)


@given(shape=WITHIN_SKILLS, switches=st.lists(st.tuples(st.integers(0, 7), st.booleans()), min_size=1, max_size=12))
def test_in_any_tree_exactly_the_running_skills_are_declared(shape: Shape, switches: list[tuple[int, bool]]) -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        urgent: list[Urgent] = []
        root = DuringSkill("root", build_behaviour(shape, clock, urgent), "drive")
        tree = tree_of(root, manager, clock)
        for which, holds in switches:
            for one in urgent[which : which + 1]:
                one.holds = holds
            tree.tick()
            clock.sleep(TICK_S)
            running = [
                node for node in root.iterate() if isinstance(node, DuringSkill) and node.status is Status.RUNNING
            ]
            assert manager.declared() == {name for node in running for name in WHOSE[node.running_skill.model.name]}
        root.stop(Status.INVALID)

        assert manager.declared() == frozenset()
        assert manager.running() == frozenset()


# Previews


def preview_status(values: Mapping[str, Value | None], **arguments: Any) -> tuple[Status, str]:
    with cycler(values) as (manager, clock):
        tree = tree_of(PreviewHolds("open?", "open_cycler", **arguments), manager, clock)
        status = tick_until_end(tree, clock)
        assert len(manager.record.of(Kind.PREVIEW)) == 1
        return status, tree.root.feedback_message


def test_a_preview_succeeds_fails_or_has_the_chosen_status_and_states_the_reason() -> None:
    unknown = {**HOLDS, "gap": None}

    assert preview_status(HOLDS) == (Status.SUCCESS, "holds")
    assert preview_status({**unknown, "locked": True}) == (Status.FAILURE, "violated: locked == false")
    assert preview_status(unknown)[0] is Status.FAILURE
    assert preview_status(unknown, unknown=Status.SUCCESS)[0] is Status.SUCCESS
    assert preview_status(unknown, wait_up_to_s=2.0)[1].startswith("unknown: gap (never_observed")


def test_a_preview_waits_for_observers_over_several_ticks_and_records_one_decision() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door(angle_rad=1.0)}) as manager:
        manager.set("localized", True)
        node = PreviewHolds("pass?", "pass_door", wait_up_to_s=9.0)
        tree = tree_of(Sequence("pass", memory=True, children=[node]), manager, clock)
        manager.expect("pass_door")
        tree.tick()

        assert (node.status, node.feedback_message.partition(":")[0]) == (Status.RUNNING, "unknown")
        assert tick_until_end(tree, clock) is Status.SUCCESS
        assert [event.what for event in manager.record.of(Kind.PREVIEW)] == ["answered"]


def write_late(manager: Manager, clock: SimClock) -> None:
    """Write a value that was seen shortly before."""
    manager.set("open", True, evidence_s=clock.now_s() - 0.01)


def test_a_preview_uses_no_evidence_from_before_the_end_of_an_action_that_changes_a_variable() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door(angle_rad=1.0)}) as manager:
        manager.set("localized", True)
        manager.expect("pass_door")
        clock.sleep(3.0)
        write = partial(write_late, manager, clock)
        act = Acting("act", Takes("pull", clock, 1.0, done=write))
        preview = PreviewHolds("again?", "pass_door", unknown=Status.SUCCESS)
        skill = DuringSkill("pass", Sequence("steps", memory=True, children=[act, preview]), "pass_door")
        tick_until_end(tree_of(skill, manager, clock), clock)

        assert manager.get("open").known
        assert preview.feedback_message == "unknown: open (too_old)"


def test_a_derived_variable_uses_no_evidence_of_its_inputs_from_before_the_end_of_an_action() -> None:
    """The lid is seen shortly before the end of the action; `localized`, the other input, is much older."""
    ready = VariableModel(name="ready", type=boolean(), derived=value("open") & value("localized"))
    skill = SkillModel(name="pass_door", preview=("ready",), monitor=("open",), changes=("open",))
    model = replace(OBSERVED, variables=(*OBSERVED.variables, ready), skills=(skill,))
    clock = SimClock()
    with Manager(model, clock=clock, resources={"door": Door(angle_rad=1.0)}) as manager:
        manager.set("localized", True)
        manager.expect("pass_door")
        clock.sleep(3.0)
        nodes = [
            PreviewHolds("preview", "pass_door", unknown=Status.SUCCESS),
            ContextIs("condition", "ready", unknown=Status.SUCCESS),
            Decide("decision", Success("look"), "ready", result=lambda: None, unknown=Status.SUCCESS),
            Decide("later", Success("look"), "ready", result=lambda: None, wait_up_to_s=5.0),
        ]
        act = Acting("act", Takes("pull", clock, 1.0, done=partial(write_late, manager, clock)))
        tree = tree_of(DuringSkill("pass", Sequence("steps", True, [act, *nodes]), "pass_door"), manager, clock)
        assert tick_until_end(tree, clock) is Status.SUCCESS

        assert nodes[0].feedback_message == "unknown: ready (too_old)"
        assert [event.what for event in manager.record.of(Kind.DECISION)] == ["fell_back", "answered"]
        assert nodes[3].feedback_message == "True, from context"


def test_an_interrupted_preview_is_abandoned() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door(markers=0)}) as manager:
        urgent, node = Urgent(), PreviewHolds("pass?", "pass_door", wait_up_to_s=9.0)
        tree = tree_of(Selector("root", memory=False, children=[urgent, node]), manager, clock)
        tree.tick()
        urgent.holds = True
        tree.tick()

        (event,) = manager.record.of(Kind.PREVIEW)
        assert (event.what, event.details["raised"]) == ("unanswered", "interrupted")


def test_a_preview_of_an_unknown_skill_is_an_error_before_the_first_tick() -> None:
    with cycler() as (manager, clock), pytest.raises(UnknownNameError, match="no skill 'fly'"):
        tree_of(PreviewHolds("fly?", "fly"), manager, clock)
