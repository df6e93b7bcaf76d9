"""Nodes with one child, tick by tick, compared with BehaviorTree.CPP's documentation."""

from __future__ import annotations

import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Result, Scope, TreeError
from tests.language.behavior_trees.stories import document, main_tree, planned, table, ticks

CASES = {
    "always success": ("<AlwaysSuccess/>", "", "success:"),
    "always failure": ("<AlwaysFailure/>", "", "failure:"),
    "an inverter turns success into failure": ("<Inverter><A/></Inverter>", "", "failure: A"),
    "an inverter turns failure into success": (
        "<Inverter><A/></Inverter>",
        "A=RF",
        """
        running: A
        success: a
        """,
    ),
    "an inverter of a skipped child is skipped": ("<Inverter><A/></Inverter>", "A=K", "skipped: A"),
    "forced success": (
        "<ForceSuccess><A/></ForceSuccess>",
        "A=RFK",
        """
        running: A
        success: a
        skipped: A
        """,
    ),
    "forced failure": (
        "<ForceFailure><A/></ForceFailure>",
        "A=RSK",
        """
        running: A
        failure: a
        skipped: A
        """,
    ),
    "keep running until failure": (
        "<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>",
        "A=SRSKF",
        """
        running: A
        running: A
        running: a
        running: A
        failure: A
        """,
    ),
    "repeat yields between rounds that took one tick": (
        '<Repeat num_cycles="3"><A/></Repeat>',
        "",
        """
        running: A
        running: A
        success: A
        """,
    ),
    "repeat goes on in the same tick after a round that took several": (
        '<Repeat num_cycles="2"><A/></Repeat>',
        "A=RSRS",
        """
        running: A
        running: a A
        success: a
        """,
    ),
    "repeat fails at once": ('<Repeat num_cycles="3"><A/></Repeat>', "A=F", "failure: A"),
    "repeat starts counting again after a failure": (
        '<Repeat num_cycles="2"><A/></Repeat>',
        "A=SFSS",
        """
        running: A
        failure: A
        running: A
        success: A
        """,
    ),
    "repeat keeps its count when a round is skipped": (
        '<Repeat num_cycles="2"><A/></Repeat>',
        "A=SKS",
        """
        running: A
        skipped: A
        success: A
        """,
    ),
    "repeat of no round succeeds": ('<Repeat num_cycles="0"><A/></Repeat>', "", "success:"),
    "repeat without end": (
        '<Repeat num_cycles="-1"><A/></Repeat>',
        "A=SSF",
        """
        running: A
        running: A
        failure: A
        """,
    ),
    "retry until a success": (
        '<RetryUntilSuccessful num_attempts="3"><A/></RetryUntilSuccessful>',
        "A=FS",
        """
        running: A
        success: A
        """,
    ),
    "retry until no attempt is left": (
        '<RetryUntilSuccessful num_attempts="2"><A/></RetryUntilSuccessful>',
        "A=RFF",
        """
        running: A
        failure: a A
        """,
    ),
    "retry of a skipped child is skipped": (
        '<RetryUntilSuccessful num_attempts="2"><A/></RetryUntilSuccessful>',
        "A=K",
        "skipped: A",
    ),
    "run once, then be skipped": (
        "<RunOnce><A/></RunOnce>",
        "A=RF",
        """
        running: A
        failure: a
        skipped:
        skipped:
        """,
    ),
    "run once, then return the same": (
        '<RunOnce then_skip="false"><A/></RunOnce>',
        "A=F",
        """
        failure: A
        failure:
        """,
    ),
    "a precondition that does not hold": ('<Precondition if="1 > 2"><A/></Precondition>', "", "failure:"),
    "a precondition with another result": (
        '<Precondition if="false" else="SKIPPED"><A/></Precondition>',
        "",
        "skipped:",
    ),
    "a loop over a queue takes one item a tick": (
        '<LoopInt queue="1;2" value="{item}"><A/></LoopInt>',
        "",
        """
        running: A
        running: A
        success:
        running: A
        """,
    ),
    "a loop over a queue ends with a failure": (
        '<LoopString queue="x;y"><A/></LoopString>',
        "A=RF",
        """
        running: A
        failure: a
        """,
    ),
    "a loop over nothing": ('<LoopBool queue="" if_empty="SKIPPED"><A/></LoopBool>', "", "skipped:"),
}


