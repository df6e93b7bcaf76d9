"""Decisions in behavior trees: conditions, entries and guards, each for the actions that they concern."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.tooling.main_execution.model import SourceError
from codra_dsl.tooling.main_execution.sources import read_source
from codra_dsl.tooling.main_execution.trees import read_trees
from tests.language.behavior_trees.real_texts import NAV2_BODIES, NAV2_MODELS, nav2_file

Found = set[tuple[str, str, str]]

NAV2_DECISIONS = {
    "recovery": {("goal_updated", action, "hold") for action in ("clear_entire_costmap", "spin", "wait", "back_up")},
    "nonblocking": {("is_stuck", "follow_path", "effect")},
    "help": {
        ("would_a_planner_recovery_help", "main_tree", "precondition"),
        ("is_battery_low_0_2_battery", "main_tree", "precondition"),
    },
    "valid path": {("is_path_valid", "follow_path", "hold"), ("time_expired_10", "follow_path", "hold")},
}
"""The decisions of the bodies of Nav2, listed by hand; all other bodies have none."""


def found_in(folder: Path, body: str, others: str = "") -> Found:
    """Return the name, the skill and the role of each decision in a tree."""
    tree = f'<BehaviorTree ID="Main">{body}</BehaviorTree>'
    (folder / "a.xml").write_text(f'<root BTCPP_format="4" main_tree_to_execute="Main">{tree}{others}</root>')
    main_execution, findings = read_source(folder / "a.xml", [], folder)
    assert main_execution is not None, findings
    return {(decision.name, decision.skill, decision.role.value) for decision in main_execution.decisions}


@pytest.mark.parametrize(
    "models", ["", f"<TreeNodesModel>{NAV2_MODELS}</TreeNodesModel>"], ids=["alone", "with models"]
)
@pytest.mark.parametrize("name", NAV2_BODIES)
def test_trees_of_nav2_have_exactly_the_listed_decisions(name: str, models: str, tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(nav2_file(NAV2_BODIES[name]).replace("</root>", f"{models}</root>"))

    main_execution, _ = read_trees([tmp_path / "a.xml"], [], tmp_path)

    found = {(decision.name, decision.skill, decision.role.value) for decision in main_execution.decisions}
    assert found == NAV2_DECISIONS.get(name, set())


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (
            "<Sequence><IsA/><Go/><IsB/><Stop/></Sequence>",
            {("is_a", "go", "precondition"), ("is_b", "stop", "precondition")},
        ),
        ("<Sequence><Go/><IsA/></Sequence>", {("is_a", "go", "effect")}),
        ("<IsA/>", {("is_a", "main", "precondition")}),
        ("<Sequence><IsÖffen/><Issue/></Sequence>", {("is_offen", "issue", "precondition")}),
        ('<Fallback><Condition ID="Fine"/><Action ID="IsGo"/></Fallback>', {("fine", "is_go", "precondition")}),
        (
            '<Sequence><IsA x="1"/><IsA x="2"/><IsA x="1"/><Go/></Sequence>',
            {("is_a_1", "go", "precondition"), ("is_a_2", "go", "precondition")},
        ),
        (
            '<Sequence><IsA x="{b}"/><IsA x="{c}"/><Go/></Sequence>',
            {("is_a", "go", "precondition"), ("is_a_2", "go", "precondition")},
        ),
        (
            "<ReactiveSequence><IsA/><Sequence><IsB/><Go/></Sequence><Stop/></ReactiveSequence>",
            {
                ("is_a", "go", "hold"),
                ("is_b", "go", "precondition"),
                ("is_a", "stop", "hold"),
                ("is_b", "stop", "hold"),
            },
        ),
        ("<WhileDoElse><IsA/><Go/><Stop/></WhileDoElse>", {("is_a", "go", "hold"), ("is_a", "stop", "hold")}),
        ("<IfThenElse><IsA/><Go/><Stop/></IfThenElse>", {("is_a", "go", "precondition")}),
        ('<Go _skipIf="a" _while="b &gt; 1"/>', {("a", "go", "precondition"), ("b", "go", "hold")}),
        ('<Sequence _while="a"><Go/><Stop/></Sequence>', {("a", "go", "hold"), ("a", "stop", "hold")}),
        (
            '<Sequence><Go _onSuccess="a := true; b := 1"/><Stop _skipIf="a"/></Sequence>',
            {("a", "go", "effect"), ("a", "stop", "precondition")},
        ),
        ('<Precondition if="a == B" else="FAILURE"><Go/></Precondition>', {("a", "go", "precondition")}),
        (
            '<Sequence><ScriptCondition code="a + c * 2 &lt; 1 &amp;&amp; !b"/><Go/></Sequence>',
            {(name, "go", "precondition") for name in "abc"},
        ),
        (
            '<Switch2 variable="{mode}" case_1="x" case_2="y"><Go/><Stop/><Wait/></Switch2>',
            {("mode", "go", "precondition")},
        ),
        ("<Sequence><AlwaysSuccess/><Sleep msec='1'/><Go/></Sequence>", set()),
    ],
)
def test_each_condition_belongs_to_the_actions_that_it_concerns(body: str, expected: Found, tmp_path: Path) -> None:
    assert found_in(tmp_path, body) == expected


def test_a_subtree_is_a_skill_and_its_own_decisions_belong_to_its_actions(tmp_path: Path) -> None:
    other = '<BehaviorTree ID="EnterRoom"><Sequence><IsB/><Go/></Sequence></BehaviorTree>'

    assert found_in(tmp_path, '<Sequence><IsA/><SubTree ID="EnterRoom"/></Sequence>', other) == {
        ("is_a", "enter_room", "precondition"),
        ("is_b", "go", "precondition"),
    }


@pytest.mark.parametrize(
    ("script", "types"),
    [
        ("a", {"a": "bool"}),
        ("a &gt; 0.5", {"a": "float"}),
        ("a == 'x'", {"a": "str"}),
        ("a == MANUAL", {"a": "str"}),
        ("a == b", {"a": "bool", "b": "bool"}),
        ("a == true", {"a": "bool"}),
        ("(a ? b : c) &lt; 1", {"a": "bool", "b": "float", "c": "float"}),
        ("-a &lt; b", {"a": "float", "b": "float"}),
    ],
)
def test_the_type_of_an_entry_follows_from_its_use(script: str, types: dict[str, str], tmp_path: Path) -> None:
    text = f'<root BTCPP_format="4"><BehaviorTree ID="A"><Go _skipIf="{script}"/></BehaviorTree></root>'
    (tmp_path / "a.xml").write_text(text)

    main_execution, _ = read_trees([tmp_path / "a.xml"], [], tmp_path)

    assert {decision.name: decision.type.value for decision in main_execution.decisions} == types


def test_an_included_file_is_read_once_with_its_own_places(tmp_path: Path) -> None:
    (tmp_path / "b.xml").write_text('<root BTCPP_format="4"><BehaviorTree ID="B"><IsB/></BehaviorTree></root>')
    text = '<root BTCPP_format="4"><include path="b.xml"/>\n<BehaviorTree ID="A"><IsA/></BehaviorTree></root>'
    (tmp_path / "a.xml").write_text(text)

    main_execution, _ = read_trees([tmp_path], [], tmp_path)

    places = [(decision.name, decision.place.span) for decision in main_execution.decisions]
    assert [(name, span.file, span.line) for name, span in places] == [("is_a", "a.xml", 2), ("is_b", "b.xml", 1)]


def test_too_many_decisions_are_refused(tmp_path: Path) -> None:
    conditions = "".join(f'<IsA x="{number}"/>' for number in range(1001))
    text = f'<root BTCPP_format="4"><BehaviorTree ID="A"><Sequence>{conditions}</Sequence></BehaviorTree></root>'
    (tmp_path / "a.xml").write_text(text)

    with pytest.raises(SourceError, match="more than 1,000 decisions"):
        read_trees([tmp_path / "a.xml"], [], tmp_path)
