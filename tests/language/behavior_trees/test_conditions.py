"""Conditions before a tick and scripts after it, compared with BehaviorTree.CPP's guide."""

from __future__ import annotations

import pytest

from codra_dsl.runtime.behavior_trees import Result, Scope
from tests.language.behavior_trees.stories import document, main_tree, planned, table, ticks

CASES = {
    "skip": ('<Sequence><A _skipIf="true"/><B/></Sequence>', "", "success: B"),
    "fail instead": ('<Fallback><A _failureIf="true"/><B/></Fallback>', "", "success: B"),
    "succeed instead": ('<Sequence><A _successIf="true"/><B/></Sequence>', "", "success: B"),
    "nothing decides": ('<A _failureIf="false" _successIf="false" _skipIf="false" _while="true"/>', "", "success: A"),
    "failure is asked before success": ('<A _skipIf="true" _successIf="true" _failureIf="true"/>', "", "failure:"),
    "success is asked before skipping": ('<A _while="false" _skipIf="true" _successIf="true"/>', "", "success:"),
    "while does not hold": ('<A _while="false"/>', "", "skipped:"),
    "a composite is skipped with all below it": (
        '<Sequence><Sequence _skipIf="true"><A/></Sequence><B/></Sequence>',
        "",
        "success: B",
    ),
    "what decides instead of the tick has scripts after it": (
        '<Sequence><ForceSuccess><A _failureIf="true" _onFailure="x := 1"/></ForceSuccess>'
        '<B _skipIf="x == 1"/></Sequence>',
        "",
        "success:",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_condition_decides_as_in_the_guide(name: str) -> None:
    body, plans, expected = CASES[name]
    rows = table(expected)

    assert ticks(body, plans, len(rows)) == rows


def test_only_while_is_evaluated_for_a_running_node_and_halts_it() -> None:
    log: list[str] = []
    scope = Scope()
    scope.create("on", True)
    scope.create("done", False)
    body = '<A _while="on" _successIf="done" _onHalted="halted := true" _post="after := true"/>'
    tree = main_tree(document(body), planned("A=R", log), scope=scope)

    assert tree.tick() is Result.RUNNING
    scope.create("done", True)
    assert tree.tick() is Result.RUNNING
    scope.create("on", False)
    scope.create("done", False)
    assert tree.tick() is Result.SKIPPED
    assert log == ["A", "a", "A!"]
    assert (scope.has("halted"), scope.has("after")) == (True, False)


def test_scripts_after_a_tick_run_for_success_failure_or_both() -> None:
    scope = Scope()
    scope.create("trace", "")
    scripts = (
        "_onSuccess=\"trace += 's'\" _onFailure=\"trace += 'f'\" _post=\"trace += 'p'\" _onHalted=\"trace += 'h'\""
    )
    tree = main_tree(document(f"<A {scripts}/>"), planned("A=SFRKRS", []), scope=scope)

    assert [tree.tick() for _ in range(2)] == [Result.SUCCESS, Result.FAILURE]
    assert scope.get("trace") == "spfp"
    assert [tree.tick() for _ in range(2)] == [Result.RUNNING, Result.SKIPPED]
    assert scope.get("trace") == "spfp"
    assert tree.tick() is Result.RUNNING
    tree.halt()
    assert scope.get("trace") == "spfph"


def test_halting_runs_from_the_leaves_up_and_skips_idle_nodes() -> None:
    scope = Scope()
    scope.create("trace", "")
    mark = "_onHalted=\"trace += '{}'\"".format
    inner = f"<Sequence {mark('s')}><A {mark('a')}/></Sequence><B {mark('b')}/><C {mark('c')}/>"
    body = f"<Parallel {mark('p')}>{inner}</Parallel>"
    log: list[str] = []
    tree = main_tree(document(body), planned("A=R C=R", log), scope=scope)

    assert tree.tick() is Result.RUNNING
    tree.halt()
    tree.halt()

    assert scope.get("trace") == "ascp"
    assert log == ["A", "B", "C", "A!", "C!"]


def test_a_skipped_composite_is_idle_and_not_halted_later() -> None:
    scope = Scope()
    body = '<Sequence><Sequence _onHalted="halted := true"><A/></Sequence><B/></Sequence>'
    tree = main_tree(document(body), planned("A=K", []), scope=scope)

    assert tree.tick() is Result.SUCCESS
    assert not scope.has("halted")


def test_an_action_that_raises_halts_what_runs() -> None:
    log: list[str] = []
    tree = main_tree(document('<Parallel><A/><Script code="x = 1"/></Parallel>'), planned("A=R", log))

    with pytest.raises(RuntimeError, match="the entry 'x' does not exist yet"):
        tree.tick()
    assert log == ["A", "A!"]


def test_scripts_after_every_attempt_of_a_retry_run_once() -> None:
    scope = Scope()
    again = '<AlwaysFailure _onFailure="x += 1" _post="y += 1"/>'
    retry = f'<RetryUntilSuccessful num_attempts="5">{again}</RetryUntilSuccessful>'
    body = f'<Sequence><Script code="x := 0; y := 0"/>{retry}</Sequence>'
    tree = main_tree(document(body), planned("", []), scope=scope)

    assert tree.tick() is Result.FAILURE
    assert (scope.get("x"), scope.get("y")) == (5, 5)


def test_entries_written_by_a_script_affect_later_nodes_and_the_next_tick() -> None:
    log: list[str] = []
    scope = Scope()
    scope.create("state", 3)
    body = """<Sequence><A _skipIf="state != 1"/><B _skipIf="state != 2" _onSuccess="state = 1"/>
      <C _skipIf="state != 3" _onSuccess="state = 2"/></Sequence>"""
    tree = main_tree(document(body), planned("", log), scope=scope)

    assert [tree.tick() for _ in range(3)] == [Result.SUCCESS] * 3
    assert log == ["C", "B", "A"]
