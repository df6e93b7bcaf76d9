"""The kinds of journal events: their topics, their JSON schemas, and what tools show about a topic.

A new kind of event needs a member of `Kind`, a schema and an entry of `TOPICS`, all in this module. The rest of the
journal, the commands and replay use the kinds that this module defines. The code that adds the events is elsewhere.

Each field has one type, and unknown values are left out, because viewers support neither unions nor null in schemas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

from codra_dsl.runtime.journal.fields import (
    JsonSchema,
    cause_fields,
    decision_schema,
    event_schema,
    field_schema,
    infinite_fields,
    list_schema,
    preview_schema,
    reason_schema,
    result_fields,
    value_fields,
)
from codra_dsl.runtime.journal.spec_summary import Place, SpecSummary

RULE_EVENTS = {
    "begun": "its precondition held",
    "broken": "its condition for the time of execution no longer holds",
    "fulfilled": "its postcondition holds",
    "unfulfilled": "it has ended, and its postcondition does not hold",
}
"""The changes of an agent's rule. The key is the `what` of the event."""


class Kind(StrEnum):
    """The kind of the subject of an event.

    An `INPUT` is an event that reaches the context manager from outside and does not follow from other events: a call
    by a program, or the end of a job's function. All other events follow from inputs and evidence. Only journals hold
    inputs; an event log in memory does not.
    """

    VARIABLE = "variable"
    OVERRIDE = "override"
    OBSERVER = "observer"
    JOB = "job"
    HOST = "host"
    DECISION = "decision"
    PREVIEW = "preview"
    DECLARATION = "declaration"
    EXPECTATION = "expectation"
    KNOWLEDGE = "knowledge"
    ADAPTATION = "adaptation"
    INPUT = "input"


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """The topics to which the events of one kind are written, and descriptions of these topics.

    Attributes:
        folder: the folder of the topics, one for each subject. If `is_shared`, the folder itself is the only topic.
        schema: returns the name of the schema of a subject's events, and the schema.
        metadata: returns the metadata that tools show about a subject's topic: units, label.
        place: returns the place of a subject in the spec.
        is_shared: whether all events of the kind are written to one topic.
        has_evidence_time: whether the publish time of a message is the time of its evidence, not of the event.
    """

    folder: str
    schema: Callable[[str, SpecSummary], tuple[str, JsonSchema]]
    metadata: Callable[[str, SpecSummary], Mapping[str, str]]
    place: Callable[[str, SpecSummary], Place | None]
    is_shared: bool = False
    has_evidence_time: bool = False


def topic_of(kind: Kind, name: str) -> str:
    """Return the topic of the events of a subject."""
    topic = TOPICS[kind]
    return topic.folder if topic.is_shared else f"{topic.folder}/{name}"


@lru_cache(maxsize=65_536)
def kind_of(topic: str) -> Kind | None:
    """Return the kind of events on a topic; None if the topic has no events."""
    return next((kind for kind, kind_topic in TOPICS.items() if f"{topic}/".startswith(f"{kind_topic.folder}/")), None)


def schema_of(kind: Kind, name: str, summary: SpecSummary) -> tuple[str, JsonSchema]:
    """Return the name of the schema of a subject's events, and the schema."""
    return TOPICS[kind].schema(name, summary)


def topic_metadata(kind: Kind, name: str, summary: SpecSummary) -> dict[str, str]:
    """Return the metadata that tools show about a subject's topic: units, label, place in the spec."""
    topic, place = TOPICS[kind], place_of(kind, name, summary)
    metadata = {**topic.metadata(name, summary), "place": "" if place is None else str(place)}
    return {key: text for key, text in metadata.items() if text}


def place_of(kind: Kind, name: str, summary: SpecSummary) -> Place | None:
    """Return the place in the spec that declares the subject of some events; None if there is none."""
    return TOPICS[kind].place(name, summary)


def _variable_metadata(name: str, summary: SpecSummary) -> Mapping[str, str]:
    variable = summary.variables[name]
    return {
        "label": variable.label,
        "unit": variable.type.unit or "",
        "values": ", ".join(variable.type.members),
        "valid_for_s": "" if variable.valid_for_s == math.inf else f"{variable.valid_for_s:g}",
    }


