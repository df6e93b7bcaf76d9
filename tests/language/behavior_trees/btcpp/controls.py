"""Nodes with several children."""

from __future__ import annotations

from collections.abc import Iterator

from tests.language.behavior_trees.btcpp.core import COMPLETED, Memory, Node, Quirk, Status, Tick, UndefinedError
from tests.language.behavior_trees.btcpp.scripts import Value


def in_order(node: Node, onward: Status, *, asynchronous: bool, keeps_place: bool) -> Status:
    """Tick children, beginning with the stored one, as long as they return `onward` or are skipped."""
    memory, stop = node.memory, Status.FAILURE if onward is Status.SUCCESS else Status.SUCCESS
    begins = node.status is Status.IDLE if node.has(Quirk.SKIPS_STAY_COUNTED) else node.status is not Status.RUNNING
    if begins:
        memory.skipped = 0
    node.status = Status.RUNNING
    while memory.index < len(node.children):
        child = node.children[memory.index]
        fresh, status = child.status is Status.IDLE, child.execute()
        if status is Status.RUNNING:
            return status
        if status is stop:
            if keeps_place:
                for later in node.children[memory.index :]:
                    later.reset()
            else:
                node.reset_children()
                memory.index = 0
            return status
        memory.index += 1
        if status is Status.SKIPPED:
            memory.skipped += 1
        elif asynchronous and fresh and memory.index < len(node.children):
            node.wake_up()
            return Status.RUNNING
    all_skipped = memory.skipped == len(node.children)
    node.reset_children()
    memory.index = memory.skipped = 0
    return Status.SKIPPED if all_skipped else onward


def reactive(node: Node, onward: Status) -> Status:
    """Tick all children in every tick, beginning with the first; a running child halts all its siblings."""
    node.status, all_skipped = Status.RUNNING, True
    for child in node.children:
        status = child.execute()
        all_skipped = all_skipped and status is Status.SKIPPED
        if status is Status.RUNNING:
            for other in node.children:
                if other is not child:
                    other.reset()
            return status
        if status is Status.SKIPPED:
            child.reset()
        elif status is not onward:
            node.reset_children()
            return status
    node.reset_children()
    return Status.SKIPPED if all_skipped else onward


def threshold(node: Node, text: int) -> int:
    return max(len(node.children) + text + 1, 0) if text < 0 else text


def execute_open(node: Node) -> Iterator[int]:
    """Execute each child that has not completed and count its result; yield the number of skipped children so far."""
    node.status, skipped, memory = Status.RUNNING, 0, node.memory
    for at, child in enumerate(node.children):
        if at not in memory.completed:
            status = child.execute()
            skipped += status is Status.SKIPPED
            if status in COMPLETED:
                memory.completed.add(at)
                memory.successes += status is Status.SUCCESS
                memory.failures += status is Status.FAILURE
        yield skipped


def tick_parallel(node: Node) -> Status:
    wanted = node.integer("success_count", "-1")
    successes, failures = threshold(node, wanted), threshold(node, node.integer("failure_count", "1"))
    if len(node.children) < successes or len(node.children) < failures:
        raise UndefinedError(f"{node.kind}: a threshold above the number of children")
    skipped, memory = 0, node.memory
    for skipped in execute_open(node):
        verdict = None
        if memory.successes + (skipped if wanted < 0 else 0) >= successes:
            verdict = Status.SUCCESS
        elif len(node.children) - memory.failures < successes or memory.failures == failures:
            verdict = Status.FAILURE
        if verdict is not None:
            node.memory = Memory()
            node.reset_children()
            return verdict
    return Status.SKIPPED if skipped == len(node.children) else Status.RUNNING


def tick_parallel_all(node: Node) -> Status:
    allowed = threshold(node, node.integer("max_failures", "1"))
    if len(node.children) < allowed:
        raise UndefinedError(f"{node.kind}: a threshold above the number of children")
    memory = node.memory
    skipped = max(execute_open(node), default=0)
    if skipped == len(node.children):
        return Status.SKIPPED
    if skipped + len(memory.completed) < len(node.children):
        return Status.RUNNING
    node.reset_children()
    node.memory = Memory()
    return Status.FAILURE if memory.failures >= allowed else Status.SUCCESS


def condition_of(node: Node) -> Status:
    status = node.children[0].execute()
    if status is Status.SKIPPED and node.has(Quirk.SKIPPED_CONDITION_THROWS):
        raise UndefinedError(f"{node.kind}: its condition was skipped")
    return status


def tick_if_then_else(node: Node) -> Status:
    node.status = Status.RUNNING
    if node.memory.index == 0:
        status = condition_of(node)
        missing = status is Status.FAILURE and len(node.children) == 2
        if missing and not node.has(Quirk.FAILED_CONDITION_STAYS):
            node.reset_children()
        if missing or status not in COMPLETED:
            return status
        node.memory.index = 1 if status is Status.SUCCESS else 2
    status = node.children[node.memory.index].execute()
    if status is not Status.RUNNING:
        node.reset_children()
        node.memory.index = 0
    return status


def tick_while_do_else(node: Node) -> Status:
    node.status = Status.RUNNING
    condition = condition_of(node)
    if condition is Status.SKIPPED:
        node.reset_children()
    if condition not in COMPLETED:
        return condition
    status = Status.FAILURE
    chosen, other = (1, 2) if condition is Status.SUCCESS else (2, 1)
    if len(node.children) == 3:
        node.children[other].reset()
    if chosen < len(node.children):
        status = node.children[chosen].execute()
    if status is not Status.RUNNING:
        node.reset_children()
    return status


def same(left: Value, right: Value) -> bool:
    if str(left) == str(right):
        return True
    try:
        return abs(float(left) - float(right)) <= 2.0**-23
    except ValueError:
        return False


def tick_switch(node: Node) -> Status:
    cases = len(node.children) - 1
    try:
        variable = node.port("variable")
        chosen = next((at for at in range(cases) if same(variable, node.port(f"case_{at + 1}"))), cases)
    except UndefinedError:
        chosen = cases
    if node.memory.running not in (-1, chosen):
        node.children[node.memory.running].reset()
    status = node.children[chosen].execute()
    node.memory.running = chosen if status is Status.RUNNING else -1
    if status in COMPLETED:
        node.reset_children()
    return status


CONTROLS: dict[str, Tick] = {
    "Sequence": lambda node: in_order(node, Status.SUCCESS, asynchronous=False, keeps_place=False),
    "AsyncSequence": lambda node: in_order(node, Status.SUCCESS, asynchronous=True, keeps_place=False),
    "SequenceWithMemory": lambda node: in_order(node, Status.SUCCESS, asynchronous=True, keeps_place=True),
    "Fallback": lambda node: in_order(node, Status.FAILURE, asynchronous=False, keeps_place=False),
    "AsyncFallback": lambda node: in_order(node, Status.FAILURE, asynchronous=True, keeps_place=False),
    "ReactiveSequence": lambda node: reactive(node, Status.SUCCESS),
    "ReactiveFallback": lambda node: reactive(node, Status.FAILURE),
    "Parallel": tick_parallel,
    "ParallelAll": tick_parallel_all,
    "IfThenElse": tick_if_then_else,
    "WhileDoElse": tick_while_do_else,
    **{f"Switch{cases}": tick_switch for cases in range(2, 7)},
}
