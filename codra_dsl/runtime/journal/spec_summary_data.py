"""An outline as plain data, as a file can hold it, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, cast

from codra_dsl.runtime.journal.spec_summary import AlgorithmOutline, ObserverOutline, Place, Rule, SpecSummary, place_of
from codra_dsl.runtime.values.model import Kind, SkillModel, ValueType, VariableModel


def plain_outline(summary: SpecSummary) -> dict[str, Any]:
    """Return an outline as JSON can hold it."""
    return {
        "name": summary.name,
        "variables": {name: _plain_variable(each) for name, each in summary.variables.items()},
        "observers": {
            name: {
                "identifies": list(each.identifies),
                "algorithms": list(each.algorithms),
                "period_s": each.period_s,
                "place": _plain_place(each.place),
            }
            for name, each in summary.observers.items()
        },
        "algorithms": {name: _plain_algorithm(each) for name, each in summary.algorithms.items()},
        "skills": {
            name: {"preview": list(each.preview), "monitor": list(each.monitor), "changes": list(each.changes)}
            for name, each in summary.skills.items()
        },
        "places": {key: _plain_place(place) for key, place in summary.places.items()},
        **({"nodes": dict(summary.nodes)} if summary.nodes else {}),
    }


def _plain_variable(variable: VariableModel) -> dict[str, Any]:
    return {
        **_plain_type(variable.type),
        "label": variable.label,
        "sources": list(variable.sources),
        "valid_for_s": _finite(variable.valid_for_s),
        "when_unobservable": variable.when_unobservable,
    }


def _plain_type(declared: ValueType) -> dict[str, Any]:
    return {
        "type": declared.kind,
        "unit": declared.unit,
        "range": None if declared.range is None else [_finite(end) for end in declared.range],
        "values": list(declared.members),
        "optional": declared.optional,
    }


def _plain_algorithm(algorithm: AlgorithmOutline) -> dict[str, Any]:
    return {
        "observable_when": [_plain_rule(rule) for rule in algorithm.conditions],
        "accept_when": [_plain_rule(rule) for rule in algorithm.accepts],
        "identifies": {name: _plain_rule(rule) for name, rule in algorithm.identifies.items()},
        "returns": {name: _plain_type(each) for name, each in algorithm.returns.items()},
        "timeout_s": _finite(algorithm.timeout_s),
        "place": _plain_place(algorithm.place),
    }


def _plain_rule(rule: Rule) -> dict[str, Any]:
    return {"text": rule.said, "python": rule.python, "place": _plain_place(rule.place)}


def _plain_place(place: Place | None) -> dict[str, Any] | None:
    if place is None:
        return None
    use = {} if place.use is None else {"use": _plain_place(place.use)}
    return {"file": place.file, "line": place.line, **use}


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def outline_of(plain: Mapping[str, Any]) -> SpecSummary:
    """Return the outline that plain data holds.

    Raises:
        ValueError: if it holds none; KeyError, TypeError and AttributeError likewise.
    """
    return SpecSummary(
        name=str(plain["name"]),
        variables={name: _variable_of(name, about) for name, about in plain["variables"].items()},
        observers={
            name: ObserverOutline(
                name=name,
                identifies=tuple(about["identifies"]),
                algorithms=tuple(about["algorithms"]),
                period_s=float(about["period_s"]),
                place=place_of(about["place"]),
            )
            for name, about in plain["observers"].items()
        },
        algorithms={name: _algorithm_of(name, about) for name, about in plain["algorithms"].items()},
        skills={
            name: SkillModel(
                name=name,
                preview=tuple(about["preview"]),
                monitor=tuple(about["monitor"]),
                changes=tuple(about["changes"]),
            )
            for name, about in plain["skills"].items()
        },
        places={key: place for key, about in plain["places"].items() if (place := place_of(about))},
        nodes={str(name): str(node) for name, node in plain.get("nodes", {}).items()},
    )


def _variable_of(name: str, about: Mapping[str, Any]) -> VariableModel:
    return VariableModel(
        name=name,
        type=_type_of(about),
        label=about["label"],
        sources=tuple(about["sources"]),
        valid_for_s=_bound(about["valid_for_s"], math.inf),
        when_unobservable=about["when_unobservable"],
    )


def _type_of(about: Mapping[str, Any]) -> ValueType:
    ends = about["range"]
    return ValueType(
        kind=cast("Kind", about["type"]),
        unit=about["unit"],
        range=None if ends is None else (_bound(ends[0], -math.inf), _bound(ends[1], math.inf)),
        members=tuple(about["values"]),
        optional=bool(about["optional"]),
    )


def _bound(number: float | None, instead: float) -> float:
    return instead if number is None else float(number)


def _algorithm_of(name: str, about: Mapping[str, Any]) -> AlgorithmOutline:
    return AlgorithmOutline(
        name=name,
        conditions=tuple(map(_rule_of, about["observable_when"])),
        accepts=tuple(map(_rule_of, about["accept_when"])),
        identifies={variable: _rule_of(rule) for variable, rule in about["identifies"].items()},
        returns={key: _type_of(each) for key, each in about["returns"].items()},
        timeout_s=_bound(about["timeout_s"], math.inf),
        place=place_of(about["place"]),
    )


def _rule_of(about: Mapping[str, Any]) -> Rule:
    return Rule(said=about["text"], python=str(about["python"]), place=place_of(about["place"]))
