"""Trees written back, equal when read again, with comments and what has no effect; and the module that is emitted."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings

from codra_dsl.trees import TreeFile, read_text, write
from tests.trees.random_trees import RandomTree
from tests.trees.stories import compiled, document
from tests.trees.test_reference import trees

ROOT = Path(__file__).parents[2]
KEPT = """<?xml version="1.0"?>
<!-- before all -->
<root BTCPP_format="4" main_tree_to_execute="Main" project_name="store &amp; more">
  <include path="other.xml"/>
  <!-- of the tree -->
  <BehaviorTree ID="Main" _fullpath="x">
    <!-- of the root -->
    <Sequence name="a &lt;b&gt; &quot;c&quot;&#10;d" _uid="1" _note="kept">
      <Action ID="Own" port="{x}" _onSuccess="x := 'a &amp; b'"/>
      <!-- of the leaf --><!-- and another -->
      <AlwaysSuccess _description="said"/>
      <!-- last -->
    </Sequence>
  </BehaviorTree>
  <TreeNodesModel>
    <!-- of a model -->
    <Condition ID="Seen" editable="true">
      <input_port name="at" type="Pose" default="{=}" description="where"/>
    </Condition>
    <SubTree ID="Main"><inout_port name="x"/></SubTree>
  </TreeNodesModel>
</root>
<!-- after all -->
"""


def again(file: TreeFile) -> TreeFile:
    written, found = read_text(write(file).encode(), file.file)
    assert written is not None, found
    return written


def test_what_was_written_is_read_again_equal_and_whole() -> None:
    file, _ = read_text(KEPT.encode(), "kept.xml")
    assert file is not None

    assert again(file) == file
    text = write(file)
    comments = (
        "before all",
        "of the tree",
        "of the root",
        "of the leaf",
        "and another",
        "last",
        "of a model",
        "after all",
    )
    assert [text.count(f"<!-- {comment} -->") for comment in comments] == [1] * len(comments)
    for kept in ('_note="kept"', '_uid="1"', 'project_name="store &amp; more"', 'editable="true"', "&#10;", 'ID="Own"'):
        assert kept in text
    assert write(again(file)) == text


@settings(max_examples=100, deadline=None)
@given(trees)
def test_random_trees_are_read_again_equal(made: RandomTree) -> None:
    file, _ = read_text(made.text.encode(), "random.xml")
    assert file is not None

    assert again(file) == file


@settings(max_examples=25, deadline=None)
@given(trees)
def test_the_module_does_not_depend_on_how_the_file_is_laid_out(made: RandomTree) -> None:
    file, _ = read_text(made.text.encode(), "trees.xml")
    assert file is not None

    assert compiled(write(file)) == compiled(made.text)


@pytest.mark.parametrize("name", ["mission", "pick_up"])
def test_modules_of_whole_trees_are_as_the_formatter_and_the_type_checker_want_them(name: str, tmp_path: Path) -> None:
    module = tmp_path / f"{name}.py"
    module.write_text(compiled((ROOT / "specs" / "trees" / f"{name}.xml").read_text("utf-8")), "utf-8")

    for command in (
        ["ruff", "format", "--check", "--isolated", "--line-length", "120"],
        ["ruff", "check", "--isolated", "--select", "E,W,F,I", "--line-length", "120"],
        ["mypy", "--strict"],
    ):
        done = subprocess.run([Path(sys.executable).with_name(command[0]), *command[1:], module], cwd=ROOT, check=False)
        assert done.returncode == 0


def test_a_name_from_the_file_cannot_become_code() -> None:
    hostile = "x'); import os  # \\ \" {0} \u202e"
    escaped = hostile.replace("&", "&amp;").replace('"', "&quot;")
    action = f'<Action ID="{escaped}" port="{escaped}"/>'
    body = f'<Sequence name="{escaped}">{action}<Script code="a := \'\\n&quot;\'"/></Sequence>'
    others = f'<BehaviorTree ID="{escaped}"><AlwaysSuccess/></BehaviorTree>'

    module = compiled(document(body, others=others))
    assert module.isascii()
    names: dict[str, object] = {}
    exec(compile(module, "hostile.py", "exec"), names)
    assert names["ACTIONS"] == (hostile,)
    assert "os" not in names


def test_the_bytes_of_a_module_do_not_depend_on_the_run() -> None:
    program = "import sys; from tests.trees.stories import compiled; sys.stdout.write(compiled(sys.stdin.read()))"
    text = (ROOT / "specs" / "trees" / "mission.xml").read_text("utf-8")
    runs = [
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT,
            env={"PYTHONHASHSEED": seed},
            input=text,
            text=True,
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]

    assert runs == [compiled(text)] * 2
