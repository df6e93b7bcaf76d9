"""The page on trees names every supported or refused node, every condition and every finding."""

from __future__ import annotations

import re
from pathlib import Path

from codra_dsl.language.behavior_trees import RULES
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN, POST_SCRIPTS, PRECONDITIONS, REFUSED_NODES
from codra_dsl.language.behavior_trees.elements import MAX_DEPTH
from codra_dsl.runtime.behavior_trees import Result, Robot
from tests.language.behavior_trees.stories import document, main_tree

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "reference" / "trees.md").read_text("utf-8")
TEST_FOLDER = ROOT / "tests" / "language" / "behavior_trees"
TESTS = "".join(path.read_text("utf-8") for path in sorted(TEST_FOLDER.glob("test_*.py")))


def rows(heading: str) -> dict[str, str]:
    """Return the last cell of each row in a table; the key is its first cell. `heading` is the first heading."""
    table = PAGE.split(f"| {heading} |")[1].split("\n\n")[0].splitlines()[2:]
    cells = [re.split(r"(?<!\\\\) \| ", row.strip("| ")) for row in table]
    return {row[0]: row[-1] for row in cells}


def test_every_supported_node_has_a_row_that_names_its_tests() -> None:
    switches = {f"`Switch{cases}`" for cases in range(2, 7)}
    named = rows("node")

    assert {f"`{node}`" for node in BUILT_IN} - switches == set(named) - {"`Switch2` to `Switch6`"}
    for node, file in named.items():
        tag = node.split("`")[1].rstrip("2") if "Switch" in node else node.strip("`")
        assert f"<{tag}" in (TEST_FOLDER / file.strip("`")).read_text("utf-8")


def test_every_refused_node_has_a_row_with_its_help() -> None:
    named = rows("refused")

    assert {node: named[f"`{node}`"] for node in REFUSED_NODES} == dict(REFUSED_NODES)


def test_every_condition_and_every_finding_is_on_the_page() -> None:
    assert [name for name in (*PRECONDITIONS, *POST_SCRIPTS) if f"`{name}`" not in PAGE] == []
    assert [
        rule.code for rule in RULES.values() if f"| {rule.code} | `{rule.name}` | {rule.severity} |" not in PAGE
    ] == []


def test_every_finding_is_tested() -> None:
    assert [name for name in RULES if name not in TESTS] == []


def test_the_deepest_accepted_trees_are_compiled_and_ticked() -> None:
    inverters = "<Inverter>" * (MAX_DEPTH - 4), "</Inverter>" * (MAX_DEPTH - 4)
    others = f'<BehaviorTree ID="Below">{inverters[0]}<AlwaysSuccess/>{inverters[1]}</BehaviorTree>'

    assert main_tree(document('<SubTree ID="Below"/>'.join(inverters), others=others), Robot()).tick() is Result.SUCCESS
