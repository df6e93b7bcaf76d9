"""The common parts of all nodes: status, conditions around a tick, halting, and the blackboard."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field

from tests.language.behavior_trees.btcpp.scripts import Value, holds, number, run


class Status(enum.Enum):
    IDLE = "idle"
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    SKIPPED = "skipped"


COMPLETED = (Status.SUCCESS, Status.FAILURE)


class Quirk(enum.Enum):
    """Behaviour of the source that the documentation does not describe."""

    SKIPPED_KEEPS_RUNNING = "a node that began to run and then is skipped stays running, and is halted later"
    WAKE_UP_PENDS = "a wake-up in a tick that completes is kept, and a later tick runs twice"
    LATCHED_PRECONDITION = "Precondition forgets neither at a halt nor at a skip that its condition held"
    SKIPPED_CONDITION_THROWS = "IfThenElse and WhileDoElse throw when their condition is skipped"
    FAILED_CONDITION_STAYS = "IfThenElse without else does not reset its condition that failed"
    COMPLETED_ACTION_REPEATS = "an action that completed and was not reset returns the same again without acting"
    TIMERS_SURVIVE_SKIP = "Delay and Timeout keep their started timer when their child is skipped"
    UPDATED_HALTS_NOTHING = "SkipUnlessUpdated and WaitValueUpdate do not halt their child"
    LOOP_LEAVES_CHILD = "Repeat and RetryUntilSuccessful do not halt a child that is one too many"
    SKIPS_STAY_COUNTED = "a sequence or fallback that completed and was not reset also counts its previous skips"
    UNSET_IS_LOCAL = "UnsetBlackboard does not remove an entry that is remapped"


class UndefinedError(Exception):
    """Raised where BehaviorTree.CPP throws or never returns."""


class Board:
    """A blackboard: its own entries, names that are mapped to the parent's entries, and optionally all other names."""

    def __init__(self, parent: Board | None, remapped: dict[str, str], *, automatic: bool) -> None:
        self.parent, self.remapped, self.automatic = parent, remapped, automatic
        self.values: dict[str, Value] = {}
        self.writes: dict[str, int] = {}
        self.declared: set[str] = set()

    def place(self, key: str) -> tuple[Board, str]:
        """Return the board of an entry, and its name there."""
        if key in self.values or self.parent is None:
            return self, key
        if key in self.remapped:
            return self.parent.place(self.remapped[key])
        return self.parent.place(key) if self.automatic and not key.startswith("_") else (self, key)

    def read(self, key: str) -> Value | None:
        board, name = self.place(key)
        return board.values.get(name)

    def knows(self, key: str) -> bool:
        board, name = self.place(key)
        return name in board.values or name in board.declared

    def declare(self, key: str) -> None:
        """Declare an entry that a port names. The entry then exists without a value."""
        board, name = self.place(key)
        board.declared.add(name)

    def write(self, key: str, value: Value) -> None:
        """Write an entry; a text is converted to a number if the entry contains a number."""
        board, name = self.place(key)
        board.values[name] = number(value) if isinstance(board.values.get(name), float) else value
        board.writes[name] = board.writes.get(name, 0) + 1

    def written(self, key: str) -> int:
        board, name = self.place(key)
        return board.writes.get(name, 0)

    def unset(self, key: str, *, only_here: bool) -> None:
        board, name = (self, key) if only_here else self.place(key)
        board.values.pop(name, None)
        board.writes.pop(name, None)
        board.declared.discard(name)


@dataclass
class World:
    """The outside of a tree.

    Attributes:
        act: returns the status of a leaf for an event (`start`, `running`, `halt`) and the leaf's name.
    """

    act: Callable[[str, str], Status]
    quirks: frozenset[Quirk] = frozenset()
    now_ms: float = 0.0
    woken: bool = False


@dataclass
class Memory:
    """The state of a node between ticks; each kind of node uses a part of it."""

    index: int = 0
    skipped: int = 0
    count: int = 0
    successes: int = 0
    failures: int = 0
    completed: set[int] = field(default_factory=set)
    started_ms: float | None = None
    expired: bool = False
    open: bool = False
    running: int = -1
    seen: int = 0
    returned: Status = Status.IDLE


