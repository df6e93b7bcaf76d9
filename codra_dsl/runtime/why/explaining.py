"""Explaining a variable from what a record or a journal holds, at any instant of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reading, Reason
from codra_dsl.runtime.declarations import POSES
from codra_dsl.runtime.journal.ledger import Ledger
from codra_dsl.runtime.outline import AlgorithmOutline, Outline, Rule
from codra_dsl.runtime.why.adapting import adapting, explain_course
from codra_dsl.runtime.why.knowing import explain_knowledge, poses_between
from codra_dsl.runtime.why.story import doing, story
from codra_dsl.runtime.why.values import Condition, Look, Missing, Way, Why
from codra_dsl.runtime.why.wanting import wanted

Ledgers = Callable[[float], Ledger]
"""What the events up to an instant come to."""


def explain(outline: Outline, ledgers: Ledgers, name: str, at_s: float) -> Why:
    """Return why a variable is what it is at an instant, with the chain through all that led to it.

    Of knowledge it tells who wrote it last, in which change, and what was refused; of a course or parameter the whole
    chain of the last decision about it.

    Args:
        outline: what the spec says.
        ledgers: tells what had happened up to an instant.
        name: of a variable of the spec, or of knowledge: a node, `node.attribute`, an edge as `origin -edge-> target`,
            or a task; or of a course or parameter, or of an action, whose weight is meant.
        at_s: the instant.

    Raises:
        UnknownNameError: if there is no such variable, and nothing had become of such knowledge by then.
    """
    node, _, attribute = name.rpartition(".")
    if node and outline.nodes.get(attribute) == node:
        name = attribute  # a context-variable, by its other name
    if name not in outline.variables:
        name = _meant(outline, ledgers(at_s), name)
    if name in outline.variables:
        found = _Explanation(outline, ledgers).why(name, at_s, ())
        return replace(found, story=(*found.story, *adapting(ledgers(at_s), name)))
    ledger = ledgers(at_s)
    return explain_course(ledger, name, at_s) or explain_knowledge(outline, ledger, name, at_s)


def _meant(outline: Outline, ledger: Ledger, name: str) -> str:
    """Return the variable of the weight of an action that nothing else is called like."""
    weight = f"weight_of_{name}"
    is_other = name in outline.nodes.values() or name in ledger.knowledge or f"adaptation/{name}" in ledger.adaptations
    return weight if weight in outline.variables and not is_other else name


@dataclass(frozen=True, slots=True)
class _Then:
    """The context as it was at an instant."""

    ledger: Ledger
    outline: Outline
    at_s: float

    def reading(self, name: str) -> Reading[Value]:
        """Return what was known of a variable."""
        event = self.ledger.present.get(name)
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
        expires_s = evidence_s + self.outline.variables[name].valid_for_s
        return Reading(**{key: getattr(reading, key) for key in _KEPT}, expires_s=expires_s).at(self.at_s)

    def value(self, name: str) -> Value | None:
        return self.reading(name).content

    def age_s(self, name: str) -> float | None:
        reading = self.reading(name)
        return reading.age_s(self.at_s) if reading.known else None


_KEPT = ("name", "content", "reason", "detail", "evidence_s", "start_s", "identified_s", "source")


class _Explanation:
    """One explanation: nothing is told twice in it, and no chain goes round."""

    def __init__(self, outline: Outline, ledgers: Ledgers) -> None:
        self._outline = outline
        self._ledgers = ledgers
        self._known: dict[float, Ledger] = {}
        self._told: set[tuple[str, int]] = set()

    def why(self, name: str, at_s: float, path: tuple[str, ...]) -> Why:
        """Explain a variable, for the sake of those on the path that led to it."""
        then = self._then(at_s)
        reading, event = then.reading(name), then.ledger.present.get(name)
        model = self._outline.variables[name]
        unit, place = model.type.unit or "", self._outline.places.get(f"context/{name}")
        if name in path or (name, id(event)) in self._told:
            return Why(at_s=at_s, reading=reading, unit=unit, place=place, is_told=True)
        self._told.add((name, id(event)))
        look = self._look(name, then, (*path, name)) if reading.known else None
        ways = tuple(self._way(each, then, (*path, name)) for each in self._outline.algorithms_of(name))
        is_asked = not path
        poses = self._poses(name, then) if POSES in model.sources else ()
        return Why(
            at_s=at_s,
            reading=reading,
            unit=unit,
            place=place,
            story=tuple(story(name, reading, then.ledger, self._outline)),
            look=look,
            poses=poses,
            ways=ways if not reading.known or (is_asked and _are_blocked(ways)) else (),
            missing=tuple(self._missing(name, then, ways)) if is_asked else (),
        )

    def _then(self, at_s: float) -> _Then:
        if at_s not in self._known:
            self._known[at_s] = self._ledgers(at_s)
        return _Then(self._known[at_s], self._outline, at_s)

    def _look(self, name: str, then: _Then, path: tuple[str, ...]) -> Look | None:
        """Return the job that a value comes from, with the preconditions as they were when its evidence was taken."""
        job, source = then.ledger.basis.get(name), then.reading(name).source
        algorithm = self._outline.algorithms.get(source)
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
            under=tuple(self._condition(each, self._then(stamp_s), path) for each in algorithm.conditions),
            place=rule.place,
        )

    def _poses(self, name: str, then: _Then) -> tuple[Why, ...]:
        """Explain the edges from whose poses it follows what a variable is."""
        found: list[Why] = []
        for edge in poses_between(then.ledger, name):
            why = explain_knowledge(self._outline, then.ledger, edge, then.at_s)
            told = (edge, id(then.ledger.knowledge[edge]["placed"]))
            found.append(replace(why, story=(), is_told=True) if told in self._told else why)
            self._told.add(told)
        return tuple(found)

    def _condition(self, rule: Rule, then: _Then, path: tuple[str, ...]) -> Condition:
        found = rule.term.evaluate(then)
        holds = None if found is None else found is True
        names = sorted(name for name in rule.term.variables() if name in self._outline.variables)
        because = tuple(self.why(name, then.at_s, path) for name in names)
        return Condition(text=rule.text, holds=holds, because=because, place=rule.place)

    def _way(self, algorithm: AlgorithmOutline, then: _Then, path: tuple[str, ...]) -> Way:
        """Return what an algorithm lacks; only conditions that do not hold are explained."""
        conditions = tuple(
            Condition(text=rule.text, holds=True, because=(), place=rule.place)
            if rule.term.holds(then)
            else self._condition(rule, then, path)
            for rule in algorithm.conditions
        )
        return Way(
            algorithm=algorithm.name,
            conditions=conditions,
            doing=doing(algorithm, then.ledger),
            missing=tuple(self._lacks(algorithm, then)),
            place=algorithm.place,
        )

    def _lacks(self, algorithm: AlgorithmOutline, then: _Then) -> Iterator[Missing]:
        """Yield what would have to be otherwise for an algorithm to look."""
        failing = [rule for rule in algorithm.conditions if not rule.term.holds(then)]
        values = wanted([rule.term for rule in algorithm.conditions], then, self._outline.variables) if failing else {}
        if values is not None:
            for name, value in values.items():
                rule = next(each for each in failing if name in each.term.variables())
                unit = self._outline.variables[name].type.unit or ""
                yield Missing(variable=name, condition=rule.text, value=value, unit=unit, place=rule.place)
            return
        for rule in failing:
            flips_s = rule.term.flips_s(then)
            yield Missing(
                variable=min(rule.term.variables(), default=""),
                condition=rule.text,
                from_s=None if flips_s is None else then.at_s + flips_s,
                place=rule.place,
            )

    def _missing(self, name: str, then: _Then, ways: tuple[Way, ...]) -> Iterator[Missing]:
        """Yield what keeps a variable from being observed: of the way that lacks least, and its observer."""
        observer = self._outline.observer_of(name)
        if observer is None:
            if not then.reading(name).known and POSES not in self._outline.variables[name].sources:
                sources = " or ".join(self._outline.variables[name].sources)
                yield Missing(variable=name, condition=f"for {sources} to write")
            return
        last = then.ledger.observers.get(observer.name)
        if last is None or last.what != "started":
            is_broken = last is not None and last.what == "failed"
            again = f"withdraw {name} and declare it again: {observer.name} broke and rests"
            condition = again if is_broken else f"declare {name}: {observer.name} does not run"
            yield Missing(variable=name, condition=condition, place=observer.place)
        yield from min((way.missing for way in ways), key=len, default=())


def _are_blocked(ways: tuple[Way, ...]) -> bool:
    return all(way.blocked_by for way in ways)