def _job_metadata(name: str, summary: SpecSummary) -> Mapping[str, str]:
    return {f"unit of {key}": value_type.unit or "" for key, value_type in summary.algorithms[name].returns.items()}


def _no_metadata(_name: str, _summary: SpecSummary) -> Mapping[str, str]:
    return {}


def _variable_place(name: str, summary: SpecSummary) -> Place | None:
    return summary.places.get(f"context/{name}")


def _job_place(name: str, summary: SpecSummary) -> Place | None:
    return summary.algorithms[name].place if name in summary.algorithms else None


def _observer_place(name: str, summary: SpecSummary) -> Place | None:
    return summary.observers[name].place if name in summary.observers else None


def _skill_place(name: str, summary: SpecSummary) -> Place | None:
    return summary.places.get(f"skill/{name}")


def _no_place(_name: str, _summary: SpecSummary) -> Place | None:
    return None


def _variable_schema(name: str, summary: SpecSummary) -> tuple[str, JsonSchema]:
    kind = summary.variables[name].type.kind
    return f"codra.Variable.{kind}", event_schema(
        "A reading of a context-variable, or a value that was not accepted.",
        "The variable.",
        {
            "identified": "it has a value",
            "unknown": "it is unknown",
            "too_old": "a value did not count, because its evidence was taken before an action",
            "refused": "an agent without permission tried to write it",
        },
        **value_fields("value", kind, "The value; left out when unknown."),
        reason=reason_schema("Why it is unknown; left out when known."),
        detail=field_schema("string", "The cause of an unknown value."),
        evidence_s=field_schema("number", "When the evidence was taken, or since when the variable is unknown."),
        source=field_schema("string", "The source of the value: an algorithm, an agent or the main execution."),
        present=field_schema("boolean", "Whether this is the present reading of the sources, an override aside."),
    )


def _override_schema(name: str, summary: SpecSummary) -> tuple[str, JsonSchema]:
    kind = summary.variables[name].type.kind
    return f"codra.Override.{kind}", event_schema(
        "The beginning or the end of an override of a variable by the operator.",
        "The variable.",
        {
            "begun": "the variable has the reading of the operator, which replaces an earlier override",
            "expired": "the override has reached its end, and the variable has the reading of its sources again",
            "cleared": "the operator has ended the override, and the variable has the reading of its sources again",
        },
        **value_fields("value", kind, "The value that the variable has from now on; left out when unknown."),
        reason=reason_schema("Why it is unknown; left out when known."),
        detail=field_schema("string", "The reason that the operator gave."),
        until_s=field_schema("number", "When the override expires."),
        source=field_schema("string", "The source of the value at the end of the override."),
    )


def _observer_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    return "codra.Observer", event_schema(
        "A start, stop or failure of an observer.",
        "The observer.",
        {"started": "it runs", "stopped": "it no longer runs", "failed": "its tree raised an error"},
        message=field_schema("string", "The error of the tree."),
    )


def _job_schema(name: str, summary: SpecSummary) -> tuple[str, JsonSchema]:
    returned_types = summary.algorithms[name].returns.items()
    returns = {key: (value_type.kind, value_type.unit) for key, value_type in returned_types}
    return f"codra.Job.{name}", event_schema(
        "A change in the state of a job of a perception algorithm.",
        "The algorithm.",
        {
            "started": "its function was called",
            "returned": "its function returned a result",
            "rejected": "its result gave some variables no value",
            "failed": "it raised, took too long, or returned an invalid result",
            "voided": "a precondition did not hold while its evidence was taken",
            "cancelled": "its result is no longer needed",
            "stuck": "it was cancelled and does not end",
        },
        index=field_schema("integer", "The number of the job among the jobs of its algorithm."),
        **result_fields(returns),
        evidence_s=list_schema("number", "When the evidence was taken: the start and the end."),
        variables=list_schema("string", "The variables that receive no value."),
        reason=reason_schema("Why these variables receive no value."),
        message=field_schema("string", "The error, or the condition that the result does not meet."),
        condition=field_schema("string", "The precondition that did not hold."),
    )