Tick = Callable[["Node"], Status]
PRECONDITIONS = (("_failureIf", Status.FAILURE), ("_successIf", Status.SUCCESS), ("_skipIf", Status.SKIPPED))


@dataclass(eq=False)
class Node:
    """A node of a tree. `tick` is None for a leaf of the robot."""

    kind: str
    attributes: dict[str, str]
    board: Board
    world: World
    tick: Tick | None
    is_decorator: bool
    children: list[Node] = field(default_factory=list)
    status: Status = Status.IDLE
    memory: Memory = field(default_factory=Memory)

    def has(self, quirk: Quirk) -> bool:
        return quirk in self.world.quirks

    # ports

    def port(self, name: str, default: str = "") -> Value:
        text = self.attributes.get(name, default)
        key = parse_entry_name(name, text)
        if key is None:
            return text
        stored_value = self.board.read(key)
        if stored_value is None:
            raise UndefinedError(f"{self.kind}: no entry {text}")
        return stored_value

    def integer(self, name: str, default: str = "") -> int:
        value = number(self.port(name, default))
        if not value.is_integer():
            raise UndefinedError(f"{self.kind}: {name} is {value}")
        return int(value)

    # one tick

    def execute(self) -> Status:
        status = self.check_preconditions()
        if status is None:
            status = self.tick_leaf() if self.tick is None else self.tick(self)
            if self.is_decorator and self.children[0].status in COMPLETED:
                self.children[0].status = Status.IDLE
        if status in COMPLETED:
            self.script("_onSuccess" if status is Status.SUCCESS else "_onFailure")
            self.script("_post")
        if status is not Status.SKIPPED:
            self.status = status
        elif self.status is Status.RUNNING and not self.has(Quirk.SKIPPED_KEEPS_RUNNING):
            self.status = Status.IDLE
        return status

    def check_preconditions(self) -> Status | None:
        """Return the status that the preconditions decide, or None.

        They are evaluated in this order. All except `_while` are evaluated only while the node is not running.
        """
        if self.status is Status.IDLE:
            for attribute, status in PRECONDITIONS:
                if attribute in self.attributes and holds(self.attributes[attribute], self.board):
                    return status
        is_while_checked = self.status in (Status.IDLE, Status.RUNNING) and "_while" in self.attributes
        if not is_while_checked or holds(self.attributes["_while"], self.board):
            return None
        if self.status is Status.RUNNING:
            self.halt()
        return Status.SKIPPED

    def tick_leaf(self) -> Status:
        """Return the status of the robot's leaf, which continues if it is running, and is started otherwise."""
        if self.status in COMPLETED and self.has(Quirk.COMPLETED_ACTION_REPEATS):
            return self.status
        return self.world.act("running" if self.status is Status.RUNNING else "start", self.kind)

    def script(self, attribute: str) -> None:
        if attribute in self.attributes:
            run(self.attributes[attribute], self.board)

    def wake_up(self) -> None:
        self.world.woken = True

    # halting: the children from the left, then the script

    def halt(self) -> None:
        if self.kind in {"SkipUnlessUpdated", "WaitValueUpdate"} and self.has(Quirk.UPDATED_HALTS_NOTHING):
            self.memory.open = False
        else:
            self.forget()
            if self.tick is None and self.status is Status.RUNNING:
                self.world.act("halt", self.kind)
            self.reset_children()
        self.status = Status.IDLE
        self.script("_onHalted")

    def forget(self) -> None:
        kept, self.memory = self.memory, Memory()
        self.memory.seen, self.memory.returned = kept.seen, kept.returned
        if self.kind == "SequenceWithMemory":
            self.memory.index, self.memory.skipped = kept.index, kept.skipped
        if self.kind.startswith("Loop"):
            self.memory.count = kept.count
        if self.kind == "Precondition" and self.has(Quirk.LATCHED_PRECONDITION):
            self.memory.open = kept.open

    def reset(self) -> None:
        if self.status is Status.RUNNING:
            self.halt()
        self.status = Status.IDLE

    def reset_children(self) -> None:
        for child in self.children:
            child.reset()


def parse_entry_name(name: str, text: str) -> str | None:
    """Return the entry that `{entry}` names; `{=}` means the port's own name."""
    if not (text.startswith("{") and text.endswith("}") and len(text) > 2):
        return None
    return name if text == "{=}" else text[1:-1]
