"""Hostile knowledge graphs, as JSON of DSR and as GraphML: random graphs and those of this repository, with damage."""

from __future__ import annotations

import json
import re
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

from codra_dsl.integrations.networkx import from_networkx, graphml_text, parse_graphml, read_graphml, to_networkx
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.knowledge.exchange import (
    DsrGraph,
    ExchangeError,
    dsr_text,
    export_dsr,
    import_dsr,
    parse_dsr,
    read_dsr,
)
from tests.campaigns.hostile.damage import damaged, damaged_bytes, damaged_json, encoded
from tests.campaigns.hostile.reading import Answer, Files, Kind, refused
from tests.campaigns.hostile.texts import NAMES, NUMBERS, ODD_NAMES, TEXTS
from tests.campaigns.hostile.xml_damage import damaged_xml
from tests.runtime.knowledge.exchange.test_start import ROBOCOMP

ROOT = Path(__file__).parents[3]
_EVERY_TYPE = (ROOT / "tests/data/dsr_every_type.json").read_text("utf-8")
_SHOP = re.findall(
    r"```json file=shop.json\n(.*?)```", (ROOT / "docs/reference/interchange.md").read_text("utf-8"), re.DOTALL
)[0]
_TYPES = ("world", "robot", "battery", "roll_container", "person", "room")
_LABELS = ("RT", "has", "in", "pose", "sees", "task")
_VALUES: dict[int, tuple[Any, ...]] = {
    0: ("", "text", *TEXTS[:30]),
    1: (0, -1, 2**31 - 1, "7"),
    2: (0.5, 1e308, None, "0,5", "inf", "nan"),
    3: ([], [1, 2.5, "nan"], [0] * 50, [2000, 1000, 0]),
    4: (True, False),
    5: ([], [0, 255]),
    6: (0, -1, 2**31 - 1),
    7: ("0", "18446744073709551615", 5),
    8: (0.5, -0.0, 5e-324, None),
    9: ([], ["1", "18446744073709551615"]),
    10: ([1, 2],),
    11: ([1, 2, 3],),
    12: ([0, 0, 0, 1],),
    13: ([0, 0, 0, 0, 0, 1],),
    99: ({"a": [1]}, None, [[]]),
}


def random_document(chance: Random, wild: float) -> dict[str, Any]:
    """Return a valid document of DSR; with the probability `wild`, names and values are odd."""
    numbers = chance.sample((1, 2, 3, 4, 5, 100, 2**63, 2**64 - 2), chance.choice((0, 1, 3, 6)))
    symbols = {}
    for number in numbers:
        name = chance.choice((*NAMES, *ODD_NAMES[20:-40])) if chance.random() < wild else f"n{number}"
        symbols[str(number)] = {
            "id": str(number),
            "name": name or "empty",
            "type": chance.choice(_TYPES),
            "attribute": _attributes(chance, ("battery_load", "mass", "level", "parent", "colour", "pos_x")),
            "links": _links(chance, number, numbers),
        }
    return {"DSRModel": {"name": "dsr", "symbols": symbols}}


def _attributes(chance: Random, names: tuple[str, ...]) -> dict[str, Any]:
    attributes = {}
    for name in chance.sample(names, chance.randrange(len(names))):
        code = chance.choice(sorted(_VALUES))
        attributes[name] = {"type": code, "value": deepcopy(chance.choice(_VALUES[code]))}
    return attributes


def _links(chance: Random, origin: int, numbers: list[int]) -> list[dict[str, Any]]:
    links = {}
    for _ in range(chance.choice((0, 1, 2, 4))):
        label, target = chance.choice(_LABELS), chance.choice(numbers)
        attributes = _attributes(chance, ("codra_type", "weight", "rt_timestamps", "rt_head_index"))
        if label == "RT":
            number: Any = chance.choice((0, 1.5, 1e308, -1e308, "nan", "inf", 5e-324))
            attributes["rt_translation"] = {"type": 3, "value": [number] * chance.choice((3, 3, 3, 0, 2, 60))}
            attributes["rt_rotation_euler_xyz"] = {"type": 3, "value": [number] * chance.choice((3, 3, 3, 4, 60))}
        links[label, target] = {"src": str(origin), "dst": str(target), "label": label, "linkAttribute": attributes}
    return list(links.values())


def _make_dsr(chance: Random) -> Files:
    kind = chance.random()
    document = random_document(chance, chance.choice((0.0, 0.1)))
    if kind < 0.35:
        document = json.loads(chance.choice((_EVERY_TYPE, _SHOP)))
    text = json.dumps(document, indent=1)
    if kind > 0.15:
        text = damaged_json(chance, document) if chance.random() < 0.6 else damaged(chance, text)
    if chance.random() < 0.03:
        text = _large_json(chance)
    data = encoded(chance, text)
    return {"graph.json": damaged_bytes(chance, data) if chance.random() < 0.05 else data}


