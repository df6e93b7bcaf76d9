"""Read the edges of the knowledge graph that a moment of a timeline places or removes.

An edge is written by an agent that may write its type: the one with the highest priority. A node at an end of the edge
that is not in the initial graph is inserted first, by an agent that may insert nodes of its type.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from codra_dsl.integrations.testing.timeline import Change, NewNode, Placement, Removal
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.knowledge import read_pose
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import EdgeTypeModel, KnowledgeModel, NodeModel, NodeTypeModel
from codra_dsl.runtime.knowledge.declarations import Writer

_EDGE_PATTERN = re.compile(r"(\S+) +-(\S+)-> +(\S+)")
_EDGE_HELP = "write it as in patterns: 'world -robot_pose-> robot'"
_GONE = "gone"


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
            is_gone = isinstance(value, ScalarNode) and value.text == _GONE
            change = (
                self._removed_node(key, steps)
                if is_gone and " " not in key.text
                else self._edge_change(key, value, steps, is_gone=is_gone)
            )
            if change is not None:
                yield change

    def _removed_node(self, key: ScalarNode, steps: tuple[str, ...]) -> Change | None:
        if key.text in self._nodes:
            writers = self._node_types[self._nodes[key.text].type].sources
            agent = self._agent(writers, key, f"node {shown(key.text)} may be deleted", steps)
        else:  # a node that an agent inserts; the agents of its type are known when it is there
            agent = ""
        return None if agent is None else Removal(agent=agent, node=key.text, place=self._subject.origin.of(key))

    def _edge_change(self, key: ScalarNode, value: YamlNode, steps: tuple[str, ...], *, is_gone: bool) -> Change | None:
        match = _EDGE_PATTERN.fullmatch(key.text)
        if match is None:
            self._fail("unknown-key", key, f"{shown(key.text)} is not an edge", _EDGE_HELP, steps)
            return None
        origin, type_name, target = match.groups()
        edge_type = self._edge_types.get(type_name)
        if edge_type is None:
            self._fail_unknown(key, f"{self._missing_prefix} edge", type_name, self._edge_types, steps)
            return None
        agent = self._agent(edge_type.sources, key, f"edge {shown(type_name)} may be written", steps)
        new_nodes = self._new_nodes(key, ((origin, edge_type.origins), (target, edge_type.targets)), steps)
        if agent is None or new_nodes is None or not self._has_right_form(key, value, edge_type, steps, is_gone):
            return None
        place = self._subject.origin.of(key)
        if is_gone:
            return Removal(agent=agent, edge=(origin, type_name, target), place=place)
        pose = _pose(Reader(self._subject, value, self._findings)) if isinstance(value, MappingNode) else None
        return Placement(
            agent=agent, origin=origin, type=type_name, target=target, pose=pose, new_nodes=new_nodes, place=place
        )

    def _has_right_form(
        self, key: ScalarNode, value: YamlNode, edge_type: EdgeTypeModel, steps: tuple[str, ...], is_gone: bool
    ) -> bool:
        has_pose = isinstance(value, MappingNode)
        if is_gone or has_pose is (edge_type.motion is not None):
            return True
        message, help_text = (
            (f"edge {shown(edge_type.name)} has no pose", "write 'present' or 'gone'")
            if has_pose
            else (f"edge {shown(edge_type.name)} has a pose", "write the pose: '{x: 2 m, yaw: 90 deg}'")
        )
        self._fail("wrong-type", key, message, help_text, steps)
        return False

    def _new_nodes(
        self, key: ScalarNode, ends: Sequence[tuple[str, Sequence[str]]], steps: tuple[str, ...]
    ) -> tuple[NewNode, ...] | None:
        """Return the ends of an edge that are not in the initial graph; None if an end is not possible."""
        new_nodes: list[NewNode] = []
        for name, allowed_names in ends:
            node = self._nodes.get(name)
            if node is not None and {name, node.type} & {*allowed_names}:
                continue
            new_node = None if node is not None else self._new_node(key, name, allowed_names, steps)
            if node is not None:
                help_text = f"the edge can have {list_names(allowed_names)} there"
                self._fail("unknown-key", key, f"this edge cannot have node {shown(name)} there", help_text, steps)
            if new_node is None:
                return None
            new_nodes.append(new_node)
        return tuple(new_nodes)

    def _new_node(
        self, key: ScalarNode, name: str, allowed_names: Sequence[str], steps: tuple[str, ...]
    ) -> NewNode | None:
        node_types = [
            self._node_types[type_name]
            for type_name in allowed_names
            if type_name in self._node_types and type_name not in self._nodes and self._node_types[type_name].sources
        ]
        if len(node_types) == 1:
            return NewNode(name=name, type=node_types[0].name, agent=_first_agent(node_types[0].sources))
        if not node_types:
            possible_nodes = [node.name for node in self._nodes.values() if _is_allowed(node, allowed_names)]
            self._fail_unknown(key, f"{self._missing_prefix} node", name, possible_nodes, steps)
        else:
            message = f"node {shown(name)} can have type {_either(node_types)}"
            help_text = "place it first by an edge that allows only one of these types"
            self._fail("unknown-key", key, message, help_text, steps)
        return None

    def _agent(
        self, writers: Sequence[Writer], key: ScalarNode, permission_text: str, steps: tuple[str, ...]
    ) -> str | None:
        if writers:
            return _first_agent(writers)
        help_text = "name an agent under its 'source' in the spec"
        self._fail("unknown-key", key, f"{permission_text} by no agent", help_text, steps)
        return None

    def _fail_unknown(
        self, key: ScalarNode, problem: str, name: str, names: Iterable[str], steps: tuple[str, ...]
    ) -> None:
        allowed_names = list(names)
        similar_name = self._findings.nearest(name, allowed_names)
        allowed_text = f"there is {list_names(allowed_names)}" if allowed_names else "there is none"
        help_text = f"did you mean '{similar_name}'?" if similar_name else allowed_text
        self._fail("unknown-key", key, f"{problem} {shown(name)}", help_text, steps)

    def _fail(self, rule: str, key: ScalarNode, message: str, help_text: str, steps: tuple[str, ...]) -> None:
        path = self._subject.part(*steps, key.text)
        self._findings.add(rule, message, self._subject.origin.of(key), help=help_text, path=path)


def _first_agent(writers: Sequence[Writer]) -> str:
    """Return the writer with the highest priority; the first of several."""
    return max(writers, key=lambda writer: writer.priority).agent


def _is_allowed(node: NodeModel, allowed_names: Sequence[str]) -> bool:
    return node.name in allowed_names or node.type in allowed_names


def _either(node_types: Sequence[NodeTypeModel]) -> str:
    return " or ".join(node_type.name for node_type in node_types)


def _pose(reader: Reader) -> Pose:
    """Return the pose that a mapping describes: turned about the fixed axes x, then y, then z, then moved."""
    starting_pose = read_pose(reader)
    roll_rad, pitch_rad, yaw_rad = starting_pose.rotation_rad
    rotation = Pose.about((0, 0, 1), yaw_rad) @ Pose.about((0, 1, 0), pitch_rad) @ Pose.about((1, 0, 0), roll_rad)
    return Pose.of(starting_pose.translation_m, rotation.rotation)
