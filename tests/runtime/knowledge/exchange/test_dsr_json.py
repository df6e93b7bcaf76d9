"""DSR's JSON: a file written by hand after RoboComp's sources is read and written; mistakes are reported by place."""

from __future__ import annotations

import contextlib
import json
import math
import os
import stat
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from codra_dsl.runtime.knowledge.exchange import (
    DsrEdge,
    DsrGraph,
    DsrNode,
    DsrValue,
    ExchangeError,
    ValueCode,
    dsr_text,
    parse_dsr,
    read_dsr,
    write_dsr,
)

EVERY_TYPE = Path(__file__).parents[3] / "data/dsr_every_type.json"
LARGEST = 18446744073709551614
PERSON = 27311629926412499


@pytest.fixture(scope="module")
def graph() -> DsrGraph:
    return read_dsr(EVERY_TYPE)


def float32(number: float) -> float:
    rounded_number: float = struct.unpack("f", struct.pack("f", number))[0]
    return rounded_number


def by_number(graph: DsrGraph, number: int) -> DsrNode:
    return next(node for node in graph.nodes if node.number == number)


def edge_of(graph: DsrGraph, *key: object) -> DsrEdge:
    return next(edge for edge in graph.edges if edge.key == key)


def test_a_file_with_every_type_is_read_and_written_without_loss(graph: DsrGraph, tmp_path: Path) -> None:
    write_dsr(tmp_path / "out.json", graph)
    assert json.loads((tmp_path / "out.json").read_bytes()) == json.loads(EVERY_TYPE.read_bytes())
    assert read_dsr(tmp_path / "out.json") == graph
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]


def test_a_file_is_written_through_no_link(graph: DsrGraph, tmp_path: Path) -> None:
    """Another user of a shared folder can create links with all names that can be predicted."""
    for number, name in enumerate(("out.json", f"new.json.{os.getpid()}.part")):
        (tmp_path / f"victim {number}").write_text("precious")
        (tmp_path / name).symlink_to(f"victim {number}")

    for name in ("out.json", "new.json"):
        write_dsr(tmp_path / name, graph)
        assert stat.S_ISREG((tmp_path / name).lstat().st_mode)

    assert [(tmp_path / f"victim {number}").read_text() for number in range(2)] == ["precious", "precious"]


def test_it_is_written_line_for_line_as_by_robocomp_except_for_the_format_of_some_numbers(graph: DsrGraph) -> None:
    there, here = EVERY_TYPE.read_text("utf-8").splitlines(), dsr_text(graph).splitlines()
    others = [(a.strip(), b.strip()) for a, b in zip(there, here, strict=True) if a != b]
    assert others == [
        ('"value": 0.000001', '"value": 1e-06'),
        ('"value": 0.000001', '"value": 1e-06'),
        ('"value": 100.0', '"value": 100'),
        ('"value": -0.000001', '"value": -1e-06'),
    ]


TINY, MAX_FLOAT, MAX_DOUBLE = 2.0**-149, 3.4028234663852886e38, 1.7976931348623157e308

ON_NODE: dict[str, tuple[int, object]] = {
    "test_string_type": (0, 'Íñigo\t"comillas" \\ barra / línea1\nlínea2 \x01 日本 \U0001f6d2 é'),
    "obj_id": (1, 2147483647),
    "gps_longitude": (2, -4.421266),
    "path_y_values": (3, (TINY, -TINY, 5.87699951652896e-39, 2.0**-126, MAX_FLOAT, -838.0, float32(0.1))),
    "path_is_cyclic": (4, False),
    "compressed_data": (5, b"\x00\x0a\x0d\x7f\x80\xff"),
    "test_uint32_type": (6, 4294967295),
    "timestamp_alivetime": (7, 2**53 + 1),
    "test_double_type": (8, 2.0**-1074),
    "test_uint64_vec_type": (9, (0, 1, 2**53 + 1, 2**63, 2**64 - 1)),
    "test_vec2_type": (10, (-3206.950927734375, 2.740164518399979e-06)),
    "test_vec3_type": (11, (-1.0, 0.0, TINY)),
    "test_vec4_type": (12, (0.5, -0.5, 0.5, -0.5)),
    "test_vec6_type": (13, (float32(0.1), -838.0, 0.0, MAX_FLOAT, -(2.0**-126), 16777216.0)),
    "fork_stiction_index": (2, 0.125),
    "rt_timestamps": (9, ()),
}