@pytest.mark.parametrize("name", CASES)
def test_a_decorator_behaves_as_documented(name: str) -> None:
    body, plans, expected = CASES[name]
    rows = table(expected)

    assert ticks(body, plans, len(rows)) == rows


def test_loops_that_yield_complete_within_one_tick_of_the_tree() -> None:
    """This is the behaviour of BehaviorTree.CPP's `tickOnce`, which ticks again if a node has only yielded."""
    log: list[str] = []
    body = '<Repeat num_cycles="3"><AsyncSequence><A/><B/></AsyncSequence></Repeat>'

    assert main_tree(document(body), planned("", log)).tick() is Result.SUCCESS
    assert log == ["A", "B"] * 3


def test_a_precondition_is_not_evaluated_for_a_running_child() -> None:
    log: list[str] = []
    scope = Scope()
    scope.create("go", True)
    tree = main_tree(document('<Precondition if="go"><A/></Precondition>'), planned("A=RRS", log), scope=scope)

    assert tree.tick() is Result.RUNNING
    scope.create("go", False)
    assert [tree.tick(), tree.tick(), tree.tick()] == [Result.RUNNING, Result.SUCCESS, Result.FAILURE]
    assert log == ["A", "a", "a"]


# Time


def test_a_delay_ticks_its_child_after_its_time() -> None:
    log: list[str] = []
    clock = SimClock()
    tree = main_tree(document('<Delay delay_msec="500"><A/></Delay>'), planned("A=RS", log), clock=clock)

    assert tree.tick() is Result.RUNNING
    assert tree.due_s == 0.5
    clock.sleep(0.4)
    assert (tree.tick(), log) == (Result.RUNNING, [])
    clock.sleep(0.1)
    assert (tree.tick(), log) == (Result.RUNNING, ["A"])
    assert tree.tick() is Result.SUCCESS


def test_a_timeout_halts_a_child_that_runs_too_long() -> None:
    log: list[str] = []
    clock = SimClock()
    tree = main_tree(document('<Timeout msec="500"><A/></Timeout>'), planned("A=R", log), clock=clock)

    assert tree.run(period_s=10.0) is Result.FAILURE
    assert clock.now_s() == 0.5  # woken when it was due, not after the period
    assert log == ["A", "A!"]


def test_a_timeout_does_not_affect_a_child_that_completes_in_time() -> None:
    log: list[str] = []
    tree = main_tree(document('<Timeout msec="500"><A/></Timeout>'), planned("A=RF", log))

    assert [tree.tick(), tree.tick()] == [Result.RUNNING, Result.FAILURE]
    assert log == ["A", "a"]


def test_a_retry_with_a_timeout_starts_again() -> None:
    """Run the example of the documentation."""
    log: list[str] = []
    clock = SimClock()
    retry = '<RetryUntilSuccessful num_attempts="3"><Timeout msec="5000"><A/></Timeout></RetryUntilSuccessful>'

    assert main_tree(document(retry), planned("A=R", log), clock=clock).run(period_s=1.0) is Result.FAILURE
    assert log == ["A", *"aaaa", "A!"] * 3
    assert clock.now_s() == 15.0


def test_sleep_runs_for_its_time() -> None:
    clock = SimClock()

    assert main_tree(document('<Sleep msec="250"/>'), planned("", []), clock=clock).run(1.0) is Result.SUCCESS
    assert clock.now_s() == 0.25
    assert main_tree(document('<Sleep msec="0"/>'), planned("", [])).tick() is Result.SUCCESS


# Entries


def test_skip_unless_updated_begins_only_after_a_write() -> None:
    log: list[str] = []
    scope = Scope()
    body = '<SkipUnlessUpdated entry="{goal}"><A/></SkipUnlessUpdated>'
    tree = main_tree(document(body), planned("A=RSS", log), scope=scope)

    assert tree.tick() is Result.SKIPPED
    scope.create("goal", "here")
    assert [tree.tick(), tree.tick(), tree.tick()] == [Result.RUNNING, Result.SUCCESS, Result.SKIPPED]
    scope.create("goal", "here")  # the same value, written again
    assert tree.tick() is Result.SUCCESS


def test_wait_value_update_runs_until_a_write() -> None:
    scope = Scope()
    tree = main_tree(document('<WaitValueUpdate entry="goal"><A/></WaitValueUpdate>'), planned("", []), scope=scope)

    assert [tree.tick(), tree.tick()] == [Result.RUNNING, Result.RUNNING]
    scope.create("goal", 1)
    assert tree.tick() is Result.SUCCESS


