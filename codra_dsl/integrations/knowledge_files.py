"""Check files of knowledge graphs, and report findings with line and column."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from xml.parsers import expat

from codra_dsl.integrations.networkx import NEEDED_ATTRIBUTES, SEVERAL_GRAPHS, parse_graphml
from codra_dsl.language.diagnostics import Diagnostic, Place, Span, in_file_order
from codra_dsl.language.knowledge_files import RULES
from codra_dsl.regular_files import read_regular_file
from codra_dsl.runtime.knowledge.exchange.document import DsrGraph, ExchangeError, PlacedError
from codra_dsl.runtime.knowledge.exchange.dsr_json import MAX_BYTES, MAX_ERRORS, decode_text, examine_dsr

__all__ = ["check_knowledge_file"]

_JSON_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]|[^\s{}\[\]:,"]+')
_BOTH_WAYS_HELP = "with --both-ways, each undirected edge is read as two edges, one in each direction"

_Path = tuple[str | int, ...]
_FilePlace = tuple[int, int, int]
"""The line and the column of a place, and the number of its characters."""


def check_knowledge_file(
    path: Path, file: str, within: Path, *, both_ways: bool = False
) -> tuple[DsrGraph | None, tuple[Diagnostic, ...]]:
    """Return the graph of a file of DSR or GraphML, or None after an error; and the findings.

    Args:
        path: the file.
        file: the path of the file in findings.
        within: the folder in which the file must be after links are followed.
        both_ways: whether an undirected edge of GraphML is read as two edges, one in each direction.
    """
    findings = _Findings(file)
    graph = None
    try:
        text = decode_text(read_regular_file(path, MAX_BYTES, within=within), file)
        is_xml = text.lstrip().startswith("<")
        graph = _check_graphml(text, findings, both_ways=both_ways) if is_xml else _check_dsr(text, findings)
    except OSError as error:
        findings.add("graph-unreadable", f"'{file}' cannot be read: {error.strerror}")
    except PlacedError as error:
        findings.add("graph-unreadable", error.reason, _place_of(error))
    except ExchangeError as error:
        if not findings.has_errors:
            findings.add("graph-wrong-value", str(error).removeprefix(f"{file}: "))
    return (None if findings.has_errors else graph), in_file_order(findings.diagnostics)


def _place_of(error: PlacedError) -> _FilePlace:
    return (1, 1, 0) if error.position is None else (*error.position, 0)


class _Findings:
    """The findings about one file."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.diagnostics: list[Diagnostic] = []

    @property
    def has_errors(self) -> bool:
        """Whether a finding is an error."""
        return any(diagnostic.rule.is_binding for diagnostic in self.diagnostics)

    def add(self, rule: str, message: str, place: _FilePlace = (1, 1, 0), *, help: str = "") -> None:
        """Report a finding of a rule in `RULES`. After MAX_ERRORS findings, only the first error is added."""
        line, column, length = place
        span = Span(self.file, line, column, line, column + length)
        if len(self.diagnostics) < MAX_ERRORS or (RULES[rule].is_binding and not self.has_errors):
            self.diagnostics.append(Diagnostic(rule=RULES[rule], message=message, place=Place(span), help=help))


# DSR


def _check_dsr(text: str, findings: _Findings) -> DsrGraph:
    graph, errors = examine_dsr(text, findings.file)
    places = _places_in_json(
        text, {error.path[:end] for error in errors if error.path for end in range(len(error.path) + 1)}
    )
    for error in errors:
        if not error.path:
            findings.add("graph-unreadable", error.reason, _place_of(error))
            continue
        path = next(path for end in range(len(error.path), -1, -1) if (path := error.path[:end]) in places)
        rule = "edge-to-missing-node" if error.is_missing_node else "graph-wrong-value"
        key = f"{error.path[-1]}: " if path != error.path else ""
        help = "the edge is skipped" if error.is_missing_node else ""
        findings.add(rule, f"{key}{error.reason}", places[path], help=help)
    return graph


