"""Nodes with several children, tick by tick, compared with BehaviorTree.CPP's documentation."""

from __future__ import annotations

import pytest
from py_trees.common import Status
from py_trees.display import unicode_tree
from py_trees.trees import BehaviourTree

from tests.language.behavior_trees.stories import LEAVES, document, main_tree, planned, table, ticks

CASES = {
    # Sequences: "Restart" and "Tick again" of the table on SequenceNode
    "a sequence ticks all in one tick as long as they succeed": ("<Sequence><A/><B/></Sequence>", "", "success: A B"),
    "a sequence goes on with the running child": (
        "<Sequence><A/><B/><C/></Sequence>",
        "B=RRS",
        """
        running: A B
        running: b
        success: b C
        """,
    ),
    "a sequence restarts after a failure": (
        "<Sequence><A/><B/></Sequence>",
        "B=FRFS",
        """
        failure: A B
        running: A B
        failure: b
        success: A B
        """,
    ),
    "a sequence with memory ticks again what failed": (
        "<SequenceWithMemory><A/><B/></SequenceWithMemory>",
        "A=RS B=RFS",
        """
        running: A
        running: a B
        failure: b
        success: B
        """,
    ),
    "a reactive sequence restarts while a child runs": (
        "<ReactiveSequence><A/><B/></ReactiveSequence>",
        "B=RRS",
        """
        running: A B
        running: A b
        success: A b
        """,
    ),
    "a reactive sequence halts the running child when a condition before it fails": (
        "<ReactiveSequence><A/><B/><C/></ReactiveSequence>",
        "A=SFS B=RRS",
        """
        running: A B
        failure: A B!
        running: A B
        success: A b C
        """,
    ),
    "a reactive sequence halts what ran after the child that runs now": (
        "<ReactiveSequence><A/><B/></ReactiveSequence>",
        "A=SRS B=RS",
        """
        running: A B
        running: A B!
        success: a B
        """,
    ),
    "an asynchronous sequence yields after a child that completed in one tick": (
        "<AsyncSequence><A/><B/><C/></AsyncSequence>",
        "B=RS",
        """
        running: A
        running: B
        success: b C
        """,
    ),
    # Fallbacks
    "a fallback ticks all in one tick as long as they fail": ("<Fallback><A/><B/></Fallback>", "A=F", "success: A B"),
    "a fallback goes on with the running child": (
        "<Fallback><A/><B/><C/></Fallback>",
        "A=F B=RF C=F",
        """
        running: A B
        failure: b C
        """,
    ),
    "a reactive fallback interrupts a running child when one before it succeeds": (
        "<ReactiveFallback><A/><B/></ReactiveFallback>",
        "A=FFS B=R",
        """
        running: A B
        running: A b
        success: A B!
        """,
    ),
    "an asynchronous fallback yields after a child that failed in one tick": (
        "<AsyncFallback><A/><B/></AsyncFallback>",
        "A=F",
        """
        running: A
        success: B
        """,
    ),
    # Skipped children
    "a sequence ignores skipped children": ("<Sequence><A/><B/></Sequence>", "A=K", "success: A B"),
    "a sequence of skipped children is skipped": ("<Sequence><A/><B/></Sequence>", "A=K B=K", "skipped: A B"),
    "a fallback of skipped children is skipped": ("<Fallback><A/><B/></Fallback>", "A=K B=K", "skipped: A B"),
    "a fallback fails when only some are skipped": ("<Fallback><A/><B/></Fallback>", "A=K B=F", "failure: A B"),
    "a reactive sequence of skipped children is skipped": (
        "<ReactiveSequence><A/><B/></ReactiveSequence>",
        "A=K B=K",
        "skipped: A B",
    ),
    "a reactive fallback of skipped children is skipped": (
        "<ReactiveFallback><A/><B/></ReactiveFallback>",
        "A=K B=K",
        "skipped: A B",
    ),
    "a sequence asks a skipped child again the next time": (
        "<Sequence><A/><B/></Sequence>",
        "A=KS",
        """
        success: A B
        success: A B
        """,
    ),
    "skipped children of a sequence do not count for the next time": (
        "<Sequence><A/><B/></Sequence>",
        "A=KKKS B=FK",
        """
        failure: A B
        skipped: A B
        skipped: A B
        success: A B
        """,
    ),
    # Parallel
    "a parallel node needs all to succeed": (
        "<Parallel><A/><B/></Parallel>",
        "A=RS B=RRS",
        """
        running: A B
        running: a b
        success: b
        """,
    ),
    "a parallel node fails with the first failure and halts the others": (
        "<Parallel><A/><B/><C/></Parallel>",
        "A=R B=RF C=R",
        """
        running: A B C
        failure: a b A! C!
        """,
    ),
    "a parallel node decides on the way and leaves the rest alone": (
        '<Parallel success_count="1" failure_count="3"><A/><B/><C/></Parallel>',
        "A=RR B=FR C=RS",
        """
        running: A B C
        success: a c A!
        """,
    ),
    "two of three succeed before two fail": (
        '<Parallel success_count="2" failure_count="2"><A/><B/><C/></Parallel>',
        "A=S B=F C=RS",
        """
        running: A B C
        success: c
        """,
    ),
    "two of three fail before two succeed": (
        '<Parallel success_count="2" failure_count="2"><A/><B/><C/></Parallel>',
        "A=S B=F C=RF",
        """
        running: A B C
        failure: c
        """,
    ),
    "a negative threshold counts from the number of children": (
        '<Parallel success_count="-2" failure_count="-1"><A/><B/><C/></Parallel>',
        "A=S B=R C=S",
        "success: A B C B!",
    ),
    "a skipped child is not a success if a number is required": (
        '<Parallel success_count="2" failure_count="2"><A/><B/><C/></Parallel>',
        "A=K B=S C=RS",
        """
        running: A B C
        success: A c
        """,
    ),
    "a skipped child does not count if all are required": ("<Parallel><A/><B/></Parallel>", "A=K", "success: A B"),
    "parallel-all runs all to completion": (
        "<ParallelAll><A/><B/></ParallelAll>",
        "A=F B=RRS",
        """
        running: A B
        running: b
        failure: b
        """,
    ),
    "parallel-all allows failures below its number": (
        '<ParallelAll max_failures="2"><A/><B/><C/></ParallelAll>',
        "A=F",
        "success: A B C",
    ),
    "parallel-all with skipped children only is skipped": (
        "<ParallelAll><A/><B/></ParallelAll>",
        "A=K B=K",
        "skipped: A B",
    ),
    # Conditional nodes
    "if-then-else asks once": (
        "<IfThenElse><A/><B/><C/></IfThenElse>",
        "A=SF B=RRS",
        """
        running: A B
        running: b
        success: b
        """,
    ),
    "if-then-else takes its third child after a failure": (
        "<IfThenElse><A/><B/><C/></IfThenElse>",
        "A=F C=RF",
        """
        running: A C
        failure: c
        """,
    ),
    "if-then fails where its condition does": ("<IfThenElse><A/><B/></IfThenElse>", "A=F", "failure: A"),
    "if-then-else waits for its condition": (
        "<IfThenElse><A/><B/></IfThenElse>",
        "A=RS",
        """
        running: A
        success: a B
        """,
    ),
    "while-do-else asks at each tick and halts the other branch": (
        "<WhileDoElse><A/><B/><C/></WhileDoElse>",
        "A=SSFS B=R C=R",
        """
        running: A B
        running: A b
        running: A B! C
        running: A C! B
        """,
    ),
    "while-do halts its branch when the condition fails": (
        "<WhileDoElse><A/><B/></WhileDoElse>",
        "A=SF B=R",
        """
        running: A B
        failure: A B!
        """,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_composite_behaves_as_documented(name: str) -> None:
    body, plans, expected = CASES[name]
    rows = table(expected)

    assert ticks(body, plans, len(rows)) == rows


@pytest.mark.parametrize("cases", range(2, 7))
def test_a_switch_takes_the_first_case_that_is_equal(cases: int) -> None:
    given = " ".join(f'case_{number}="{number}"' for number in range(1, cases + 1))
    leaves = "".join(f"<{leaf}/>" for leaf in LEAVES[: cases + 1])

    for value in range(1, cases + 2):
        body = f'<Switch{cases} variable="{value}" {given}>{leaves}</Switch{cases}>'
        assert ticks(body, "", 1) == [f"success: {LEAVES[value - 1]}"]


def test_a_tree_can_be_ticked_and_interrupted_by_py_trees() -> None:
    log: list[str] = []
    tree = main_tree(document('<Sequence><A _skipIf="false"/><B/></Sequence>'), planned("B=RSR", log))
    outside = BehaviourTree(tree.root)

    seen = []
    for _ in range(3):
        outside.tick()
        seen.append((tree.root.status, [node.status for node in tree.root.children]))
    assert seen == [
        (Status.RUNNING, [Status.SUCCESS, Status.RUNNING]),
        (Status.SUCCESS, [Status.INVALID, Status.INVALID]),
        (Status.RUNNING, [Status.SUCCESS, Status.RUNNING]),
    ]
    tree.root.stop(Status.INVALID)
    assert log == ["A", "B", "b", "A", "B", "B!"]
    assert "[*]" not in unicode_tree(tree.root, show_status=True)
