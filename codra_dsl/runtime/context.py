"""The context manager M (P1, sections 3.2 and 3.3): the one place where context is declared, kept and asked for."""

from __future__ import annotations

import difflib
import math
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Generic, Self, TypeVar, cast

from codra_dsl.collector import paused_collector
from codra_dsl.logic import Value
from codra_dsl.runtime.agents import Agent
from codra_dsl.runtime.cell import FOREVER_S, Cell, Reading, Reason
from codra_dsl.runtime.clock import Clock, LockedClock
from codra_dsl.runtime.decisions import Demand
from codra_dsl.runtime.forest import Forest
from codra_dsl.runtime.inputs import MAIN, OBSERVER, Inputs, NotDeclaredError
from codra_dsl.runtime.journal import Record, Scribe
from codra_dsl.runtime.journal.head import Head
from codra_dsl.runtime.model import Algorithm, ContextModel, SkillModel, VariableModel
from codra_dsl.runtime.observer import Observer
from codra_dsl.runtime.outline import Outline, manifest_of, outlined, package_folder
from codra_dsl.runtime.perception import CallError, Function, Perception, imported
from codra_dsl.runtime.slots import Slots
from codra_dsl.runtime.store import Store
from codra_dsl.runtime.why import Why, explain

VariableName = TypeVar("VariableName", bound=str)
SkillName = TypeVar("SkillName", bound=str)
Answer = TypeVar("Answer")

__all__ = ["MAIN", "Answer", "ContextManager", "NotDeclaredError", "Skill", "UnknownNameError"]


class UnknownNameError(LookupError):
    """A name that the spec does not declare."""


@dataclass(frozen=True, slots=True)
class _Surroundings:
    """What observers see of the context manager."""

    cells: Mapping[str, Cell]
    variables: Mapping[str, VariableModel]
    perception: Perception
    scribe: Scribe
    clock: Clock

    def now_s(self) -> float:
        return self.clock.now_s()


class Skill:
    """A skill under way: what it previews and monitors is declared until it ends."""

    def __init__(self, model: SkillModel, act: Callable[[str], None]) -> None:
        self.model = model
        self._act = act

    @contextmanager
    def acting(self) -> Iterator[None]:
        """Act: from here what the skill changes is unknown, and only evidence that is newer counts."""
        self._act(self.model.name)
        yield


