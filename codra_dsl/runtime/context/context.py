"""The context manager M (P1, sections 3.2 and 3.3): the one place where context is declared, stored and read."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, Self, cast

from codra_dsl.collector import paused_collector
from codra_dsl.logic import Term, Value, known
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.agents import NO_KNOWLEDGE, Agent
from codra_dsl.runtime.context.answers import AnsweringContext, SkillName, VariableName
from codra_dsl.runtime.context.commands import NotDeclaredError
from codra_dsl.runtime.context.components import Components
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.context.overrides import Overrides
from codra_dsl.runtime.context.package_files import manifest_of, package_folder
from codra_dsl.runtime.context.shared_acquisition import shared_declaration
from codra_dsl.runtime.context.skills import Skill
from codra_dsl.runtime.context.slots import MainExecutionSlots
from codra_dsl.runtime.context.summarise import summarise_spec
from codra_dsl.runtime.errors import NotASourceError, UnknownNameError, unknown_name_error
from codra_dsl.runtime.journal import Event, EventLog
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge, KnowledgeModel, nodes_of_variables
from codra_dsl.runtime.observers.waiting import wait_for
from codra_dsl.runtime.perception import Cost, Function, check_handles, imported
from codra_dsl.runtime.values.cell import FOREVER_S, Reading
from codra_dsl.runtime.values.declarations import MAIN
from codra_dsl.runtime.values.derived import with_inputs
from codra_dsl.runtime.values.model import Algorithm, SkillModel, VariableModel
from codra_dsl.runtime.why import Why, explain

__all__ = ["MAIN", "ContextManager", "NotDeclaredError", "Skill", "UnknownNameError"]


class ContextManager(AnsweringContext[VariableName, SkillName], Overrides[VariableName]):
    """M of P1: keeps C_M(t), controls the observers, and answers the main execution.

    Use it as a Python context manager, so that all observers stop in the end. `get` never waits.

    Attributes:
        record: the event log.
        clock: the clock from the arguments.
        model: the compiled spec.
        commands: executes the commands of programs, one step each; sessions and replays use it.
        hosts: executes the steps of other programs that run perception functions.
        knowledge: the graph, if the spec declares one.
    """

    @paused_collector()
    def __init__(
        self,
        model: ContextModel,
        *,
        clock: Clock,
        resources: Mapping[str, object],
        seed: int = 0,
        record: EventLog | None = None,
        find: Callable[[Algorithm], Function] = imported,
        knowledge: KnowledgeModel | None = None,
        hosts_here: bool = False,
    ) -> None:
        """Build the forest; no observer runs before a variable is declared.

        Args:
            model: the compiled spec.
            clock: real or simulated time.
            resources: the handle of each resource without slots, by name; handles that the site states may be left out.
            seed: the seed of `job.random` in jobs.
            record: the event log for every change; by default a new one.
            find: returns the perception function of an algorithm; by default, the function that `call` of the algorithm
                names.
            knowledge: the knowledge graph and its agents in the spec; None if the spec declares no graph.
            hosts_here: whether this program also runs the functions of algorithms that have a host, as simulations do.

        Raises:
            CallError: if a perception function cannot be imported, or a handle is missing or not usable.
        """
        check_handles(model.resources, resources)
        self.record = EventLog() if record is None else record
        self.model = model
        components = Components(
            model, clock=clock, resources=resources, record=self.record, seed=seed, find=find, hosts_here=hosts_here
        )
        self._components = components
        self._lock, self._clock, self.clock, self._now_s = components.lock, components.clock, clock, clock.now_s
        self._store, self._cells, self._forest = components.store, components.store.cells, components.forest
        self._perception, self._expectations = components.perception, components.expectations
        self._subscriptions, self.commands = components.subscriptions, components.commands
        self.hosts = components.hosts
        self._skills = components.skills
        self._main_execution_slots = MainExecutionSlots(components.slots, self.commands, self._clock)
        self._main_execution_numbers = itertools.count(2)
        self._nodes = {} if knowledge is None else nodes_of_variables(knowledge, model.variables)
        with self._clock:  # so that the graph begins at the same instant as the journal
            self.record.begin(lambda: self._run_header(seed))
            self._knowledge = None if knowledge is None else components.create_knowledge(knowledge)
            self._store.derivations.start()
            for host in sorted(self.hosts.names) if hosts_here else ():
                self.hosts.connect(host, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Withdraw all declarations, stop all observers and cancel their jobs; after that nothing can be declared.

        A decision that waits for an observer in another thread stops waiting. While the interpreter shuts down, this
        method does nothing: threads that held the lock no longer run, and processes of isolated algorithms end by
        themselves.
        """
        if sys.is_finalizing():
            return
        with self._clock:
            if not self.commands.is_closed:
                self.commands.close()
                self.record.end()
                self._clock.notify()
                self._subscriptions.wake_followers()
        self._perception.close()

    # Declarations of the main execution (P1, Equation 4)

    def declare(self, name: VariableName, value: Any = None) -> None:
        """Add a variable to C_E(t) until it is withdrawn; a repeated declaration has no effect.

        Args:
            name: the variable.
            value: its value, if the main execution knows it already; otherwise None.

        Raises:
            NotOfTypeError: if the value does not have the declared type; then the variable is not declared.
            RuntimeError: if the context manager is closed.
        """
        model = self._model(name)
        content = None if value is None else model.type.convert(value)
        with self._clock:
            self.commands.declare(name)
            if value is not None:
                self.commands.write(name, content, MAIN, None)

    def withdraw(self, name: VariableName) -> None:
        """Undo `declare`; a variable that a skill declares stays declared."""
        self._model(name)
        self.commands.withdraw(name)

    def expect(self, *skills: SkillName) -> None:
        """Set the skills that come next: their previews are declared until the skills begin or others are expected."""
        for name in skills:
            self._skill(name)
        self.commands.expect(skills)

    @contextmanager
    def skill(self, name: SkillName) -> Iterator[Skill]:
        """Run a skill. Its previews and monitored variables are declared until its end; it is no longer expected."""
        model = self._skill(name)
        number = self.commands.begin(name)
        try:
            yield self._skill_under_way(model, number)
        finally:
            self.commands.finish(number)
            self._subscriptions.remove_skill(number)

    def modelled(self) -> tuple[str, ...]:
        """Return C_M, all variables of the spec (P1, Equation 3)."""
        return tuple(self._store.variables)

    def skills(self) -> Mapping[str, SkillModel]:
        """Return the declared skills, by name."""
        return MappingProxyType(self._skills)

    def declared(self) -> frozenset[str]:
        """Return C_E(t), the variables that the main execution declares now."""
        with self._lock:
            return self.commands.declarations.names()

    def running(self) -> frozenset[str]:
        """Return the names of the observers that run now."""
        with self._lock:
            return self._forest.running()

    def in_force(self) -> frozenset[str]:
        """Return C_M(t), the variables that are declared or needed by a running observer (P1, Equation 8)."""
        with self._lock:
            needed_variables = {
                need for name in self._forest.running() for need in self._forest.observers[name].needs()
            }
            return with_inputs(self.commands.declarations.names(), self._cells) | needed_variables

    def spent(self) -> Mapping[str, Cost]:
        """Return a mapping from the name of each observer to its costs and results so far."""
        with self._lock:
            observers = self._forest.observers.items()
            return {
                name: self._perception.total_cost(branch.algorithm for branch in observer.branches)
                for name, observer in observers
            }

    # Values

    def get(self, name: VariableName) -> Reading[Any]:
        """Return the reading of a variable now, without waiting.

        If the variable was never observed or is stale, `detail` states why it cannot be observed now.
        """
        try:
            reading = self._cells[name].reading
        except KeyError:
            raise unknown_name_error("variable", name, self._cells) from None
        if reading.expires_s != FOREVER_S and reading.expires_s <= (now_s := self._now_s()):
            reading = self._cells[name].now(now_s)
        return reading if reading.reason is None else self._components.with_obstacle(reading)

    def readings(self, names: Iterable[VariableName]) -> Mapping[str, Reading[Any]]:
        """Return the readings of several variables at one instant."""
        with self._lock:
            return {name: self._reading(name) for name in names}

    def obstacle(self, name: VariableName) -> str:
        """Return why a variable, known or unknown, cannot be observed now; empty if an algorithm can look.

        The text states for each algorithm the first condition that does not hold. If the observer of the variable does
        not run, the text states this. If no observer identifies the variable, the text names the sources of the
        variable.
        """
        self._model(name)
        return self._components.obstacle(name)

    def why(self, name: VariableName | str, *, at_s: float | None = None, before: Event | None = None) -> Why:
        """Return the explanation of a variable: its value and the evidence, or the reason why it is unknown.

        Args:
            name: the variable; also a skill, to explain its preview, or `preview of SKILL` if something else has this
                name; a course, a parameter or an action of a loop; or an element of knowledge.
            at_s: a past instant that the event log still covers; now, if None.
            before: an event of the event log, in place of `at_s`, to explain the state just before it: a decision, for
                example, can have the instant of the value that its look found.

        Raises:
            UnknownNameError: if the spec does not declare the name, and no event up to the instant has this name.
            ValueError: if the instant lies in the future, or before the start of the event log, or if the event log
                does not have the event.
        """
        with self._lock:
            now_s, record = self._clock.now_s(), self.record.copy()
        at_s = before.instant_s if before is not None else now_s if at_s is None else at_s
        if not at_s <= now_s:
            raise ValueError(f"the instant {at_s} lies in the future: it is {now_s} now")
        return explain(self._spec_summary(), partial(record.latest_events, before=before), name, at_s)

    def set(self, name: VariableName, value: Any, *, evidence_s: float | None = None) -> None:
        """Write a variable as the main execution.

        Args:
            name: the variable.
            value: its value.
            evidence_s: when the evidence was taken; now, if None. If the variable has a value from newer evidence, the
                variable keeps this value.

        Raises:
            NotDeclaredError: if the variable is not declared, and the main execution is not a source of the variable.
            NotOfTypeError: if the value does not have the declared type.
            ValueError: if the evidence lies in the future.
        """
        try:
            content = self._store.variables[name].type.convert(value)
        except KeyError:
            raise unknown_name_error("variable", name, self._cells) from None
        self.commands.write(name, content, MAIN, evidence_s)

    def agent(self, name: str) -> Agent[VariableName, AgentHandle]:
        """Return the handle with which an agent writes the variables that list this agent under `source`.

        With a knowledge graph, the agents are those of the graph, and only one handle per agent can be open. The main
        execution is one of these agents if it is a source or requests tasks.

        Raises:
            UnknownNameError: if no variable lists the agent under `source`, and the graph has no such agent.
            AgentTakenError: if there is a knowledge graph and a handle of the agent is open.
        """
        if self._knowledge is not None:
            acquisition = shared_declaration(
                self.commands, f"agent {name}", self._variables_of_wakes(name, self._knowledge.model)
            )
            return Agent(name, self._write_as, self._knowledge, acquisition)
        if name not in self.model.agents:
            raise unknown_name_error("variable whose source is", name, sorted(self.model.agents))
        return Agent(name, self._write_as)

    def _variables_of_wakes(self, agent: str, model: KnowledgeModel) -> list[str]:
        """Return the observed variables in the `wakes` patterns of an agent."""
        wakes = (pattern for agent_model in model.agents if agent_model.name == agent for pattern in agent_model.wakes)
        attributes = {name for pattern in wakes if isinstance(pattern, Term) for name in pattern.variables()}
        names = sorted(self.model.observed_variables)
        return [name for name in names if f"{self._nodes[name]}.{name}" in attributes]

    @property
    def knowledge(self) -> Knowledge:
        """Return the knowledge graph; the context-variables are attributes of its nodes.

        Raises:
            LookupError: if the spec declares no knowledge graph.
        """
        if self._knowledge is None:
            raise LookupError(f"the spec {self.model.name!r} {NO_KNOWLEDGE}")
        return self._knowledge

    def history(self, name: VariableName) -> tuple[Reading[Any], ...]:
        """Return the stored readings of a variable, in the order of their evidence.

        The readings of a derived variable are in the order in which they were derived.
        """
        self._model(name)
        with self._lock:
            return self._store.history(name)

    def subscribe(
        self, names: VariableName | Iterable[VariableName], callback: Callable[[Reading[Any]], object]
    ) -> Subscription:
        """Call back with the present reading of one or several variables, and with each change.

        A change is another value, the loss of the value, or another reason; newer evidence for the same value is not a
        change. Subscribing does not declare the variable.

        The callback runs without any lock, one call at a time, in the order of the changes. In real time it runs in a
        separate thread. In simulated time it runs in an event at the instant of the change, and must not wait. Its
        exceptions are logged. At most 1,000 changes wait for a slow callback. If there are more, the oldest change is
        dropped and counted in `Subscription.dropped`.
        """
        unique_names = dict.fromkeys([names] if isinstance(names, str) else names)
        with self._lock:  # not a step: it changes nothing that a journal records
            return self._subscriptions.subscribe([self._reading(name) for name in unique_names], callback)

    def follow(self, name: VariableName, callback: Callable[[], object]) -> Subscription:
        """Call back, in the same way as `subscribe`, for each new reading, even if only the evidence is newer."""
        self._model(name)
        with self._lock:
            return self._subscriptions.follow(name, callback)

    def wait_for(self, condition: VariableName | Term, timeout_s: float) -> bool:
        """Wait until a variable is known, or a condition over variables holds; return whether this happened in time.

        Args:
            condition: a variable, or a condition built with `codra_dsl.runtime.values.conditions`.
            timeout_s: the longest wait. Waiting does not declare variables.
        """
        term = condition if isinstance(condition, Term) else known(condition)
        for name in sorted(term.variables()):
            self._model(name)
        return wait_for(term, self._store.cells, self._clock, timeout_s)

    @contextmanager
    def slot(self, *resources: str) -> Iterator[None]:
        """Use slots of shared resources as the main execution, which gets slots before every observer.

        The call waits for the jobs that hold the slots, at most for the longest timeout of these jobs. Inside the
        `with` block the same thread may request the same slots again, without effect.

        Raises:
            UnknownNameError: if the spec has no such resource, or the resource has no slots.
            RuntimeError: if the thread has slots and requests others, because two threads could wait for each other
                forever; or if the clock was closed before the slots were free.
        """
        with self._main_execution_slots.hold(resources):
            yield

    def next_main_execution_name(self) -> str:
        """Return the name of a further main execution, for its declarations; each call returns a new name."""
        return f"{MAIN} {next(self._main_execution_numbers)}"

    # Internal

    def _skill_under_way(self, model: SkillModel, number: int) -> Skill:
        return Skill(
            model,
            number,
            commands=self.commands,
            expectations=self._expectations,
            clock=self._clock,
            decide=lambda name, look: self.decide(cast("VariableName", name), look),
            subscribe=lambda callback: self._subscriptions.subscribe_to_skill(number, callback),
        )

    def _run_header(self, seed: int) -> RunHeader:
        """Return the header of this run for a journal."""
        manifest = manifest_of(package_folder(self))
        return RunHeader.of_run(self._spec_summary(), manifest, seed=seed, start_s=self._clock.now_s())

    def _spec_summary(self) -> SpecSummary:
        summary = summarise_spec(
            self.model.name,
            self._store.variables.values(),
            self._forest.observers.values(),
            self._skills.values(),
            package_folder(self),
        )
        return replace(summary, nodes=self._nodes)

    def _reading(self, name: str) -> Reading[Value]:
        return self._store.reading(self._model(name).name)

    def _model(self, name: str) -> VariableModel:
        if name not in self._store.variables:
            raise unknown_name_error("variable", name, self._store.variables)
        return self._store.variables[name]

    def _skill(self, name: str) -> SkillModel:
        if name not in self._skills:
            raise unknown_name_error("skill", name, self._skills)
        return self._skills[name]

    def _write_as(self, name: str, value: object, writer: str, evidence_s: float | None) -> None:
        content = self._model(name).type.convert(value)
        try:
            self.commands.write(name, content, writer, evidence_s)
        except NotASourceError as error:
            if self._knowledge is not None:
                self._knowledge.audit_refusal(writer, str(error))
            raise