ON_EDGE: dict[str, tuple[int, object]] = {
    "color": (0, "naranja «cálido» 橙 🟠"),
    "width": (1, -2147483648),
    "distance_to_robot": (2, 0.85),
    "path_x_values": (3, (-MAX_FLOAT, MAX_FLOAT, 2.0**-126)),
    "is_ready": (4, False),
    "compressed_data": (5, b"\xff\x00\x01\x80"),
    "memory_usage": (6, 2147483647),
    "timestamp_creation": (7, 2**64 - 1),
    "test_double_type": (8, -MAX_DOUBLE),
    "test_uint64_vec_type": (9, (2**64 - 1, 0, 2**53 + 1)),
    "test_vec2_type": (10, (-1.5, float32(2.35))),
    "test_vec3_type": (11, (1.0, -2.0, 3.5)),
    "test_vec4_type": (12, (0.0, 0.0, -0.70703125, 0.70703125)),
    "test_vec6_type": (13, (1.5, -2.5, 3.5, -4.5, 5.5, -6.5)),
}


def codes_and_values(attributes: Any, names: Any) -> dict[str, tuple[int, object]]:
    return {name: (attributes[name].code, attributes[name].value) for name in names}


def test_every_type_is_decoded_on_nodes_and_on_edges(graph: DsrGraph) -> None:
    assert codes_and_values(by_number(graph, 900).attributes, ON_NODE) == ON_NODE
    assert codes_and_values(edge_of(graph, 200, "close_to", 300).attributes, ON_EDGE) == ON_EDGE
    assert {code for code, _ in ON_NODE.values()} == set(ValueCode) == {code for code, _ in ON_EDGE.values()}


def test_numbers_of_nodes_labels_and_empty_values_are_kept(graph: DsrGraph) -> None:
    assert (len(graph.nodes), len(graph.edges)) == (10, 15)
    assert {0, PERSON, LARGEST} < {node.number for node in graph.nodes}
    lonely = by_number(graph, LARGEST)
    assert lonely.attributes["memory_usage"].value == 3_000_000_000
    assert not {"level", "parent"} & set(lonely.attributes)
    assert sorted(edge.label for edge in graph.edges if edge.key[::2] == (200, 300)) == [
        "close_to",
        "looking_at",
        "reachable",
    ]
    assert edge_of(graph, 200, "has", 201).attributes == {}
    velocity = by_number(graph, 200).attributes["robot_local_linear_velocity"].value
    assert isinstance(velocity, tuple)
    assert math.copysign(1.0, velocity[1]) == -1.0
    assert graph.node("every_type_ñ").type == "pallet_fork_probe"


# Any graph


names = some.text(some.characters(exclude_categories=["Cs"]), min_size=1, max_size=8)
reals = some.floats(allow_nan=False)
values = some.one_of(
    some.builds(DsrValue, code=some.just(0), value=some.text(some.characters(exclude_categories=["Cs"]))),
    some.builds(DsrValue, code=some.just(1), value=some.integers(-(2**31), 2**31 - 1)),
    some.builds(DsrValue, code=some.sampled_from([2, 8]), value=reals | some.none()),
    some.builds(DsrValue, code=some.just(3), value=some.lists(reals).map(tuple)),
    some.builds(DsrValue, code=some.just(4), value=some.booleans()),
    some.builds(DsrValue, code=some.just(5), value=some.binary()),
    some.builds(DsrValue, code=some.just(6), value=some.integers(0, 2**32 - 1)),
    some.builds(DsrValue, code=some.just(7), value=some.integers(0, 2**64 - 1)),
    some.builds(DsrValue, code=some.just(9), value=some.lists(some.integers(0, 2**64 - 1)).map(tuple)),
    some.builds(DsrValue, code=some.just(13), value=some.tuples(*([reals] * 6))),
    some.builds(DsrValue, code=some.just(77), value=some.sampled_from(["x", [1, {"a": None}], {"b": [True]}, None])),
    some.builds(DsrValue, code=some.just(1), value=some.just(5), extra=some.just({"agent_id": 3, "timestamp": "9"})),
)
attributes = some.dictionaries(names, values, max_size=3)
extras = some.sampled_from([{}, {"note": [1, "two"]}, {"Tipo": {"é": 1.5}}])


