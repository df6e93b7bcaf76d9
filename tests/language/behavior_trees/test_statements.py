"""Statements of BehaviorTree.CPP's documentation and unit tests, checked in our runtime and the second interpreter."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from codra_dsl.runtime import SimClock
from tests.language.behavior_trees import btcpp
from tests.language.behavior_trees.btcpp import Quirk
from tests.language.behavior_trees.pairs import acting
from tests.language.behavior_trees.statements import DEPARTURES, STATEMENTS, Statement
from tests.language.behavior_trees.stories import document, main_tree, planned

TICK_MS = 100
Entry = float | str | None


class Ours:
    """A statement's tree, compiled."""

    def __init__(self, statement: Statement, log: list[str]) -> None:
        self._clock = SimClock()
        text = document(statement.tree, others=statement.others)
        self._tree = main_tree(text, planned(statement.plans, log), clock=self._clock)

    def tick(self) -> str:
        result = self._tree.tick().value
        self._clock.sleep(TICK_MS / 1000)
        return result

    def halt(self) -> None:
        self._tree.halt()

    def write(self, entry: str, value: float) -> None:
        self._tree.scope.create(entry, value)

    def read(self, entry: str) -> Entry:
        value: Entry = self._tree.scope.get(entry) if self._tree.scope.has(entry) else None
        return value


class Theirs:
    """A statement's tree in the second interpreter."""

    def __init__(self, statement: Statement, log: list[str], *quirks: Quirk) -> None:
        self._world = acting(statement.plans, log, *quirks)
        self._tree = btcpp.Tree(document(statement.tree, others=statement.others), self._world)

    def tick(self) -> str:
        try:
            result = self._tree.tick().value
        except btcpp.UndefinedError:
            result = "throws"
        self._world.now_ms += TICK_MS
        return result

    def halt(self) -> None:
        self._tree.halt()

    def write(self, entry: str, value: float) -> None:
        self._tree.board.write(entry, value)

    def read(self, entry: str) -> Entry:
        return self._tree.board.read(entry)


def actual_rows(rows: str, log: list[str], player: Ours | Theirs) -> str:
    """Return the actual rows."""
    actual_texts = []
    for row in rows.split(" | "):
        log.clear()
        entry, equals, value = row.partition("=")
        if value.startswith("="):
            entry_value = player.read(entry)
            actual_texts.append(f"{entry}==" + ("" if entry_value is None else f"{float(entry_value):g}"))
        elif equals:
            player.write(entry, float(value))
            actual_texts.append(row)
        elif row.startswith("halt:"):
            player.halt()
            actual_texts.append(" ".join(["halt:", *log]))
        else:
            result = player.tick()
            actual_texts.append(" ".join([f"{result}:", *log]))
    return " | ".join(actual_texts)


@pytest.mark.parametrize("make", [Ours, Theirs])
@pytest.mark.parametrize("name", STATEMENTS)
def test_a_statement_holds(name: str, make: Callable[[Statement, list[str]], Ours | Theirs]) -> None:
    log: list[str] = []
    statement = STATEMENTS[name]

    assert actual_rows(statement.rows, log, make(statement, log)) == statement.rows


@pytest.mark.parametrize("quirk", Quirk)
def test_our_runtime_does_not_have_the_quirks_of_the_source(quirk: Quirk) -> None:
    statement, with_quirk = DEPARTURES[quirk]
    log: list[str] = []

    assert actual_rows(with_quirk, log, Theirs(statement, log, quirk)) == with_quirk
    assert actual_rows(statement.rows, log, Theirs(statement, log)) == statement.rows
    assert actual_rows(statement.rows, log, Ours(statement, log)) == statement.rows
