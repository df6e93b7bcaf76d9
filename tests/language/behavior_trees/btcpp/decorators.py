"""Nodes with one child."""

from __future__ import annotations

from tests.language.behavior_trees.btcpp.core import COMPLETED, Node, Quirk, Status, Tick, parse_entry_name
from tests.language.behavior_trees.btcpp.scripts import holds, number


def forced(returned: dict[Status, Status]) -> Tick:
    def tick(node: Node) -> Status:
        node.status = Status.RUNNING
        status = node.children[0].execute()
        if status in COMPLETED:
            node.reset_children()
        return returned.get(status, status)

    return tick


def loop(onward: Status, port: str) -> Tick:
    """Tick the child again in the same tick.

    If the child took several ticks, this happens immediately. If it took one tick, the tree's root is ticked again.
    """

    def tick(node: Node) -> Status:
        limit, child = node.integer(port), node.children[0]
        node.status = Status.RUNNING
        while node.memory.count < limit or limit == -1:
            fresh, status = child.status is Status.IDLE, child.execute()
            if status is Status.RUNNING:
                return status
            child.reset()
            if status is Status.SKIPPED:
                return status
            if status is not onward:
                node.memory.count = 0
                return status
            node.memory.count += 1
            if onward is Status.FAILURE:
                limit = node.integer(port)
            if fresh and (node.memory.count < limit or limit == -1):
                node.wake_up()
                return Status.RUNNING
        node.memory.count = 0
        if not node.has(Quirk.LOOP_LEAVES_CHILD):
            child.reset()
        return onward

    return tick


def tick_keep_running(node: Node) -> Status:
    node.status = Status.RUNNING
    status = node.children[0].execute()
    if status in COMPLETED:
        node.reset_children()
    return Status.FAILURE if status is Status.FAILURE else Status.RUNNING


def timer_done(node: Node, status: Status) -> None:
    if status in COMPLETED or (status is Status.SKIPPED and not node.has(Quirk.TIMERS_SURVIVE_SKIP)):
        node.memory.started_ms = None
    if status in COMPLETED:
        node.reset_children()


def tick_delay(node: Node) -> Status:
    if node.memory.started_ms is None:
        node.memory.started_ms, node.status = node.world.now_ms, Status.RUNNING
    if node.world.now_ms - node.memory.started_ms < node.integer("delay_msec"):
        return Status.RUNNING
    status = node.children[0].execute()
    timer_done(node, status)
    return status


def tick_timeout(node: Node) -> Status:
    child, limit_ms = node.children[0], node.integer("msec")
    if node.memory.started_ms is None:
        node.memory.started_ms, node.status, node.memory.expired = node.world.now_ms, Status.RUNNING, False
    if limit_ms > 0 and not node.memory.expired and node.world.now_ms - node.memory.started_ms >= limit_ms:
        node.memory.expired = True
        if child.status is Status.RUNNING:
            child.reset()
            node.memory.started_ms = None
            return Status.FAILURE
    status = child.execute()
    timer_done(node, status)
    return status


def tick_run_once(node: Node) -> Status:
    if node.memory.returned in COMPLETED:
        skips = str(node.port("then_skip", "true")).lower() in {"1", "1.0", "true"}
        return Status.SKIPPED if skips else node.memory.returned
    node.status = Status.RUNNING
    status = node.children[0].execute()
    if status in COMPLETED:
        node.memory.returned = status
        node.reset_children()
    return status


def tick_precondition(node: Node) -> Status:
    if not node.memory.open and not holds(str(node.port("if")), node.board):
        return Status[str(node.port("else", "FAILURE"))]
    node.memory.open = True
    status = node.children[0].execute()
    if status in COMPLETED:
        node.reset_children()
    if status in COMPLETED or (status is Status.SKIPPED and not node.has(Quirk.LATCHED_PRECONDITION)):
        node.memory.open = False
    return status


def unless_updated(otherwise: Status) -> Tick:
    def tick(node: Node) -> Status:
        if not node.memory.open and not updated(node):
            return otherwise
        status = node.children[0].execute()
        node.memory.open = status is Status.RUNNING
        return status

    return tick


def tick_queue(node: Node) -> Status:
    """Take one item per round; the items of a text are available again when the node starts again."""
    memory, items = node.memory, node.attributes["queue"].split(";")
    if node.status is Status.IDLE:
        memory.count, memory.open = len(items), False
    if not memory.open:
        if memory.count == 0:
            return Status[str(node.port("if_empty", "SUCCESS"))]
        item, key = items[-memory.count], parse_entry_name("value", node.attributes.get("value", ""))
        memory.count -= 1
        if key is not None:
            node.board.write(key, item if node.kind == "LoopString" else number(item))
    node.status = Status.RUNNING
    status = node.children[0].execute()
    memory.open = status is Status.RUNNING
    if status in COMPLETED:
        node.reset_children()
    return Status.FAILURE if status is Status.FAILURE else Status.RUNNING


def tick_subtree(node: Node) -> Status:
    node.status = Status.RUNNING
    status = node.children[0].execute()
    if status in COMPLETED:
        node.reset_children()
    return status


INVERTED = {Status.SUCCESS: Status.FAILURE, Status.FAILURE: Status.SUCCESS}
DECORATORS: dict[str, Tick] = {
    "Inverter": forced(INVERTED),
    "ForceSuccess": forced(dict.fromkeys(COMPLETED, Status.SUCCESS)),
    "ForceFailure": forced(dict.fromkeys(COMPLETED, Status.FAILURE)),
    "Repeat": loop(Status.SUCCESS, "num_cycles"),
    "RetryUntilSuccessful": loop(Status.FAILURE, "num_attempts"),
    "KeepRunningUntilFailure": tick_keep_running,
    "Delay": tick_delay,
    "Timeout": tick_timeout,
    "RunOnce": tick_run_once,
    "Precondition": tick_precondition,
    "SkipUnlessUpdated": unless_updated(Status.SKIPPED),
    "WaitValueUpdate": unless_updated(Status.RUNNING),
    **{f"Loop{of}": tick_queue for of in ("Int", "Double", "Bool", "String")},
    "SubTree": tick_subtree,
}


def updated(node: Node) -> bool:
    """Return whether the entry was written since this node last read it."""
    entry = node.attributes["entry"]
    before, node.memory.seen = node.memory.seen, node.board.written(parse_entry_name("entry", entry) or entry)
    return node.memory.seen != before
