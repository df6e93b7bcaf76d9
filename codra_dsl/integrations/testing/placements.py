"""Read the edges of the knowledge graph that a moment of a timeline places or removes.

An edge is written by an agent that may write its type: the one with the highest priority. A node at an end of the edge
that is not in the initial graph is inserted first, by an agent that may insert nodes of its type.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence

from codra_dsl.integrations.testing.timeline import Change, GraphChange
from codra_dsl.integrations.testing.values import unknown_name_help
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.knowledge import read_pose
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import KnowledgeModel
from codra_dsl.runtime.knowledge.declarations import Writer
from codra_dsl.runtime.knowledge.operations import Operation, Verb

_EDGE_PATTERN = re.compile(r"(\S+) +-(\S+)-> +(\S+)")
_EDGE_HELP = "write it as in patterns: 'world -robot_pose-> robot'"
_GONE = "gone"


class _RefusedError(Exception):
    """The spec does not allow a change of the graph."""

    def __init__(self, message: str, help_text: str, rule: str = "unknown-key") -> None:
        super().__init__(message)
        self.message, self.help, self.rule = message, help_text, rule


class PlacementReader:
    """Reads the sections `poses` of one file."""

    def __init__(
        self, knowledge: KnowledgeModel | None, missing_prefix: str, subject: Subject, findings: Findings
    ) -> None:
        """Read for the knowledge graph of a compiled spec.

        Args:
            knowledge: the graph; None if the spec has none.
            missing_prefix: the beginning of the message about a name that the spec does not declare.
            subject: the timeline, to which findings refer.
            findings: the findings so far.
        """
        model = KnowledgeModel(name="") if knowledge is None else knowledge
        self._missing_prefix = missing_prefix
        self._subject = subject
        self._findings = findings
        self._edge_types = {edge_type.name: edge_type for edge_type in model.edge_types}
        self._node_types = {node_type.name: node_type for node_type in model.node_types}
        self._nodes = {node.name: node for node in model.nodes}

    def changes(self, node: YamlNode, steps: tuple[str, ...]) -> Iterator[Change]:
        """Yield the changes of a section; report entries that the graph does not allow."""
        for key, value in entries(node):
            if value.reported or key.reported:
                continue
            place = self._subject.origin.of(key)
            is_gone = isinstance(value, ScalarNode) and value.text == _GONE
            try:
                if is_gone and " " not in key.text:
                    yield self._removed_node(key.text, place)
                else:
                    yield self._edge_change(key.text, None if is_gone else value, place)
            except _RefusedError as error:
                path = self._subject.part(*steps, key.text)
                self._findings.add(error.rule, error.message, place, help=error.help, path=path)

    def _removed_node(self, name: str, place: Place) -> GraphChange:
        node, agent = self._nodes.get(name), ""
        if node is not None:  # the agents of any other node are known when an agent has inserted it
            agent = _first_agent(self._node_types[node.type].sources, f"node {shown(name)} may be deleted")
        return GraphChange(agent=agent, operation=Operation(Verb.DELETE_NODE, (name,)), place=place)

    def _edge_change(self, text: str, value: YamlNode | None, place: Place) -> GraphChange:
        """Return the change of an edge; without a value, the edge is deleted."""
        match = _EDGE_PATTERN.fullmatch(text)
        if match is None:
            raise _RefusedError(f"{shown(text)} is not an edge", _EDGE_HELP)
        origin, type_name, target = edge = match.groups()
        edge_type = self._edge_types.get(type_name)
        if edge_type is None:
            raise self._unknown_name("edge", type_name, self._edge_types)
        agent = _first_agent(edge_type.sources, f"edge {shown(type_name)} may be written")
        ends = ((origin, edge_type.origins), (target, edge_type.targets))
        new_nodes = tuple(self._new_node(*end, place) for end in ends if not self._is_present(*end))
        has_pose = isinstance(value, MappingNode)
        if value is not None and has_pose is (edge_type.motion is None):
            help_text = "write 'present' or 'gone'" if has_pose else "write the pose: '{x: 2 m, yaw: 90 deg}'"
            message = f"edge {shown(type_name)} has {'no' if has_pose else 'a'} pose"
            raise _RefusedError(message, help_text, "wrong-type")
        if value is None:
            operation, new_nodes = Operation(Verb.DELETE_EDGE, edge), ()
        elif isinstance(value, MappingNode):
            pose = _pose(Reader(self._subject, value, self._findings))
            operation = Operation(Verb.PLACE, (*edge, pose, None))
        else:
            operation = Operation(Verb.INSERT_EDGE, (*edge, {}))
        return GraphChange(agent=agent, operation=operation, place=place, new_nodes=new_nodes)

    def _is_present(self, name: str, allowed_names: Sequence[str]) -> bool:
        """Return whether an end of an edge is in the initial graph.

        Raises:
            _RefusedError: if the edge cannot have this node.
        """
        node = self._nodes.get(name)
        if node is not None and not {name, node.type} & {*allowed_names}:
            help_text = f"the edge can have {list_names(allowed_names)} there"
            raise _RefusedError(f"this edge cannot have node {shown(name)} there", help_text)
        return node is not None

    def _new_node(self, name: str, allowed_names: Sequence[str], place: Place) -> GraphChange:
        node_types = [
            self._node_types[type_name]
            for type_name in allowed_names
            if type_name in self._node_types and type_name not in self._nodes and self._node_types[type_name].sources
        ]
        if not node_types:
            nodes = self._nodes.values()
            raise self._unknown_name("node", name, [n.name for n in nodes if {n.name, n.type} & {*allowed_names}])
        if len(node_types) > 1:
            types_text = " or ".join(node_type.name for node_type in node_types)
            help_text = "place it first by an edge that allows only one of these types"
            raise _RefusedError(f"node {shown(name)} can have type {types_text}", help_text)
        agent = _first_agent(node_types[0].sources, "")
        operation = Operation(Verb.INSERT_NODE, (name, node_types[0].name, {}))
        return GraphChange(agent=agent, operation=operation, place=place)

    def _unknown_name(self, noun: str, name: str, names: Collection[str]) -> _RefusedError:
        help_text = unknown_name_help(name, names, self._findings)
        return _RefusedError(f"{self._missing_prefix} {noun} {shown(name)}", help_text)


def _first_agent(writers: Sequence[Writer], permission_text: str) -> str:
    """Return the writer with the highest priority; the first of several.

    Raises:
        _RefusedError: if there is no writer.
    """
    if not writers:
        raise _RefusedError(f"{permission_text} by no agent", "name an agent under its 'source' in the spec")
    return max(writers, key=lambda writer: writer.priority).agent


def _pose(reader: Reader) -> Pose:
    """Return the pose that a mapping describes: turned about the fixed axes x, then y, then z, then moved."""
    starting_pose = read_pose(reader)
    roll_rad, pitch_rad, yaw_rad = starting_pose.rotation_rad
    rotation = Pose.about((0, 0, 1), yaw_rad) @ Pose.about((0, 1, 0), pitch_rad) @ Pose.about((1, 0, 0), roll_rad)
    return Pose.of(starting_pose.translation_m, rotation.rotation)
