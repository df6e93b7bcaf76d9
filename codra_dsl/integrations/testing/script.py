"""The world of a story: the behavior of perception algorithms, and the values that agents write."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from codra_dsl.integrations.testing.timeline import AgentValues, Behaviour, Fault, GraphChange
from codra_dsl.language.model import Literal
from codra_dsl.runtime import Clock, ContextManager, Job
from codra_dsl.runtime.clock import Timer
from codra_dsl.runtime.knowledge.operations import Verb
from codra_dsl.runtime.perception import Function, imported
from codra_dsl.runtime.values.model import Algorithm

_NO_FAULT = Fault()


class UnscriptedError(Exception):
    """An algorithm was called, but the timeline does not state the values that it returns."""


@dataclass(slots=True)
class _AlgorithmState:
    """The present behavior of one algorithm.

    Attributes:
        values: the values that the algorithm returns; empty until the timeline states them.
        jobs_left: the number of jobs that the fault still affects.
    """

    values: dict[str, Literal | None] = field(default_factory=dict)
    takes_s: float = 0.0
    evidence_s: tuple[float, float] | None = None
    fault: Fault = _NO_FAULT
    jobs_left: float = 0.0

    def change(self, behaviour: Behaviour) -> None:
        self.values.update(behaviour.returns or {})
        self.takes_s = self.takes_s if behaviour.takes_s is None else behaviour.takes_s
        self.evidence_s = behaviour.evidence_s or self.evidence_s
        self.fault = behaviour.fault or _NO_FAULT
        self.jobs_left = self.fault.jobs

    def take_fault(self) -> Fault:
        """Return the fault of the next job, and reduce the number of jobs that the fault still affects."""
        self.jobs_left -= 1
        return self.fault if self.jobs_left >= 0 else _NO_FAULT


class Script:
    """Replaces perception functions, or adds faults to them.

    Attributes:
        unscripted_since_s: a mapping from algorithms without stated values to the instants of their first calls.
    """

    def __init__(self, scripted_names: Collection[str], handle_names: Collection[str]) -> None:
        """Script some algorithms. Functions of other algorithms are called if the handles that they read exist."""
        self.unscripted_since_s: dict[str, float] = {}
        self._scripted_names = scripted_names
        self._handle_names = handle_names
        self._algorithm_states: dict[str, _AlgorithmState] = {}

    def change(self, behaviour: Behaviour) -> None:
        """Change the behavior of an algorithm from now on."""
        self._state_of(behaviour.algorithm).change(behaviour)

    def function_for(self, algorithm: Algorithm) -> Function:
        """Return the function or class that runs in place of an algorithm's own function or class.

        Raises:
            CallError: if the algorithm's own function is needed and cannot be imported.
        """
        state = self._state_of(algorithm.name)
        # The function of a scripted algorithm is never imported, so tests do not need its libraries.
        calls_own_function = algorithm.name not in self._scripted_names and all(
            name in self._handle_names for name in algorithm.handles
        )
        imported_function = imported(algorithm) if calls_own_function else None

        def wrap_with_faults(function: Function | None) -> Function:
            def perceive(*, job: Job, **arguments: Any) -> object:
                evidence_job = _JobWithEvidence(job)
                run_scripted = self._scripted_function(algorithm.name, state, evidence_job)
                run_without_fault = (
                    run_scripted if function is None else lambda: function(**arguments, job=evidence_job)
                )
                return _with_fault(state.take_fault(), run_without_fault, evidence_job)

            return perceive

        return (
            _subclass_with_faults(imported_function, wrap_with_faults)
            if isinstance(imported_function, type)
            else wrap_with_faults(imported_function)
        )

    def _state_of(self, name: str) -> _AlgorithmState:
        return self._algorithm_states.setdefault(name, _AlgorithmState())

    def _scripted_function(self, name: str, state: _AlgorithmState, job: _JobWithEvidence) -> Callable[[], object]:
        def run() -> object:
            if not state.values:
                self.unscripted_since_s.setdefault(name, job.now_s())
                raise UnscriptedError("the timeline does not state the values that the algorithm returns")
            return _run_script(state, job)

        return run


def _subclass_with_faults(algorithm_class: type[Any], wrap_with_faults: Callable[[Function], Function]) -> type[Any]:
    """Return a subclass whose `perceive` is wrapped with faults; `setup` and `close` stay the same."""

    def perceive(self: Any, **arguments: Any) -> object:
        return wrap_with_faults(partial(algorithm_class.perceive, self))(**arguments)

    return type(algorithm_class.__name__, (algorithm_class,), {"perceive": perceive})


class _JobWithEvidence:
    """The `job` of a function, which records whether evidence was reported."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._start_s = job.now_s()
        self._has_evidence = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._job, name)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken."""
        self._job.evidence(start_s, stamp_s)
        self._has_evidence = True

    def delay(self, late_s: float) -> None:
        """Delay the result; the evidence keeps the times that it would have without the delay."""
        if late_s > 0:
            if not self._has_evidence:
                self.evidence(self._start_s, self._job.now_s())
            self._job.sleep(late_s)


def _run_script(state: _AlgorithmState, job: _JobWithEvidence) -> Mapping[str, Literal | None]:
    """Run a job as scripted, and report its evidence as soon as the evidence is taken."""
    start_s, values, takes_s = job.now_s(), dict(state.values), state.takes_s
    if state.evidence_s is not None:
        evidence_start_s, stamp_s = state.evidence_s
        job.sleep(max(0.0, stamp_s))
        job.evidence(start_s + evidence_start_s, start_s + stamp_s)
        takes_s -= max(0.0, stamp_s)
    job.sleep(max(0.0, takes_s))
    return values


def _with_fault(fault: Fault, run_without_fault: Callable[[], object], job: _JobWithEvidence) -> object:
    if fault.hangs:
        job.sleep(math.inf)
        return None
    if fault.raises is not None:
        job.delay(fault.late_s)
        raise RuntimeError(fault.raises)
    returned_value = _with_garbage(fault.garbage[0], run_without_fault) if fault.garbage else run_without_fault()
    job.delay(fault.late_s)
    return returned_value


def _with_garbage(garbage: object, run_without_fault: Callable[[], object]) -> object:
    """Return the garbage. If the garbage is a mapping, return the usual result, updated with this mapping."""
    if not isinstance(garbage, Mapping):
        return garbage
    returned_value = run_without_fault()
    return {**returned_value, **garbage} if isinstance(returned_value, Mapping) else garbage


class StoryAgents:
    """The agents of a story: they write values, repeat their last values, and fall silent."""

    def __init__(
        self,
        codra: ContextManager[Any, Any],
        clock: Clock,
        repeat_intervals_s: Mapping[str, float],
        refusals_at: Callable[[AgentValues | GraphChange], AbstractContextManager[None]],
    ) -> None:
        """Write to a context manager.

        Args:
            codra: the context manager.
            clock: the clock of the story.
            repeat_intervals_s: how often agents repeat their values and edges.
            refusals_at: reports a repetition that is refused, at the place of the repetition.
        """
        self._codra = codra
        self._types = {variable.name: variable.type for variable in codra.model.variables}
        self._clock = clock
        self._repeat_intervals_s = repeat_intervals_s
        self._refusals_at = refusals_at
        self._last_values: dict[str, AgentValues] = {}
        self._last_edges: dict[str, dict[tuple[str, ...], GraphChange]] = {}
        self._inserting_agents: dict[str, str] = {}
        self._timers: dict[str, Timer] = {}

    def apply(self, agent_values: AgentValues) -> None:
        """Let an agent write values, or fall silent."""
        agent = agent_values.agent
        if agent in self._timers:
            self._timers.pop(agent).cancel()
        if agent_values.values is not None:
            before = self._last_values.get(agent, agent_values).values or {}
            self._last_values[agent] = replace(agent_values, values={**before, **agent_values.values})
            self._write(agent_values)
            self._repeat_later(agent)

    def change_graph(self, change: GraphChange) -> None:
        """Let an agent change the graph.

        Raises:
            LookupError: if the graph does not allow this; ValueError, PermissionError and RuntimeError likewise.
        """
        verb, arguments = change.operation
        if verb in (Verb.INSERT_EDGE, Verb.PLACE):
            self._last_edges.setdefault(change.agent, {})[arguments[:3]] = change
            self._write_edge(change)
            if change.agent not in self._timers:
                self._repeat_later(change.agent)
            return
        for edges in self._last_edges.values():
            for edge in [edge for edge in edges if arguments in (edge, edge[:1], edge[2:])]:
                del edges[edge]
        agent = change.agent or self._inserting_agents.get(arguments[0], "")
        self._codra.knowledge.write_as(agent, [change.operation])

    def _write_edge(self, change: GraphChange) -> None:
        graph = self._codra.knowledge
        for insertion in change.new_nodes:
            node = insertion.operation.arguments[0]
            if node not in graph.snapshot():
                self._inserting_agents[node] = insertion.agent
                graph.write_as(insertion.agent, [insertion.operation])
        graph.write_as(change.agent, [change.operation])

    def _repeat_later(self, agent: str) -> None:
        if agent in self._repeat_intervals_s:
            next_write_s = self._clock.now_s() + self._repeat_intervals_s[agent]
            self._timers[agent] = self._clock.call_at(next_write_s, lambda: self._repeat(agent))

    def _repeat(self, agent: str) -> None:
        """Write the last values and edges of an agent again."""
        __tracebackhide__ = True
        if agent in self._last_values:
            with self._refusals_at(self._last_values[agent]):
                self._write(self._last_values[agent])
        for change in self._last_edges.get(agent, {}).values():
            with self._refusals_at(change):
                self._write_edge(change)
        self._repeat_later(agent)

    def _write(self, agent_values: AgentValues) -> None:
        """Write for an agent. This is possible whether or not the program has a handle of this agent."""
        for name, value in (agent_values.values or {}).items():
            self._codra.commands.write(name, self._types[name].convert(value), agent_values.agent, None)