@some.composite
def graphs(draw: some.DrawFn) -> DsrGraph:
    """Draw a graph with arbitrary valid content."""
    node_names = draw(some.lists(names, unique=True, max_size=4))
    numbers = draw(
        some.lists(some.integers(0, LARGEST), unique=True, min_size=len(node_names), max_size=len(node_names))
    )
    nodes = [
        DsrNode(number=number, name=name, type=draw(names), attributes=draw(attributes), extra=draw(extras))
        for number, name in zip(numbers, node_names, strict=True)
    ]
    ends = some.sampled_from(numbers) if numbers else some.nothing()
    keys = draw(some.lists(some.tuples(ends, names, ends), unique=True, max_size=4 if numbers else 0))
    edges = [
        DsrEdge(origin=a, label=label, target=b, attributes=draw(attributes), extra=draw(extras))
        for a, label, b in keys
    ]
    return DsrGraph(nodes=tuple(nodes), edges=tuple(edges), extra=draw(extras), model_extra=draw(extras))


def parts(graph: DsrGraph) -> tuple[object, ...]:
    """Return the content of a graph without the order of its nodes and edges, which JSON objects do not have."""
    nodes = sorted(graph.nodes, key=lambda node: node.number)
    return nodes, sorted(graph.edges, key=lambda edge: edge.key), graph.extra, graph.model_extra


@settings(max_examples=50)
@given(graph=graphs())
def test_any_graph_is_read_as_it_was_written(graph: DsrGraph) -> None:
    text = dsr_text(graph)
    assert parts(parse_dsr(text)) == parts(graph)
    assert dsr_text(parse_dsr(text)) == text


# Mistakes


def symbol(**changed: object) -> dict[str, Any]:
    return {"id": "1", "name": "a", "type": "t", "attribute": {}, "links": []} | changed


def file(*symbols: dict[str, Any], **more: object) -> str:
    return json.dumps({"DSRModel": {"symbols": {str(content["id"]): content for content in symbols}}} | more)


def link(**changed: object) -> dict[str, Any]:
    return {"src": "1", "dst": "1", "label": "l", "linkAttribute": {}} | changed


def attribute(code: object, value: object) -> str:
    return file(symbol(attribute={"speed": {"type": code, "value": value}}))


AT = '$.DSRModel.symbols["1"]'
SPEED = f"{AT}.attribute.speed"
WRONG = {
    "f.json:2:1: this is not JSON: Expecting value": '{"DSRModel":\n}',
    "f.json:1:1: this is not JSON": "",
    "f.json: this is not JSON: NaN is not a JSON number: write null": attribute(2, math.nan),
    "f.json: this is not JSON: Exceeds the limit": f"[{'9' * 5000}]",
    "f.json: objects and lists are nested more than 40 levels deep": "[" * 100_000 + "]" * 100_000,
    "f.json: $[0][0]": "[" * 50 + "]" * 50,
    "f.json: $: there must be an object": "[]",
    "f.json: $.DSRModel: the key is missing: a DSR file is": "{}",
    "f.json: $.DSRModel.symbols: there must be an object": '{"DSRModel": {"symbols": []}}',
    f"f.json: {AT}.id: this key occurs twice in one object": '{"DSRModel": {"symbols": {"1": {"id": "1", "id": "2"}}}}',
    f"f.json: {AT}.name: a text with a lone surrogate": file(symbol(name="\ud800")),
    f"f.json: {AT}.id: expected the number of a node, from 0 to {LARGEST}": '{"DSRModel":{"symbols":{"1":{}}}}',
    f'f.json: $.DSRModel.symbols["{LARGEST + 1}"].id: expected the number of a node': file(symbol(id=str(LARGEST + 1))),
    f"f.json: {AT}: the symbol under this key has the id 2": '{"DSRModel":{"symbols":{"1":{"id": 2}}}}',
    f"f.json: {AT}.name: expected a text that is not empty": file(symbol(name="")),
    f"f.json: {AT}.type: expected a text that is not empty": file(symbol(type=None)),
    f"f.json: {AT}.links: there must be a list": file(symbol(links={})),
    f"f.json: {AT}.links[0]: there must be an object": file(symbol(links=[1])),
    f"f.json: {AT}.links[1].dst: there is no symbol 7: add it": file(symbol(links=[link(), link(dst="7")])),
    f"f.json: {AT}.links[1]: there is already a link 'l' from 1 to 1": file(symbol(links=[link(), link()])),
    "f.json: $.DSRModel.symbols[\"2\"].name: 'a' is also the name of node 1": file(symbol(), symbol(id="2")),
    f'f.json: {SPEED}: an attribute is {{"type": NUMBER': file(symbol(attribute={"speed": {"value": 1}})),
    f"f.json: {SPEED}.type: the type of a value is an integer": attribute("float", 1.0),
    f"f.json: {SPEED}.value: 3 is not a text, but type 0 is text: change the value or the type": attribute(0, 3),
    f"f.json: {SPEED}.value: 2147483648 lies outside [-2147483648, 2147483647], but": attribute(1, 2**31),
    f"f.json: {SPEED}.value: 1.5 is not an integer, but type 1 is int32": attribute(1, 1.5),
    f"f.json: {SPEED}.value: true is not a number, but type 2 is float": attribute(2, True),
    f"f.json: {SPEED}.value: a list is neither true nor false": attribute(4, [1]),
    f"f.json: {SPEED}.value: 256 lies outside [0, 255], but type 5 is bytes": attribute(5, [256]),
    f"f.json: {SPEED}.value: -1 lies outside [0, 18446744073709551615]": attribute(7, -1),
    f"f.json: {SPEED}.value: null is not a list, but type 3 is floats": attribute(3, None),
    f"f.json: {SPEED}.value: there are 2 numbers instead of 3": attribute(11, [1, 2]),
    f"f.json: {SPEED}.value: an object is not a number, but type 8": attribute(8, {}),
    f"f.json: {SPEED}.value: 100000000000000000000000000": attribute(8, 10**400),
}