def _host_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    return "codra.Host", event_schema(
        "A host, which runs perception functions in another program, is connected or lost.",
        "The host.",
        {"connected": "its algorithms can look", "lost": "its jobs have ended, and its algorithms cannot look"},
        message=field_schema("string", "Why the host is lost."),
    )


def _declaration_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    return "codra.Declaration", event_schema(
        "The main execution declares that it needs a variable, or that it no longer needs the variable.",
        "The variable.",
        {"declared": "it is needed", "withdrawn": "it is no longer needed"},
        holder=field_schema("string", "On whose behalf: main_execution, expected, or a skill."),
    )


def _expectation_schema(name: str, summary: SpecSummary) -> tuple[str, JsonSchema]:
    kind = summary.variables[name].type.kind
    return f"codra.Expectation.{kind}", event_schema(
        "The result of a skill's expectation.",
        "The variable that the expectation is about.",
        {
            "met": "it became true, or stayed true",
            "violated": "it did not become true, or did not stay true",
            "not_seen": "up to now, it was not observed whether it became or stayed true",
        },
        skill=field_schema("string", "The skill."),
        expected=field_schema("string", "The expectation, as written in the spec."),
        acting_s=field_schema("number", "Since when the expectation counts."),
        **value_fields("value", kind, "The value of the variable; left out when unknown."),
        reason=reason_schema("Why it is unknown; left out when known."),
        detail=field_schema("string", "The cause of an unknown value."),
        source=field_schema("string", "The source of the value."),
    )


def _input_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    return "codra.Input", event_schema(
        "An input to the context manager from outside. Replay starts from inputs and from the results of jobs.",
        "The sender: main_execution, with a number if there are several, an agent, operator, an algorithm, a host, or "
        "clock.",
        {
            "declare": "a variable is needed",
            "withdraw": "the variable is no longer needed",
            "expect": "these skills come next",
            "begin": "a skill begins",
            "act": "the skill acts",
            "acted": "the skill no longer acts",
            "finish": "the skill ends",
            "write": "a variable is written",
            "override": "the operator overrides a variable",
            "clear": "the operator ends the override of a variable",
            "decide": "a decision is requested",
            "preview": "the answer to a skill's preview is requested",
            "waited": "the decision or preview has waited for observers",
            "found": "the main execution has acquired the value itself",
            "looked": "for a preview, the main execution has looked for a variable, or has stopped",
            "request": "the main execution requests slots",
            "release": "the main execution releases the slots",
            "leave": "all declarations of the main execution are withdrawn",
            "close": "the run ends",
            "delivered": "the function of a job ended",
            "unstarted": "the function of a job could not be started",
            "evidence": "a job reported when its evidence was taken",
            "connected": "a host begins to execute the jobs of its algorithms",
            "lost": "a host is lost, and its jobs have ended",
            "late": "the next event happens now, long after its scheduled time",
            "graph": "an agent writes to the knowledge graph in one change",
            "refused": "an agent tried to write, or to begin an action, but its permissions or its rule forbid this",
            "rule": "the state of an agent's rule changed",
            "adapt": "a loop reports an adaptation",
        },
        step=field_schema("integer", "The number of clock events before this input."),
        work=field_schema(
            "integer", "In simulated time, the number of the job that makes this call, counted over all jobs."
        ),
        variable=field_schema("string", "The variable."),
        value=field_schema("string", "The value, as JSON."),
        **infinite_fields("value", "max_age_s", "since_s", "wait_up_to_s"),
        evidence_s=list_schema("number", "When the evidence was taken: the end, or the start and the end."),
        skill=field_schema("string", "The skill."),
        skills=list_schema("string", "The skills."),
        number=field_schema("integer", "The number of the skill, decision or slot request, counted from 1."),
        max_age_s=field_schema("number", "The maximum age of usable evidence."),
        since_s=field_schema("number", "The earliest instant of usable evidence."),
        wait_up_to_s=field_schema("number", "How long the decision waits for observers."),
        shadow=field_schema("boolean", "Whether the main execution looks in any case."),
        since=field_schema("string", "For some variables, the earliest instant of usable evidence, as JSON."),
        looks=field_schema("boolean", "Whether the main execution looks for variables that a preview lacks."),
        raised=field_schema("string", "The error that the acquisition raised, or why the decision was abandoned."),
        resources=list_schema("string", "The resources whose slots are requested."),
        for_s=field_schema("number", "How long the override lasts."),
        detail=field_schema("string", "The reason of the override."),
        index=field_schema("integer", "The number of the job."),
        told_s=field_schema("number", "When the job reported the time of its evidence."),
        earliest_s=field_schema(
            "number", "For a host: the earliest end of taking the evidence; `evidence_s` is widened by the uncertainty."
        ),
        host_s=list_schema("number", "For a host: when the evidence was taken, on the clock of the host."),
        message=field_schema("string", "The error."),
        operations=field_schema("string", "The change, as JSON: a list of operations with their arguments."),
        rule=field_schema("string", "The rule of the agent."),
        became=field_schema("string", "The new state of the rule."),
        told=field_schema("string", "The report of the loop, as JSON: an event's name, `what` and details."),
        subject=field_schema("string", "The target of the refused write: a node, an attribute, an edge, or a task."),
    )


