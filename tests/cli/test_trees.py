"""`codra trees` checks, draws and converts files of trees without a spec."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app
from tests.language.behavior_trees.real_texts import NAV2_BODIES, NAV2_MODELS, nav2_file

OLD = """<root BTCPP_format="3">
  <BehaviorTree ID="Main"><SequenceStar><Go _skipIf="a && b"/></SequenceStar></BehaviorTree>
  <TreeNodesModel><Action ID="Go"/></TreeNodesModel>
</root>
"""
NEW = """<?xml version="1.0" encoding="UTF-8"?>
<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <SequenceWithMemory>
      <Go _skipIf="a &amp;&amp; b"/>
    </SequenceWithMemory>
  </BehaviorTree>
  <TreeNodesModel>
    <Action ID="Go"/>
  </TreeNodesModel>
</root>
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    (tmp_path / "trees").mkdir()
    (tmp_path / "nav2").mkdir()
    models = f'<root BTCPP_format="4"><TreeNodesModel>{NAV2_MODELS}</TreeNodesModel></root>'
    (tmp_path / "nav2" / "nodes.xml").write_text(models)
    (tmp_path / "trees" / "navigate.xml").write_text(nav2_file(NAV2_BODIES["recovery"]))
    (tmp_path / "old.xml").write_text(OLD)
    return tmp_path


def codra(*arguments: str, exit_code: int = 0) -> tuple[str, str]:
    """Run a command and return its standard output and its standard error."""
    result = CliRunner().invoke(app, ["trees", *arguments])
    assert result.exit_code == exit_code, (result.output, result.exception)
    return result.stdout, result.stderr


def test_check_reports_undeclared_nodes_once_each_and_none_with_the_list_of_nodes() -> None:
    output, counts = codra("check", "trees", "--format", "concise")
    assert output.splitlines()[0] == (
        "navigate.xml:1:84: warning[CDR3310]: the node 'RecoveryNode' is not declared, so its ports are not checked"
        ' (add <Control ID="RecoveryNode"> with its ports to <TreeNodesModel>, or use --models FILE)'
    )
    assert counts == "1 tree in 1 file: 11 warnings\n"

    output, _ = codra("check", "trees", "--models", "nav2/nodes.xml", "--format", "json")
    findings = [json.loads(line) for line in output.splitlines()]
    assert {finding["code"] for finding in findings} == {"CDR3311"}


def test_check_accepts_a_list_of_nodes_alone() -> None:
    assert codra("check", "nav2/nodes.xml") == ("", "0 trees in 1 file: no findings\n")


def test_check_fails_on_errors_and_on_request_on_warnings(folder: Path) -> None:
    (folder / "bad.xml").write_text('<root BTCPP_format="4"><BehaviorTree ID="A"><Sleep/></BehaviorTree></root>')

    output, counts = codra("check", "bad.xml", exit_code=1)
    assert "bad.xml:1:45" in output
    assert counts == "1 tree in 1 file: 1 error\n"
    codra("check", "old.xml")
    codra("check", "old.xml", "--fail-on", "warning", exit_code=1)


def test_check_obeys_the_settings_of_the_project_and_comments(folder: Path) -> None:
    (folder / "pyproject.toml").write_text('[tool.codra.lint]\nignore = ["CDR2308"]\n')
    comment = "<!-- codra: ignore[CDR1305] the robot's own editor writes it -->"
    (folder / "old.xml").write_text(OLD.replace("  <BehaviorTree", f"  {comment}\n  <BehaviorTree"))

    assert codra("check", "old.xml") == ("", "1 tree in 1 file: no findings\n")