@pytest.mark.parametrize("message", WRONG)
def test_mistakes_in_a_file_are_reported_with_their_place_and_help(message: str) -> None:
    with pytest.raises(ExchangeError) as error:
        parse_dsr(WRONG[message], "f.json")
    assert str(error.value).startswith(message)
    assert len(str(error.value)) < 400


@settings(max_examples=75)
@given(data=some.data())
def test_a_damaged_file_is_read_or_reported_and_never_raises_another_error(data: some.DataObject) -> None:
    content = bytearray(EVERY_TYPE.read_bytes()[:6000] if data.draw(some.booleans()) else EVERY_TYPE.read_bytes())
    for _ in range(data.draw(some.integers(1, 4))):
        at = data.draw(some.integers(0, len(content) - 1))
        content[at : at + data.draw(some.integers(0, 3))] = data.draw(some.binary(max_size=3))
    text = content.decode("utf-8", "replace")
    with contextlib.suppress(ExchangeError):  # anything else fails
        graph = parse_dsr(text, "f.json")
        assert parts(parse_dsr(dsr_text(graph))) == parts(graph)


def test_an_unreadable_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(ExchangeError, match=r"none\.json: cannot be read \(No such file or directory\)"):
        read_dsr(tmp_path / "none.json")
    with pytest.raises(ExchangeError, match="this is not a file"):
        read_dsr(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ExchangeError, match="pipe: this is not a file"):
        read_dsr(tmp_path / "pipe")
    (tmp_path / "latin.json").write_bytes(b'{\n"a": "\xf1"}')
    with pytest.raises(ExchangeError, match=r"latin\.json:2:\d+: a byte is not valid UTF-8"):
        read_dsr(tmp_path / "latin.json")
    with (tmp_path / "large.json").open("wb") as large:
        large.truncate(64 * 2**20 + 1)
    with pytest.raises(ExchangeError, match="it has more than 67108864 bytes: leave out"):
        read_dsr(tmp_path / "large.json")


def test_number_formats_of_other_writers_are_read() -> None:
    spelt = {"a": (2, "3,25"), "b": (7, 12), "c": (6, 4294967295), "d": (1, 5.0), "e": (8, None), "f": (8, "-inf")}
    given = {name: {"type": code, "value": value} for name, (code, value) in spelt.items()}
    (node,) = parse_dsr(file(symbol(id=1, attribute=given))).nodes
    assert {name: value.value for name, value in node.attributes.items()} == {
        "a": 3.25,
        "b": 12,
        "c": 4294967295,
        "d": 5,
        "e": None,
        "f": -math.inf,
    }


def test_values_that_json_cannot_represent_are_reported() -> None:
    wrong = DsrGraph(nodes=(DsrNode(number=1, name="a", type="t", extra={"set": {1}}),))
    with pytest.raises(ExchangeError, match=r'\$\.DSRModel\.symbols\["1"\]\.set: JSON has no set'):
        dsr_text(wrong)
    with pytest.raises(ExchangeError, match="an edge 'l' goes from 1 to 2: one of the two is not a node"):
        dsr_text(DsrGraph(edges=(DsrEdge(origin=1, label="l", target=2),)))
