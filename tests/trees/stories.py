"""Trees for tests: XML is read, checked, compiled, and what was compiled is ticked."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from codra_dsl.diagnostics import Diagnostic
from codra_dsl.emit.behaviour_trees import tree_module
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.trees import Action, Node, Ports, Result, Robot, Scope, Tree
from codra_dsl.trees import Forest, check, read_text

LETTERS = {"R": Result.RUNNING, "S": Result.SUCCESS, "F": Result.FAILURE, "K": Result.SKIPPED}
LEAVES = "ABCDEFG"
MODELS = "".join(f'<Action ID="{leaf}"/>' for leaf in LEAVES)


def document(body: str, models: str = MODELS, others: str = "") -> str:
    """A file with the tree Main, others, and models."""
    main = f'<BehaviorTree ID="Main">{body}</BehaviorTree>{others}'
    models = f"<TreeNodesModel>{models}</TreeNodesModel>"
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}{models}</root>'


def findings(text: str | bytes, enums: Mapping[str, int] | None = None) -> list[Diagnostic]:
    """All findings of reading and checking a text."""
    data = text.encode() if isinstance(text, str) else text
    file, read = read_text(data, "trees.xml")
    return [*read, *(check(Forest(files=(file,)), enums)[1] if file is not None else ())]


def told(text: str | bytes) -> list[str]:
    """All findings as `line:column name`."""
    return [f"{f.place.span.line}:{f.place.span.column} {f.rule.name}" for f in findings(text)]


def compiled(text: str, enums: Mapping[str, int] | None = None) -> str:
    """The module of a text, which has no errors."""
    file, read = read_text(text.encode(), "trees.xml")
    assert file is not None, read
    checked, found = check(Forest(files=(file,)), enums)
    assert checked is not None, found
    return tree_module(checked)


def functions(module: str) -> dict[str, Callable[[], Node]]:
    """The functions of a module's trees, by the ids of the trees."""
    names: dict[str, Any] = {}
    exec(compile(module, "trees.py", "exec", dont_inherit=True), names)
    trees: dict[str, Callable[[], Node]] = names["TREES"]
    return trees


def main_tree(text: str, robot: Robot, *, clock: SimClock | None = None, scope: Scope | None = None) -> Tree:
    """The tree Main of a text, ready to be ticked."""
    root = functions(compiled(text))["Main"]()
    return Tree(root, leaves=robot, clock=clock or SimClock(), scope=scope)


class Planned(Action):
    """An action that comes to what its plan says, one letter a tick; the last one for ever."""

    def __init__(self, name: str, plan: list[str], log: list[str]) -> None:
        self._name = name
        self._plan = plan
        self._log = log

    def start(self, _: Ports) -> Result:
        self._log.append(self._name)
        return self._next()

    def go_on(self, _: Ports) -> Result:
        self._log.append(self._name.lower())
        return self._next()

    def halt(self, _: Ports) -> None:
        self._log.append(f"{self._name}!")

    def _next(self) -> Result:
        return LETTERS[self._plan.pop(0) if len(self._plan) > 1 else self._plan[0]]


def planned(plans: str, log: list[str]) -> Robot:
    """A robot whose actions follow plans such as `A=RRS B=F`; an action without plan succeeds."""
    robot = Robot()
    plan = dict(each.split("=") for each in plans.split())
    for leaf in LEAVES:
        robot.can(leaf, partial(Planned, leaf, list(plan.get(leaf, "S")), log))
    return robot


def ticks(body: str, plans: str, count: int) -> list[str]:
    """What each tick comes to and what happened in it: `running: A B a C!`, by ticking exactly once.

    `A` is started, `a` goes on, `A!` is halted.
    """
    log: list[str] = []
    tree = main_tree(document(body), planned(plans, log))
    told_ = []
    for _ in range(count):
        log.clear()
        result = tree.tick_exactly_once()
        told_.append(f"{result}: {' '.join(log)}".strip())
    return told_


def table(text: str) -> list[str]:
    """The lines of a table of expected ticks."""
    return [re.sub(r"\s+", " ", line).strip() for line in text.strip().splitlines()]
