"""Entries of trees and subtrees, compared with BehaviorTree.CPP's tutorials on ports, remapping and autoremap."""

from __future__ import annotations

from typing import Any

import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Ports, Result, Robot, Scope, Tree, TreeError
from tests.language.behavior_trees.stories import compiled, document, functions, main_tree

PORTS = (
    '<Action ID="Say"><input_port name="message"/></Action>'
    '<Action ID="Move"><input_port name="goal"/><output_port name="error" type="int"/></Action>'
)
MOVE_ROBOT = """
<BehaviorTree ID="MoveRobot"><Sequence>
  <Move goal="{target}" error="{code}"/><Script code="result := 'goal reached'; _own := 1"/>
</Sequence></BehaviorTree>
"""


def run(body: str, others: str = MOVE_ROBOT, models: str = PORTS) -> tuple[list[Any], Scope]:
    """Return the values that the robot received, and the entries of the tree Main at the end."""
    received_values: list[Any] = []
    robot = Robot()

    def say(ports: Ports) -> bool:
        received_values.append(ports.value("message"))
        return True

    def move(ports: Ports) -> bool:
        received_values.append(ports.value("goal"))
        ports.set("error", 7)
        return True

    robot.does("Say", say)
    robot.does("Move", move)
    tree = main_tree(document(body, models, others), robot)
    assert tree.tick() is Result.SUCCESS
    return received_values, tree.scope


def test_a_port_takes_a_text_or_an_entry() -> None:
    received_values, scope = run(
        '<Sequence><Script code="m := 2"/><Say message="Hello"/><Say message="{m}"/></Sequence>'
    )

    assert received_values == ["Hello", 2]
    assert list(scope.names()) == ["m"]


def test_ports_of_a_subtree_are_remapped() -> None:
    """Run the example of tutorial 6."""
    body = """<Sequence><Script code="move_goal := '1;2;3'"/>
      <SubTree ID="MoveRobot" target="{move_goal}" result="{move_result}"/><Say message="{move_result}"/></Sequence>"""

    received_values, scope = run(body)
    assert received_values == ["1;2;3", "goal reached"]
    assert sorted(scope.names()) == ["move_goal", "move_result"]  # `code` and `_own` are the subtree's own


def test_an_entry_that_a_port_names_can_be_assigned_to() -> None:
    """Run the example of tutorial 6 as printed: `=` before the entry has been written."""
    body = """<Sequence><Script code="move_goal = '1;2;3'"/>
      <SubTree ID="MoveRobot" target="{move_goal}" result="{move_result}"/><Say message="{move_result}"/></Sequence>"""

    assert run(body)[0] == ["1;2;3", "goal reached"]
    with pytest.raises(TreeError, match="the entry 'elsewhere' does not exist yet"):
        run("""<Sequence><Script code="elsewhere = '1;2;3'"/><Say message="{move_goal}"/></Sequence>""")


def test_a_port_of_a_built_in_node_can_name_an_entry() -> None:
    _, scope = run('<Sequence><Script code="n = 2"/><Repeat num_cycles="{n}"><AlwaysSuccess/></Repeat></Sequence>')

    assert scope.get("n") == 2


def test_autoremap_shares_all_entries_but_private_ones() -> None:
    body = """<Sequence><Script code="target := 'here'"/><SubTree ID="MoveRobot" _autoremap="true"/></Sequence>"""

    assert sorted(run(body)[1].names()) == ["code", "result", "target"]


def test_a_text_for_a_subtree_is_an_entry_of_its_own_even_with_autoremap() -> None:
    body = """<Sequence><Script code="target := 'here'"/>
      <SubTree ID="MoveRobot" _autoremap="true" target="there"/><Say message="{target}"/></Sequence>"""

    assert run(body)[0] == ["there", "here"]


def test_a_model_of_a_subtree_gives_defaults() -> None:
    """Run the example of tutorial 14."""
    model = """<SubTree ID="MoveRobot"><input_port name="target" default="{move_goal}"/>
      <output_port name="result" default="{answer}"/></SubTree>"""
    body = """<Sequence><Script code="move_goal := 'a'"/><SubTree ID="MoveRobot"/>
      <SubTree ID="MoveRobot" target="b"/><Say message="{answer}"/></Sequence>"""

    assert run(body, models=PORTS + model)[0] == ["a", "b", "goal reached"]


