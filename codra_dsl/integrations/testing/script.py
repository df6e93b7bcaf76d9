"""The world of a story: how perception algorithms behave, and what agents say."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from codra_dsl.integrations.testing.timeline import Behaviour, Fault, Saying
from codra_dsl.language.model import Literal
from codra_dsl.runtime import Clock, ContextManager, Job
from codra_dsl.runtime.clock import Timer
from codra_dsl.runtime.perception import Function, imported
from codra_dsl.runtime.values.model import Algorithm

_SOUND = Fault()


class UnsaidError(Exception):
    """An algorithm was asked, and the timeline does not say what it returns."""


@dataclass(slots=True)
class _Part:
    """How one algorithm behaves now.

    Attributes:
        values: that it returns; empty as long as nothing is said.
        jobs_left: for how many jobs the fault still is.
    """

    values: dict[str, Literal | None] = field(default_factory=dict)
    takes_s: float = 0.0
    evidence_s: tuple[float, float] | None = None
    fault: Fault = _SOUND
    jobs_left: float = 0.0

    def change(self, behaviour: Behaviour) -> None:
        self.values.update(behaviour.returns or {})
        self.takes_s = self.takes_s if behaviour.takes_s is None else behaviour.takes_s
        self.evidence_s = behaviour.evidence_s or self.evidence_s
        self.fault = behaviour.fault or _SOUND
        self.jobs_left = self.fault.jobs

    def take_fault(self) -> Fault:
        """Return the fault of the next job."""
        self.jobs_left -= 1
        return self.fault if self.jobs_left >= 0 else _SOUND


class Script:
    """Stands in for perception functions, or for what fails in them.

    Attributes:
        unsaid: the algorithms that were asked in vain, each with the first instant.
    """

    def __init__(self, scripted: Collection[str], handles: Collection[str]) -> None:
        """Speak for some algorithms; others are called if the handles that they read are there."""
        self.unsaid: dict[str, float] = {}
        self._scripted = scripted
        self._handles = handles
        self._parts: dict[str, _Part] = {}

    def change(self, behaviour: Behaviour) -> None:
        """Let an algorithm behave otherwise from here on."""
        self._part(behaviour.algorithm).change(behaviour)

    def function(self, algorithm: Algorithm) -> Function:
        """Return what is run in place of an algorithm's function.

        Raises:
            CallError: if its own function is needed and cannot be imported.
        """
        part = self._part(algorithm.name)
        is_called = algorithm.name not in self._scripted and all(name in self._handles for name in algorithm.handles)
        own = imported(algorithm) if is_called else None

        def around(function: Function | None) -> Function:
            def perceive(*, job: Job, **arguments: Any) -> object:
                heard = _Heard(job)
                said = self._usual(algorithm.name, part, heard)
                usual = said if function is None else lambda: function(**arguments, job=heard)
                return _with_fault(part.take_fault(), usual, heard)

            return perceive

        return _class_around(own, around) if isinstance(own, type) else around(own)

    def _part(self, name: str) -> _Part:
        return self._parts.setdefault(name, _Part())

    def _usual(self, name: str, part: _Part, job: _Heard) -> Callable[[], object]:
        def say() -> object:
            if not part.values:
                self.unsaid.setdefault(name, job.now_s())
                raise UnsaidError("the timeline does not say what it returns")
            return _scripted(part, job)

        return say


def _class_around(own: type[Any], around: Callable[[Function], Function]) -> type[Any]:
    """Return a class whose objects perceive as those of another, with faults; its `setup` and `close` are the same."""

    def perceive(self: Any, **arguments: Any) -> object:
        return around(partial(own.perceive, self))(**arguments)

    return type(own.__name__, (own,), {"perceive": perceive})


class _Heard:
    """The `job` of a function, which remembers whether it was told of evidence."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._start_s = job.now_s()
        self._is_told = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._job, name)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Say when the evidence was taken."""
        self._job.evidence(start_s, stamp_s)
        self._is_told = True

    def delay(self, late_s: float) -> None:
        """Let the result come later, though its evidence was taken as if it did not."""
        if late_s > 0:
            if not self._is_told:
                self.evidence(self._start_s, self._job.now_s())
            self._job.sleep(late_s)


def _scripted(part: _Part, job: _Heard) -> Mapping[str, Literal | None]:
    """Do a job as it is told: its evidence is told as soon as it is taken."""
    start_s, values, takes_s = job.now_s(), dict(part.values), part.takes_s
    if part.evidence_s is not None:
        begun_s, stamp_s = part.evidence_s
        job.sleep(max(0.0, stamp_s))
        job.evidence(start_s + begun_s, start_s + stamp_s)
        takes_s -= max(0.0, stamp_s)
    job.sleep(max(0.0, takes_s))
    return values


def _with_fault(fault: Fault, usual: Callable[[], object], job: _Heard) -> object:
    if fault.hangs:
        job.sleep(math.inf)
        return None
    if fault.raises is not None:
        job.delay(fault.late_s)
        raise RuntimeError(fault.raises)
    found = _garbled(fault.garbage[0], usual) if fault.garbage else usual()
    job.delay(fault.late_s)
    return found


def _garbled(garbage: object, usual: Callable[[], object]) -> object:
    """Return garbage; a mapping lies over what would be returned otherwise."""
    if not isinstance(garbage, Mapping):
        return garbage
    found = usual()
    return {**found, **garbage} if isinstance(found, Mapping) else garbage


class Speakers:
    """The agents of a story: they write, repeat what they said last, and fall silent."""

    def __init__(self, codra: ContextManager[Any, Any], clock: Clock, every_s: Mapping[str, float]) -> None:
        """Speak to a context manager; `every_s` tells how often each agent repeats itself."""
        self._codra = codra
        self._types = {variable.name: variable.type for variable in codra.model.variables}
        self._clock = clock
        self._every_s = every_s
        self._said: dict[str, dict[str, Literal | None]] = {}
        self._next: dict[str, Timer] = {}

    def say(self, saying: Saying) -> None:
        """Let an agent write, or fall silent."""
        agent = saying.agent
        if agent in self._next:
            self._next.pop(agent).cancel()
        if saying.values is not None:
            self._said.setdefault(agent, {}).update(saying.values)
            self._write(agent, saying.values)

    def _write(self, agent: str, values: Mapping[str, Literal | None]) -> None:
        """Write for an agent: a story speaks for it, whether or not the program holds its handle."""
        for name, value in values.items():
            self._codra.commands.write(name, self._types[name].convert(value), agent, None)
        if agent in self._every_s:
            then_s = self._clock.now_s() + self._every_s[agent]
            self._next[agent] = self._clock.call_at(then_s, lambda: self._write(agent, self._said[agent]))
