"""Built-in leaves, and trees: read from XML, ticked and halted from outside."""

from __future__ import annotations

from xml.etree import ElementTree

from tests.language.behavior_trees.btcpp.controls import CONTROLS
from tests.language.behavior_trees.btcpp.core import (
    COMPLETED,
    Board,
    Node,
    Quirk,
    Status,
    Tick,
    UndefinedError,
    World,
    parse_entry_name,
)
from tests.language.behavior_trees.btcpp.decorators import DECORATORS, updated
from tests.language.behavior_trees.btcpp.scripts import holds, run

MOST_PASSES = 60
"""The maximum number of passes within one tick; more passes count as an endless loop."""


def tick_script(node: Node) -> Status:
    run(str(node.port("code")), node.board)
    return Status.SUCCESS


def tick_script_condition(node: Node) -> Status:
    return Status.SUCCESS if holds(str(node.port("code")), node.board) else Status.FAILURE


def tick_set_blackboard(node: Node) -> Status:
    key = parse_entry_name("value", node.attributes["value"])
    if key is not None and node.board.knows(key) and node.board.read(key) is None:
        return Status.FAILURE
    node.board.write(str(node.port("output_key")), node.port("value"))
    return Status.SUCCESS


def tick_unset(node: Node) -> Status:
    node.board.unset(str(node.port("key")), only_here=node.has(Quirk.UNSET_IS_LOCAL))
    return Status.SUCCESS


def tick_was_updated(node: Node) -> Status:
    return Status.SUCCESS if updated(node) else Status.FAILURE


def tick_sleep(node: Node) -> Status:
    if node.status is not Status.RUNNING:
        node.memory.started_ms = node.world.now_ms
        return Status.RUNNING if node.integer("msec") > 0 else Status.SUCCESS
    assert node.memory.started_ms is not None
    return Status.SUCCESS if node.world.now_ms - node.memory.started_ms >= node.integer("msec") else Status.RUNNING


LEAVES: dict[str, Tick] = {
    "AlwaysSuccess": lambda _node: Status.SUCCESS,
    "AlwaysFailure": lambda _node: Status.FAILURE,
    "Script": tick_script,
    "ScriptCondition": tick_script_condition,
    "SetBlackboard": tick_set_blackboard,
    "UnsetBlackboard": tick_unset,
    "WasEntryUpdated": tick_was_updated,
    "Sleep": tick_sleep,
}
TICKS = {**LEAVES, **DECORATORS, **CONTROLS}


class Tree:
    """A tree built from a text."""

    def __init__(self, text: str, world: World) -> None:
        root = ElementTree.fromstring(text)
        self.trees = {element.attrib["ID"]: element for element in root.iter("BehaviorTree")}
        self.world, self.board = world, Board(None, {}, automatic=False)
        self.root = self.build(self.trees[root.attrib["main_tree_to_execute"]][0], self.board)

    def build(self, element: ElementTree.Element, board: Board) -> Node:
        kind = element.attrib["ID"] if element.tag in {"Action", "Condition", "Control", "Decorator"} else element.tag
        node = Node(kind, dict(element.attrib), board, self.world, TICKS.get(kind), kind in DECORATORS)
        if kind == "SubTree":
            inner = self.trees[element.attrib["ID"]][0]
            node.children = [self.build(inner, subtree_board(node.attributes, board))]
            return node
        for name, text in node.attributes.items():
            key = parse_entry_name(name, text)
            if key is not None and not name.startswith("_"):
                board.declare(key)
        node.children = [self.build(child, board) for child in element]
        return node

    def tick(self) -> Status:
        """Tick once. Tick again within the same tick, as long as a node requests this and the tree is running."""
        status, passes = self.tick_exactly_once(), 1
        while status is Status.RUNNING and self.world.woken:
            self.world.woken, passes = False, passes + 1
            if passes > MOST_PASSES:
                raise UndefinedError("an endless loop within a tick")
            status = self.tick_exactly_once()
        if Quirk.WAKE_UP_PENDS not in self.world.quirks:
            self.world.woken = False
        return status

    def tick_exactly_once(self) -> Status:
        status = self.root.execute()
        if status in COMPLETED:
            self.root.status = Status.IDLE
        return status

    def halt(self) -> None:
        self.root.reset()


def subtree_board(attributes: dict[str, str], parent: Board) -> Board:
    """Return the board of a subtree: remapped entries, constants as text, and, with autoremap, all other names."""
    ports = {name: text for name, text in attributes.items() if name not in {"ID", "name"} and not name.startswith("_")}
    remapped = {name: key for name, text in ports.items() if (key := parse_entry_name(name, text)) is not None}
    automatic = attributes.get("_autoremap", "false") in {"1", "true", "TRUE", "True"}
    board = Board(parent, remapped, automatic=automatic)
    board.values = {name: text for name, text in ports.items() if name not in remapped}
    board.writes = dict.fromkeys(board.values, 1)
    return board