def test_was_entry_updated_fails_until_a_write() -> None:
    scope = Scope()
    tree = main_tree(document('<WasEntryUpdated entry="{goal}"/>'), planned("", []), scope=scope)

    assert tree.tick() is Result.FAILURE
    scope.create("goal", 1)
    assert [tree.tick(), tree.tick()] == [Result.SUCCESS, Result.FAILURE]


def test_a_loop_takes_its_items_off_a_list_in_an_entry() -> None:
    scope = Scope()
    scope.create("poses", ["p1", "p2"])
    body = '<LoopString queue="{poses}" value="{pose}"><Script code="went := pose"/></LoopString>'
    tree = main_tree(document(body), planned("", []), scope=scope)

    went = [(tree.tick(), scope.get("went"), list(scope.get("poses"))) for _ in range(3)]
    assert went == [(Result.RUNNING, "p1", ["p2"]), (Result.RUNNING, "p2", []), (Result.SUCCESS, "p2", [])]


def test_numbers_of_rounds_and_thresholds_can_be_in_entries() -> None:
    scope = Scope()
    scope.create("rounds", "2")
    tree = main_tree(document('<Repeat num_cycles="{rounds}"><A/></Repeat>'), planned("", []), scope=scope)

    assert tree.tick() is Result.SUCCESS
    scope.create("rounds", "many")
    with pytest.raises(TreeError, match="'Repeat' needs a whole number, not 'many'"):
        tree.tick()


def rounds(tag: str, plans: str) -> list[str]:
    """Return the ticks of a loop of two rounds, reduced to one after the first round."""
    log: list[str] = []
    scope = Scope()
    scope.create("rounds", 2)
    body = f'<{tag}><A _post="rounds := 1"/></{tag.split(maxsplit=1)[0]}>'
    tree = main_tree(document(body), planned(plans, log), scope=scope)
    return [f"{tree.tick()}: {' '.join(log)}" for _ in range(3)]


def test_repeat_reads_its_number_once_per_tick_and_halts_a_superfluous_child() -> None:
    assert rounds('Repeat num_cycles="{rounds}"', "A=RSR") == ["running: A", "running: A a A", "success: A a A A!"]


def test_retry_reads_its_number_after_every_failure() -> None:
    assert rounds('RetryUntilSuccessful num_attempts="{rounds}"', "A=RFR")[1] == "failure: A a"


def test_a_loop_that_is_ticked_again_without_a_reset_does_not_start_again() -> None:
    body = '<WhileDoElse><LoopInt queue="1" if_empty="FAILURE"><A/></LoopInt><B/><C/></WhileDoElse>'

    assert ticks(body, "C=R", 3) == ["running: A", "running: C", "running: c"]


def test_a_threshold_above_the_number_of_children_is_an_error() -> None:
    scope = Scope()
    scope.create("count", 3)
    body = '<Parallel success_count="{count}"><A/><B/></Parallel>'

    with pytest.raises(TreeError, match="has 2 children: 3 of them can never succeed"):
        main_tree(document(body), planned("", []), scope=scope).tick()


def test_a_loop_without_end_does_not_block_the_program() -> None:
    tree = main_tree(document('<Repeat num_cycles="-1"><A/></Repeat>'), planned("", []))

    assert tree.tick() is Result.RUNNING


@pytest.mark.parametrize(
    ("loop", "items"),
    [
        ('<LoopInt queue="1;-2" value="{item}">{}</LoopInt>', [1, -2]),
        ('<LoopDouble queue="1;2.5" value="{item}">{}</LoopDouble>', [1.0, 2.5]),
        ('<LoopBool queue="true;0" value="{item}">{}</LoopBool>', [True, False]),
        ('<LoopString queue="a b;c" value="{item}">{}</LoopString>', ["a b", "c"]),
    ],
)
def test_a_loop_reads_its_items_with_their_type(loop: str, items: list[object]) -> None:
    tree = main_tree(document(loop.replace("{}", '<Script code="went := item"/>')), planned("", []))

    visited_items = []
    while tree.tick() is Result.RUNNING:
        visited_items.append(tree.scope.get("went"))
    assert [repr(item) for item in visited_items] == [repr(item) for item in items]


def test_an_invalid_item_is_an_error() -> None:
    tree = main_tree(document('<LoopInt queue="1;x"><A/></LoopInt>'), planned("", []))

    with pytest.raises(TreeError, match="'LoopInt' cannot read the item 'x'"):
        tree.tick()
