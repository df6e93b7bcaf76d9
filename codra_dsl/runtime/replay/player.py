"""Derive the events of a run again from its journal, with the same inputs and evidence, at the same positions.

A replay calls no perception function and does not wait. The same code as in the run computes observers, variables and
decisions, so a difference means that the spec, the runtime or the journal has changed.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.context.decisions import Decision, DecisionRequest
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.context.previews import Preview, PreviewRequest
from codra_dsl.runtime.journal.encoding import parse_json
from codra_dsl.runtime.journal.event_log import EventLog
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.journal.spec_summary_changes import changes_by_distance
from codra_dsl.runtime.knowledge import ConflictError, KnowledgeModel, Snapshot
from codra_dsl.runtime.knowledge.context_link import RefusedWrite
from codra_dsl.runtime.replay.comparison import Comparison, Difference, Replayed
from codra_dsl.runtime.replay.jobs import DivergedError, ReplayedClock, ReplayedJobs
from codra_dsl.runtime.replay.recording import Recording

Build = Callable[..., ContextManager[Any, Any]]
"""Creates the context manager of a package: a class with the parameters of `ContextManager`."""


_INPUT_ERRORS = (LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, ConflictError)
"""The errors of inputs that cannot come from a run, such as a skill that acts after its end."""

_POSITION_DETAILS = frozenset({"step", "work", "number"})
"""The details of an input that state its position in the run; they are not arguments."""


class _Player:
    """Passes the inputs of a journal to a context manager, at their positions."""

    def __init__(
        self, manager: ContextManager[Any, Any], model: ContextModel, jobs: ReplayedJobs, recording: Recording
    ) -> None:
        self._commands: Commands = manager.commands
        self._manager = manager
        self._jobs = jobs
        self._variable_names = frozenset(variable.name for variable in model.variables)
        self._skill_names = frozenset(skill.name for skill in model.skills)
        self._decisions: dict[int, Decision] = {}
        self._previews: dict[int, Preview] = {}
        self._recording = recording
        jobs.repeat_calls = self._repeat_calls_of

    def pass_input(self, event: Event) -> None:
        """Pass an input to the context manager; an input that was refused in the run is refused again."""
        details = event.details
        self._check_names("variable", [details["variable"]] if "variable" in details else [], self._variable_names)
        self._check_names(
            "skill", details.get("skills", [details["skill"]] if "skill" in details else []), self._skill_names
        )
        try:
            with contextlib.suppress(PermissionError, ValueError):
                self._apply(event, details)
        except _INPUT_ERRORS as error:
            raise DivergedError(
                f"{event.what} of {event.name} cannot be replayed: {type(error).__name__} {error}"
            ) from error

    def _check_names(self, kind: str, names: Sequence[str], declared_names: frozenset[str]) -> None:
        missing_name = next((name for name in names if name not in declared_names), None)
        if missing_name is not None:
            raise DivergedError(f"the package has no {kind} '{missing_name}', which the run used")

    def _repeat_calls_of(self, work_number: int) -> None:
        """Repeat the calls that a job's function made. In simulated time, the step that begins the job made them."""
        for event in self._recording.calls.pop(work_number, ()):
            self.pass_input(event)

    def _apply(self, event: Event, details: Mapping[str, Any]) -> None:
        commands = self._commands
        match event.what:
            case "declare":
                commands.declare(details["variable"], event.name)
            case "withdraw":
                commands.withdraw(details["variable"], event.name)
            case "expect":
                commands.expect(details["skills"], event.name)
            case "begin":
                commands.begin(details["skill"], event.name)
            case "act":
                commands.act(details["number"])
            case "acted":
                commands.acted(details["number"])
            case "finish":
                commands.finish(details["number"])
            case "leave":
                commands.leave(event.name)
            case "write":
                (evidence_s,) = details.get("evidence_s", (None,))
                commands.write(details["variable"], details.get("value"), event.name, evidence_s)
            case "request":
                commands.request_slots(tuple(details["resources"]), lambda: None)
            case "release":
                commands.release_slots(details["number"])
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
                request_fields = {key: value for key, value in details.items() if key not in _POSITION_DETAILS}
                self._decisions[number] = self._commands.ask(DecisionRequest(**request_fields))
            case "preview":
                since_s = parse_json(details["since"]) if "since" in details else {}
                fields = {key: value for key, value in details.items() if key not in {*_POSITION_DETAILS, "since"}}
                self._previews[number] = self._commands.previews.ask(PreviewRequest(**fields, since_s=since_s))
            case "waited" if number in self._previews:
                self._commands.previews.resume(self._previews[number])
            case "looked" if "variable" in details:
                self._commands.previews.record_look(self._previews[number], details["variable"], details.get("value"))
            case "looked":
                self._commands.previews.abandon(self._previews.pop(number), details.get("raised", ""))
            case "waited":
                self._commands.resume(self._decisions[number])
            case "found":
                decision = self._decisions.pop(number)
                self._commands.conclude(decision, details.get("value"), details.get("raised"))
            case "graph":
                self._manager.knowledge.replay_operations(event.name, parse_json(details["operations"]))
            case "refused":
                refused_write_fields = (
                    details["subject"],
                    details["message"],
                    details.get("variable", ""),
                    details.get("value"),
                )
                self._manager.knowledge.replay_refusal(event.name, RefusedWrite(*refused_write_fields))
            case "adapt":
                adaptation = parse_json(details["told"])
                self._commands.adapt(event.name, adaptation["name"], adaptation["what"], adaptation["details"])
            case "rule":
                rule_event_fields = (details["rule"], details["became"], details.get("message", ""))
                self._manager.knowledge.record_rule_state(event.name, *rule_event_fields)
            case _:
                pass


