"""Values in a timeline, with the types and units of the compiled spec, and the help about unknown names."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.values import read_literal, report_unknown_unit
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.model import Literal
from codra_dsl.language.units import convert, parse_quantity, parse_unit
from codra_dsl.runtime import NotOfTypeError
from codra_dsl.runtime.values.model import ValueType

_NUMBER_KINDS = ("int", "float")
_TEXT_KINDS = ("enum", "str")


def read_value(reader: Reader, node: YamlNode, type_: ValueType, *steps: str, unknown_help: str = "") -> Literal | None:
    """Return a node's value, in the unit of a type. If the value is not of this type, add a finding and return None.

    `unknown_help` states how a timeline expresses that the value is unknown.
    """
    if node.reported or not isinstance(node, ScalarNode):
        return None
    data = _read_data(reader, node, type_, *steps)
    if data is None:
        return None
    try:
        return type_.convert(data)
    except NotOfTypeError as error:
        help_text = unknown_help if unknown_help and node.text == "unknown" else _type_help(type_)
        reader.fail("wrong-type", f"{shown(steps[-1])} has a wrong value: {error}", node, help_text, *steps)
        return None


def read_difference(reader: Reader, node: YamlNode, type_: ValueType, *steps: str) -> float | None:
    """Read a tolerance for numbers of a type, in the unit of the type; return None if the node has no such value."""
    difference = read_value(reader, node, ValueType(kind="float", unit=type_.unit), *steps)
    return float(difference) if isinstance(difference, int | float) else None


def read_anything(reader: Reader, node: YamlNode, *steps: str) -> object:
    """Return plain data for a handle; quantities are converted to SI."""
    if isinstance(node, MappingNode):
        return {key: read_anything(reader, value, *steps, key) for key, (_, value) in node.entries.items()}
    if isinstance(node, SequenceNode):
        return [read_anything(reader, item, *steps, str(index)) for index, item in enumerate(node.items)]
    return None if node.data is None else read_literal(reader, node, *steps)


def read_garbage(reader: Reader, node: YamlNode, types: Mapping[str, ValueType], *steps: str) -> object:
    """Return what an algorithm returns in spite of its types; quantities have the units of the returned values."""
    if not isinstance(node, MappingNode):
        return node.data
    garbage = dict(node.data)
    for key, (_, value) in node.entries.items():
        type_ = types.get(key)
        if type_ is not None and type_.kind in _NUMBER_KINDS and _is_quantity(value):
            garbage[key] = read_value(reader, value, ValueType(kind="float", unit=type_.unit), *steps, key)
    return garbage


def unknown_name_help(name: str, names: Collection[str], findings: Findings, key: str = "") -> str:
    """Return the help about a name that is not among the names that a timeline, or one of its keys, may use."""
    similar_name = findings.nearest(name, names)
    if similar_name:
        return f"did you mean '{similar_name}'?"
    if not names:
        return "declare it in the spec"
    return f"{shown(key)} takes {list_names(names)}" if key else f"write one of {list_names(names)}"


def _read_data(reader: Reader, node: ScalarNode, type_: ValueType, *steps: str) -> object:
    """Return the written value; a quantity is converted to the type's unit.

    If the units do not match, add a finding and return None.
    """
    if type_.kind in _TEXT_KINDS and not isinstance(node.data, bool) and node.data is not None:
        return node.text
    unit = None if type_.unit is None else parse_unit(type_.unit)
    if type_.kind not in _NUMBER_KINDS:
        return _require_data(reader, node, type_, *steps)
    quantity = parse_quantity(node.text) if _is_quantity(node) else None
    if quantity is not None:
        if unit is not None and quantity.unit.dimension == unit.dimension:
            return convert(quantity.value, quantity.unit, unit)
        unit_text = f"is in {type_.unit}" if unit is not None else "has no unit"
        message = f"{shown(steps[-1])} {unit_text}, but {shown(node.text)} is in {quantity.unit}"
        reader.fail("unit", message, node, _type_help(type_), *steps)
        return None
    if unit is not None and isinstance(node.data, int | float) and not isinstance(node.data, bool) and node.data != 0:
        message = f"{shown(steps[-1])} is in {type_.unit}, and {shown(node.text)} has no unit"
        reader.fail("unit", message, node, f"write '{node.text} {type_.unit}', or another unit", *steps)
        return None
    if _is_quantity(node) and report_unknown_unit(reader, node, *steps):
        return None
    return _require_data(reader, node, type_, *steps)


def _is_quantity(node: YamlNode) -> bool:
    """Return whether a node is a text that begins like a number, and is not quoted."""
    if not isinstance(node, ScalarNode) or node.style is not Style.PLAIN:
        return False
    return isinstance(node.data, str) and node.text[:1] in "-0123456789"


def _require_data(reader: Reader, node: ScalarNode, type_: ValueType, *steps: str) -> object:
    if node.data is None:
        reader.fail("wrong-type", f"{shown(steps[-1])} has no value", node, _type_help(type_), *steps)
    return node.data


def _type_help(type_: ValueType) -> str:
    if type_.kind == "bool":
        return "write true or false"
    if type_.members:
        return f"write one of {', '.join(type_.members)}"
    if type_.kind == "str":
        return "write a text"
    kind_text = "a whole number" if type_.kind == "int" else "a number"
    unit = f" in {type_.unit}, or another unit of its kind" if type_.unit else ""
    bounds = "" if type_.range is None else f", from {type_.range[0]:g} to {type_.range[1]:g}"
    return f"write {kind_text}{unit}{bounds}"
