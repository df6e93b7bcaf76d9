"""Subscriptions of a context manager: what they cost, counted in executed instructions."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from codra_dsl.runtime import callbacks
from codra_dsl.runtime.callbacks import Subscription
from tests.runtime.forests import World, forest, given
from tests.runtime.forests import started as started_forest

VARIABLE_COUNT = 50
SUBSCRIPTION_COUNT = 200


def count_instructions(action: Callable[[], object]) -> int:
    """Return the number of instructions that the interpreter executes in `callbacks.py`."""
    count = 0

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal count
        frame.f_trace_opcodes = frame.f_code.co_filename == callbacks.__file__
        count += event == "opcode"
        return trace

    outer_trace = sys.gettrace()
    sys.settrace(trace)
    try:
        action()
    finally:
        sys.settrace(outer_trace)
    return count


@pytest.mark.parametrize("order", [1, -1], ids=["oldest first", "newest first"])
@pytest.mark.parametrize("kind", ["subscribe", "follow"])
def test_ending_a_subscription_costs_the_same_however_many_others_there_are(kind: str, order: int) -> None:
    model = forest([given(f"v{number}") for number in range(VARIABLE_COUNT)])
    with started_forest(model, World()) as manager:
        subscribe: Callable[..., Subscription] = getattr(manager, kind)
        subscriptions = [
            subscribe(f"v{number % VARIABLE_COUNT}", lambda *_: None) for number in range(SUBSCRIPTION_COUNT)
        ]
        costs = [count_instructions(subscription.unsubscribe) for subscription in subscriptions[::order]]

    assert len(set(costs)) == 1
    assert costs[0] > 0


def test_an_ended_subscription_gets_no_more_changes_and_the_others_get_all() -> None:
    changes: list[tuple[str, object]] = []
    with started_forest(forest([given("x"), given("y")]), World()) as manager:
        clock = manager.clock
        names = ("first", "second", "third")
        subscriptions = {
            name: manager.subscribe(["x", "y"], lambda reading, name=name: changes.append((name, reading.content)))  # type: ignore[misc]
            for name in names
        }
        clock.sleep(1.0)
        subscriptions["second"].unsubscribe()
        subscriptions["second"].unsubscribe()
        changes.clear()
        manager.set("x", True)
        clock.sleep(1.0)

    assert changes == [("first", True), ("third", True)]
