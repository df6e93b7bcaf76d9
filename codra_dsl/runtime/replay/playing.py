"""Deriving the events of a run anew from its journal: the same inputs and the same evidence, taken at the same places.

No perception function is called and no time passes. What observers, variables and decisions come to is worked out by
the same code as in the run, so a difference means that the spec, the runtime or the journal is another.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.context import ContextManager
from codra_dsl.runtime.decisions import Decision, Demand
from codra_dsl.runtime.inputs import Inputs
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.head import Head
from codra_dsl.runtime.journal.record import Record
from codra_dsl.runtime.knowledge import ConflictError, KnowledgeModel, Snapshot
from codra_dsl.runtime.knowledge.sharing import Refused
from codra_dsl.runtime.model import ContextModel
from codra_dsl.runtime.outline_changes import changes_near
from codra_dsl.runtime.replay.comparison import Comparison, Difference, Replayed
from codra_dsl.runtime.replay.jobs import DivergedError, ReplayedClock, ReplayedJobs

Build = Callable[..., ContextManager[Any, Any]]
"""Makes the context manager of a package: its class, which takes what `ContextManager` takes."""


_PLACE = frozenset({"step", "work", "number"})
"""Details of inputs that say where they belong, and nothing of what is asked."""


class _Player:
    """Takes the inputs of a journal, each at its place."""

    def __init__(
        self, manager: ContextManager[Any, Any], model: ContextModel, jobs: ReplayedJobs, events: Sequence[Event]
    ) -> None:
        self._inputs: Inputs = manager.inputs
        self._manager = manager
        self._jobs = jobs
        self._variables = frozenset(variable.name for variable in model.variables)
        self._skills = frozenset(skill.name for skill in model.skills)
        self._decisions: dict[int, Decision] = {}
        self._of_jobs: dict[int, list[Event]] = {}
        for event in events:
            if "work" in event.details:
                self._of_jobs.setdefault(event.details["work"], []).append(event)
        jobs.calls = self._take_all_of

    def take(self, event: Event) -> None:
        """Let an input reach the context manager; what was refused in the run is refused again."""
        details = event.details
        self._check("variable", [details["variable"]] if "variable" in details else [], self._variables)
        self._check("skill", details.get("skills", [details["skill"]] if "skill" in details else []), self._skills)
        try:
            with contextlib.suppress(PermissionError, ValueError):
                self._apply(event, details)
        except (LookupError, TypeError, ConflictError) as error:
            raise DivergedError(
                f"{event.what} of {event.name} cannot be taken: {type(error).__name__} {error}"
            ) from error

    def _check(self, kind: str, names: Sequence[str], known: frozenset[str]) -> None:
        missing = next((name for name in names if name not in known), None)
        if missing is not None:
            raise DivergedError(f"the package has no {kind} '{missing}', and the run named it")

    def _take_all_of(self, work: int) -> None:
        """Take what the function of a job asked, which in simulated time happens within the step that begins it."""
        for event in self._of_jobs.get(work, ()):
            self.take(event)

    def _apply(self, event: Event, details: Mapping[str, Any]) -> None:
        inputs = self._inputs
        match event.what:
            case "declare":
                inputs.declare(details["variable"], event.name)
            case "withdraw":
                inputs.withdraw(details["variable"], event.name)
            case "expect":
                inputs.expect(details["skills"], event.name)
            case "begin":
                inputs.begin(details["skill"], event.name)
            case "act":
                inputs.act(details["number"])
            case "acted":
                inputs.acted(details["number"])
            case "finish":
                inputs.finish(details["number"])
            case "leave":
                inputs.leave(event.name)
            case "write":
                (evidence_s,) = details.get("evidence_s", (None,))
                inputs.write(details["variable"], details.get("value"), event.name, evidence_s)
            case "request":
                inputs.request_slots(tuple(details["resources"]), _nothing)
            case "release":
                inputs.release_slots(details["number"])
            case "delivered":
                self._jobs.deliver((event.name, details["index"]))
            case "close":
                self._manager.close()
            case _:
                self._decide(event, details)

    def _decide(self, event: Event, details: Mapping[str, Any]) -> None:
        number = details.get("number", 0)
        match event.what:
            case "decide":
                asked = {key: part for key, part in details.items() if key not in _PLACE}
                self._decisions[number] = self._inputs.ask(Demand(**asked))
            case "waited":
                self._inputs.resume(self._decisions[number])
            case "found":
                found = self._decisions.pop(number)
                self._inputs.conclude(found, details.get("value"), details.get("raised"))
            case "graph":
                self._manager.knowledge.redo(event.name, json.loads(details["operations"]))
            case "refused":
                about = (details["subject"], details["message"], details.get("variable", ""), details.get("value"))
                self._manager.knowledge.refuse_again(event.name, Refused(*about))
            case "adapt":
                adapted = json.loads(details["told"])
                self._inputs.adapt(event.name, adapted["name"], adapted["what"], adapted["details"])
            case "rule":
                told = (details["rule"], details["became"], details.get("message", ""))
                self._manager.knowledge.tell_rule(event.name, *told)
            case _:
                pass


def replay(  # noqa: PLR0917 - a journal, and what a package holds
    head: Head,
    events: Sequence[Event],
    model: ContextModel,
    build: Build,
    copy: Record | None,
    knowledge: KnowledgeModel | None = None,
) -> Replayed:
    """Derive the events of a run anew, and compare them with those of its journal.

    Args:
        head: of the journal.
        events: of the journal.
        model: what the spec is compiled to.
        build: makes its context manager.
        copy: takes what is derived, e.g. a `Journal`; it becomes the same, byte for byte, if nothing differs.
        knowledge: what the spec says of a knowledge graph, if it does.
    """
    comparison = Comparison([event for event in events if event.kind is not Kind.INPUT], copy)
    _, _, because = _played(head, events, model, build, comparison, knowledge)
    comparison.miss(because)
    comparison.end()
    return Replayed(
        compared=comparison.position,
        derived=comparison.derived,
        absent=comparison.absent(),
        difference=_with_changes(comparison, head),
    )


def knowledge_at(
    head: Head, events: Sequence[Event], model: ContextModel, knowledge: KnowledgeModel, instant_s: float
) -> Snapshot:
    """Return the knowledge graph as it was at an instant of a run, made again from the run's journal.

    Args:
        head: of the journal.
        events: of the journal.
        model: what the spec is compiled to.
        knowledge: what it says of the graph.
        instant_s: of the run.

    Raises:
        ValueError: if the run had not begun at that instant, or the journal does not follow from its inputs.
    """
    if instant_s < head.start_s:
        raise ValueError(f"the run begins at {head.start_s}, so nothing is known of {instant_s}")
    until = [event for event in events if event.instant_s <= instant_s]
    comparison = Comparison([event for event in until if event.kind is not Kind.INPUT], None)
    manager, clock, because = _played(head, until, model, ContextManager, comparison, knowledge)
    if comparison.difference is not None or because:
        raise ValueError(f"the journal does not follow from its inputs: {because or comparison.difference}")
    clock.advance(instant_s)
    return manager.knowledge.at(instant_s)


def _played(  # noqa: PLR0917 - what `replay` was given
    head: Head,
    events: Sequence[Event],
    model: ContextModel,
    build: Build,
    comparison: Comparison,
    knowledge: KnowledgeModel | None,
) -> tuple[ContextManager[Any, Any], ReplayedClock, str]:
    """Make a context manager take the inputs of a journal; return it, its time, and why it could go on no further."""
    jobs = ReplayedJobs(events)
    clock = ReplayedClock(head.start_s, jobs)
    handles = {resource.name: None for resource in model.resources if resource.slots is None}
    about = {"clock": clock, "resources": handles, "seed": head.seed, "record": comparison, "find": jobs.find}
    manager = build(model, **about, knowledge=knowledge)
    inputs = [event for event in events if event.kind is Kind.INPUT]
    player = _Player(manager, model, jobs, inputs)
    try:
        _play(player, clock, comparison, [event for event in inputs if "work" not in event.details])
        _run_on(clock, comparison, events[-1].instant_s if events else head.start_s)
    except DivergedError as error:
        return manager, clock, str(error)
    return manager, clock, ""


def _with_changes(comparison: Comparison, head: Head) -> Difference | None:
    """Return the first difference, with what the spec says otherwise."""
    found = comparison.difference
    if found is None or comparison.outline is None:
        return found
    names = [event.name for event in (found.replayed, found.recorded) if event is not None]
    return replace(found, changes=changes_near(names, head.outline, comparison.outline))


def _play(player: _Player, clock: ReplayedClock, comparison: Comparison, inputs: Sequence[Event]) -> None:
    last = next((event for event in reversed(inputs) if event.what != "evidence"), None)
    for event in inputs:
        while clock.steps < event.details["step"] and comparison.difference is None:
            if clock.next_s() > event.instant_s:
                raise DivergedError
            clock.step()
        if comparison.difference is not None:
            return
        clock.advance(event.instant_s)
        comparison.may_go_on |= event is last  # a journal may be torn in the midst of what its last input brought
        player.take(event)


def _run_on(clock: ReplayedClock, comparison: Comparison, end_s: float) -> None:
    """Let happen what still happened after the last input, in a journal that ends in the middle."""
    while not comparison.is_over and clock.next_s() <= end_s:
        clock.step()


def _nothing() -> None:
    pass
