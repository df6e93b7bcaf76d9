"""Build knowledge and agents: nodes -> values of the model. Keys that cannot be read get their default."""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.patterns import read_patterns
from codra_dsl.language.load.elements.values import read_type
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.reader import Reader, entries
from codra_dsl.language.model import (
    FOREVER_S,
    RT,
    Agent,
    AgentRule,
    Attribute,
    Conduct,
    EdgeType,
    Motion,
    NodeElement,
    NodeType,
    Phase,
    Reference,
    StartingPose,
    StartingValue,
    Task,
    View,
    Writer,
)
from codra_dsl.language.units import UNITS, Unit, parse_quantity

_METRE, _RADIAN = UNITS["m"], UNITS["rad"]
_PHASES = {phase.value: phase for phase in Phase}


def as_mapping(key: ScalarNode, node: YamlNode) -> YamlNode:
    """Return the mapping for a node declared by its type alone: `robot: robot` means `robot: {type: robot}`."""
    if not isinstance(node, ScalarNode):
        return node
    mapping = MappingNode(node.start, node.end, flow=True)
    mapping.reported = node.reported
    mapping.put(ScalarNode("type", "type", key.start, key.end, Style.PLAIN), node)
    return mapping


def build_node_type(reader: Reader) -> NodeType:
    """Return a type of nodes."""
    view = reader.node.value("view")
    return NodeType(
        name=reader.subject.name,
        place=reader.place,
        label=reader.text("label", ""),
        sources=_read_writers(reader),
        attributes=tuple(_read_attributes(reader)),
        view=_read_view(reader.inner(view, "view")) if isinstance(view, MappingNode) else None,
        places=reader.places(),
    )


def build_node(reader: Reader) -> NodeElement:
    """Return a node that exists from the start."""
    return NodeElement(
        name=reader.subject.name,
        place=reader.place,
        type=_read_reference(reader, "type"),
        label=reader.text("label", ""),
        values=tuple(_read_values(reader)),
        places=reader.places(),
    )


def build_edge(reader: Reader) -> EdgeType:
    """Return a type of edges. Edges with the label `RT` have rigid motions."""
    label = reader.text("label", reader.subject.name)
    pose = reader.node.value("pose")
    return EdgeType(
        name=reader.subject.name,
        place=reader.place,
        label=label,
        origins=reader.references("from"),
        targets=reader.references("to"),
        sources=_read_writers(reader),
        attributes=tuple(_read_attributes(reader)),
        motion=_read_motion(reader) if label == RT else None,
        pose=read_pose(reader.inner(pose, "pose")) if isinstance(pose, MappingNode) and label == RT else None,
        places=reader.places(),
    )


def build_task(reader: Reader) -> Task:
    """Return a task."""
    return Task(
        name=reader.subject.name,
        place=reader.place,
        label=reader.text("label", ""),
        origin=_read_reference(reader, "from"),
        by=_read_reference(reader, "by"),
        requesters=reader.references("requesters"),
        results=reader.references("results"),
        acknowledge_s=reader.duration_s("acknowledge", FOREVER_S, most="forever"),
        finish_s=reader.duration_s("finish", FOREVER_S, most="forever"),
        places=reader.places(),
    )


def build_agent(reader: Reader) -> Agent:
    """Return an agent. An agent without keys is only an outside writer."""
    if not reader.node.entries:
        return Agent(name=reader.subject.name, place=reader.place)
    phase = reader.scalar("phase")
    conduct = Conduct(
        label=reader.text("label", ""),
        phase=_PHASES.get(phase.text) if phase is not None else None,
        wakes=read_patterns(reader, "wakes"),
        owns=reader.references("owns"),
        reads=reader.references("reads"),
        rules=tuple(_read_rules(reader)),
        places=reader.places(),
    )
    period_s = reader.duration_s("period", 0.0) if "period" in reader.node.entries else None
    return Agent(name=reader.subject.name, place=reader.place, conduct=conduct, period_s=period_s or None)


def _read_reference(reader: Reader, key: str) -> Reference:
    node = reader.scalar(key)
    if node is None:
        reader.damage(key)
        return Reference(name="", place=reader.place)
    return reader.reference(node)


def _read_writers(reader: Reader) -> tuple[Writer, ...]:
    """Return the writers under `source`: one name, a list, or a mapping from names to priorities."""
    node = reader.node.value("source")
    if not isinstance(node, MappingNode):
        return tuple(Writer(name=reference.name, place=reference.place) for reference in reader.references("source"))
    writers = []
    for key, value in entries(node):
        priority = value.data
        if isinstance(priority, int) and not isinstance(priority, bool) and not (key.reported or value.reported):
            writers.append(Writer(name=key.text, place=reader.origin.of(key), priority=priority))
        else:
            reader.damage("source")
    return tuple(writers)