def test_the_default_of_a_model_is_used_for_a_port_without_value() -> None:
    models = """<Action ID="Say"><input_port name="message" default="{=}"/></Action>
      <Action ID="Move"><input_port name="goal" default="home"/><output_port name="error" default="{e}"/></Action>"""
    received_values, scope = run('<Sequence><Script code="message := 1"/><Say/><Move/></Sequence>', models=models)

    assert received_values == [1, "home"]
    assert scope.get("e") == 7


def test_remapping_goes_through_several_levels() -> None:
    others = MOVE_ROBOT + '<BehaviorTree ID="Outer"><SubTree ID="MoveRobot" target="{to}" code="{c}"/></BehaviorTree>'
    body = """<Sequence><Script code="x := 'far'"/><SubTree ID="Outer" to="{x}" c="{found}"/></Sequence>"""
    received_values, scope = run(body, others)

    assert received_values == ["far"]
    assert scope.get("found") == 7


def test_an_entry_with_an_at_sign_belongs_to_the_outermost_tree() -> None:
    others = '<BehaviorTree ID="In"><Sequence><Say message="{@m}"/><Script code="@n := 3"/></Sequence></BehaviorTree>'
    received_values, scope = run('<Sequence><Script code="m := 2"/><SubTree ID="In"/></Sequence>', others)

    assert received_values == [2]
    assert scope.get("n") == 3


def test_two_uses_of_a_subtree_have_entries_of_their_own() -> None:
    others = '<BehaviorTree ID="Count"><Script code="n := 1" _skipIf="false"/></BehaviorTree>'

    assert list(run('<Sequence><SubTree ID="Count"/><SubTree ID="Count"/></Sequence>', others)[1].names()) == []


def test_set_blackboard_writes_a_text_or_copies_an_entry() -> None:
    body = """<Sequence><SetBlackboard value="42" output_key="the_answer"/>
      <SetBlackboard value="{the_answer}" output_key="copy"/><UnsetBlackboard key="the_answer"/>
      <ScriptCondition code="copy == 42"/></Sequence>"""
    _, scope = run(body)

    assert scope.get("copy") == "42"
    assert not scope.has("the_answer")


def test_reading_a_missing_entry_is_an_error_that_names_the_others() -> None:
    with pytest.raises(TreeError, match="the entry 'goal' does not exist yet; existing entries: a"):
        run('<Sequence><Script code="a := 1"/><Say message="{goal}"/></Sequence>')


def test_ports_read_texts_as_the_type_that_the_action_wants() -> None:
    scope = Scope()
    scope.create("n", "7")
    ports = Ports("Act", scope, {"a": "2.5", "b": "true"}, {})

    assert (ports.number("a"), ports.truth("b"), ports.text("a")) == (2.5, True, "2.5")
    assert "c" not in ports
    with pytest.raises(TreeError, match="'Act' has no input 'c': its inputs are a, b"):
        ports.value("c")
    with pytest.raises(TreeError, match="the port 'b' of 'Act' needs a number"):
        Ports("Act", scope, {"b": "often"}, {}).number("b")


def test_a_missing_action_is_reported_before_the_first_tick() -> None:
    root = functions(compiled(document("<A/>")))["Main"]()

    with pytest.raises(TreeError, match="the robot has no action 'A': it has none"):
        Tree(root, leaves=Robot(), clock=SimClock())


def test_a_function_without_a_result_is_an_error() -> None:
    robot = Robot()
    robot.does("A", lambda _: [].append(1))  # type: ignore[arg-type, return-value]

    with pytest.raises(TreeError, match="'A' returned None: it must return True, False or a Result"):
        main_tree(document("<A/>"), robot).tick()


def test_a_name_has_one_action() -> None:
    robot = Robot()
    robot.does("A", lambda _: True)

    with pytest.raises(ValueError, match="the action 'A' already exists"):
        robot.does("A", lambda _: True)
