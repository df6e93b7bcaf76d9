"""Explain a variable from an event log or a journal, at any instant of the run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from codra_dsl.logic import Value
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEventsView
from codra_dsl.runtime.journal.spec_summary import AlgorithmSummary, Rule, SpecSummary
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.declarations import OPERATOR, POSES
from codra_dsl.runtime.values.model import PreviewCondition, SkillModel
from codra_dsl.runtime.values.previews import PreviewOutcome, evaluate
from codra_dsl.runtime.why.adaptation import adaptation_lines, explain_course
from codra_dsl.runtime.why.knowledge import explain_knowledge, pose_edges_between
from codra_dsl.runtime.why.story import host_text, job_text, override_text, story
from codra_dsl.runtime.why.unmet_conditions import find_solution
from codra_dsl.runtime.why.values import Condition, Derivation, Look, MissingChange, Way, Why

LatestEventsAt = Callable[[float], LatestEventsView]
"""Returns the latest events up to an instant."""


PREVIEW_PREFIX = "preview of "
"""The words before the name of a skill in a question about its preview; needed if another element has this name."""


def explain(summary: SpecSummary, latest_events_at: LatestEventsAt, name: str, at_s: float) -> Why:
    """Return the explanation of a variable at an instant, with its chain of causes.

    For an element of the knowledge graph, the explanation states the last writer, the change, and refused writes. For a
    course or parameter, the explanation states the complete chain of the last decision about this course or parameter.

    Args:
        summary: the spec summary.
        latest_events_at: returns the latest events up to an instant.
        name: a variable of the spec; an element of the knowledge graph (a node, `node.attribute`, an edge as
            `origin -edge-> target`, or a task); a course or parameter; an action, to explain its weight; or a skill, to
            explain its preview, or `preview of SKILL` if something else has the skill's name.
        at_s: the instant.

    Raises:
        UnknownNameError: if the name is no variable and no course or parameter of a loop, and up to the instant no
            event is about an element of the knowledge graph with this name.
    """
    skill = summary.skills.get(name.removeprefix(PREVIEW_PREFIX)) if name.startswith(PREVIEW_PREFIX) else None
    if skill is not None:
        return _Explanation(summary, latest_events_at).preview(skill, at_s)
    node, _, attribute = name.rpartition(".")
    if node and summary.nodes.get(attribute) == node:
        name = attribute  # `node.attribute` is another name of this context-variable
    if name not in summary.variables:
        name = _resolve_action_name(summary, latest_events_at(at_s), name)
    if name in summary.variables:
        why = _Explanation(summary, latest_events_at).why(name, at_s, ())
        reading_of = _PastContext(latest_events_at(at_s), summary, at_s).reading
        lines = tuple(adaptation_lines(latest_events_at(at_s), reading_of, name))
        if why.beneath is not None:
            return replace(why, beneath=replace(why.beneath, story=(*why.beneath.story, *lines)))
        return replace(why, story=(*why.story, *lines))
    latest_events = latest_events_at(at_s)
    reading_of = _PastContext(latest_events, summary, at_s).reading
    course = explain_course(latest_events, reading_of, name, at_s)
    if course is None and name in summary.skills and name not in latest_events.knowledge_events:
        return _Explanation(summary, latest_events_at).preview(summary.skills[name], at_s)
    return course or explain_knowledge(summary, latest_events, name, at_s)


def _resolve_action_name(summary: SpecSummary, latest_events: LatestEventsView, name: str) -> str:
    """Return the variable of an action's weight if only an action has this name; otherwise return the name."""
    weight = f"weight_of_{name}"
    has_other_meaning = (
        name in summary.nodes.values()
        or name in latest_events.knowledge_events
        or f"adaptation/{name}" in latest_events.adaptation_events
    )
    return weight if weight in summary.variables and not has_other_meaning else name


