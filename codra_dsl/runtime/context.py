"""The context manager M (P1, sections 3.2 and 3.3): the one place where context is declared, kept and asked for."""

from __future__ import annotations

import difflib
import math
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, Self, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Cell, Reading, Reason
from codra_dsl.runtime.clock import Clock, LockedClock
from codra_dsl.runtime.declarations import Declarations
from codra_dsl.runtime.forest import Forest
from codra_dsl.runtime.journal import Kind, Record, Scribe
from codra_dsl.runtime.model import ContextModel, NotOfTypeError, SkillModel, VariableModel
from codra_dsl.runtime.observer import Observer
from codra_dsl.runtime.perception import Perception
from codra_dsl.runtime.slots import MAIN_EXECUTION, Slots
from codra_dsl.runtime.store import Store

VariableName = TypeVar("VariableName", bound=str)
SkillName = TypeVar("SkillName", bound=str)
Answer = TypeVar("Answer")

MAIN = "main_execution"
_EXPECTED = "expected"


class UnknownNameError(LookupError):
    """A name that the spec does not declare."""


class NotDeclaredError(PermissionError):
    """The main execution wrote a variable that is not its own and that it has not declared."""


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

    def __init__(self, model: SkillModel, invalidate: Callable[[SkillModel], None]) -> None:
        self.model = model
        self._invalidate = invalidate

    @contextmanager
    def acting(self) -> Iterator[None]:
        """Act: from here what the skill changes is unknown, and only evidence that is newer counts."""
        self._invalidate(self.model)
        yield