def _large_json(chance: Random) -> str:
    """Return JSON that is too deep, too long, or that repeats one key."""
    many = chance.choice((100, 1000, 100_000))
    node = '{"DSRModel": {"symbols": {"1": {"id": "1", "name": "a", "type": "t"'
    return chance.choice(
        (
            "[" * many,
            '{"a":' * many,
            '{"DSRModel": {"symbols": {' + '"1": {},' * many + '"1": {}}}}',
            '{"DSRModel": {"symbols": {"1": {'
            + node
            + ', "attribute": {"x": {"type": 3, "value": ['
            + "0," * many
            + "0]}}}}}}",
            '{"DSRModel": {"symbols": {"1": {'
            + node
            + ', "links": ['
            + '{"src": "1", "dst": "1", "label": "a"},' * (many // 10)
            + "]}}}}",
            '{"DSRModel": {"x": ' + "9" * many + "}}",
            f'{{"DSRModel": {{"symbols": {{}}, "x": {chance.choice(NUMBERS)}}}}}',
        )
    )


def _read_dsr(root: Path) -> Answer:
    """Read a graph, write it and read it again; import it, and export it from a knowledge graph."""
    try:
        graph = read_dsr(root / "graph.json")
        _require_equal(graph, parse_dsr(dsr_text(graph)))
    except ExchangeError as error:
        return refused(error)
    start = import_dsr(ROBOCOMP, graph)
    exported = export_dsr(Knowledge(start.model, clock=SimClock()), start)
    try:
        _require_equal(graph, exported)
        _require_equal(graph, from_networkx(to_networkx(graph)))
    except ExchangeError as error:
        return refused(error)
    return Answer(True, tuple(part.reason.split("'")[0] for part in start.skipped_parts))


def _require_equal(graph: DsrGraph, other: DsrGraph) -> None:
    assert _canonical_text(other) == _canonical_text(graph), "the graph differs"


def _canonical_text(graph: DsrGraph) -> str:
    return dsr_text(replace(graph, edges=tuple(sorted(graph.edges, key=lambda edge: edge.key))))


def _make_graphml(chance: Random) -> Files:
    texts = (_EVERY_TYPE, _SHOP, *(json.dumps(random_document(chance, wild)) for wild in (0.0, 0.0, 0.1)))
    try:
        text = graphml_text(parse_dsr(chance.choice(texts)))
    except ExchangeError:  # a name that XML cannot write
        text = graphml_text(parse_dsr(_SHOP))
    kind = chance.random()
    if kind < 0.2:
        text = re.sub(r"\{.*?\}", lambda match: damaged(chance, match[0], (1,)), text)
    elif kind < 0.5:
        text = _changed_types(chance, text)
    data = damaged_xml(chance, text) if chance.random() < 0.75 else encoded(chance, text)
    return {"graph.graphml": damaged_bytes(chance, data) if chance.random() < 0.05 else data}


def _changed_types(chance: Random, text: str) -> str:
    """Replace types, directions, identifiers and keys of GraphML."""
    replacements = (
        ("directed", ("undirected", "", "Directed", "x" * 300)),
        ("long", ("int", "boolean", "float", "double", "string", "yfiles", "", "object", "java.lang.Integer")),
        ("string", ("int", "boolean", "long", "double", "x")),
        ('for="node"', ('for="edge"', 'for="all"', 'for="graph"', 'for="port"', "")),
        ("<node id", ("<hyperedge id", "<port name", "<graph id", "<node ID", "<node")),
        ("source=", ("target=", "src=", "sourceport=")),
        ("d0", ("d1", "", "d99", "id")),
        ("<data", ("<default", "<key", "<y:ShapeNode", "<data key='d0'><data")),
        ("http://graphml.graphdrawing.org/xmlns", ("", "http://example.org", "x", "http://www.w3.org/2000/xmlns/")),
    )
    for _ in range(chance.choice((1, 2, 3))):
        old, new = chance.choice(replacements)
        text = text.replace(old, chance.choice(new), chance.choice((1, 1, -1)))
    return text


def _read_graphml(root: Path) -> Answer:
    """Read a graph, write it as GraphML and as DSR, and read both again."""
    try:
        graph = read_graphml(root / "graph.graphml")
        _require_equal(graph, parse_graphml(graphml_text(graph)))
        _require_equal(graph, parse_dsr(dsr_text(graph)))
    except ExchangeError as error:
        return refused(error)
    return Answer(True)


DSR = Kind(_make_dsr, _read_dsr)
GRAPHML = Kind(_make_graphml, _read_graphml)
