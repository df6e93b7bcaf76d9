"""Pass the inputs of a journal to a context manager, which derives the events of the run from them.

A replay calls no perception function and does not wait. The same code as in the run computes observers, variables and
decisions, so a difference means that the spec, the runtime or the journal has changed.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Set
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.context.decisions import Decision, DecisionRequest, Preview, PreviewRequest, ValueDecision
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.journal.encoding import parse_json
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.knowledge import ConflictError, KnowledgeModel
from codra_dsl.runtime.knowledge.context_link import RefusedWrite
from codra_dsl.runtime.knowledge.operations import operations_of
from codra_dsl.runtime.replay.comparison import Comparison
from codra_dsl.runtime.replay.jobs import DivergedError, ReplayedClock, ReplayedJobs
from codra_dsl.runtime.replay.recording import Recording
from codra_dsl.runtime.values.model import NotOfTypeError

Build = Callable[..., ContextManager[Any, Any]]
"""Creates the context manager of a package: a class with the parameters of `ContextManager`."""


_INPUT_ERRORS = (LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, ConflictError)
"""The errors of inputs that cannot come from a run, such as a skill that acts after its end."""

_POSITION_DETAILS = frozenset({"step", "work", "number"})
"""The details of an input that state its position in the run; they are not arguments."""


class Player:
    """A context manager, with time and jobs that follow a journal, and the inputs that it receives.

    Attributes:
        decisions: the decisions that wait or look, by their numbers in the journal.
        on_decision: called with each decision that context has answered, or for which the main execution looks now.
        pending_input: the input that comes next, and has not been passed completely.
        has_tried_input: whether the player has tried to pass it.
    """

    def __init__(  # noqa: PLR0917 - the arguments of `replay`
        self,
        header: RunHeader,
        recording: Recording,
        model: ContextModel,
        build: Build,
        comparison: Comparison,
        knowledge: KnowledgeModel | None,
    ) -> None:
        """Create the context manager; no input is passed yet."""
        self.recording = recording
        self.jobs = ReplayedJobs(lambda: comparison.difference is None)
        self.jobs.repeat_calls = self._repeat_calls_of
        recording.on_job_event = self.jobs.add_event
        self.clock = ReplayedClock(header.start_s, self.jobs)
        self.manager = build(
            model,
            clock=self.clock,
            resources={resource.name: None for resource in model.resources if resource.slots is None},
            seed=header.seed,
            record=comparison,
            find=self.jobs.find,
            knowledge=knowledge,
        )
        hosts_of_run = {algorithm.host for algorithm in header.summary.algorithms.values()}
        for host in sorted(self.manager.hosts.names - hosts_of_run):  # in the run, its algorithms had no host
            self.manager.hosts.connect(host, None)
        self._commands = self.manager.commands
        self._types = {variable.name: variable.type for variable in model.variables}
        self._skill_names = frozenset(skill.name for skill in model.skills)
        self.decisions: dict[int, Decision] = {}
        self.on_decision: Callable[[Decision], None] = lambda _: None
        self.pending_input: Event | None = None
        self.has_tried_input = False
        self._skill_numbers: dict[int, int] = {}
        self._slot_numbers: dict[int, int] = {}
        self._begun_skill_count = 0
        self._slot_request_count = 0

    def pass_input(self, event: Event) -> None:
        """Pass an input to the context manager; an input that was refused in the run is refused again."""
        details = event.details
        self._begun_skill_count += event.what == "begin"
        self._slot_request_count += event.what == "request"
        self._check_names("variable", details, self._types.keys())
        self._check_names("skill", details, self._skill_names)
        try:
            with contextlib.suppress(PermissionError, ValueError):
                self._apply(event, details)
        except _INPUT_ERRORS as error:
            raise DivergedError(
                f"{event.what} of {event.name} cannot be replayed: {type(error).__name__} {error}"
            ) from error

    def waiting_numbers(self) -> list[int]:
        """Return the numbers of the decisions that wait for observers."""
        return [number for number, decision in self.decisions.items() if decision.is_waiting]

    def next_check_s(self, number: int) -> float:
        """Return the next instant at which time alone can end the wait of a decision."""
        return self.decisions[number].next_check_s(self._commands.decision_context, self.clock.now_s())

    def is_wait_over(self, number: int, until_s: float) -> bool:
        """Return whether context can answer a decision now, or its wait ends by an instant."""
        decision = self.decisions[number]
        context, now_s = self._commands.decision_context, self.clock.now_s()
        return decision.until_s <= until_s or decision.can_be_decided(context, now_s)

    def resume(self, number: int) -> None:
        """Look up the answer to a decision again after its wait."""
        decision = self.decisions[number]
        self._commands.resume(decision)
        self._note_decision(number, decision)

    def abandon(self, number: int, why: str) -> None:
        """End a decision that waits, or for which the main execution looks."""
        self._commands.abandon(self._take_decision(number), why)

    def _note_decision(self, number: int, decision: Decision) -> None:
        """Keep a decision that waits or looks."""
        if not decision.is_waiting:
            self.on_decision(decision)
        if decision.is_over:
            self.decisions.pop(number, None)
        else:
            self.decisions[number] = decision

    def _take_decision(self, number: int) -> Decision:
        """Remove a decision that ends, and return it. If it still waits, the main execution has abandoned it."""
        decision = self.decisions.pop(number)
        if decision.is_waiting:
            self.on_decision(decision)
        return decision

    def _check_names(self, kind: str, details: Mapping[str, Any], declared_names: Set[str]) -> None:
        names = [*details.get(f"{kind}s", ()), *([details[kind]] if kind in details else ())]
        missing_name = next((name for name in names if name not in declared_names), None)
        if missing_name is not None:
            raise DivergedError(f"the package has no {kind} '{missing_name}', which the run used")

    def _value(self, variable: str, details: Mapping[str, Any]) -> Value | None:
        """Return the value of an input; the package may have another type for the variable than the run."""
        content = details.get("value")
        try:
            return None if content is None else self._types[variable].convert(content)
        except NotOfTypeError as error:
            raise DivergedError(f"the package refuses the value of '{variable}' in the run: {error}") from error

    def _repeat_calls_of(self, work_number: int) -> None:
        """Repeat the calls that a job's function made. In simulated time, the step that begins the job made them."""
        for event in self.recording.calls.pop(work_number, ()):
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
                self._skill_numbers[self._begun_skill_count] = commands.begin(details["skill"], event.name)
            case "act":
                commands.act(self._skill_numbers[details["number"]])
            case "acted":
                commands.acted(self._skill_numbers[details["number"]])
            case "finish":
                commands.finish(self._skill_numbers[details["number"]])
            case "leave":
                commands.leave(event.name)
            case "write":
                (evidence_s,) = details.get("evidence_s", (None,))
                commands.write(details["variable"], self._value(details["variable"], details), event.name, evidence_s)
            case "override":
                content = self._value(details["variable"], details)
                commands.override(details["variable"], content, details["for_s"], details["detail"])
            case "clear":
                commands.clear_override(details["variable"])
            case "request":
                slot_number = commands.request_slots(tuple(details["resources"]), lambda: None)
                self._slot_numbers[self._slot_request_count] = slot_number
            case "release":
                commands.release_slots(self._slot_numbers.pop(details["number"]))
            case "connected":
                self.manager.hosts.connect(event.name, None)
            case "lost":
                self.manager.hosts.disconnect(event.name, details["message"])
            case "delivered":
                self.jobs.deliver((event.name, details["index"]), self.clock.now_s())
            case "close":
                self.manager.close()
            case _:
                self._decide(event, details)

    def _decide(self, event: Event, details: Mapping[str, Any]) -> None:
        number = details.get("number", 0)
        request_fields = {key: value for key, value in details.items() if key not in _POSITION_DETAILS}
        if "since" in request_fields:
            request_fields["since_s"] = parse_json(request_fields.pop("since"))
        match event.what:
            case "decide":
                self._note_decision(number, self._commands.ask(DecisionRequest(**request_fields)))
            case "preview":
                self._note_decision(number, self._commands.ask_preview(PreviewRequest(**request_fields)))
            case "waited":
                self.resume(number)
            case "found" | "looked" if "raised" in details:
                self.abandon(number, details["raised"])
            case "looked" if isinstance(preview := self.decisions[number], Preview):
                variable = details["variable"]
                self._commands.record_look(preview, variable, self._value(variable, details))
                self._note_decision(number, preview)
            case "found" if isinstance(decision := self._take_decision(number), ValueDecision):
                self._commands.conclude(decision, self._value(decision.name, details))
            case "graph":
                operations = operations_of(parse_json(details["operations"]))
                self.manager.knowledge.write_as(event.name, operations)
            case "refused":
                variable, content = details.get("variable", ""), details.get("value")
                refused_write = RefusedWrite(details["subject"], details["message"], variable, content)
                self.manager.knowledge.replay_refusal(event.name, refused_write)
            case "adapt":
                adaptation = parse_json(details["told"])
                self._commands.adapt(event.name, adaptation["name"], adaptation["what"], adaptation["details"])
            case "rule":
                rule_event_fields = (details["rule"], details["became"], details.get("message", ""))
                self.manager.knowledge.record_rule_state(event.name, *rule_event_fields)
            case _:
                pass
