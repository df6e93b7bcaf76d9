"""Written trees keep comments and attributes without effect, and are equal when read again; also emitted modules."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings

from codra_dsl.language.behavior_trees import TreeFile, read_text, write
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN
from tests.language.behavior_trees.random_trees import RandomTree
from tests.language.behavior_trees.stories import compiled, document
from tests.language.behavior_trees.test_reference import trees
from tests.type_checker import run_mypy

ROOT = Path(__file__).parents[3]
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
    written, problems = read_text(write(file).encode(), file.file)
    assert written is not None, problems
    return written


def test_a_written_file_is_read_again_equal_and_complete() -> None:
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


def test_a_port_is_described_by_its_text_as_the_library_and_groot2_write_it() -> None:
    """A description as an attribute works too; the library reads this attribute for subtrees."""
    ports = '<input_port name="a" type="int"> at &lt;5&#10;m </input_port><output_port name="b" description="free"/>'
    file, problems = read_text(document("<AlwaysSuccess/>", f'<Action ID="Own">{ports}</Action>').encode(), "ports.xml")
    assert file is not None

    assert problems == ()
    assert [port.description for port in file.models[0].ports] == ["at <5\nm", "free"]
    assert '<input_port name="a" type="int">at &lt;5&#10;m</input_port>' in write(file)
    assert '<output_port name="b">free</output_port>' in write(file)
    assert again(file) == file


def misfits(text: str) -> list[str]:
    """Return the parts that the library's schema (an XSD, and rules on models and subtrees) would refuse."""
    root = ElementTree.fromstring(text)
    tags = [child.tag for child in root]
    trees_, models = root.findall("BehaviorTree"), root.findall("TreeNodesModel")
    known_ids = {*BUILT_IN, *(model.attrib["ID"] for group in models for model in group)}
    ids = {tree.get("ID") for tree in trees_}
    problems = (
        [] if root.attrib.get("BTCPP_format") == "4" and root.get("main_tree_to_execute", "Main") in ids else ["root"]
    )
    problems += ["order"] if tags != sorted(tags, key=["include", "BehaviorTree", "TreeNodesModel"].index) else []
    problems += ["models"] if len(models) > 1 else []
    problems += [f"tree {tree.get('ID')}" for tree in trees_ if len(tree) != 1 or not tree.get("ID")]
    for node in (node for tree in trees_ for node in tree.iter() if node is not tree):
        node_id = node.attrib["ID"] if node.tag in ("Action", "Condition", "Control", "Decorator") else node.tag
        problems += (
            [f"node {node_id}"]
            if node_id not in known_ids or (node.tag == node_id and "ID" in node.attrib) != (node.tag == "SubTree")
            else []
        )
        problems += [f"subtree {node.get('ID')}"] if node.tag == "SubTree" and node.get("ID") not in ids else []
    for model in (model for group in models for model in group):
        kinds = ("Action", "Condition", "Control", "Decorator", "SubTree")
        problems += [] if model.tag in kinds and model.get("ID") else [f"model {model.tag}"]
        for port in model:
            is_port = port.tag in ("input_port", "output_port", "inout_port") and "name" in port.attrib
            problems += [] if is_port and set(port.attrib) <= {"name", "type", "default"} else [f"port {port.attrib}"]
    return problems


@settings(max_examples=50, deadline=None)
@given(trees)
def test_random_trees_are_written_in_accordance_with_the_schema_of_the_library(made: RandomTree) -> None:
    file, _ = read_text(made.text.encode(), "random.xml")
    assert file is not None

    assert misfits(write(file)) == []


@pytest.mark.parametrize("name", ["mission", "pick_up"])
def test_the_trees_of_the_store_conform_to_the_schema_of_the_library(name: str) -> None:
    text = (ROOT / "specs" / "trees" / f"{name}.xml").read_text("utf-8")
    file, _ = read_text(text.encode(), "trees.xml")
    assert file is not None

    assert misfits(text) == misfits(write(file)) == []


@settings(max_examples=40, deadline=None)
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
def test_modules_of_complete_trees_pass_the_formatter_and_the_type_checker(name: str, tmp_path: Path) -> None:
    module = tmp_path / f"{name}.py"
    module.write_text(compiled((ROOT / "specs" / "trees" / f"{name}.xml").read_text("utf-8")), "utf-8")

    for command in (
        ["ruff", "format", "--check", "--isolated", "--line-length", "120"],
        ["ruff", "check", "--isolated", "--select", "E,W,F,I", "--line-length", "120"],
    ):
        done = subprocess.run([Path(sys.executable).with_name(command[0]), *command[1:], module], cwd=ROOT, check=False)
        assert done.returncode == 0
    assert run_mypy(str(module)).returncode == 0


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
    program = (
        "import sys; from tests.language.behavior_trees.stories import compiled; "
        "sys.stdout.write(compiled(sys.stdin.read()))"
    )
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
