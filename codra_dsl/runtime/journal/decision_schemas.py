"""The JSON schemas of the events of decisions and previews."""

from __future__ import annotations

from codra_dsl.runtime.journal.fields import (
    JsonSchema,
    event_schema,
    field_schema,
    list_schema,
    reason_schema,
    value_fields,
)
from codra_dsl.runtime.journal.spec_summary import SpecSummary


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
        detail=field_schema("string", "Why it was unknown, or why it could not be observed."),
        source=field_schema("string", "The source of the value in context."),
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