class ContextManager(Generic[VariableName, SkillName]):
    """M of P1: keeps C_M(t), controls the observers, and answers the main execution.

    Use it as a Python context manager, so that all observers stop in the end. `get` never waits for anybody.

    Attributes:
        record: what happened.
        inputs: takes, one step each, what programs ask; for whoever replays a run.
    """

    @paused_collector()
    def __init__(
        self,
        model: ContextModel,
        *,
        clock: Clock,
        resources: Mapping[str, object],
        seed: int = 0,
        record: Record | None = None,
        find: Callable[[Algorithm], Function] = imported,
    ) -> None:
        """Build the forest; nothing runs before something is declared.

        Args:
            model: what a spec was compiled to.
            clock: real or simulated time.
            resources: the handle of each resource without slots, by name.
            seed: of the chance that jobs see as `job.random`.
            record: takes every change; by default one of its own.
            find: returns the perception function of an algorithm; by default the one that its `call` names.

        Raises:
            CallError: if a perception function cannot be imported, or a handle is missing or of no use.
        """
        _check_handles(model, resources)
        self.record = Record() if record is None else record
        self._name = model.name
        self._lock = threading.RLock()
        self._clock = LockedClock(clock, self._lock)
        self._now_s = clock.now_s
        self._notify = clock.notify
        self._scribe = Scribe(self.record, self._clock, lambda: self._clock.steps)
        self._clock.is_late = lambda: self._scribe.tell_input("clock", "late")
        self._skills = {skill.name: skill for skill in model.skills}
        self._store = Store(model.variables, self._clock, self._scribe, self._changed)
        self._cells = self._store.cells
        self._slots = Slots(self._clock, {resource.name: resource for resource in model.resources})
        self._perception = Perception(
            clock=self._clock, slots=self._slots, handles=resources, seed=seed, scribe=self._scribe, find=find
        )
        cells, variables = self._store.cells, self._store.variables
        surroundings = _Surroundings(cells, variables, self._perception, self._scribe, self._clock)
        self._forest = Forest(model.observers, surroundings, self._clock, self._store.write, self._observer_stopped)
        for observer in self._forest.observers.values():
            for branch in observer.branches:
                self._perception.prepare(branch.algorithm)
        self.inputs = Inputs(
            clock=self._clock,
            scribe=self._scribe,
            store=self._store,
            forest=self._forest,
            slots=self._slots,
            skills=self._skills,
            explain=self._explained,
        )
        self._closed = False
        self.record.begin(lambda: self._head(seed))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Withdraw everything, stop all observers and cancel their jobs; nothing can be declared any more.

        A decision that waits for an observer in another thread waits no longer.
        """
        with self._clock:
            if not self._closed:
                self._closed = True
                self.inputs.close()
                self.record.end()
                self._clock.notify()

    # What the main execution declares (P1, Equation 4)

    def declare(self, name: VariableName, value: object = None) -> None:
        """Take a variable into C_E(t), until it is withdrawn; declaring twice changes nothing.

        Args:
            name: the variable.
            value: what the main execution knows of it already; None if nothing.

        Raises:
            NotOfTypeError: if the value is not what the spec declares; then the variable is not declared.
            RuntimeError: if the context manager is closed.
        """
        model = self._model(name)
        content = None if value is None else model.type.convert(value)
        with self._clock:
            self._check_open()
            self.inputs.declare(name)
            if value is not None:
                self.inputs.write(name, content, MAIN, None)

    def withdraw(self, name: VariableName) -> None:
        """Take back what `declare` said; what a skill declares stays declared."""
        self._model(name)
        self.inputs.withdraw(name)

    def expect(self, *skills: SkillName) -> None:
        """Say which skills come next: what each previews is declared until it begins or others are expected."""
        for name in skills:
            self._skill(name)
        with self._clock:
            self._check_open()
            self.inputs.expect(skills)

    @contextmanager
    def skill(self, name: SkillName) -> Iterator[Skill]:
        """Run a skill: what it previews and monitors is declared until it ends; its expectation is fulfilled."""
        model = self._skill(name)
        with self._clock:
            self._check_open()
            number = self.inputs.begin(name)
        try:
            yield Skill(model, self.inputs.act)
        finally:
            self.inputs.finish(number)

    def modelled(self) -> tuple[str, ...]:
        """Return C_M, all variables of the spec (P1, Equation 3)."""
        return tuple(self._store.variables)

    def declared(self) -> frozenset[str]:
        """Return C_E(t), what the main execution declares now."""
        with self._lock:
            return self.inputs.declarations.names()

    def running(self) -> frozenset[str]:
        """Return the names of the observers that run now."""
        with self._lock:
            return self._forest.running()

    def in_force(self) -> frozenset[str]:
        """Return C_M(t), what is declared or needed by a running observer (P1, Equation 8)."""
        with self._lock:
            needed = {need for name in self._forest.running() for need in self._forest.observers[name].needs()}
            return self.inputs.declarations.names() | needed

    # What is known

    def get(self, name: VariableName) -> Reading[Any]:
        """Return what is known of a variable now; it never waits.

        Of a variable that was never observed, or that is stale, `detail` tells what keeps it from being observed now.
        """
        try:
            reading = self._cells[name].reading
        except KeyError:
            raise _unknown("variable", name, self._cells) from None
        if reading.expires_s != FOREVER_S and reading.expires_s <= (now_s := self._now_s()):
            reading = reading.at(now_s)
        return reading if reading.reason is None else self._explained(reading)

    def obstacle(self, name: VariableName) -> str:
        """Return what keeps a variable from being observed now, known or not; empty if an algorithm can look.

        It is the first condition that does not hold, of each algorithm if there are alternatives, or that the observer
        does not run, or whose the variable is to write if none observes it.
        """
        model = self._model(name)
        obstacle = self._forest.obstacle(name)
        return f"for {' or '.join(model.sources)} to write" if obstacle is None else obstacle

    def why(self, name: VariableName, *, at_s: float | None = None) -> Why:
        """Return why a variable is what it is: from its value to the evidence, or from unknown to what is missing.

        Args:
            name: the variable.
            at_s: an instant of the past that the record still holds; now, if None.

        Raises:
            ValueError: if the instant lies in the future, or before what the record holds.
        """
        self._model(name)
        with self._clock:
            now_s, record = self._clock.now_s(), self.record.copy()
        if at_s is not None and not at_s <= now_s:
            raise ValueError(f"it is {now_s} now: what is at {at_s} is not known yet")
        return explain(self._outlined(), record.ledger, name, now_s if at_s is None else at_s)

    def set(self, name: VariableName, value: object, *, evidence_s: float | None = None) -> None:
        """Write a variable as the main execution.

        Args:
            name: the variable.
            value: what the main execution knows of it.
            evidence_s: when the evidence was taken; now, if None. A value with newer evidence stays.

        Raises:
            NotDeclaredError: if it is for others to write and is not declared.
            NotOfTypeError: if the value is not what the spec declares.
            ValueError: if the evidence lies in the future.
        """
        try:
            content = self._store.variables[name].type.convert(value)
        except KeyError:
            raise _unknown("variable", name, self._cells) from None
        self.inputs.write(name, content, MAIN, evidence_s)

    def agent(self, name: str) -> Agent[VariableName]:
        """Return the handle by which an outside writer writes the variables that name it as `source`.

        Raises:
            UnknownNameError: if no variable does.
        """
        names = {source for model in self._store.variables.values() for source in model.sources} - {MAIN, OBSERVER}
        if name not in names:
            raise _unknown("variable whose source is", name, sorted(names))
        return Agent(name, self._write_as)

    def history(self, name: VariableName) -> tuple[Reading[Any], ...]:
        """Return the kept readings of a variable, by the instant of their evidence."""
        self._model(name)
        with self._lock:
            return self._store.cells[name].history()

    def decide(
        self,
        name: VariableName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = math.inf,
        since_s: float = -math.inf,
        wait_up_to_s: float = 0.0,
        shadow: bool = False,
    ) -> Any | Answer:
        """Answer a decision from context, or fall back to sequential perception (P1, section 3.3).

        Args:
            name: the variable that the decision needs.
            otherwise: looks as the robot did without observers. It returns a value of the variable, or None if it found
                none. What it finds is kept as evidence if the main execution may `set` the variable.
            max_age_s: evidence that is older does not do.
            since_s: evidence that began to be taken before this instant does not do, e.g. before an action ended.
            wait_up_to_s: how long to wait for observers before falling back.
            shadow: look in any case, return what was found, and record whether the context agrees; nothing is kept, so
                that the context goes on as if nobody had looked.

        Returns:
            The value from context, or what `otherwise` returned.

        Raises:
            NotOfTypeError: if `otherwise` returns what is no value of the variable.
        """
        model = self._model(name)
        demand = Demand(
            variable=name,
            max_age_s=float(max_age_s),
            since_s=float(since_s),
            wait_up_to_s=float(wait_up_to_s),
            shadow=shadow,
        )
        decision = self.inputs.ask(demand)
        if not decision.met and wait_up_to_s > 0:
            self._clock.wait_until(
                lambda: self._closed or demand.is_met(self._reading(name), self._clock.now_s()), wait_up_to_s
            )
            self.inputs.resume(decision)
        if decision.is_answered:
            return decision.reading.content
        try:
            found = otherwise()
            content = None if found is None else model.type.convert(found)
        except BaseException as error:
            self.inputs.conclude(decision, None, raised=type(error).__name__)
            raise
        self.inputs.conclude(decision, content)
        return found

    @contextmanager
    def slot(self, *resources: str) -> Iterator[None]:
        """Use slots of shared resources as the main execution: it goes before every observer.

        It waits for the job that has the slot, for the longest timeout of those at most.

        Raises:
            UnknownNameError: if the spec has no such resource, or one without slots.
            RuntimeError: if the clock was closed before the slots were free.
        """
        for resource in resources:
            if resource not in self._slots.resources:
                raise _unknown("resource", resource, self._slots.resources)
            if self._slots.resources[resource] == math.inf:
                raise UnknownNameError(
                    f"resource {resource!r} has no slots: use its handle, or say `slots: 1` where the spec declares it"
                )
        granted = threading.Event()

        def grant() -> None:
            granted.set()
            self._clock.notify()

        number = self.inputs.request_slots(resources, grant)
        try:
            if not self._clock.wait_until(granted.is_set, math.inf):
                raise RuntimeError("the clock was closed before the slots were free")
            yield
        finally:
            self.inputs.release_slots(number)

    # Within

    def _head(self, seed: int) -> Head:
        """Return what a journal says of this run."""
        manifest = manifest_of(package_folder(self))
        return Head(
            spec=self._name,
            file=str(manifest.get("spec", "")),
            model=str(manifest.get("model", "")),
            seed=seed,
            start_s=self._clock.now_s(),
            outline=self._outlined(),
        )

    def _outlined(self) -> Outline:
        return outlined(
            self._name,
            self._store.variables.values(),
            self._forest.observers.values(),
            self._skills.values(),
            package_folder(self),
        )

    def _reading(self, name: str) -> Reading[Value]:
        try:
            return self._store.reading(name)
        except KeyError:
            raise _unknown("variable", name, self._store.cells) from None

    def _check_open(self) -> None:
        """Refuse what would start observers after the end; within a step, so that no other thread closes meanwhile."""
        if self._closed:
            raise RuntimeError("the context manager is closed: start() makes a new one")

    def _explained(self, reading: Reading[Value]) -> Reading[Any]:
        """Return a reading; one that nobody has renewed tells what keeps it from being observed now."""
        if reading.reason not in (Reason.NEVER_OBSERVED, Reason.STALE):
            return reading
        return replace(reading, detail=self.obstacle(cast("VariableName", reading.name)))

    def _model(self, name: str) -> VariableModel:
        if name not in self._store.variables:
            raise _unknown("variable", name, self._store.variables)
        return self._store.variables[name]

    def _skill(self, name: str) -> SkillModel:
        if name not in self._skills:
            raise _unknown("skill", name, self._skills)
        return self._skills[name]

    def _changed(self, name: str, is_renewed: bool) -> None:
        self._forest.changed(name, is_renewed)
        self._notify()

    def _write_as(self, name: str, value: object, writer: str, evidence_s: float | None) -> None:
        self.inputs.write(name, self._model(name).type.convert(value), writer, evidence_s)

    def _observer_stopped(self, observer: Observer) -> None:
        for name in observer.model.identifies:
            forgets = self._store.variables[name].when_unobservable == "forget"
            if forgets and self._store.reading(name).known:
                self._store.make_unknown(name, Reason.WITHDRAWN, observer.name, MAIN)


def _check_handles(model: ContextModel, handles: Iterable[str]) -> None:
    """Refuse a handle that nothing reads: its name is misspelt, or its resource has slots instead."""
    slots = {resource.name: resource.slots for resource in model.resources}
    for name in handles:
        if name not in slots:
            raise CallError(str(_unknown("resource", name, slots)))
        if slots[name] is not None:
            raise CallError(f"resource {name!r} has slots and takes no handle: leave it out of `resources`")


def _unknown(kind: str, name: str, names: Iterable[str]) -> UnknownNameError:
    similar = difflib.get_close_matches(str(name), list(names), n=1)
    hint = f": did you mean {similar[0]!r}?" if similar else ""
    return UnknownNameError(f"the spec has no {kind} {name!r}{hint}")