def test_graph_draws_the_chosen_trees_in_the_format_of_the_ending(folder: Path) -> None:
    drawn, problems = codra("graph", "old.xml", "--format", "mermaid")
    assert drawn.startswith('flowchart TB\n  subgraph t0["Main"]\n')
    assert "CDR2308" in problems
    codra("graph", "old.xml", "--tree", "Main", "--output", "tree.dot")
    assert (folder / "tree.dot").read_text().startswith("digraph codra {")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("graph", "old.xml", "--tree", "Mian"), "there is no tree 'Mian'"),
        (
            ("graph", "old.xml", "--output", "tree.png"),
            "no picture has the ending '.png': use --format, or one of .dot",
        ),
        (("check", "none.xml"), "'none.xml' does not exist"),
        (("check", "old.xml", "--models", "none.xml"), "'none.xml' does not exist"),
    ],
)
def test_a_wrong_argument_is_a_usage_error(arguments: tuple[str, ...], message: str) -> None:
    _, problems = codra(*arguments, exit_code=2)

    assert message in " ".join(problems.replace("│", " ").split())


def test_convert_writes_version_4_that_has_no_findings() -> None:
    converted, problems = codra("convert", "old.xml")
    assert converted == NEW
    assert problems.endswith("2 warnings\n")

    codra("convert", "old.xml", "--output", "new.xml")
    assert codra("check", "new.xml") == ("", "1 tree in 1 file: no findings\n")


def test_convert_writes_nothing_while_there_are_errors(folder: Path) -> None:
    (folder / "bad.xml").write_text("<root")

    _, problems = codra("convert", "bad.xml", "--output", "new.xml", exit_code=1)
    assert problems.endswith("'bad.xml' is not converted: correct its errors first\n")
    assert not (folder / "new.xml").exists()


def test_a_folder_without_trees_is_not_a_success(folder: Path) -> None:
    (folder / "empty").mkdir()

    _, problems = codra("check", "empty", exit_code=2)
    assert "there is no file of trees in 'empty' or below" in problems


def test_a_file_with_a_node_that_only_version_3_has_is_not_converted(folder: Path) -> None:
    node = '<BlackboardCheckInt value_A="{x}" value_B="3" return_on_mismatch="FAILURE"><A/></BlackboardCheckInt>'
    (folder / "old.xml").write_text(f'<root BTCPP_format="3"><BehaviorTree ID="A">{node}</BehaviorTree></root>')

    text, problems = codra("convert", "old.xml", exit_code=1)
    assert text == ""
    assert "'old.xml' is not converted: version 4 has no BlackboardCheckInt; write Precondition" in problems


BOMB = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]><root BTCPP_format="4" n="&b;"/>'
HOSTILE = {
    "entities": BOMB.encode(),
    "a foreign entity": b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><root>&x;</root>',
    "depth": b"<root BTCPP_format='4'>" + b"<a>" * 100_000,
    "depth of values": b"<root BTCPP_format='4' a='" + b"<" * 500_000 + b"'/>",
    "references": b"<root a='" + b"&" * 500_000,
    "UTF-16": "<root/>".encode("utf-16"),
    "a wrong encoding": b'<?xml version="1.0" encoding="latin-1"?><root a="\xe4"/>',
    "bytes": bytes(range(256)),
    "nothing": b"",
    "no end": b"<root><BehaviorTree",
    "a surrogate": b"<root a='\xed\xa0\x80'/>",
    "controls": b"<root BTCPP_format='4'><BehaviorTree ID='\x1b[31m'/></root>",
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("command", ["check", "graph", "convert"])
def test_a_hostile_file_is_refused_with_a_finding(command: str, name: str, folder: Path) -> None:
    (folder / "hostile.xml").write_bytes(HOSTILE[name])

    output, problems = codra(command, "hostile.xml", exit_code=1)
    assert "error[CDR" in output + problems
    assert "root:" not in output + problems


def test_names_from_a_file_cannot_act_as_commands_of_a_terminal_or_leave_a_picture(folder: Path) -> None:
    name = "a&#x202e;&quot;];x&#10;&lt;script&gt;\\N"
    text = f'<root BTCPP_format="4"><BehaviorTree ID="{name}"><AlwaysSuccess name="{name}"/></BehaviorTree></root>'
    (folder / "odd.xml").write_text(text)

    dot, _ = codra("graph", "odd.xml")
    mermaid, _ = codra("graph", "odd.xml", "--format", "mermaid")
    assert "\u202e" not in dot + mermaid
    assert "<script>" not in mermaid
    assert '"a' in dot
    assert "\n];x" not in dot