def _knowledge_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    return "codra.Knowledge", event_schema(
        "A change of the knowledge graph, or a refused one.",
        "A node, node.attribute, an edge as origin -type-> target, a task, or agent.rule.",
        {
            "node_inserted": "the node exists",
            "node_deleted": "the node and its edges no longer exist",
            "edge_inserted": "the edge exists, or another agent is responsible for it",
            "edge_deleted": "the edge no longer exists",
            "placed": "the edge's target has this pose in the frame of its origin",
            "written": "the attribute has a value, or is unknown",
            "wants": "the task is requested",
            "is": "its executor has begun it",
            "finished": "its executor has finished it",
            "aborted": "it ended without being finished",
            "refused": "an agent tried to write, or to begin an action, but its permissions or its rule forbid this",
            **{what: f"the agent's rule: {meaning}" for what, meaning in RULE_EVENTS.items()},
        },
        agent=field_schema(
            "string", "The agent that made the change; empty at the start and for the graph's own changes."
        ),
        version=field_schema(
            "integer", "The number of the graph's change. All events with the same number became visible together."
        ),
        type=field_schema("string", "The type of the node or edge."),
        label=field_schema("string", "The label of the edge."),
        value=field_schema("string", "The value of the attribute, as JSON; left out when unknown."),
        **infinite_fields("value"),
        unit=field_schema("string", "The unit of the value."),
        reason=reason_schema("Why it is unknown; left out when known."),
        evidence_s=field_schema("number", "When the evidence was taken, or the pose was measured."),
        expires_s=field_schema("number", "When the value stops being valid; left out if never."),
        translation_m=list_schema("number", "The translation of the pose: x, y, z."),
        rotation=list_schema("number", "The rotation of the pose: a unit quaternion w, x, y, z."),
        request=field_schema("integer", "The number of the request, counted from 1."),
        requester=field_schema("string", "The agent that requested the task."),
        result=field_schema("string", "The result of a finished task."),
        since_s=field_schema("number", "Since when the task is at this stage."),
        deadline_s=field_schema(
            "number", "When the task is aborted unless it reaches its next stage; left out if never."
        ),
        rule=field_schema("string", "The rule of the agent."),
        message=field_schema(
            "string", "Who may write the element, why a task was aborted, or which part of a rule does not hold."
        ),
    )