class ContextManager(Generic[VariableName, SkillName]):
    """M of P1: keeps C_M(t), controls the observers, and answers the main execution.

    Use it as a Python context manager, so that all observers stop in the end. `get` never waits for anybody.
    """

    def __init__(
        self,
        model: ContextModel,
        *,
        clock: Clock,
        resources: Mapping[str, object],
        seed: int = 0,
        record: Record | None = None,
    ) -> None:
        """Build the forest; nothing runs before something is declared.

        Args:
            model: what a spec was compiled to.
            clock: real or simulated time.
            resources: the handle of each resource without slots, by name.
            seed: of the chance that jobs see as `job.random`.
            record: takes every change; by default one of its own.

        Raises:
            CallError: if a perception function cannot be imported or a handle is missing.
        """
        self.record = Record() if record is None else record
        self._lock = threading.RLock()
        self._clock = LockedClock(clock, self._lock)
        self._scribe = Scribe(self.record, self._clock)
        self._skills = {skill.name: skill for skill in model.skills}
        self._store = Store(model.variables, self._clock, self._scribe, self._changed)
        self._slots = Slots(self._clock, {resource.name: resource for resource in model.resources})
        self._perception = Perception(self._clock, self._slots, resources, seed, self._scribe)
        cells, variables = self._store.cells, self._store.variables
        surroundings = _Surroundings(cells, variables, self._perception, self._scribe, self._clock)
        self._forest = Forest(model.observers, surroundings, self._clock, self._store.write, self._observer_stopped)
        for observer in self._forest.observers.values():
            for branch in observer.branches:
                self._perception.prepare(branch.algorithm)
        self._declarations = Declarations(self._enter, self._leave)
        self._expected: list[str] = []
        self._skills_begun = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Withdraw everything, stop all observers and cancel their jobs."""
        with self._lock:
            self._expected.clear()
            for holder in self._declarations.holders():
                self._declarations.hold(holder, ())

    # What the main execution declares (P1, Equation 4)

    def declare(self, name: VariableName, value: object = None) -> None:
        """Take a variable into C_E(t), until it is withdrawn; declaring twice changes nothing.

        Args:
            name: the variable.
            value: what the main execution knows of it already; None if nothing.

        Raises:
            NotOfTypeError: if the value is not what the spec declares; then the variable is not declared.
        """
        model = self._model(name)
        content = None if value is None else model.type.convert(value)
        with self._lock:
            self._declarations.hold(MAIN, (*self._declarations.of(MAIN), name))
            if value is not None:
                self._write(name, content, self._clock.now_s())

    def withdraw(self, name: VariableName) -> None:
        """Take back what `declare` said; what a skill declares stays declared."""
        self._model(name)
        with self._lock:
            self._declarations.hold(MAIN, (other for other in self._declarations.of(MAIN) if other != name))

    def expect(self, *skills: SkillName) -> None:
        """Say which skills come next: what each previews is declared until it begins or others are expected."""
        for name in skills:
            self._skill(name)
        with self._lock:
            self._hold_expected(skills)

    @contextmanager
    def skill(self, name: SkillName) -> Iterator[Skill]:
        """Run a skill: what it previews and monitors is declared until it ends; its expectation is fulfilled."""
        model = self._skill(name)
        with self._lock:
            self._skills_begun += 1
            holder = f"skill {name} {self._skills_begun}"
            self._declarations.hold(holder, (*model.preview, *model.monitor))
            self._hold_expected([other for other in self._expected if other != name])
        try:
            yield Skill(model, self._invalidate)
        finally:
            with self._lock:
                self._declarations.hold(holder, ())

    def modelled(self) -> tuple[str, ...]:
        """Return C_M, all variables of the spec (P1, Equation 3)."""
        return tuple(self._store.variables)

    def declared(self) -> frozenset[str]:
        """Return C_E(t), what the main execution declares now."""
        with self._lock:
            return self._declarations.names()

    def running(self) -> frozenset[str]:
        """Return the names of the observers that run now."""
        with self._lock:
            return self._forest.running()

    def in_force(self) -> frozenset[str]:
        """Return C_M(t), what is declared or needed by a running observer (P1, Equation 8)."""
        with self._lock:
            needed = {need for name in self._forest.running() for need in self._forest.observers[name].needs()}
            return self._declarations.names() | needed

    # What is known

    def get(self, name: VariableName) -> Reading[Any]:
        """Return what is known of a variable now; it never waits."""
        return self._reading(name)

    def set(self, name: VariableName, value: object) -> None:
        """Write a variable as the main execution, with evidence of this instant.

        Raises:
            NotDeclaredError: if others identify it and it is not declared.
            NotOfTypeError: if the value is not what the spec declares.
        """
        model = self._model(name)
        content = model.type.convert(value)
        with self._lock:
            if not self._may_write(name):
                raise NotDeclaredError(f"{name!r} is for {', '.join(model.sources)} to write: declare it first")
            self._write(name, content, self._clock.now_s())

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
            otherwise: looks as the robot did without observers. What it finds is kept as evidence, if it is a value of
                the variable and the main execution may write that.
            max_age_s: evidence that is older does not do.
            since_s: evidence that began to be taken before this instant does not do, e.g. before an action ended.
            wait_up_to_s: how long to wait for observers before falling back.
            shadow: look in any case, return what was found, and record whether the context agrees; nothing is kept, so
                that the context goes on as if nobody had looked.

        Returns:
            The value from context, or what `otherwise` returned.
        """
        self._model(name)
        asked_s = self._clock.now_s()
        reading = self._reading(name)

        def answered() -> bool:
            nonlocal reading
            reading = self._reading(name)
            is_new = reading.start_s >= since_s and reading.age_s(self._clock.now_s()) <= max_age_s
            return reading.known and is_new

        known = answered() or (wait_up_to_s > 0 and self._clock.wait_until(answered, wait_up_to_s))
        if known and not shadow:
            self._decided(name, "answered", asked_s, reading)
            return reading.value
        before, looked_s = reading, self._clock.now_s()
        try:
            found = otherwise()
        except BaseException as error:
            self._decided(name, "fell_back", asked_s, before, raised=type(error).__name__)
            raise
        content = self._content(name, found)
        if known:
            self._decided(name, "shadowed", asked_s, before, agrees=content == before.content)
        else:
            self._decided(name, "fell_back", asked_s, before, found=content)
        if not shadow:
            self._keep(name, content, looked_s)
        return found

    @contextmanager
    def slot(self, *resources: str) -> Iterator[None]:
        """Use slots of shared resources as the main execution: it goes before every observer.

        It waits for the job that has the slot, for the longest timeout of those at most.

        Raises:
            UnknownNameError: if the spec has no such resource.
            RuntimeError: if the clock was closed before the slots were free.
        """
        for resource in resources:
            if resource not in self._slots.resources:
                raise _unknown("resource", resource, self._slots.resources)
        granted = threading.Event()

        def grant() -> None:
            granted.set()
            self._clock.notify()

        with self._lock:
            ticket = self._slots.request(resources, MAIN_EXECUTION, grant)
        try:
            if not self._clock.wait_until(granted.is_set, math.inf):
                raise RuntimeError("the clock was closed before the slots were free")
            yield
        finally:
            with self._lock:
                self._slots.release(ticket)

    # Within

    def _reading(self, name: str) -> Reading[Value]:
        try:
            return self._store.reading(name)
        except KeyError:
            raise _unknown("variable", name, self._store.cells) from None

    def _model(self, name: str) -> VariableModel:
        if name not in self._store.variables:
            raise _unknown("variable", name, self._store.variables)
        return self._store.variables[name]

    def _skill(self, name: str) -> SkillModel:
        if name not in self._skills:
            raise _unknown("skill", name, self._skills)
        return self._skills[name]

    def _hold_expected(self, skills: Iterable[str]) -> None:
        self._expected = list(skills)
        previews = (name for skill in self._expected for name in self._skills[skill].preview)
        self._declarations.hold(_EXPECTED, previews)

    def _enter(self, name: str, holder: str) -> None:
        self._scribe.tell(Kind.DECLARATION, name, "declared", holder=holder)
        self._forest.declare(name)

    def _leave(self, name: str, holder: str) -> None:
        self._scribe.tell(Kind.DECLARATION, name, "withdrawn", holder=holder)
        self._forest.withdraw(name)

    def _changed(self, name: str) -> None:
        self._forest.changed(name)
        self._clock.notify()

    def _may_write(self, name: str) -> bool:
        return MAIN in self._store.variables[name].sources or name in self._declarations

    def _write(self, name: str, content: Value | None, start_s: float) -> None:
        now_s = self._clock.now_s()
        reason = Reason.REJECTED if content is None else None
        self._store.write(
            Reading(
                name=name,
                content=content,
                reason=reason,
                evidence_s=now_s,
                start_s=start_s,
                identified_s=now_s,
                source=MAIN,
            )
        )

    def _content(self, name: str, found: object) -> Value | None:
        """Return what was found as a value of the variable, or None if it is none."""
        try:
            return None if found is None else self._store.variables[name].type.convert(found)
        except NotOfTypeError:
            return None

    def _keep(self, name: str, content: Value | None, looked_s: float) -> None:
        """Take what the main execution found by looking, which it began to do at `looked_s`, as evidence."""
        with self._lock:
            if content is not None and self._may_write(name):
                self._write(name, content, looked_s)

    def _invalidate(self, skill: SkillModel) -> None:
        with self._lock:
            for name in skill.changes:
                self._store.invalidate(name, skill.name, MAIN)

    def _observer_stopped(self, observer: Observer) -> None:
        for name in observer.model.identifies:
            forgets = self._store.variables[name].when_unobservable == "forget"
            if forgets and self._store.reading(name).known:
                self._store.make_unknown(name, Reason.WITHDRAWN, observer.name, MAIN)

    def _decided(self, name: str, what: str, asked_s: float, reading: Reading[Value], **details: object) -> None:
        with self._lock:
            about = {"value": reading.content, "reason": reading.reason, "asked_s": asked_s, "source": reading.source}
            self._scribe.tell(Kind.DECISION, name, what, **about, **details)


def _unknown(kind: str, name: str, names: Iterable[str]) -> UnknownNameError:
    similar = difflib.get_close_matches(str(name), list(names), n=1)
    hint = f": did you mean {similar[0]!r}?" if similar else ""
    return UnknownNameError(f"the spec has no {kind} {name!r}{hint}")
