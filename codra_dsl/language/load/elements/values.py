"""Read types, ranges and literals with units."""

from __future__ import annotations

import re
from collections.abc import Iterable

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode, visible_range
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.model import Kind, Literal, Places, ValueType
from codra_dsl.language.units import Unit, convert, parse_quantity, parse_unit, units_help

_KINDS = {kind.value: kind for kind in Kind}
_TYPE_KEYS = ("type", "unit", "range", "values")
_RANGE_HELP = "write numbers in the unit under 'unit', or numbers with a unit of the same kind"
_QUANTITY_PATTERN = re.compile(r"-?[0-9][0-9.eE+-]*[ \t]+([A-Za-z%°][A-Za-z0-9*/^%°]*)")


def read_type(reader: Reader, node: MappingNode, *steps: str) -> ValueType:
    """Return the type of a mapping with `type`, `unit`, `range` and `values`, as far as it can be read."""
    entries = node.entries
    type_node = node.value("type")
    kind = _KINDS.get(type_node.text) if isinstance(type_node, ScalarNode) else None
    unit = _read_unit(reader, entries["unit"], *steps) if "unit" in entries else None
    value_range = _read_range(reader, entries["range"], unit, *steps) if "range" in entries else None
    members = tuple(_members(entries["values"])) if "values" in entries else ()
    if kind is None:
        reader.damage(*steps, "type")
    if node.unread:
        reader.damage(*steps)
    ranges: dict[str, tuple[int, int]] = {}
    for key, (key_node, value) in entries.items():
        if key in _TYPE_KEYS:
            ranges[key] = visible_range(key_node, value)
            if value.reported or (isinstance(value, SequenceNode) and any(item.reported for item in value.items)):
                reader.damage(*steps, key)
    ranges.update((f"values.{item.text}", (item.start, item.end)) for item in members)
    return ValueType(
        kind=Kind.BOOL if kind is None else kind,
        unit=None if unit is None else unit[0],
        range=value_range,
        values=tuple([item.text for item in members]),
        places=Places(reader.place_of, ranges),
    )


def read_literal(reader: Reader, node: YamlNode, *steps: str) -> Literal:
    """Return a literal; a plain number with a unit is converted to SI units."""
    if node.reported or not isinstance(node, ScalarNode) or node.data is None:
        reader.damage(*steps)
        return ""
    if isinstance(node.data, str) and node.style is Style.PLAIN and node.text[:1] in "-0123456789":
        return _read_quantity(reader, node, *steps)
    return node.data


def _read_quantity(reader: Reader, node: ScalarNode, *steps: str) -> Literal:
    quantity = parse_quantity(node.text)
    if quantity is not None:
        return quantity.si
    report_unknown_unit(reader, node, *steps)
    return node.text


def report_unknown_unit(reader: Reader, node: ScalarNode, *steps: str) -> bool:
    """Report the unit of a number with an unknown unit, such as `3 metres`; return whether there is one."""
    quantity = _QUANTITY_PATTERN.fullmatch(node.text)
    if quantity is None or parse_unit(quantity[1]) is not None:
        return False
    unit_help = units_help(quantity[1])
    help_text = f"{unit_help}{' ' if unit_help.endswith('?') else '. '}Quote it if it is text"
    reader.fail("unit", f"unknown unit {shown(quantity[1])} in {shown(node.text)}", node, help_text, *steps)
    return True


def _read_unit(reader: Reader, entry: tuple[ScalarNode, YamlNode], *steps: str) -> tuple[str, Unit | None] | None:
    if not isinstance(entry[1], ScalarNode) or entry[1].reported:
        return None
    text = entry[1].text
    unit = parse_unit(text)
    if unit is None:
        reader.fail("unit", f"unknown unit {shown(text)}", entry[1], units_help(text), *steps, "unit")
    return text, unit


def _read_range(
    reader: Reader, entry: tuple[ScalarNode, YamlNode], unit: tuple[str, Unit | None] | None, *steps: str
) -> tuple[float, float] | None:
    """Return a range in the unit of the value; only literals, such as those under `with`, are converted to SI units."""
    if not isinstance(entry[1], SequenceNode) or entry[1].reported:
        return None
    if any(item.reported for item in entry[1].items):
        reader.damage(*steps, "range")
        return None
    range_ends = (_read_end(item, unit) for item in entry[1].items)
    ends = [end for end in range_ends if end is not None]
    if unit is not None and unit[1] is None:
        return None
    if len(ends) == 2 and ends[0] <= ends[1]:
        return ends[0], ends[1]
    place, range_text = reader.origin.of_value(*entry), reader.origin.written(entry[1])
    if len(ends) < 2:
        expected_text = "two numbers, since the value has no unit" if unit is None else f"two numbers in {unit[0]}"
        reader.fail(
            "range", f"the range {shown(range_text)} must be {expected_text}", place, _RANGE_HELP, *steps, "range"
        )
        return None
    message = f"the range {shown(range_text)} ends before it begins"
    reader.fail("range", message, place, "write the smaller number first", *steps, "range")
    return ends[0], ends[1]


def _read_end(node: YamlNode, unit: tuple[str, Unit | None] | None) -> float | None:
    """Return one end of a range in the value's unit, or None if the end is invalid.

    The end may be written with another unit.
    """
    if not isinstance(node, ScalarNode):
        return None
    if isinstance(node.data, (int, float)):
        return node.data
    quantity = parse_quantity(node.text)
    stated_unit = None if unit is None else unit[1]
    if quantity is None or stated_unit is None or quantity.unit.dimension != stated_unit.dimension:
        return None
    return convert(quantity.value, quantity.unit, stated_unit)


def _members(entry: tuple[ScalarNode, YamlNode]) -> Iterable[ScalarNode]:
    items = entry[1].items if isinstance(entry[1], SequenceNode) else ()
    return (item for item in items if isinstance(item, ScalarNode))