def _adaptation_schema(_name: str, _summary: SpecSummary) -> tuple[str, JsonSchema]:
    return "codra.Adaptation", event_schema(
        "A decision or action of a loop, with its chain of causes.",
        "The loop, course, parameter or tree.",
        _ADAPTATION_EVENT_MEANINGS,
        loop=field_schema("string", "The loop that decided or acted, or that reports the action."),
        adapts=list_schema("string", "The courses and parameters of the loop that runs."),
        course=field_schema("string", "For a branch, the course that it belongs to."),
        agent=field_schema("string", "The responsible agent."),
        variable=field_schema(
            "string", "The variable of the course, parameter or rate, or the input; left out if none."
        ),
        input=field_schema("string", "The variable from which the rate is computed."),
        action=field_schema(
            "string", "The action that is now the course; for a branch, the action that it belongs to."
        ),
        before=field_schema("string", "The action that was left; left out if none."),
        because=field_schema(
            "string",
            "The reason: first, leads, worse, hard_rule, nothing_known, planner; for a parameter, changed, unknown.",
        ),
        rule=field_schema("string", "The hard rule that decided, or the parameter's target; for a rate, its text."),
        place=field_schema("string", "The place of the hard rule, the course, or the target in the spec."),
        value=field_schema("string", "The value of the parameter, as JSON."),
        **infinite_fields("value"),
        branch=field_schema("string", "The value of the tree's entry that selects the branch."),
        result=field_schema("string", "How the branch ended: halted, success, failure, idle, or failed with an error."),
        took_s=field_schema("number", "How long ending the branch has taken."),
        tasks=list_schema("string", "The unfinished tasks."),
        message=field_schema("string", "The error, or why the input or the rate is unknown."),
        since_s=field_schema(
            "number",
            "Since when the previous action was the course, the value was set, or the readings of the rate count.",
        ),
        known_from_s=field_schema("number", "When the rate becomes known, if its input stays as it is."),
        dwell_until_s=field_schema(
            "number", "The instant until which the previous course is kept, except for a hard rule or a worse metric."
        ),
        **cause_fields(),
    )


_ADAPTATION_EVENT_MEANINGS: Mapping[str, str] = {
    "started": "the loop runs",
    "stopped": "the loop no longer runs",
    "analysed": "some metrics or weights have changed",
    "computed": "a rate, share or held bool has become known, or is unknown for another reason",
    "chosen": "the course is another action",
    "explained": "changes that would have kept the previous course",
    "ended": "the branch of the previous course has ended",
    "overdue": "the branch of the previous course has not ended within its time limit",
    "set": "the parameter has a new value",
    "failed": "an error occurred; the loop continues",
    "never_known": "an input of the loop was not known for a long time since the loop began",
}

TOPICS: Mapping[Kind, Topic] = {
    Kind.VARIABLE: Topic(
        folder="/codra/context",
        schema=_variable_schema,
        metadata=_variable_metadata,
        place=_variable_place,
        has_evidence_time=True,
    ),
    Kind.OVERRIDE: Topic(
        folder="/codra/override", schema=_override_schema, metadata=_variable_metadata, place=_variable_place
    ),
    Kind.OBSERVER: Topic(
        folder="/codra/observer", schema=_observer_schema, metadata=_no_metadata, place=_observer_place
    ),
    Kind.JOB: Topic(
        folder="/codra/perception",
        schema=_job_schema,
        metadata=_job_metadata,
        place=_job_place,
        has_evidence_time=True,
    ),
    Kind.HOST: Topic(folder="/codra/host", schema=_host_schema, metadata=_no_metadata, place=_no_place),
    Kind.DECISION: Topic(
        folder="/codra/decision", schema=decision_schema, metadata=_variable_metadata, place=_variable_place
    ),
    Kind.PREVIEW: Topic(folder="/codra/preview", schema=preview_schema, metadata=_no_metadata, place=_skill_place),
    Kind.DECLARATION: Topic(
        folder="/codra/declaration", schema=_declaration_schema, metadata=_variable_metadata, place=_variable_place
    ),
    Kind.EXPECTATION: Topic(
        folder="/codra/expectation", schema=_expectation_schema, metadata=_variable_metadata, place=_variable_place
    ),
    Kind.KNOWLEDGE: Topic(
        folder="/codra/knowledge", schema=_knowledge_schema, metadata=_no_metadata, place=_no_place, is_shared=True
    ),
    Kind.ADAPTATION: Topic(
        folder="/codra/adaptation", schema=_adaptation_schema, metadata=_no_metadata, place=_no_place, is_shared=True
    ),
    Kind.INPUT: Topic(
        folder="/codra/input", schema=_input_schema, metadata=_no_metadata, place=_no_place, is_shared=True
    ),
}
"""The topics of each kind of event."""
