"""The messages of a journal: their topics, their JSON schemas, and what tools show of a topic.

Each field has one type, and what is unknown is left out: viewers know neither unions nor null in schemas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from codra_dsl.runtime.cell import Reason
from codra_dsl.runtime.journal.events import Kind
from codra_dsl.runtime.outline import Outline, Place

RUN_TOPIC = "/codra/run"

RULE_EVENTS = {
    "begun": "what must hold before did",
    "broken": "what must hold during does not hold any more",
    "fulfilled": "what it is to bring about holds",
    "unfulfilled": "it has ended, and that does not hold",
}
"""What becomes of a rule of an agent, by what tells it."""

_JSON_TYPES = {"bool": "boolean", "int": "integer", "float": "number", "str": "string", "enum": "string"}

Field = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """Where the events of a kind go, and what is told of them.

    Attributes:
        folder: below it each thing that events are about has a topic of its own, if they do not share this one.
        schema: returns the name of the schema of the events about something, and the schema.
        told: returns what tools show of the topic of something: units, label, place in the spec.
        place: returns where something stands in the spec.
    """

    folder: str
    schema: Callable[[str, Outline], tuple[str, Field]]
    told: Callable[[str, Outline], Mapping[str, str]]
    place: Callable[[str, Outline], Place | None]
    is_shared: bool = False


def topic_of(kind: Kind, name: str) -> str:
    """Return the topic of events about something."""
    topic = TOPICS[kind]
    return topic.folder if topic.is_shared else f"{topic.folder}/{name}"


@lru_cache(maxsize=65_536)
def kind_of(topic: str) -> Kind | None:
    """Return the kind of events on a topic; None if it holds none."""
    return next((kind for kind, each in TOPICS.items() if f"{topic}/".startswith(f"{each.folder}/")), None)


def schema_of(kind: Kind, name: str, outline: Outline) -> tuple[str, Field]:
    """Return the name of the schema of the events about something, and the schema."""
    return TOPICS[kind].schema(name, outline)


def about(kind: Kind, name: str, outline: Outline) -> dict[str, str]:
    """Return what tools show of the topic of something: units, label, place in the spec."""
    topic, place = TOPICS[kind], place_of(kind, name, outline)
    told = {**topic.told(name, outline), "place": "" if place is None else str(place)}
    return {key: text for key, text in told.items() if text}


def place_of(kind: Kind, name: str, outline: Outline) -> Place | None:
    """Return where the spec says of what events are about."""
    return TOPICS[kind].place(name, outline)


def _about_variable(name: str, outline: Outline) -> Mapping[str, str]:
    variable = outline.variables[name]
    return {
        "label": variable.label,
        "unit": variable.type.unit or "",
        "values": ", ".join(variable.type.members),
        "valid_for_s": "" if variable.valid_for_s == math.inf else f"{variable.valid_for_s:g}",
    }


def _about_job(name: str, outline: Outline) -> Mapping[str, str]:
    return {f"unit of {key}": each.unit or "" for key, each in outline.algorithms[name].returns.items()}


def _about_nothing(_name: str, _outline: Outline) -> Mapping[str, str]:
    return {}


def _place_of_variable(name: str, outline: Outline) -> Place | None:
    return outline.places.get(f"context/{name}")


def _place_of_job(name: str, outline: Outline) -> Place | None:
    return outline.algorithms[name].place if name in outline.algorithms else None


def _place_of_observer(name: str, outline: Outline) -> Place | None:
    return outline.observers[name].place if name in outline.observers else None


def _nowhere(_name: str, _outline: Outline) -> Place | None:
    return None


def run_schema() -> tuple[str, Field]:
    """Return the schema of the one message that says what runs."""
    fields = {
        "format": _field("string", "What kind of file this is."),
        "format_version": _field("integer", "Of this format."),
        "spec": _field("string", "The name of the spec."),
        "file": _field("string", "The spec's file, relative to its project; empty if there is none."),
        "model": _field("string", "A digest of what the spec means, as in manifest.json; empty if there is none."),
        "seed": _field("integer", "Of the chance that perception functions see."),
        "start_s": _field("number", "What the run's clock showed at the start."),
        "codra": _field("string", "The version of codra that ran it."),
        "python": _field("string", "The version of Python that ran it."),
    }
    return "codra.Run", {
        "type": "object",
        "description": "What runs.",
        "properties": fields,
        "required": list(fields),
        "additionalProperties": False,
    }


def _of_variable(name: str, outline: Outline) -> tuple[str, Field]:
    kind = outline.variables[name].type.kind
    return f"codra.Variable.{kind}", _event(
        "What became of a context-variable.",
        "The variable.",
        {
            "identified": "it has a value",
            "unknown": "it has none",
            "too_old": "a value did not count, because its evidence was being taken before an action",
            "refused": "an agent wrote it that may not",
        },
        value=_field(_JSON_TYPES[kind], "The value; left out when unknown."),
        reason=_reason("Why it is unknown; left out when known."),
        detail=_field("string", "Who or what made it unknown."),
        evidence_s=_field("number", "When the evidence was taken; of an unknown one, since when it is unknown."),
        source=_field("string", "The algorithm, agent or main execution that it comes from."),
        present=_field("boolean", "Whether it is what holds now; false if newer evidence stands."),
    )


def _of_observer(_name: str, _outline: Outline) -> tuple[str, Field]:
    return "codra.Observer", _event(
        "What became of an observer.",
        "The observer.",
        {"started": "it runs", "stopped": "it does not run any more", "failed": "its tree broke"},
        message=_field("string", "The error of a broken tree."),
    )


def _of_job(name: str, outline: Outline) -> tuple[str, Field]:
    algorithm = outline.algorithms[name]
    returns = {key: _field(_JSON_TYPES[each.kind], _unit(each.unit)) for key, each in algorithm.returns.items()}
    return f"codra.Job.{name}", _event(
        "What became of a job of a perception algorithm.",
        "The algorithm.",
        {
            "started": "its function was called",
            "returned": "it brought a result",
            "rejected": "its result brought some variables no value",
            "failed": "it raised, took too long, or returned what it should not",
            "voided": "a precondition did not hold while its evidence was taken",
            "cancelled": "nobody needs it any more",
            "stuck": "it was cancelled and does not come to its end",
        },
        index=_field("integer", "The number of the job among those of its algorithm."),
        values={
            "type": "object",
            "description": "What it returned; without what it did not measure.",
            "properties": returns,
            "additionalProperties": False,
        },
        evidence_s=_list("number", "When the evidence was taken: start and end."),
        variables=_list("string", "The variables that get no value."),
        reason=_reason("Why."),
        message=_field("string", "The error, or the condition that the result does not meet."),
        condition=_field("string", "The precondition that did not hold."),
    )


def _of_decision(name: str, outline: Outline) -> tuple[str, Field]:
    kind = outline.variables[name].type.kind
    return f"codra.Decision.{kind}", _event(
        "How a decision of the main execution was answered.",
        "The variable that it was about.",
        {
            "answered": "from context",
            "fell_back": "by what the main execution saw itself",
            "shadowed": "from context, and the main execution looked all the same",
        },
        value=_field(_JSON_TYPES[kind], "What context held; left out when unknown."),
        reason=_reason("Why it was unknown; left out when known."),
        detail=_field("string", "Who or what made it unknown, or keeps it from being observed."),
        source=_field("string", "Where the value in context came from."),
        asked_s=_field("number", "When it was asked."),
        found=_field(_JSON_TYPES[kind], "What the main execution saw itself."),
        kept=_field("boolean", "Whether that was kept as evidence."),
        agrees=_field("boolean", "Whether that is what context held; left out if it saw nothing."),
        shadow=_field("boolean", "Whether the main execution would have looked in any case."),
        skill=_field("string", "The skill under way that was begun last; left out if there was none."),
        raised=_field("string", "The error that looking raised, or why the decision was given up."),
    )


def _of_declaration(_name: str, _outline: Outline) -> tuple[str, Field]:
    return "codra.Declaration", _event(
        "That the main execution needs a variable, or does not any more.",
        "The variable.",
        {"declared": "it is needed", "withdrawn": "it is not needed any more"},
        holder=_field("string", "On whose behalf: main_execution, expected, or a skill."),
    )


def _of_expectation(name: str, outline: Outline) -> tuple[str, Field]:
    kind = outline.variables[name].type.kind
    return f"codra.Expectation.{kind}", _event(
        "What came of what a skill expects.",
        "The variable that it expects something of.",
        {
            "met": "it came true, or stayed so",
            "violated": "it did not",
            "not_seen": "nobody has seen whether it did, up to now",
        },
        skill=_field("string", "The skill."),
        expected=_field("string", "What it expects, as the spec says it."),
        acting_s=_field("number", "Since when that counts."),
        value=_field(_JSON_TYPES[kind], "The value of the variable; left out when unknown."),
        reason=_reason("Why it is unknown; left out when known."),
        detail=_field("string", "Who or what made it unknown."),
        source=_field("string", "Where the value came from."),
    )


def _of_input(_name: str, _outline: Outline) -> tuple[str, Field]:
    return "codra.Input", _event(
        "What reached the context manager from outside. Replay starts from these and from what jobs returned.",
        "Who it came from: main_execution, with a number if there are several, an agent, an algorithm, or the clock.",
        {
            "declare": "a variable is needed",
            "withdraw": "it is not needed any more",
            "expect": "these skills come next",
            "begin": "a skill begins",
            "act": "it acts",
            "acted": "it does not act any more",
            "finish": "it ends",
            "write": "a variable is written",
            "decide": "a decision is asked",
            "waited": "it has waited for observers",
            "found": "the main execution has looked itself",
            "request": "the main execution wants slots",
            "release": "it gives them back",
            "leave": "all that it declared is withdrawn",
            "close": "the run ends",
            "delivered": "the function of a job came to its end",
            "unstarted": "the function of a job could not be started",
            "evidence": "a job said when its evidence was taken",
            "late": "the next event happens now, long after its time",
            "graph": "an agent writes knowledge, all of it at once",
            "refused": "an agent would have written knowledge that it may not, or begun what its rule does not allow",
            "rule": "something became of a rule of an agent",
            "adapt": "a loop tells what it has done",
        },
        step=_field("integer", "How many events of the clock had happened by then."),
        work=_field("integer", "In simulated time, the number of the job, among all jobs, whose function asks this."),
        variable=_field("string", "The variable."),
        value=_field("string", "The value, as JSON."),
        evidence_s=_list("number", "When the evidence was taken: its end, or start and end."),
        skill=_field("string", "The skill."),
        skills=_list("string", "The skills."),
        number=_field("integer", "Of the skill, decision or request for slots, counted from 1."),
        max_age_s=_field("number", "Evidence that is older does not do."),
        since_s=_field("number", "Evidence from before this instant does not do."),
        wait_up_to_s=_field("number", "How long the decision waits for observers."),
        shadow=_field("boolean", "Whether the main execution looks in any case."),
        raised=_field("string", "The error that looking raised, or why the decision was given up."),
        resources=_list("string", "The resources whose slots are wanted."),
        index=_field("integer", "The number of the job."),
        told_s=_field("number", "When the job said so."),
        message=_field("string", "The error."),
        operations=_field("string", "What is written, as JSON: a list of operations, each with what it is given."),
        rule=_field("string", "The rule of the agent."),
        became=_field("string", "What became of the rule."),
        told=_field("string", "What the loop tells, as JSON: the name and what of an event, and its details."),
        subject=_field("string", "What would have been written: a node, an attribute, an edge, or a task."),
    )


def _of_knowledge(_name: str, _outline: Outline) -> tuple[str, Field]:
    return "codra.Knowledge", _event(
        "What became of the knowledge graph.",
        "A node, node.attribute, an edge as origin -type-> target, a task, or agent.rule.",
        {
            "node_inserted": "the node is there",
            "node_deleted": "it is not there any more, nor are its edges",
            "edge_inserted": "the edge is there, or another agent answers for it",
            "edge_deleted": "it is not there any more",
            "placed": "the target of the edge stands in its origin, by this pose",
            "written": "the attribute has a value, or is unknown",
            "wants": "the task is asked for",
            "is": "its executor has begun it",
            "finished": "its executor has ended it",
            "aborted": "it ended otherwise",
            "refused": "an agent would have written it that may not, or begun what its rule does not allow",
            **{what: f"the agent's rule: {meaning}" for what, meaning in RULE_EVENTS.items()},
        },
        agent=_field("string", "Who did it; empty at the start and of what the graph does by itself."),
        version=_field("integer", "The number of the change of the graph; what has one number became visible at once."),
        type=_field("string", "Of the node or edge."),
        label=_field("string", "Of the edge."),
        value=_field("string", "The value of the attribute, as JSON; left out when unknown."),
        unit=_field("string", "Of the value."),
        reason=_reason("Why it is unknown; left out when known."),
        evidence_s=_field("number", "When the evidence was taken, or the pose measured."),
        expires_s=_field("number", "When the value is valid no more; left out if that is never."),
        translation_m=_list("number", "Of the pose: x, y, z."),
        rotation=_list("number", "Of the pose: a unit quaternion w, x, y, z."),
        request=_field("integer", "The number of the request, counted from 1."),
        requester=_field("string", "The agent that asked."),
        result=_field("string", "Of a task that has finished."),
        since_s=_field("number", "Since when the task is at this stage."),
        deadline_s=_field("number", "When the task ends as aborted unless it goes on; left out if never."),
        rule=_field("string", "The rule of the agent."),
        message=_field("string", "Who may write it, why a task was aborted, or what of a rule does not hold."),
    )


def _of_adaptation(_name: str, _outline: Outline) -> tuple[str, Field]:
    return "codra.Adaptation", _event(
        "What a loop has decided and done, with the chain of what led to it.",
        "The loop, course, parameter or tree.",
        _ADAPTATIONS,
        loop=_field("string", "The loop that did it."),
        adapts=_list("string", "The courses and parameters of the loop that runs."),
        course=_field("string", "Of a branch, the course that it is a branch for."),
        agent=_field("string", "The agent that answers for it."),
        variable=_field("string", "The variable that holds the course or parameter; left out if none does."),
        action=_field("string", "The action that is the course now; of a branch, the one whose branch it is."),
        before=_field("string", "The action that was left; left out if there was none."),
        because=_field("string", "first, leads, worse, hard_rule, nothing_known or planner; of a parameter changed."),
        rule=_field("string", "The hard rule that decided, or what the parameter is to be, as the spec says it."),
        place=_field("string", "Where the spec says that."),
        value=_field("string", "Of the parameter, as JSON."),
        branch=_field("string", "What the entry of the tree says for the branch."),
        result=_field("string", "How the branch ended: halted, success, failure, idle, or failed with an error."),
        took_s=_field("number", "How long that took."),
        tasks=_list("string", "The tasks that are still open."),
        message=_field("string", "The error."),
        since_s=_field("number", "Since when what was left had been the course, or the last value stood."),
        dwell_until_s=_field("number", "Until when it would have stood but for a hard rule or a worse metric."),
        readings=_parts(
            "What was known.",
            variable=_field("string", "The variable."),
            value=_field("string", "Its value, as JSON; left out when unknown."),
            evidence_s=_field("number", "When its evidence was taken."),
            because=_field("string", "Why it is unknown."),
        ),
        degrees=_parts(
            "How much each input is each of its terms.",
            variable=_field("string", "The input."),
            term=_field("string", "Its term."),
            **_BOUNDS,
        ),
        rules=_parts(
            "How strongly each rule acts; of an analysis only those that do.",
            text=_field("string", "The rule."),
            concludes=_list("string", "What it says something about."),
            place=_field("string", "Where the spec says it."),
            **_BOUNDS,
        ),
        metrics=_parts("The metrics.", **_JUDGED),
        weights=_parts(
            "The weights of the actions, and where the filter stood.",
            **_JUDGED,
            smoothed=_field("number", "What counts."),
            leads_since_s=_field("number", "Since when it leads the course that was left."),
            cooldown_until_s=_field("number", "Until when it is not chosen again."),
        ),
        kept_by=_parts(
            "Single changes that would have kept the course, the smallest of each kind.",
            kind=_field("string", "Of an input, or of a weight."),
            name=_field("string", "The variable, or the action."),
            value=_field("string", "What it was, as JSON; left out when unknown."),
            other=_field("string", "What it would have had to be, as JSON."),
            share=_field("number", "How much of its range that is."),
        ),
    )


_ADAPTATIONS: Mapping[str, str] = {
    "started": "the loop runs",
    "stopped": "it does not run any more",
    "analysed": "some metrics or weights are otherwise than before",
    "chosen": "the course is another action",
    "explained": "what would have kept the course that was left",
    "ended": "the branch that was left has ended",
    "overdue": "it has not, in the time that it had",
    "set": "the parameter has another value",
    "failed": "an error; the loop goes on",
}

_BOUNDS: Mapping[str, Field] = {
    "low": {"type": "number", "description": "The least that it can be; left out when unknown."},
    "high": {"type": "number", "description": "The most that it can be."},
}

_JUDGED: Mapping[str, Field] = {
    "name": {"type": "string", "description": "The metric or action."},
    **_BOUNDS,
    "value": {"type": "number", "description": "What counts; left out when unknown."},
    "evidence_s": {"type": "number", "description": "Of the oldest input."},
    "variable": {"type": "string", "description": "Of an analysis, the variable that holds it."},
    "reads": {"type": "array", "items": {"type": "string"}, "description": "Of an analysis, what it follows from."},
}


def _parts(description: str, **properties: Field) -> Field:
    item = {"type": "object", "properties": properties, "additionalProperties": False}
    return {"type": "array", "items": item, "description": description}


def _event(description: str, name: str, whats: Mapping[str, str], **details: Field) -> Field:
    listed = ", ".join(f"{what}: {meaning}" for what, meaning in whats.items())
    return {
        "type": "object",
        "description": description,
        "properties": {
            "instant_s": _field("number", "When, in seconds of the run's clock; log_time is the same in nanoseconds."),
            "name": _field("string", name),
            "what": {"type": "string", "enum": list(whats), "description": f"What happened ({listed})."},
            **details,
        },
        "required": ["instant_s", "name", "what"],
        "additionalProperties": False,
    }


def _field(kind: str, description: str) -> Field:
    return {"type": kind, "description": description}


def _list(kind: str, description: str) -> Field:
    return {"type": "array", "items": {"type": kind}, "description": description}


def _reason(description: str) -> Field:
    return {"type": "string", "enum": [str(reason) for reason in Reason], "description": description}


def _unit(unit: str | None) -> str:
    return f"In {unit}." if unit else "As the spec's `returns` declares it."


TOPICS: Mapping[Kind, Topic] = {
    Kind.VARIABLE: Topic(folder="/codra/context", schema=_of_variable, told=_about_variable, place=_place_of_variable),
    Kind.OBSERVER: Topic(folder="/codra/observer", schema=_of_observer, told=_about_nothing, place=_place_of_observer),
    Kind.JOB: Topic(folder="/codra/perception", schema=_of_job, told=_about_job, place=_place_of_job),
    Kind.DECISION: Topic(folder="/codra/decision", schema=_of_decision, told=_about_variable, place=_place_of_variable),
    Kind.DECLARATION: Topic(
        folder="/codra/declaration", schema=_of_declaration, told=_about_variable, place=_place_of_variable
    ),
    Kind.EXPECTATION: Topic(
        folder="/codra/expectation", schema=_of_expectation, told=_about_variable, place=_place_of_variable
    ),
    Kind.KNOWLEDGE: Topic(
        folder="/codra/knowledge", schema=_of_knowledge, told=_about_nothing, place=_nowhere, is_shared=True
    ),
    Kind.ADAPTATION: Topic(
        folder="/codra/adaptation", schema=_of_adaptation, told=_about_nothing, place=_nowhere, is_shared=True
    ),
    Kind.INPUT: Topic(folder="/codra/input", schema=_of_input, told=_about_nothing, place=_nowhere, is_shared=True),
}
"""Of each kind of event: who adds a kind adds its line here and its schema above."""
