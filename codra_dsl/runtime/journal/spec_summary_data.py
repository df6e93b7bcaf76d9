"""Conversion of spec summaries to plain data for a file, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

from codra_dsl.runtime.journal.spec_summary import (
    AlgorithmSummary,
    ObserverSummary,
    Place,
    Rule,
    SpecSummary,
    place_from_data,
)
from codra_dsl.runtime.values.condition_text import parse_condition
from codra_dsl.runtime.values.model import Kind, SkillModel, ValueType, VariableModel


def summary_to_data(summary: SpecSummary) -> dict[str, Any]:
    """Return a summary as data that can be written as JSON."""
    return {
        "name": summary.name,
        "variables": {name: _variable_to_data(variable) for name, variable in summary.variables.items()},
        "observers": {
            name: {
                "identifies": list(observer.identifies),
                "algorithms": list(observer.algorithms),
                "period_s": observer.period_s,
                "place": _place_to_data(observer.place),
            }
            for name, observer in summary.observers.items()
        },
        "algorithms": {name: _algorithm_to_data(algorithm) for name, algorithm in summary.algorithms.items()},
        "skills": {
            name: {"preview": list(skill.preview), "monitor": list(skill.monitor), "changes": list(skill.changes)}
            for name, skill in summary.skills.items()
        },
        "places": {key: _place_to_data(place) for key, place in summary.places.items()},
        **({"nodes": dict(summary.nodes)} if summary.nodes else {}),
        **({"previews": _previews_to_data(summary.previews)} if summary.previews else {}),
    }


def _previews_to_data(previews: Mapping[str, tuple[Rule, ...]]) -> dict[str, Any]:
    return {name: [_rule_to_data(rule) for rule in rules] for name, rules in previews.items()}


def _variable_to_data(variable: VariableModel) -> dict[str, Any]:
    return {
        **_type_to_data(variable.type),
        "label": variable.label,
        "sources": list(variable.sources),
        "valid_for_s": _finite_or_none(variable.valid_for_s),
        "when_unobservable": variable.when_unobservable,
        **({} if variable.derived is None else {"derived": repr(variable.derived)}),
    }


def _type_to_data(value_type: ValueType) -> dict[str, Any]:
    return {
        "type": value_type.kind,
        "unit": value_type.unit,
        "range": None if value_type.range is None else [_finite_or_none(bound) for bound in value_type.range],
        "values": list(value_type.members),
        "optional": value_type.optional,
    }


def _algorithm_to_data(algorithm: AlgorithmSummary) -> dict[str, Any]:
    return {
        "observable_when": [_rule_to_data(rule) for rule in algorithm.preconditions],
        "accept_when": [_rule_to_data(rule) for rule in algorithm.acceptance_conditions],
        "identifies": {name: _rule_to_data(rule) for name, rule in algorithm.identifies.items()},
        "returns": {name: _type_to_data(value_type) for name, value_type in algorithm.returns.items()},
        "timeout_s": _finite_or_none(algorithm.timeout_s),
        **({"host": algorithm.host} if algorithm.host else {}),
        "place": _place_to_data(algorithm.place),
    }


def _rule_to_data(rule: Rule) -> dict[str, Any]:
    return {"text": rule.source_text, "python": rule.python_text, "place": _place_to_data(rule.place)}


def _place_to_data(place: Place | None) -> dict[str, Any] | None:
    if place is None:
        return None
    others = (("use", place.use), ("site", place.site), ("replaces", place.replaces))
    others_data = {name: _place_to_data(other) for name, other in others if other is not None}
    return {"file": place.file, "line": place.line, **others_data}


def _finite_or_none(number: float) -> float | None:
    return number if math.isfinite(number) else None


def summary_from_data(data: Mapping[str, Any]) -> SpecSummary:
    """Return the summary that plain data describes.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: if the data does not describe a summary.
    """
    return SpecSummary(
        name=str(data["name"]),
        variables={name: _variable_from_data(name, entry) for name, entry in data["variables"].items()},
        observers={
            name: ObserverSummary(
                name=name,
                identifies=tuple(entry["identifies"]),
                algorithms=tuple(entry["algorithms"]),
                period_s=float(entry["period_s"]),
                place=place_from_data(entry["place"]),
            )
            for name, entry in data["observers"].items()
        },
        algorithms={name: _algorithm_from_data(name, entry) for name, entry in data["algorithms"].items()},
        skills={
            name: SkillModel(
                name=name,
                preview=tuple(entry["preview"]),
                monitor=tuple(entry["monitor"]),
                changes=tuple(entry["changes"]),
            )
            for name, entry in data["skills"].items()
        },
        places={key: place for key, entry in data["places"].items() if (place := place_from_data(entry))},
        nodes={str(name): str(node) for name, node in data.get("nodes", {}).items()},
        previews={
            str(name): tuple(_rule_from_data(rule) for rule in rules)
            for name, rules in data.get("previews", {}).items()
        },
    )


def _variable_from_data(name: str, data: Mapping[str, Any]) -> VariableModel:
    return VariableModel(
        name=name,
        type=_type_from_data(data),
        label=data["label"],
        sources=tuple(data["sources"]),
        valid_for_s=_float_or_default(data["valid_for_s"], math.inf),
        when_unobservable=data["when_unobservable"],
        derived=parse_condition(data["derived"]) if "derived" in data else None,
    )


def _type_from_data(data: Mapping[str, Any]) -> ValueType:
    bounds = data["range"]
    return ValueType(
        kind=cast("Kind", data["type"]),
        unit=data["unit"],
        range=None
        if bounds is None
        else (_float_or_default(bounds[0], -math.inf), _float_or_default(bounds[1], math.inf)),
        members=tuple(data["values"]),
        optional=bool(data["optional"]),
    )


def _float_or_default(number: float | None, default: float) -> float:
    return default if number is None else float(number)


def _algorithm_from_data(name: str, data: Mapping[str, Any]) -> AlgorithmSummary:
    return AlgorithmSummary(
        name=name,
        preconditions=tuple(map(_rule_from_data, data["observable_when"])),
        acceptance_conditions=tuple(map(_rule_from_data, data["accept_when"])),
        identifies={variable: _rule_from_data(rule) for variable, rule in data["identifies"].items()},
        returns={key: _type_from_data(value_type) for key, value_type in data["returns"].items()},
        timeout_s=_float_or_default(data["timeout_s"], math.inf),
        host=str(data.get("host", "")),
        place=place_from_data(data["place"]),
    )


def _rule_from_data(data: Mapping[str, Any]) -> Rule:
    return Rule(source_text=data["text"], python_text=str(data["python"]), place=place_from_data(data["place"]))