@dataclass(frozen=True, slots=True)
class _PastContext:
    """The context as it was at an instant."""

    latest_events: LatestEventsView
    summary: SpecSummary
    at_s: float

    def override_event(self, name: str) -> Event | None:
        """Return the event that began the override of a variable at the instant; None if there is no override."""
        event = self.latest_events.override_events.get(name)
        is_over = event is None or event.what != "begun" or self.at_s >= float(event.details["until_s"])
        return None if is_over else event

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable at the instant."""
        event = self.override_event(name)
        return self.observed_reading(name) if event is None else _reading_of_override(name, event)

    def observed_reading(self, name: str) -> Reading[Value]:
        """Return the reading that the sources gave a variable at the instant; an override hides it."""
        event = self.latest_events.present_events.get(name)
        if event is None:
            return Reading(name=name, reason=Reason.NEVER_OBSERVED)
        details = event.details
        reason = details.get("reason")
        evidence_s = float(details["evidence_s"])
        reading: Reading[Value] = Reading(
            name=name,
            content=details.get("value"),
            reason=None if reason is None else Reason(reason),
            detail=str(details.get("detail", "")),
            evidence_s=evidence_s,
            start_s=evidence_s,
            identified_s=event.instant_s,
            source=str(details["source"]),
        )
        if not reading.known:
            return reading
        expires_s = evidence_s + self.summary.variables[name].valid_for_s
        return Reading(**{key: getattr(reading, key) for key in _COPIED_FIELDS}, expires_s=expires_s).at(self.at_s)

    def value(self, name: str) -> Value | None:
        return self.reading(name).content

    def age_s(self, name: str) -> float | None:
        reading = self.reading(name)
        return reading.age_s(self.at_s) if reading.known else None


def _reading_of_override(name: str, event: Event) -> Reading[Value]:
    """Return the reading of an override, from the event that began it."""
    reason = event.details.get("reason")
    return Reading(
        name=name,
        content=event.details.get("value"),
        reason=None if reason is None else Reason(reason),
        detail=str(event.details.get("detail", "")),
        evidence_s=event.instant_s,
        identified_s=event.instant_s,
        expires_s=float(event.details["until_s"]),
        source=OPERATOR,
    )


_MAX_TEXT_LENGTH = 20_000
"""The length of a condition, in characters, from which on derived variables are not replaced by their expressions."""

_MAX_EXPRESSIONS = 30
"""The number of expressions that replace derived variables in one condition: Python limits the nesting of brackets."""

_MAX_DEPTH = 40
"""The length of a chain of causes, in readings, from which on the chain is left out: readers and Python have limits."""

_COPIED_FIELDS = ("name", "content", "reason", "detail", "evidence_s", "start_s", "identified_s", "source")


class _Explanation:
    """One explanation, which explains each reading once, so that no chain is circular."""

    def __init__(self, summary: SpecSummary, latest_events_at: LatestEventsAt) -> None:
        self._summary = summary
        self._latest_events_at = latest_events_at
        self._events_at: dict[float, LatestEventsView] = {}
        self._explained_readings: set[tuple[str, int]] = set()

    def why(self, name: str, at_s: float, path: tuple[str, ...]) -> Why:
        """Explain a variable, as a cause of the variables in `path`; leave its causes out if the path is too long."""
        context = self._context_at(at_s)
        if len(path) >= _MAX_DEPTH:
            return replace(self._bare_why(context.reading(name), at_s), is_left_out=True)
        override_event = context.override_event(name)
        if override_event is None:
            return self._observed_why(name, context, path)
        why = self._bare_why(_reading_of_override(name, override_event), at_s)
        key = (name, id(override_event))
        if key in self._explained_readings:
            return replace(why, is_repeated=True)
        self._explained_readings.add(key)
        return replace(why, story=(override_text(why.reading),), beneath=self._observed_why(name, context, path))

    def _bare_why(self, reading: Reading[Value], at_s: float) -> Why:
        unit = self._summary.variables[reading.name].type.unit or ""
        return Why(at_s=at_s, reading=reading, unit=unit, place=self._summary.places.get(f"context/{reading.name}"))

    def _observed_why(self, name: str, context: _PastContext, path: tuple[str, ...]) -> Why:
        """Explain the reading that the sources of a variable give."""
        reading, event = context.observed_reading(name), context.latest_events.present_events.get(name)
        why = self._bare_why(reading, context.at_s)
        if name in path or (name, id(event)) in self._explained_readings:
            return replace(why, is_repeated=True)
        self._explained_readings.add((name, id(event)))
        look = self._look(name, context, (*path, name)) if reading.known else None
        ways = tuple(self._way(algorithm, context, (*path, name)) for algorithm in self._summary.find_algorithms(name))
        is_asked = not path
        poses = self._poses(name, context) if POSES in self._summary.variables[name].sources else ()
        return replace(
            why,
            story=tuple(story(name, reading, context.latest_events, self._summary)),
            look=look,
            derivation=self._derivation(name, context, (*path, name)),
            poses=poses,
            ways=ways if not reading.known or (is_asked and all(way.blocked_by for way in ways)) else (),
            missing=tuple(self._missing(name, context, ways)) if is_asked else (),
        )

    def preview(self, skill: SkillModel, at_s: float) -> Why:
        """Explain the preview of a skill: why it holds, why it is unknown, or which condition is violated."""
        context, rules = self._context_at(at_s), [*self._summary.previews.get(skill.name, ())]
        conditions = tuple(PreviewCondition(text=rule.text, condition=rule.term) for rule in rules)
        answer = evaluate(replace(skill, preview_conditions=conditions), context)
        names_in_conditions = {name for rule in rules for name in rule.term.variables()}
        rules += [
            Rule(source_text=name, python_text=f'value("{name}") == value("{name}")')  # holds if the variable is known
            for name in (skill.preview if answer.holds else answer.undecided)
            if name in self._summary.variables and name not in names_in_conditions
        ]
        first_unknown = answer.unknown[0].reason if answer.unknown else Reason.NEVER_OBSERVED
        is_decided = answer.outcome is not PreviewOutcome.UNKNOWN
        return Why(
            at_s=at_s,
            reading=Reading(
                name=skill.name,
                content=str(answer.outcome) if is_decided else None,
                reason=None if is_decided else Reason(first_unknown),
            ),
            place=self._summary.places.get(f"skill/{skill.name}"),
            story=() if answer.holds else (f"the preview is {answer}",),
            conditions=tuple(
                self._condition(rule, context, ()) for rule in rules if answer.holds or not rule.term.holds(context)
            ),
        )

    def _context_at(self, at_s: float) -> _PastContext:
        if at_s not in self._events_at:
            self._events_at[at_s] = self._latest_events_at(at_s)
        return _PastContext(self._events_at[at_s], self._summary, at_s)

    def _look(self, name: str, context: _PastContext, path: tuple[str, ...]) -> Look | None:
        """Return the job that produced a value, with its preconditions at the end of its evidence, or None."""
        job, source = context.latest_events.basis_jobs.get(name), context.observed_reading(name).source
        algorithm = self._summary.algorithms.get(source)
        if job is None or algorithm is None or name not in algorithm.identifies:
            return None
        start_s, stamp_s = job.details["evidence_s"]
        rule = algorithm.identifies[name]
        return Look(
            algorithm=source,
            index=int(job.details["index"]),
            rule=rule.text,
            values={key: value for key, value in job.details.get("values", {}).items() if value is not None},
            units={key: declared.unit for key, declared in algorithm.returns.items() if declared.unit},
            start_s=float(start_s),
            stamp_s=float(stamp_s),
            under=tuple(
                self._condition(condition, self._context_at(stamp_s), path) for condition in algorithm.preconditions
            ),
            place=rule.place,
        )

    def _derivation(self, name: str, context: _PastContext, path: tuple[str, ...]) -> Derivation | None:
        """Return the expression and the inputs of a derived variable."""
        rule = self._summary.find_derivation(name)
        if rule is None:
            return None
        is_known = context.observed_reading(name).known
        inputs = (self.why(need, context.at_s, path) for need in self._inputs(rule, context, is_known=is_known))
        return Derivation(rule=rule.text, inputs=tuple(inputs), place=rule.place)

    def _inputs(self, rule: Rule, context: _PastContext, *, is_known: bool) -> list[str]:
        """Return the inputs of an expression, or only the unknown ones if the value is unknown because of them."""
        names = sorted(name for name in rule.term.variables() if name in self._summary.variables)
        unknown_names = [name for name in names if not context.reading(name).known]
        return unknown_names if unknown_names and not is_known else names

    def _unknown_plain_inputs(self, name: str, context: _PastContext) -> Iterator[str]:
        """Yield the variables that make a derived variable unknown, without derived ones."""
        pending_names, seen_names = [name], set[str]()
        while pending_names:
            other = pending_names.pop()
            if other in seen_names:
                continue
            seen_names.add(other)
            rule = self._summary.find_derivation(other)
            if rule is None:
                yield other
            elif not context.observed_reading(other).known:
                pending_names.extend(reversed(self._inputs(rule, context, is_known=False)))

    def _poses(self, name: str, context: _PastContext) -> tuple[Why, ...]:
        """Explain the edges whose poses determine a variable."""
        explanations: list[Why] = []
        for edge in pose_edges_between(context.latest_events, name):
            why = explain_knowledge(self._summary, context.latest_events, edge, context.at_s)
            key = (edge, id(context.latest_events.knowledge_events[edge]["placed"]))
            explanations.append(replace(why, story=(), is_repeated=True) if key in self._explained_readings else why)
            self._explained_readings.add(key)
        return tuple(explanations)

    def _condition(self, rule: Rule, context: _PastContext, path: tuple[str, ...]) -> Condition:
        truth = rule.term.evaluate(context)
        holds = None if truth is None else truth is True
        names = sorted(name for name in rule.term.variables() if name in self._summary.variables)
        because = tuple(self.why(name, context.at_s, path) for name in names)
        return Condition(text=rule.text, holds=holds, because=because, place=rule.place)

    def _way(self, algorithm: AlgorithmSummary, context: _PastContext, path: tuple[str, ...]) -> Way:
        """Return the state of an algorithm; only conditions that do not hold are explained."""
        conditions = tuple(
            Condition(text=rule.text, holds=True, because=(), place=rule.place)
            if rule.term.holds(context)
            else self._condition(rule, context, path)
            for rule in algorithm.preconditions
        )
        return Way(
            algorithm=algorithm.name,
            conditions=conditions,
            obstacle=host_text(algorithm.host, context.latest_events),
            doing=job_text(algorithm, context.latest_events),
            missing=tuple(self._changes_for_algorithm(algorithm, context)),
            place=algorithm.place,
        )

    def _changes_for_algorithm(self, algorithm: AlgorithmSummary, context: _PastContext) -> Iterator[MissingChange]:
        """Yield the changes that an algorithm needs before it can look."""
        if host_text(algorithm.host, context.latest_events):
            yield MissingChange(variable="", condition=f"connect host {algorithm.host!r}", place=algorithm.place)
        preconditions = [self._with_expressions(rule) for rule in algorithm.preconditions]
        unmet_preconditions = [rule for rule in preconditions if not rule.term.holds(context)]
        values = (
            find_solution([rule.term for rule in preconditions], context, self._summary.variables)
            if unmet_preconditions
            else {}
        )
        if values is not None:
            for name, value in values.items():
                rule = next(condition for condition in unmet_preconditions if name in condition.term.variables())
                unit = self._summary.variables[name].type.unit or ""
                yield MissingChange(variable=name, condition=rule.text, value=value, unit=unit, place=rule.place)
            return
        for rule in unmet_preconditions:
            wait_s = rule.term.flips_s(context)
            yield MissingChange(
                variable=min(rule.term.variables(), default=""),
                condition=rule.text,
                from_s=None if wait_s is None else context.at_s + wait_s,
                place=rule.place,
            )

    def _with_expressions(self, rule: Rule) -> Rule:
        """Return a condition with expressions in place of derived variables, which no program can write."""
        text = rule.python_text
        pending_names, expression_count = sorted(rule.term.variables()), 0
        while pending_names and len(text) < _MAX_TEXT_LENGTH and expression_count < _MAX_EXPRESSIONS:
            name = pending_names.pop()
            derivation = self._summary.find_derivation(name) if name in self._summary.variables else None
            if derivation is not None and f"value({name!r})" in text:
                expression_count += 1
                text = text.replace(f"value({name!r})", f"({derivation.python_text})")
                pending_names.extend(sorted(derivation.term.variables()))
        return rule if text == rule.python_text else replace(rule, python_text=text, source_text=rule.text)

    def _missing(self, name: str, context: _PastContext, ways: tuple[Way, ...]) -> Iterator[MissingChange]:
        """Yield the changes that are needed to observe a variable.

        These are the change that the observer of the variable needs, and the changes that one of its algorithms needs:
        the algorithm that needs the fewest changes.
        """
        rate_event = context.latest_events.adaptation_events.get(f"context/{name}", {}).get("computed")
        if self._summary.find_derivation(name) is not None or rate_event is not None:
            for need in self._unknown_plain_inputs(rate_event.details["input"] if rate_event else name, context):
                algorithms = self._summary.find_algorithms(need)
                yield from self._missing(
                    need, context, tuple(self._way(algorithm, context, (name,)) for algorithm in algorithms)
                )
            return
        observer = self._summary.find_observer(name)
        if observer is None:
            if not context.observed_reading(name).known and POSES not in self._summary.variables[name].sources:
                sources = " or ".join(self._summary.variables[name].sources)
                yield MissingChange(variable=name, condition=f"only {sources} may write {name}")
            return
        last_event = context.latest_events.observer_events.get(observer.name)
        if last_event is None or last_event.what != "started":
            has_failed = last_event is not None and last_event.what == "failed"
            retry_text = f"withdraw {name} and declare it again: {observer.name} failed and is stopped"
            condition = retry_text if has_failed else f"declare {name}: {observer.name} is not running"
            yield MissingChange(variable=name, condition=condition, place=observer.place)
        yield from min((way.missing for way in ways), key=len, default=())
