"""Read derived variables: an expression, and the step to which distances in it are rounded."""

from __future__ import annotations

from dataclasses import replace

from codra_dsl.language.expression import parse_derivation, with_resolution
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.conditions import read_condition
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.model import Condition
from codra_dsl.language.units import UNITS, parse_quantity


def read_derivation(reader: Reader) -> tuple[Condition | None, float | None]:
    """Return the expression of a derived variable and its resolution in metres; None if the spec does not state it."""
    node = reader.node.value("derived")
    if node is None:
        return None, None
    condition = read_condition(reader, node, "derived", grammar=parse_derivation)
    resolution_m = _read_resolution_m(reader)
    if condition.tree is None or resolution_m is None:
        return condition, resolution_m
    return replace(condition, tree=with_resolution(condition.tree, f"{resolution_m:g} m")), resolution_m


def _read_resolution_m(reader: Reader) -> float | None:
    node = reader.scalar("resolution")
    if node is None:
        return None
    quantity = parse_quantity(node.text)
    if quantity is None or quantity.unit.dimension != UNITS["m"].dimension or not quantity.si > 0:
        message = f"'resolution' in {reader.subject} must be a length, not {shown(node.text)}"
        reader.fail("unit", message, node, "write a length above 0, such as 10 cm", "resolution")
        return None
    return quantity.si
