"""JSON schemas of the fields of journal events, and of the events of decisions and previews.

Each field has one type, because viewers support no unions.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.values.cell import Reason

JsonSchema = dict[str, Any]

_JSON_TYPES = {"bool": "boolean", "int": "integer", "float": "number", "str": "string", "enum": "string"}

_BOUND_FIELDS: Mapping[str, JsonSchema] = {
    "low": {"type": "number", "description": "The lowest possible value; left out when unknown."},
    "high": {"type": "number", "description": "The highest possible value."},
}
"""The fields of a range of values."""

_METRIC_AND_WEIGHT_FIELDS: Mapping[str, JsonSchema] = {
    "name": {"type": "string", "description": "The metric or action."},
    **_BOUND_FIELDS,
    "value": {"type": "number", "description": "The resulting value; left out when unknown."},
    "evidence_s": {"type": "number", "description": "When the evidence of the oldest input was taken."},
    "variable": {"type": "string", "description": "For an analysis, the variable that holds the value."},
    "reads": {
        "type": "array",
        "items": {"type": "string"},
        "description": "For an analysis, the variables from which the value was computed.",
    },
}
"""The fields of a metric or of the weight of an action."""


def _object_list_schema(description: str, **properties: JsonSchema) -> JsonSchema:
    """Return the schema of a list of objects with some properties."""
    item_schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {"type": "array", "items": item_schema, "description": description}


def event_schema(
    description: str, name_description: str, meanings: Mapping[str, str], **details: JsonSchema
) -> JsonSchema:
    """Return the schema of an event: its instant, its name, what happened (a key of `meanings`), and details."""
    meanings_text = ", ".join(f"{what}: {meaning}" for what, meaning in meanings.items())
    return {
        "type": "object",
        "description": description,
        "properties": {
            "instant_s": field_schema(
                "number",
                "The instant in seconds of the run's clock. The message's log_time is the same instant in nanoseconds.",
            ),
            "name": field_schema("string", name_description),
            "what": {"type": "string", "enum": list(meanings), "description": f"What happened ({meanings_text})."},
            **details,
        },
        "required": ["instant_s", "name", "what"],
        "additionalProperties": False,
    }


def field_schema(json_type: str, description: str) -> JsonSchema:
    """Return the schema of a field of one JSON type."""
    return {"type": json_type, "description": description}


def list_schema(json_type: str, description: str) -> JsonSchema:
    """Return the schema of a list of values of one JSON type."""
    return {"type": "array", "items": {"type": json_type}, "description": description}


def reason_schema(description: str) -> JsonSchema:
    """Return the schema of the reason why a variable is unknown."""
    return {"type": "string", "enum": [str(reason) for reason in Reason], "description": description}


def value_fields(name: str, value_kind: str, description: str) -> dict[str, JsonSchema]:
    """Return the schema of a field that holds a value of a type of the spec language, and of its infinite values."""
    value_schema = field_schema(_JSON_TYPES[value_kind], description)
    return {name: value_schema, **(infinite_fields(name) if value_kind == "float" else {})}


def infinite_fields(*names: str) -> dict[str, JsonSchema]:
    """Return the schemas of the fields that replace numbers if they are infinite."""
    keys = {name: "infinite" if name == "value" else f"infinite_{name}" for name in names}
    text = "1 if `{}` is infinite, -1 if it is negative infinity; then `{}` is left out."
    return {key: field_schema("integer", text.format(name, name)) for name, key in keys.items()}


def result_fields(returns: Mapping[str, tuple[str, str | None]]) -> dict[str, JsonSchema]:
    """Return the schemas of the fields for the result of a job, from the kind and the unit of each quantity."""
    quantities = {name: field_schema(_JSON_TYPES[kind], unit_sentence(unit)) for name, (kind, unit) in returns.items()}
    signs = {
        name: field_schema("integer", "1 or -1: the sign.") for name, (kind, _) in returns.items() if kind == "float"
    }
    fields = {"values": ("The result, without quantities that were not measured or are infinite.", quantities)}
    if signs:
        fields["infinite"] = ("The infinite quantities of the result.", signs)
    return {
        key: {"type": "object", "description": description, "properties": properties, "additionalProperties": False}
        for key, (description, properties) in fields.items()
    }


def unit_sentence(unit: str | None) -> str:
    """Return the sentence about the unit of a number."""
    return f"In {unit}." if unit else "Declared under `returns` in the spec."


def cause_fields() -> dict[str, JsonSchema]:
    """Return the schemas of the causes of a decision, a metric or a weight."""
    return {
        "readings": _object_list_schema(
            "The readings that were used.",
            variable=field_schema("string", "The variable."),
            value=field_schema("string", "Its value, as JSON; left out when unknown."),
            evidence_s=field_schema("number", "When its evidence was taken."),
            because=field_schema("string", "Why it is unknown."),
        ),
        "degrees": _object_list_schema(
            "The degree of membership of each input in each of its terms.",
            variable=field_schema("string", "The input."),
            term=field_schema("string", "The term of the input."),
            **_BOUND_FIELDS,
        ),
        "rules": _object_list_schema(
            "The strength of each rule; for an analysis, only rules that act.",
            text=field_schema("string", "The rule."),
            concludes=list_schema("string", "The outputs that the rule concludes about."),
            place=field_schema("string", "The place of the rule in the spec."),
            **_BOUND_FIELDS,
        ),
        "metrics": _object_list_schema("The metrics.", **_METRIC_AND_WEIGHT_FIELDS),
        "weights": _object_list_schema(
            "The weights of the actions, and the state of the filter.",
            **_METRIC_AND_WEIGHT_FIELDS,
            smoothed=field_schema("number", "The smoothed weight, which is used for the decision."),
            leads_since_s=field_schema("number", "Since when the action leads the course that was left."),
            cooldown_until_s=field_schema("number", "The instant before which the action cannot be chosen again."),
        ),
        "kept_by": _object_list_schema(
            "The smallest single change of each kind that would have kept the course.",
            kind=field_schema("string", "The kind of the change: of an input, or of a weight."),
            name=field_schema("string", "The variable, or the action."),
            value=field_schema("string", "The actual value, as JSON; left out when unknown."),
            other=field_schema("string", "The value that would have kept the course, as JSON."),
            share=field_schema("number", "The size of the change, as a share of the range."),
        ),
    }


def decision_schema(name: str, summary: SpecSummary) -> tuple[str, JsonSchema]:
    """Return the name and the schema of the events of decisions on a variable."""
    kind = summary.variables[name].type.kind
    return f"codra.Decision.{kind}", event_schema(
        "How a decision of the main execution was answered.",
        "The variable that the decision reads.",
        {
            "answered": "from context",
            "fell_back": "by the main execution's own acquisition",
            "shadowed": "from context, although the main execution acquired the value as well",
        },
        **value_fields("value", kind, "The value in context; left out when unknown."),
        reason=reason_schema("Why it was unknown; left out when known."),
        detail=field_schema("string", "Why it was unknown, could not be observed, or was overridden."),
        source=field_schema("string", "The source of the value in context; `operator` for an override."),
        asked_s=field_schema("number", "When the decision was requested."),
        **value_fields("found", kind, "The value that the main execution acquired itself."),
        kept=field_schema("boolean", "Whether the acquired value was kept as evidence."),
        agrees=field_schema("boolean", "Whether both values are equal; left out if no value was acquired."),
        shadow=field_schema("boolean", "Whether the main execution would have looked in any case."),
        skill=field_schema("string", "The skill in progress that began last; left out if none."),
        raised=field_schema("string", "The error that the acquisition raised, or why the decision was abandoned."),
    )


def preview_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    """Return the name and the schema of the events of previews; previews of all skills have the same schema."""
    return "codra.Preview", event_schema(
        "How the preview of a skill was answered: one decision on all its variables.",
        "The skill.",
        {
            "answered": "decided from context",
            "fell_back": "the main execution looked for at least one variable itself",
            "unanswered": "context did not decide it, and the main execution did not look",
        },
        outcome=field_schema("string", "The answer: holds, violated or unknown."),
        violated=list_schema("string", "The conditions that do not hold, as written in the spec."),
        undecided=list_schema("string", "The conditions and variables that are not decided."),
        unknown=list_schema("string", "The unknown variables because of which something is undecided."),
        reasons=list_schema("string", "For each of these variables, why it is unknown."),
        details=list_schema("string", "For each of these variables, the cause, or why it cannot be observed."),
        looked=list_schema("string", "The variables for which the main execution looked."),
        variables=list_schema("string", "The variables of the preview."),
        sources=list_schema("string", "For each of these variables, the source of its value; empty if unknown."),
        asked_s=field_schema("number", "When the preview was requested."),
        raised=field_schema("string", "The error that a look raised, or why the preview was abandoned."),
    )