def _read_attributes(reader: Reader) -> Iterator[Attribute]:
    first_spellings: dict[str, str] = {}
    for key, node in entries(reader.node.value("attributes")):
        if not check_name(key, "an attribute", reader.subject, reader.findings, "attributes") or not isinstance(
            node, MappingNode
        ):
            reader.damage("attributes")
            continue
        first = first_spellings.setdefault(key.text.casefold(), key.text)
        if first != key.text:
            message = f"the attributes {shown(first)} and {shown(key.text)} differ only in case"
            reader.fail("duplicate-name", message, key, "rename one of them", "attributes", key.text)
        inner = reader.inner(node, "attributes", key.text)
        yield Attribute(
            name=key.text,
            type=read_type(inner, node),
            place=reader.origin.of(key),
            label=inner.text("label", ""),
            sources=_read_writers(inner),
            valid_for_s=inner.duration_s("valid_for", FOREVER_S, most="forever"),
            history=inner.number("history", 100),
        )


def _read_values(reader: Reader) -> Iterator[StartingValue]:
    for key, node in entries(reader.node.value("with")):
        if key.reported or node.reported or not isinstance(node, ScalarNode) or node.data is None:
            reader.damage("with")
            continue
        place, name = reader.origin.of(node), reader.origin.of(key)
        quantity = parse_quantity(node.text) if node.style is Style.PLAIN and isinstance(node.data, str) else None
        if quantity is None:
            yield StartingValue(name=key.text, value=node.data, unit=None, place=place, key=name)
        else:
            unit = str(quantity.unit)
            yield StartingValue(name=key.text, value=quantity.value, unit=unit, place=place, key=name)


def _read_motion(reader: Reader) -> Motion:
    declared_keys = reader.node.entries
    static = reader.scalar("static")
    return Motion(
        history_s=reader.duration_s("history", 0.0) if "history" in declared_keys else None,
        extrapolate_s=reader.duration_s("extrapolate", 0.0, least="zero") if "extrapolate" in declared_keys else None,
        valid_for_s=reader.duration_s("valid_for", 0.0, most="forever") if "valid_for" in declared_keys else None,
        is_static=static is not None and static.data is True,
    )


def read_pose(reader: Reader) -> StartingPose:
    """Return the pose that a mapping of lengths and angles describes; missing values are 0."""
    x, y, z = (_read_quantity(reader, key, _METRE, "a length") for key in ("x", "y", "z"))
    roll, pitch, yaw = (_read_quantity(reader, key, _RADIAN, "an angle") for key in ("roll", "pitch", "yaw"))
    return StartingPose(translation_m=(x, y, z), rotation_rad=(roll, pitch, yaw))


def _read_view(reader: Reader) -> View:
    nearest_m = _read_quantity(reader, "nearest", _METRE, "a length")
    farthest_m = _read_quantity(reader, "farthest", _METRE, "a length", math.inf)
    node = reader.node.value("farthest")
    if not 0 <= nearest_m < farthest_m and node is not None:
        reader.fail("range", "the view ends before it begins", node, "make 'farthest' larger than 'nearest'")
    return View(
        horizontal_rad=_read_view_angle(reader, "horizontal"),
        vertical_rad=_read_view_angle(reader, "vertical"),
        nearest_m=nearest_m,
        farthest_m=farthest_m,
    )


def _read_view_angle(reader: Reader, key: str) -> float:
    node = reader.node.value(key)
    angle_rad = _read_quantity(reader, key, _RADIAN, "an angle", math.nan)
    if node is not None and not math.isnan(angle_rad) and not 0 < angle_rad < math.pi:
        message = f"{shown(key)} of the view of {reader.subject} cannot be {shown(reader.origin.written(node))}"
        reader.fail("range", message, node, "write an angle above 0 deg and below 180 deg", key)
    return angle_rad if 0 < angle_rad < math.pi else 1.0


def _read_quantity(reader: Reader, key: str, unit: Unit, noun: str, default: float = 0.0) -> float:
    """Return a quantity in base units; a bare 0 is valid for any unit."""
    node = reader.scalar(key)
    if node is None or node.data == 0:
        return default if node is None else 0.0
    quantity = parse_quantity(node.text)
    if quantity is None or quantity.unit.dimension != unit.dimension:
        message = f"{shown(key)} in {reader.subject} must be {noun}, not {shown(node.text)}"
        help_text = f"write a number with a unit, such as {'0.5 m' if unit is _METRE else '30 deg'}"
        reader.fail("unit", message, node, help_text, key)
        return default
    return quantity.si


def _read_rules(reader: Reader) -> Iterator[AgentRule]:
    first_spellings: dict[str, str] = {}
    for key, node in entries(reader.node.value("rules")):
        if not check_name(key, "a rule", reader.subject, reader.findings, "rules") or not isinstance(node, MappingNode):
            reader.damage("rules")
            continue
        first = first_spellings.setdefault(key.text.casefold(), key.text)
        if first != key.text:
            message = f"the rules {shown(first)} and {shown(key.text)} differ only in case"
            reader.fail("duplicate-name", message, key, "rename one of them", "rules", key.text)
        rule_reader = reader.inner(node, "rules", key.text)
        before, during, after = (read_patterns(rule_reader, moment) for moment in ("before", "during", "after"))
        pattern_nodes = [node.value(moment) for moment in ("before", "during", "after")]
        is_readable = not node.unread and not any(
            isinstance(patterns_node, SequenceNode) and patterns_node.reported for patterns_node in pattern_nodes
        )
        is_readable = is_readable and all(pattern.tree is not None for pattern in (*before, *during, *after))
        place = reader.origin.of(key)
        yield AgentRule(name=key.text, place=place, before=before, during=during, after=after, is_whole=is_readable)