def _places_in_json(text: str, paths: Iterable[_Path]) -> Mapping[_Path, _FilePlace]:
    """Return the line, the column and the length of the first token of values in a valid JSON text, by their paths.

    If a key occurs twice, its last value counts. Paths without a value are left out.
    """
    wanted_paths = set(paths)
    max_length = max(map(len, wanted_paths), default=0)
    places: dict[_Path, _FilePlace] = {}
    steps: list[str | int] = []
    is_key, line, line_start, last_end = False, 1, 0, 0
    for match in _JSON_TOKEN.finditer(text) if wanted_paths else ():
        token, start = match[0], match.start()
        line += text.count("\n", last_end, start)
        line_start = max(line_start, text.rfind("\n", last_end, start) + 1)
        last_end = match.end()
        if token in "}]":
            steps.pop()
        elif token == ",":
            last_step = steps[-1]
            steps[-1] = last_step + 1 if isinstance(last_step, int) else ""
            is_key = isinstance(last_step, str)
        elif token == ":":
            is_key = False
        elif is_key:
            steps[-1] = json.loads(token)
        else:
            if len(steps) <= max_length and tuple(steps) in wanted_paths:
                places[tuple(steps)] = (line, start - line_start + 1, len(token))
            steps += [0] if token == "[" else [""] if token == "{" else []
            is_key = token == "{"
    return places


# GraphML


def _check_graphml(text: str, findings: _Findings, *, both_ways: bool) -> DsrGraph:
    _GraphmlElements(findings, both_ways=both_ways).read(text)
    return parse_graphml(text, findings.file, both_ways=both_ways)


class _GraphmlElements:
    """Reports what networkx refuses without a place, and the edges whose ends it would add as nodes."""

    def __init__(self, findings: _Findings, *, both_ways: bool) -> None:
        self._findings = findings
        self._both_ways = both_ways
        self._parser = expat.ParserCreate("utf-8")
        self._node_ids: set[str] = set()
        self._keys: set[str] = set()
        self._has_graph = False
        self._ends: list[tuple[str, _FilePlace]] = []

    def read(self, text: str) -> None:
        """Report the findings about a text."""
        if (offset := text.find("<!DOCTYPE")) >= 0:
            position = text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
            reason = "the file declares a document type: remove this declaration, it is not needed"
            raise PlacedError(self._findings.file, reason, position=position)
        self._parser.StartElementHandler = self._start
        try:
            self._parser.Parse(text.encode("utf-8", "replace"), True)
        except expat.ExpatError as error:
            reason = f"this is not XML: {expat.ErrorString(error.code)}"
            raise PlacedError(self._findings.file, reason, position=(error.lineno, error.offset + 1)) from None
        missing_ends = [(end, place) for end, place in self._ends if end not in self._node_ids]
        for end, place in missing_ends[:MAX_ERRORS]:
            help = "declare the node; here it is added without type and attributes"
            self._findings.add("edge-to-missing-node", f"there is no node {end!r:.80}", place, help=help)

    def _place(self, tag: str) -> _FilePlace:
        return self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1, len(tag) + 1

    def _start(self, tag: str, attributes: Mapping[str, str]) -> None:
        place, name = self._place(tag), tag.rpartition(":")[2]
        for needed in NEEDED_ATTRIBUTES.get(name, ()):
            if needed not in attributes:
                self._findings.add("graph-wrong-value", f"an element '{name}' has no attribute '{needed}'", place)
        match name:
            case "graph" if self._has_graph:
                self._findings.add("graph-wrong-value", SEVERAL_GRAPHS, place)
            case "key":
                self._keys.add(attributes.get("id", ""))
            case "node":
                self._node_ids.add(attributes.get("id", ""))
            case "graph":
                self._has_graph = True
                if attributes.get("edgedefault") != "directed" and not self._both_ways:
                    self._findings.add("undirected-graph", "the graph is not directed", place, help=_BOTH_WAYS_HELP)
            case "edge":
                self._ends += [(attributes[end], place) for end in NEEDED_ATTRIBUTES["edge"] if end in attributes]
                if attributes.get("directed") == "false" and not self._both_ways:
                    self._findings.add("undirected-graph", "the edge is not directed", place, help=_BOTH_WAYS_HELP)
            case "data" if attributes.get("key", "") not in self._keys:
                message = f"there is no key {attributes.get('key', '')!r:.80}: declare it before the graph"
                self._findings.add("graph-wrong-value", message, place)