def _show_nothing(_: float) -> None:
    """Show no progress."""


def replay(  # noqa: PLR0917 - the parts of a journal and of a package
    header: RunHeader,
    events: Sequence[Event] | Recording,
    model: ContextModel,
    build: Build,
    copy: EventLog | None,
    knowledge: KnowledgeModel | None = None,
    progress: Callable[[float], None] = _show_nothing,
) -> Replayed:
    """Derive the events of a run again, and compare them with those of its journal.

    Args:
        header: the run header of the journal.
        events: the events of the journal, or a recording, which does not hold all events in memory.
        model: the model of the compiled spec.
        build: creates the context manager of the package.
        copy: an event log that receives the derived events, e.g. a `Journal`. If there is no difference, the file of
            this journal equals, byte for byte, the file of the replayed journal.
        knowledge: the knowledge graph of the spec, if it has one.
        progress: this function is called for each input, with the time since the start of the run.

    Raises:
        JournalError: if the file of the journal exceeds a limit.
    """
    recording = events if isinstance(events, Recording) else Recording.of(events)
    comparison = Comparison(recording, copy)
    _, _, divergence_text = _play_journal(header, recording, model, build, comparison, knowledge, progress)
    comparison.check_completeness(divergence_text)
    recording.check()
    comparison.end()
    return Replayed(
        compared=comparison.position,
        derived=comparison.derived,
        absent=comparison.absent(),
        difference=_with_changes(comparison, header),
    )


def knowledge_at(
    header: RunHeader, events: Sequence[Event], model: ContextModel, knowledge: KnowledgeModel, instant_s: float
) -> Snapshot:
    """Return the knowledge graph at an instant of a run, derived again from the run's journal.

    Args:
        header: the run header of the journal.
        events: the events of the journal.
        model: the model of the compiled spec.
        knowledge: the knowledge graph of the spec.
        instant_s: the instant.

    Raises:
        ValueError: if the run had not begun at that instant, or the journal's events do not follow from its inputs.
    """
    if instant_s < header.start_s:
        raise ValueError(f"the run begins at {header.start_s}, after {instant_s}: ask for a later instant")
    recording = Recording.of([event for event in events if event.instant_s <= instant_s])
    comparison = Comparison(recording, None)
    manager, clock, divergence_text = _play_journal(header, recording, model, ContextManager, comparison, knowledge)
    if comparison.difference is not None or divergence_text:
        raise ValueError(f"the journal does not follow from its inputs: {divergence_text or comparison.difference}")
    clock.advance(instant_s)
    return manager.knowledge.at(instant_s)


def _play_journal(  # noqa: PLR0917 - the arguments of `replay`
    header: RunHeader,
    recording: Recording,
    model: ContextModel,
    build: Build,
    comparison: Comparison,
    knowledge: KnowledgeModel | None,
    progress: Callable[[float], None] = _show_nothing,
) -> tuple[ContextManager[Any, Any], ReplayedClock, str]:
    """Pass a journal's inputs to a new context manager; return this manager, its clock, and why the replay stopped.

    The reason is empty if the replay did not stop before its end.
    """
    jobs = ReplayedJobs()
    recording.on_job_event = jobs.add_event
    clock = ReplayedClock(header.start_s, jobs)
    handles = {resource.name: None for resource in model.resources if resource.slots is None}
    manager_arguments = {
        "clock": clock,
        "resources": handles,
        "seed": header.seed,
        "record": comparison,
        "find": jobs.find,
    }
    manager = build(model, **manager_arguments, knowledge=knowledge)
    player = _Player(manager, model, jobs, recording)
    try:
        _pass_inputs(player, clock, comparison, recording, lambda now_s: progress(now_s - header.start_s))
        end_s = header.start_s if recording.end_s is None else recording.end_s
        while not comparison.is_over and clock.next_event_s() <= end_s:
            clock.step()  # the journal may end in the middle of the run, after its last input
    except DivergedError as error:
        return manager, clock, str(error)
    finally:
        recording.check()
    return manager, clock, ""


def _with_changes(comparison: Comparison, header: RunHeader) -> Difference | None:
    """Return the first difference, with the changes of the spec."""
    difference = comparison.difference
    if difference is None or comparison.spec_summary is None:
        return difference
    names = [event.name for event in (difference.replayed, difference.recorded) if event is not None]
    return replace(difference, changes=changes_by_distance(names, header.summary, comparison.spec_summary))


def _pass_inputs(
    player: _Player,
    clock: ReplayedClock,
    comparison: Comparison,
    recording: Recording,
    progress: Callable[[float], None],
) -> None:
    while (next_input := recording.take_input()) is not None:
        event, is_last = next_input
        while clock.step_count < event.details["step"] and comparison.difference is None:
            if clock.next_event_s() > event.instant_s:
                raise DivergedError
            clock.step()
        if comparison.difference is not None:
            return
        clock.advance(event.instant_s)
        progress(event.instant_s)
        comparison.may_continue |= is_last  # a journal may break off within the events of its last input
        player.pass_input(event)
