"""The commands that programs give to the context manager; each command is a step, recorded before its execution.

Every input from outside is a command. The actions of observers, jobs and timers follow from the commands, from the
results of perception, and from time. So a journal of commands and results can be replayed: the same inputs at the same
places give the same events.

In simulated time a perception function runs within the step that begins its job, so a command that the function gives
belongs to that step. Such a command is recorded with the number of the job, and a replay repeats it within this job.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from codra_dsl.logic import Value
from codra_dsl.runtime.context.decisions import (
    Decision,
    DecisionContext,
    DecisionRequest,
    Explain,
    Preview,
    PreviewRequest,
    ValueDecision,
)
from codra_dsl.runtime.errors import NotASourceError
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.locked_clock import LockedClock
from codra_dsl.runtime.observers.event_triggers import EventTriggers
from codra_dsl.runtime.observers.expectations import Expectations
from codra_dsl.runtime.observers.forest import Forest
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.observers.urgency import Urgencies, Urgency
from codra_dsl.runtime.perception.requests import MAIN_EXECUTION_PRIORITY, Ticket
from codra_dsl.runtime.perception.slots import Slots
from codra_dsl.runtime.values.cell import Reading, Reason, known_reading
from codra_dsl.runtime.values.declarations import (
    MAIN,
    OBSERVER,
    OPERATOR,
    Declarations,
    expectation_holder,
    skill_holder,
)
from codra_dsl.runtime.values.derived import with_inputs
from codra_dsl.runtime.values.model import SkillModel, VariableModel


class NotDeclaredError(PermissionError):
    """The main execution tried to write an undeclared variable of which the main execution is not a source."""


class Commands:
    """The commands of programs, with names and values that are already checked. No command waits.

    Attributes:
        decision_context: the present context, as decisions read it.
        declarations: the declared variables, with the holders of their declarations.
        is_closed: whether the context manager is closed.
    """

    def __init__(
        self,
        *,
        clock: LockedClock,
        event_writer: EventWriter,
        store: Store,
        forest: Forest,
        slots: Slots,
        expectations: Expectations,
        event_triggers: EventTriggers,
        skills: Mapping[str, SkillModel],
        explain: Explain,
    ) -> None:
        """Execute commands on the parts of a context manager.

        Args:
            clock: makes each command a step.
            event_writer: records each command.
            store: holds the variables.
            forest: starts and stops observers.
            slots: the slots of shared resources.
            expectations: judges the expectations of skills.
            event_triggers: decides when variables with `refresh: on_event` are due.
            skills: the skills by name.
            explain: adds to an unknown reading the reason why the variable cannot be observed now.
        """
        self._clock = clock
        self._event_writer = event_writer
        self._store = store
        self.decision_context: DecisionContext = store
        self._forest = forest
        self._slots = slots
        self._expectations = expectations
        self._event_triggers = event_triggers
        self._skills = skills
        self._explain = explain
        self.declarations = Declarations(self._begin_declaration, self._end_declaration)
        observers = forest.observers.items()
        self._urgencies = Urgencies(
            {name: observer.model.identifies for name, observer in observers},
            {name: observer.needs() for name, observer in observers},
            self.with_inputs,
        )
        self.is_closed = False
        self._expected_skills: dict[str, list[str]] = {}
        self._skills_under_way: dict[int, tuple[str, SkillModel]] = {}
        self._skill_count = 0
        self._decision_count = 0
        self._tickets: dict[int, Ticket] = {}
        self._slot_request_count = 0

    def with_inputs(self, names: Iterable[str]) -> frozenset[str]:
        """Return some variables, with all inputs of those that are derived."""
        return with_inputs(names, self._store.cells)

    # Declarations of the main execution (P1, Equation 4)

    def declare(self, name: str, caller: str = MAIN) -> None:
        """Add a variable to C_E(t).

        Raises:
            RuntimeError: if the context manager is closed; the same holds for `expect` and `begin`.
        """
        with self._clock:
            self._check_open()
            self._record_input("declare", caller, variable=name)
            self.declarations.add(caller, name)

    def withdraw(self, name: str, caller: str = MAIN) -> None:
        """Undo `declare`."""
        with self._clock:
            self._record_input("withdraw", caller, variable=name)
            self.declarations.remove(caller, name)

    def expect(self, skills: Iterable[str], caller: str = MAIN) -> None:
        """Set the skills that a main execution expects next; all other skills are no longer expected."""
        with self._clock:
            self._check_open()
            expected_skills = list(dict.fromkeys(skills))
            self._record_input("expect", caller, skills=expected_skills)
            self._hold_expected(expected_skills, caller)

    def begin(self, name: str, caller: str = MAIN) -> int:
        """Begin a skill; return its number, by which `act`, `acted` and `finish` identify the skill."""
        with self._clock:
            self._check_open()
            self._record_input("begin", caller, skill=name)
            self._skill_count += 1
            number, skill = self._skill_count, self._skills[name]
            self._skills_under_way[number] = (caller, skill)
            self._event_triggers.begin(self.with_inputs(skill.monitor))
            self.declarations.declare_exactly(skill_holder(skill.name, number), (*skill.preview, *skill.monitor))
            self._hold_expected([other for other in self._expected_skills.get(caller, ()) if other != name], caller)
            self._forest.look_again()
            return number

    def act(self, number: int) -> None:
        """Make the variables that a skill changes unknown, and start its expectations.

        Raises:
            RuntimeError: if the skill has ended.
        """
        with self._clock:
            if number not in self._skills_under_way:
                raise RuntimeError("a skill that has ended cannot act: begin it again")
            _caller, skill = self._skills_under_way[number]
            self._record_input("act", number=number)
            with self._store.derivations.deferred():
                for variable in skill.changes:
                    self._store.invalidate(variable, skill.name, MAIN)
            self._event_triggers.act(number, skill.changes)
            self._expectations.act(number, skill)

    def acted(self, number: int) -> None:
        """End the acting of a skill."""
        with self._clock:
            self._record_input("acted", number=number)
            self._expectations.acted(number)
            self._event_triggers.acted(number, self._clock.now_s())
            self._forest.look_again()

    def finish(self, number: int) -> None:
        """End a skill."""
        with self._clock:
            self._record_input("finish", number=number)
            self._finish(number)

    def leave(self, caller: str) -> None:
        """Withdraw all declarations of a caller, such as a main execution that has left or no longer responds."""
        with self._clock:
            self._record_input("leave", caller)
            for number in [
                number for number, (skill_caller, _) in self._skills_under_way.items() if skill_caller == caller
            ]:
                self._finish(number)
            self._hold_expected([], caller)
            del self._expected_skills[caller]
            self.declarations.declare_exactly(caller, ())

    def close(self) -> None:
        """Withdraw all declarations."""
        with self._clock:
            self._record_input("close")
            self.is_closed = True
            self._expected_skills.clear()
            for holder in self.declarations.holders():
                self.declarations.declare_exactly(holder, ())

    # Values from programs

    def write(self, name: str, content: Value | None, writer: str, evidence_s: float | None) -> None:
        """Write a variable as the main execution or an agent.

        Raises:
            NotDeclaredError: if the writer is the main execution, the variable is not declared, and the main execution
                is not a source of the variable.
            NotASourceError: if the writer is an agent that is not a source of the variable, or if the variable follows
                from poses or from other variables.
            ValueError: if the evidence lies in the future.
        """
        evidence_s = None if evidence_s is None else float(evidence_s)
        with self._clock:
            if self._event_writer.accepts_inputs:
                self._event_writer.write_input(writer, "write", variable=name, value=content, evidence_s=evidence_s)
            model = self._store.variables[name]
            if model.is_computed:
                origin = "other context-variables" if model.derived is not None else "poses"
                raise NotASourceError(f"{name!r} follows from {origin} and cannot be written")
            if writer == MAIN and not (MAIN in model.sources or name in self.declarations):
                raise NotDeclaredError(
                    f"{name!r} may be written by {' or '.join(model.sources)}: "
                    f"the main execution may write the variable only while it is declared{_agent_help(model)}"
                )
            if writer != MAIN and writer not in model.sources:
                self._event_writer.write(Kind.VARIABLE, name, "refused", value=content, source=writer)
                raise NotASourceError(f"{name!r} may be written by {' or '.join(model.sources)}, not by {writer!r}")
            self._store.write(self._reading_of(name, content, writer, evidence_s))

    def override(self, name: str, content: Value | None, for_s: float, detail: str) -> None:
        """Let the operator give a variable a value for some time; it is unknown in this time if `content` is None."""
        with self._clock:
            self._record_input("override", OPERATOR, variable=name, value=content, for_s=for_s, detail=detail)
            self._store.begin_override(name, content, detail, self._clock.now_s() + for_s)

    def clear_override(self, name: str) -> None:
        """End the override of a variable."""
        with self._clock:
            self._record_input("clear", OPERATOR, variable=name)
            self._store.end_override(name, "cleared")

    def adapt(self, agent: str, name: str, what: str, details: Mapping[str, object]) -> None:
        """Record an action of a loop.

        Args:
            agent: the agent that is responsible for the action.
            name: the name of the loop, course, parameter or tree.
            what: the action.
            details: plain values; none of them is None.
        """
        with self._clock:
            if self._event_writer.accepts_inputs:
                adaptation_text = json_text({"name": name, "what": what, "details": details})
                self._event_writer.write_input(agent, "adapt", told=adaptation_text)
            self._event_writer.write(Kind.ADAPTATION, name, what, agent=agent, **details)

    # Decisions

    def ask(self, request: DecisionRequest) -> ValueDecision:
        """Return a new decision. If context has the answer, the decision is answered at once."""
        with self._clock:
            number, now_s = self._next_decision_number(), self._clock.now_s()
            decision = ValueDecision(number=number, name=request.variable, asked_s=now_s, request=request)
            self._begin_decision("decide", decision)
            return decision

    def ask_preview(self, request: PreviewRequest) -> Preview:
        """Return a new preview. If context decides it, or if no wait or look can decide it, it is answered at once."""
        with self._clock:
            number, now_s, skill = self._next_decision_number(), self._clock.now_s(), self._skills[request.skill]
            preview = Preview(number=number, name=skill.name, asked_s=now_s, request=request, skill=skill)
            self._begin_decision("preview", preview)
            return preview

    def resume(self, decision: Decision) -> None:
        """Look up the answer again after the wait; answer the decision, or let the main execution look."""
        with self._clock:
            self._record_input("waited", number=decision.number)
            self._urgencies.answer(decision.number)
            self._look_up(decision)
            self._answer_or_look(decision)

    def conclude(self, decision: ValueDecision, content: Value | None) -> None:
        """Record the value that the main execution got by its own look.

        The value is kept as evidence of the main execution if the main execution may write the variable, the decision
        is not in shadow mode, and no skill has made the variable unknown since the look began.
        """
        shadow = decision.request.shadow
        with self._clock:
            self._record_input("found", number=decision.number, value=content)
            is_kept = not shadow and content is not None and self._may_keep(decision.name, decision.looked_s)
            look_details: dict[str, object] = {"found": content}
            if not decision.is_decided:
                look_details["kept"] = is_kept
            elif content is not None:
                look_details["agrees"] = content == decision.reading.content
            self._record_answer(decision, **look_details)
            if is_kept:
                self._store.write(self._reading_of(decision.name, content, MAIN, None, decision.looked_s))

    def record_look(self, preview: Preview, variable: str, content: Value | None) -> None:
        """Record the value that the main execution found for a variable, and answer the preview if it is decided now.

        The value is kept under the conditions under which a decision on the variable would keep it.
        """
        with self._clock:
            self._record_input("looked", number=preview.number, variable=variable, value=content)
            reading = self._reading_of(variable, content, MAIN, None, preview.looked_s)
            preview.looked[variable] = reading
            if content is not None and self._may_keep(variable, preview.looked_s):
                self._store.write(reading)
            self._look_up(preview)
            self._answer_or_look(preview)

    def abandon(self, decision: Decision, raised: str) -> None:
        """Record that the main execution stopped waiting or looking: the name of the error, or why."""
        with self._clock:
            is_preview = isinstance(decision, Preview)
            self._record_input("looked" if is_preview else "found", number=decision.number, raised=raised)
            if is_preview:
                self._look_up(decision)
                decision.explain(self._explain)
            self._record_answer(decision, raised=raised)

    # Slots

    def urgency(self, observer: str) -> Urgency:
        """Return how urgently the main execution needs the variables of an observer."""
        return self._urgencies.of(observer, self.declarations)

    @property
    def urgency_version(self) -> object:
        """Return a value that changes when the urgency of an observer may have changed."""
        return self._urgencies.version(self.declarations)

    def request_slots(self, resources: tuple[str, ...], grant: Callable[[], None]) -> int:
        """Request slots for the main execution; return the number of the request, which `release_slots` needs."""
        with self._clock:
            self._record_input("request", resources=list(resources))
            self._slot_request_count += 1
            self._tickets[self._slot_request_count] = self._slots.request(
                resources, lambda: (MAIN_EXECUTION_PRIORITY, 0), grant
            )
            return self._slot_request_count

    def release_slots(self, number: int) -> None:
        """Release slots, or cancel their request."""
        with self._clock:
            self._record_input("release", number=number)
            self._slots.release(self._tickets.pop(number))

    # Internal

    def _check_open(self) -> None:
        """Raise an error if the context manager is closed, so that no observer starts after the closing.

        Callers are within a step, so no other thread closes the context manager meanwhile.
        """
        if self.is_closed:
            raise RuntimeError("the context manager is closed: start() creates a new one")

    def _record_input(self, what: str, caller: str = MAIN, /, **details: object) -> None:
        self._event_writer.write_input(caller, what, **details)

    def _finish(self, number: int) -> None:
        _caller, skill = self._skills_under_way.pop(number)
        self._expectations.finish(number)
        self._event_triggers.finish(number, self.with_inputs(skill.monitor))
        self.declarations.declare_exactly(skill_holder(skill.name, number), ())
        self._forest.look_again()  # the skill may have acted until its end

    def _hold_expected(self, skills: list[str], caller: str) -> None:
        self._expected_skills[caller] = skills
        previews = (name for skill in skills for name in self._skills[skill].preview)
        self.declarations.declare_exactly(expectation_holder(caller), previews)

    def _begin_declaration(self, name: str, holder: str) -> None:
        self._event_writer.write(Kind.DECLARATION, name, "declared", holder=holder)
        self._forest.declare(name)

    def _end_declaration(self, name: str, holder: str) -> None:
        self._event_writer.write(Kind.DECLARATION, name, "withdrawn", holder=holder)
        self._forest.withdraw(name)

    def _next_decision_number(self) -> int:
        self._decision_count += 1
        return self._decision_count

    def _may_keep(self, name: str, looked_s: float) -> bool:
        """Return whether the value from a look may be kept: not if a skill has acted since the look began."""
        return looked_s >= self._store.cells[name].invalidated_s and self._may_write(name)

    def _may_write(self, name: str) -> bool:
        model = self._store.variables[name]
        return not model.is_computed and (MAIN in model.sources or name in self.declarations)

    def _reading_of(
        self, name: str, content: Value | None, writer: str, evidence_s: float | None, start_s: float | None = None
    ) -> Reading[Value]:
        """Return the reading that a program wrote or found; an unknown reading if it found no value."""
        now_s = self._clock.now_s()
        if evidence_s is None:
            evidence_s = now_s
        elif not -math.inf < evidence_s <= now_s:
            raise ValueError(f"evidence for {name!r} cannot be from {evidence_s}: the present instant is {now_s}")
        start_s = evidence_s if start_s is None else start_s
        if content is None:
            return Reading(
                name=name,
                reason=Reason.REJECTED,
                evidence_s=evidence_s,
                start_s=start_s,
                identified_s=now_s,
                source=writer,
            )
        expires_s = evidence_s + self._store.variables[name].valid_for_s
        return known_reading(name, content, evidence_s, start_s, now_s, expires_s, writer)

    def _begin_decision(self, what: str, decision: Decision) -> None:
        self._record_input(what, number=decision.number, **decision.request.input_details())
        self._look_up(decision)
        if decision.is_decided or decision.request.wait_up_to_s <= 0:
            self._answer_or_look(decision)
        else:
            self._urgencies.wait(decision.number, *decision.unknown)

    def _look_up(self, decision: Decision) -> None:
        decision.look_up(self._store, self._clock.now_s())

    def _answer_or_look(self, decision: Decision) -> None:
        """Answer a decision from context, or note that the main execution begins to look."""
        decision.explain(self._explain)
        if decision.missing:
            decision.looked_s = self._clock.now_s()
        else:
            self._record_answer(decision)

    def _record_answer(self, decision: Decision, **details: object) -> None:
        decision.is_over = True
        self._urgencies.answer(decision.number)  # the decision may have been abandoned while it waited
        skill = next(reversed(self._skills_under_way.values()))[1].name if self._skills_under_way else ""
        event_details = decision.event_details(skill, details)
        self._event_writer.write(decision.kind, decision.name, decision.how, **event_details)


def _agent_help(model: VariableModel) -> str:
    agents = [source for source in model.sources if source not in (MAIN, OBSERVER)]
    return f", and an agent writes with agent({agents[0]!r}).set" if agents else ""
