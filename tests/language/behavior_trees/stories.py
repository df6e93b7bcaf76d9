"""Helpers for tests of trees: read, check and compile XML, and tick the result."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from codra_dsl.generation.emit.behaviour_trees import tree_module
from codra_dsl.language.behavior_trees import Forest, check, read_text
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Action, Node, Ports, Result, Robot, Scope, Tree

LETTERS = {"R": Result.RUNNING, "S": Result.SUCCESS, "F": Result.FAILURE, "K": Result.SKIPPED}
LEAVES = "ABCDEFG"
MODELS = "".join(f'<Action ID="{leaf}"/>' for leaf in LEAVES)


def document(body: str, models: str = MODELS, others: str = "") -> str:
    """Return a file with the tree Main, other trees, and models."""
    main = f'<BehaviorTree ID="Main">{body}</BehaviorTree>{others}'
    models = f"<TreeNodesModel>{models}</TreeNodesModel>"
    return f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}{models}</root>'


def findings(text: str | bytes, enums: Mapping[str, int] | None = None) -> list[Diagnostic]:
    """Return all findings of reading and checking a text."""
    data = text.encode() if isinstance(text, str) else text
    file, read = read_text(data, "trees.xml")
    return [*read, *(check(Forest(files=(file,)), enums)[1] if file is not None else ())]


def places_and_rules(text: str | bytes) -> list[str]:
    """Return all findings as `line:column name`."""
    return [f"{f.place.span.line}:{f.place.span.column} {f.rule.name}" for f in findings(text)]


def compiled(text: str, enums: Mapping[str, int] | None = None) -> str:
    """Return the module of a text without errors."""
    file, read_problems = read_text(text.encode(), "trees.xml")
    assert file is not None, read_problems
    checked, problems = check(Forest(files=(file,)), enums)
    assert checked is not None, problems
    return tree_module(checked)


def functions(module: str) -> dict[str, Callable[[], Node]]:
    """Return the functions of a module's trees, by the ids of the trees."""
    names: dict[str, Any] = {}
    exec(compile(module, "trees.py", "exec", dont_inherit=True), names)
    trees: dict[str, Callable[[], Node]] = names["TREES"]
    return trees


def main_tree(text: str, robot: Robot, *, clock: SimClock | None = None, scope: Scope | None = None) -> Tree:
    """Return the tree Main of a text, ready to be ticked."""
    root = functions(compiled(text))["Main"]()
    return Tree(root, leaves=robot, clock=clock or SimClock(), scope=scope)


class Planned(Action):
    """An action whose results are the letters of its plan, one per tick; the last letter repeats."""

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
    """Return a robot whose actions follow plans such as `A=RRS B=F`; an action without a plan succeeds."""
    robot = Robot()
    plan = dict(assignment.split("=") for assignment in plans.split())
    for leaf in LEAVES:
        robot.can(leaf, partial(Planned, leaf, list(plan.get(leaf, "S")), log))
    return robot


def ticks(body: str, plans: str, count: int) -> list[str]:
    """Return the result and the events of each tick, `running: A B a C!`, by ticking exactly once.

    `A` is started, `a` continues, `A!` is halted.
    """
    log: list[str] = []
    tree = main_tree(document(body), planned(plans, log))
    outcomes = []
    for _ in range(count):
        log.clear()
        result = tree.tick_exactly_once()
        outcomes.append(f"{result}: {' '.join(log)}".strip())
    return outcomes


def table(text: str) -> list[str]:
    """Return the lines of a table of expected ticks."""
    return [re.sub(r"\s+", " ", line).strip() for line in text.strip().splitlines()]
