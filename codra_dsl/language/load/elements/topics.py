"""Read the key `ros` of a context-variable: topic, type and field of messages, and the factor between the units."""

from __future__ import annotations

import re
from collections.abc import Sequence

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, visible_range
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.model import Kind, Places, Qos, Reference, Topic, ValueType
from codra_dsl.language.units import parse_unit, ratio, units_help

_OBSERVER = "observer"
_TOPIC = re.compile(r"[~/]?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*|~/[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*", re.ASCII)
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)")
_FIELD = re.compile(r"[A-Za-z]\w*(?:\[[0-9]{1,9}\])?(?:\.[A-Za-z]\w*(?:\[[0-9]{1,9}\])?)*", re.ASCII)
_SHORT_TYPE = re.compile(r"([a-z][a-z0-9_]*)(?:/|\.|::|\.msg\.|::msg::|/msg\.)([A-Z][A-Za-z0-9]*)")
_NUMBERS = (Kind.INT, Kind.FLOAT)


def read_topic(reader: Reader, value_type: ValueType, sources: Sequence[Reference]) -> Topic | None:
    """Return the topic of a variable with a type and sources, or None if it has none or it cannot be read."""
    node = reader.node.value("ros")
    if not isinstance(node, MappingNode):
        return None
    inner = reader.inner(node, "ros")
    ranges = {key: visible_range(key_node, value) for key, (key_node, value) in node.entries.items()}
    key_node = reader.node.entries["ros"][0]
    ranges["ros"] = (key_node.start, key_node.end)
    topic = _checked_text(inner, "topic", _TOPIC, "write a name such as /battery_state: letters, digits, _ and /")
    type_name = _checked_text(inner, "type", _TYPE, _type_help(inner))
    field = _checked_text(inner, "field", _FIELD, "write a field such as percentage, pose.position.x or ranges[0]")
    factor = _factor(inner, value_type, reader.node.entries["ros"][0])
    writer = _writer(reader, sources)
    if topic is None or type_name is None or field is None or factor is None or writer is None:
        return None
    places = Places(reader.place_of, ranges)
    qos = inner.choice("qos", Qos.DEFAULT)
    return Topic(topic=topic, type=type_name, field=field, factor=factor, qos=qos, writer=writer, places=places)


def _checked_text(reader: Reader, key: str, pattern: re.Pattern[str], help_text: str) -> str | None:
    node = reader.scalar(key)
    if node is None or pattern.fullmatch(node.text) is not None:
        return None if node is None else node.text
    nouns = {"topic": "the name of a topic", "type": "a type of messages", "field": "the path of a field"}
    message = f"{shown(key)} of 'ros' in {reader.subject} cannot be {shown(node.text)}: it is not {nouns[key]}"
    reader.fail("ros-name", message, node, help_text, key)
    return None


def _type_help(reader: Reader) -> str:
    node = reader.scalar("type")
    short_type = None if node is None else _SHORT_TYPE.fullmatch(node.text)
    if short_type is not None:
        return f"did you mean '{short_type[1]}/msg/{short_type[2]}'?"
    return "write package/msg/Name, such as sensor_msgs/msg/BatteryState"


def _factor(reader: Reader, value_type: ValueType, key: ScalarNode) -> float | None:
    """Return the number by which the field is multiplied, or None if it cannot be determined."""
    unit_node, scale_node = reader.scalar("unit"), reader.scalar("scale")
    if value_type.kind not in _NUMBERS:
        for name, node in (("unit", unit_node), ("scale", scale_node)):
            if node is not None:
                message = f"{shown(name)} of 'ros' in {reader.subject} has no effect: the variable is not a number"
                reader.fail("misplaced-key", message, node, f"remove {shown(name)}", name)
        return 1.0
    scale = float(scale_node.data) if scale_node is not None and isinstance(scale_node.data, (int, float)) else 1.0
    if scale_node is not None and (scale == 0 or isinstance(scale_node.data, bool)):
        reader.fail("range", f"'scale' of {reader.subject} cannot be 0", scale_node, "remove 'scale', or correct it")
        return None
    unit_factor = _unit_factor(reader, value_type, unit_node, key)
    factor = None if unit_factor is None else scale * unit_factor
    if factor is not None and value_type.kind is Kind.INT and not factor.is_integer():
        message = f"{reader.subject} is an int, but the field is multiplied by {factor:g}"
        reader.fail("message-type-mismatch", message, scale_node or unit_node or key, "make the variable a float")
        return None
    return factor


def _unit_factor(reader: Reader, value_type: ValueType, node: ScalarNode | None, key: ScalarNode) -> float | None:
    """Return the size of the field's unit in the unit of the variable."""
    if "unit" in reader.node.entries and node is None:
        return None
    variable_unit = None if value_type.unit is None else parse_unit(value_type.unit)
    if value_type.unit is None:
        if node is not None:
            message = f"the field of {reader.subject} has the unit {shown(node.text)}, but the variable has none"
            reader.fail("message-type-mismatch", message, node, f"state 'unit: {node.text}' for the variable", "unit")
        return 1.0
    if node is None:
        message = f"'ros' in {reader.subject} needs 'unit', because the variable has a unit and messages have none"
        help_text = "state the unit of the field, which the documentation of the message gives"
        reader.fail("missing-key", message, reader.origin.of(key), help_text)
        return None
    unit = parse_unit(node.text)
    if unit is None:
        reader.fail("unit", f"unknown unit {shown(node.text)}", node, units_help(node.text), "unit")
        return None
    if variable_unit is None:  # it has been reported
        return None
    if unit.dimension != variable_unit.dimension:
        message = f"the field of {reader.subject} is in {node.text}, but the variable in {value_type.unit}"
        help_text = "state the unit of the field; 'scale' is for fields in other units, such as 100 for a fraction"
        reader.fail("message-type-mismatch", message, node, help_text, "unit")
        return None
    return ratio(unit, variable_unit)


def _writer(reader: Reader, sources: Sequence[Reference]) -> str | None:
    """Return as whom the bridge writes the variable: the first source that is not an observer."""
    if "source" in reader.damaged:
        return None
    is_computed = any(key in reader.node.entries for key in ("derived", "rate_of", "share_of", "held"))
    writer = next((source.name for source in sources if source.name != _OBSERVER), None)
    if writer is not None and not is_computed:
        return writer
    message = f"{reader.subject} has 'ros', but no source that can write its values"
    help_text = "name an agent or main_execution under 'source', or remove 'ros'"
    if is_computed:
        message, help_text = f"{reader.subject} has 'ros', but its value is computed", "remove 'ros'"
    reader.damage("source")
    reader.fail("ros-without-writer", message, reader.origin.of(reader.node.entries["ros"][0]), help_text, "ros")
    return None
