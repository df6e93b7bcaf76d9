"""`codra knowledge` checks files of knowledge graphs without a spec."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app
from codra_dsl.integrations.networkx import read_graphml
from codra_dsl.runtime.knowledge.exchange import ExchangeError, read_dsr

GOOD = """\
{"DSRModel": {"symbols": {
  "1": {"id": "1", "name": "world", "type": "world", "attribute": {}, "links": [
    {"src": "1", "dst": "2", "label": "RT", "linkAttribute": {}}]},
  "2": {"id": "2", "name": "robot", "type": "robot", "attribute": {}, "links": []}
}}}
"""
MISSING = GOOD.replace('"dst": "2"', '"dst": "7"')
GRAPHML = """\
<graphml xmlns="http://graphml.graphdrawing.org/xmlns">
  <key id="d0" for="node" attr.name="floor"/>
  <graph edgedefault="undirected">
    <node id="hall"><data key="d0">2</data></node><node id="dock"/>
    <edge id="e0" source="hall" target="dock"/>
    <edge id="e1" source="dock" target="dock"/>
  </graph>
</graphml>
"""
DIRECTED = GRAPHML.replace('"undirected"', '"directed"')


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    return tmp_path


def check(text: str | bytes, *options: str, exit_code: int = 0, file: str = "graph.json") -> tuple[list[str], str]:
    """Check a text; return its findings as `line:column code message`, and the line with the counts."""
    Path(file).write_bytes(text if isinstance(text, bytes) else text.encode())
    result = CliRunner().invoke(app, ["knowledge", "check", file, "--format", "json", *options])
    assert result.exit_code == exit_code, (result.output, result.exception)
    findings = [json.loads(line) for line in result.stdout.splitlines()]
    texts = [f"{finding['line']}:{finding['column']} {finding['code']} {finding['message']}" for finding in findings]
    return texts, result.stderr


def test_a_file_of_dsr_is_accepted_and_counted() -> None:
    assert check(GOOD) == ([], "2 nodes and 1 edge in 1 file: no findings\n")


def test_an_edge_to_a_missing_node_is_reported_and_skipped() -> None:
    findings, counts = check(MISSING)

    assert findings == ["3:25 CDR2403 there is no symbol 7: add it, or remove the link"]
    assert counts == "2 nodes and 0 edges in 1 file: 1 warning\n"
    check(MISSING, "--fail-on", "warning", exit_code=1)
    with pytest.raises(ExchangeError, match="there is no symbol 7"):
        read_dsr("graph.json")
    assert read_dsr("graph.json", skip_missing_nodes=True).edges == ()


def test_all_mistakes_of_a_file_are_reported_at_their_places() -> None:
    text = MISSING.replace('"name": "robot", ', "").replace(
        '"name": "world", "type": "world", "attribute": {}',
        '"name": "world", "type": "world", "attribute": {"a": {"type": 1, "value": "x"}, "b": {"value": 1}}',
    )

    findings, counts = check(text, exit_code=1)
    assert findings == [
        "2:94 CDR2402 'x' is not an integer, but type 1 is int32: change the value or the type",
        '2:105 CDR2402 an attribute is {"type": NUMBER, "value": VALUE}',
        "3:25 CDR2403 there is no symbol 7: add it, or remove the link",
        "4:8 CDR2402 name: expected a text that is not empty",
    ]
    assert counts == "0 nodes and 0 edges in 1 file: 3 errors, 1 warning\n"


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("", "1:1 CDR2401 this is not JSON: Expecting value"),
        ('{"DSRModel": ', "1:14 CDR2401 this is not JSON: Expecting value"),
        ("{}", '1:1 CDR2402 DSRModel: the key is missing: a DSR file is {"DSRModel": {"symbols": {...}}}'),
        ("[]", "1:1 CDR2401 there must be an object: {...}"),
        (b'{\n"\xff"}', "2:2 CDR2401 a byte is not valid UTF-8: save the file as UTF-8"),
        (
            GOOD.replace('"id": "2", ', '"id": "2", "id": "2", '),
            "4:26 CDR2402 this key occurs twice in one object: remove one of the two entries",
        ),
        (GOOD.replace('"name": "robot"', '"name": "world"'), "4:28 CDR2402 'world' is also the name of node 1"),
        ("<graphml>\n</x>", "2:3 CDR2401 this is not XML: mismatched tag"),
        ("<!-- \n --> <!DOCTYPE x><graphml/>", "2:6 CDR2401 the file declares a document type"),
        ("<graphml/>", "1:1 CDR2402 this is not GraphML"),
        (
            DIRECTED.replace('key="d0">2', 'key="d1">2'),
            "4:21 CDR2402 there is no key 'd1': declare it before the graph",
        ),
        (
            DIRECTED.replace("</graphml>", '<graph edgedefault="directed"><node id="attic"/></graph></graphml>'),
            "8:1 CDR2402 there are several graphs, of which only one can be read",
        ),
        (
            DIRECTED.replace('<node id="dock"/>', '<node id="dock"><graph edgedefault="directed"/></node>'),
            "4:67 CDR2402 there are several graphs, of which only one can be read",
        ),
        (DIRECTED.replace("</node>", "</node><node/>"), "4:51 CDR2402 an element 'node' has no attribute 'id'"),
        (DIRECTED.replace(' target="dock"', "", 1), "5:5 CDR2402 an element 'edge' has no attribute 'target'"),
    ],
)
def test_a_mistake_is_reported_once_at_its_place(text: str | bytes, finding: str) -> None:
    (only_finding,), _ = check(text, exit_code=1)

    assert only_finding.startswith(finding)


def test_undirected_edges_are_refused_and_on_request_read_as_two() -> None:
    findings, _ = check(GRAPHML, exit_code=1, file="graph.graphml")
    assert findings == ["3:3 CDR2404 the graph is not directed"]

    assert check(GRAPHML, "--both-ways", file="graph.graphml") == (
        [],
        "2 nodes and 3 edges in 1 file: no findings\n",
    )
    graph = read_graphml("graph.graphml", both_ways=True)
    names = {node.number: node.name for node in graph.nodes}
    assert sorted((names[edge.origin], names[edge.target]) for edge in graph.edges) == [
        ("dock", "dock"),
        ("dock", "hall"),
        ("hall", "dock"),
    ]
    assert graph.node("hall").attributes["floor"].value == "2"


def test_undirected_edges_are_read_as_two_without_a_namespace() -> None:
    text = GRAPHML.replace(' xmlns="http://graphml.graphdrawing.org/xmlns"', "")

    assert check(text, "--both-ways") == ([], "2 nodes and 3 edges in 1 file: no findings\n")


def test_directed_edges_of_a_mixed_graph_keep_their_direction() -> None:
    mixed = GRAPHML.replace('target="dock"/>', 'target="dock" directed="true"/>', 1)
    assert check(mixed, "--both-ways")[1] == "2 nodes and 2 edges in 1 file: no findings\n"

    (finding,), _ = check(DIRECTED.replace("/>\n  </g", ' directed="false"/>\n  </g'), exit_code=1)
    assert finding == "6:5 CDR2404 the edge is not directed"


def test_an_edge_of_graphml_to_a_missing_node_adds_the_node() -> None:
    text = DIRECTED.replace('target="dock"', 'target="lift"', 1)
    findings, counts = check(text)

    assert findings == ["5:5 CDR2403 there is no node 'lift'"]
    assert counts == "3 nodes and 2 edges in 1 file: 1 warning\n"


def test_an_empty_label_of_yed_is_no_value() -> None:
    label = (
        '<data key="d1"><y:ShapeNode xmlns:y="http://www.yworks.com/xml/graphml"><y:NodeLabel/></y:ShapeNode></data>'
    )
    text = GRAPHML.replace("  <graph ", '  <key for="node" id="d1" yfiles.type="nodegraphics"/>\n  <graph ')
    check(text.replace('<node id="dock"/>', f'<node id="dock">{label}</node>'), "--both-ways", file="graph.graphml")

    assert read_graphml("graph.graphml", both_ways=True).node("dock").attributes == {}


def test_files_that_cannot_be_read_are_reported(folder: Path) -> None:
    (folder / "secret.json").write_text(GOOD)
    (folder / "project").mkdir()
    (folder / "project" / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "project" / "link.json").symlink_to(folder / "secret.json")
    result = CliRunner().invoke(app, ["knowledge", "check", "project/link.json", ".", "--format", "concise"])

    assert result.exit_code == 1
    assert "project/link.json:1:1: error[CDR2401]: 'project/link.json' cannot be read: it is a link" in result.stdout
    assert "error[CDR2401]: '.' cannot be read: it is a folder" in result.stdout
    assert CliRunner().invoke(app, ["knowledge", "check", "none.json"]).exit_code == 2


def test_a_file_with_thousands_of_mistakes_shows_some_of_them_and_fails() -> None:
    links = ",".join('{"src": "1", "dst": "9", "label": "l", "linkAttribute": {}}' for _ in range(3000))
    text = GOOD.replace('{"src": "1", "dst": "2", "label": "RT", "linkAttribute": {}}', links)
    assert check(text)[1].endswith(": 200 warnings\n")

    _, counts = check(text.replace('"name": "robot"', '"name": "world"'), exit_code=1)
    assert counts.endswith(": 1 error, 199 warnings\n")


def test_a_file_that_is_too_deep_is_refused_at_once() -> None:
    (finding,), _ = check('{"a":' * 100_000, exit_code=1)

    assert finding == "1:1 CDR2401 objects and lists are nested more than 40 levels deep"
