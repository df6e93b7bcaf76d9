"""The common part of a graph and its copies in other programs: reading, waiting, subscriptions, handles of agents."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.geometry import Transform
from codra_dsl.runtime.knowledge.agent_handle import AgentHandle, AgentPort, Transaction, raise_closed_error
from codra_dsl.runtime.knowledge.change_set import ChangeSet, ChangeSubject
from codra_dsl.runtime.knowledge.declarations import Pattern, RuleModel
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import subjects_of_patterns
from codra_dsl.runtime.knowledge.operations import Operation, Verb
from codra_dsl.runtime.knowledge.rule_execution import RuleExecution
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import OvertakenError, State
from codra_dsl.runtime.knowledge.watches import (
    Change,
    View,
    Watch,
    Watches,
    watch_functions_for_attribute,
    watch_functions_for_matches,
    watch_functions_for_wakes,
)
from codra_dsl.runtime.values.cell import Override, Reading

ValueT = TypeVar("ValueT")

MAX_PAST_INSTANTS = 4_096
"""The maximum number of instants with changes that `at` can go back."""


class GraphChange(NamedTuple):
    """One change of a graph: everything that makes its next version, if it is applied to a copy of the version before.

    Attributes:
        version: the version of the graph after the change.
        instant_s: the instant of the change.
        agent: the agent that made the change.
        operations: the operations of the agent; empty if a context-variable changed.
        variable: the context-variable that changed; empty if the agent wrote the graph.
        reading: the new reading of the variable, or its override; None if its override has ended.
    """

    version: int
    instant_s: float
    agent: str
    operations: tuple[Operation, ...] = ()
    variable: str = ""
    reading: Reading[Value] | None = None

    def apply(self, change_set: ChangeSet) -> None:
        """Apply the change to a change set with the instant and the agent of the change."""
        for operation in self.operations:
            operation.apply(change_set)
        if not self.variable:
            return
        node, reading = change_set.schema.nodes_by_variable[self.variable], self.reading
        if reading is None or isinstance(reading, Override):
            change_set.set_override(node, self.variable, reading)
        else:
            change_set.add_reading(node, change_set.history(node, self.variable), reading)


class SharedGraph(ABC):
    """The present graph, its past and its subscriptions. Threads may share it.

    Attributes:
        model: the declarations.
    """

    def __init__(
        self, schema: GraphSchema, state: State, *, clock: Clock, write_lock: AbstractContextManager[object]
    ) -> None:
        """Begin with a state.

        Args:
            schema: the declarations of the graph.
            state: the state of the graph.
            clock: runs callbacks; it must not be a clock that holds a lock during events.
            write_lock: held while the state is replaced.
        """
        self.model = schema.model
        self._schema = schema
        self._state = state
        self._past_states: deque[State] = deque(maxlen=MAX_PAST_INSTANTS - 1)
        self._clock = clock
        self._now_s = clock.now_s
        self._write_lock = write_lock
        self._watches = Watches()
        self._held_handles: dict[int, AgentHandle] = {}  # handles that a subscription keeps alive
        self._handles_lock = new_lock()

    @abstractmethod
    def as_agent(self, name: str) -> AgentHandle:
        """Return the handle with which an agent writes."""

    # Reading

    def snapshot(self) -> Snapshot:
        """Return an immutable snapshot of the present graph."""
        return Snapshot(self._schema, self._state, self._now_s())

    def at(self, instant_s: float) -> Snapshot:
        """Return the graph as it was at an instant, with the values known at that instant.

        Raises:
            ValueError: if the instant lies in the future, or before the oldest version that is kept.
        """
        if not instant_s <= self._now_s():
            raise ValueError(f"the instant {instant_s} lies in the future: the present instant is {self._now_s()}")
        with self._write_lock:
            states = chain((self._state,), reversed(self._past_states))
            state = next((candidate for candidate in states if candidate.since_s <= instant_s), None)
            begin_s = self._past_states[0].since_s if self._past_states else self._state.since_s
        if state is None:
            raise ValueError(f"the graph is kept only from {begin_s} s on: for {instant_s}, read it from a journal")
        return Snapshot(self._schema, state, instant_s)

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return the present reading of an attribute of a node; this raises the errors of `Snapshot.get`."""
        return Snapshot(self._schema, self._state, self._now_s()).get(name, attribute)

    def transform(self, target: str, source: str, instant_s: float | None = None) -> Transform:
        """Return the pose of `source` relative to `target`, now or at an instant; see `Snapshot.transform`."""
        now_s = self._now_s()
        return self._state.frames.transform(target, source, now_s if instant_s is None else instant_s)

    # Waiting and subscriptions

    def subscribe(self, callback: Callable[[Change], object], *patterns: Pattern) -> Subscription:
        """Call back whenever the matches of the patterns change, and once at the beginning if the patterns hold.

        The callback runs without any lock, one call at a time. In real time it runs in a thread of its own. In
        simulated time it runs as an event at the instant of the change and must not wait. Its exceptions are logged.
        A call gets the graph as it is at the time of the call, and not each change before the call, so calls cannot
        pile up. An agent that needs every single change should hand over a task instead.

        Raises:
            UnknownNameError: if a pattern uses a type that is not declared.
        """
        self.snapshot().match(*patterns)
        return self._watch(
            subjects_of_patterns(self._schema, patterns), *watch_functions_for_matches(self._schema, patterns, callback)
        )

    def follow(self, name: str, attribute: str, callback: Callable[[Reading[Any]], object]) -> Subscription:
        """Call back with the reading of an attribute of a node, now and whenever the reading changes; see `subscribe`.

        Raises:
            AbsentError: if the node does not exist.
            UnknownNameError: if nodes of its type have no such attribute.
        """
        self.get(name, attribute)
        return self._watch([(name, attribute)], *watch_functions_for_attribute(name, attribute, callback))

    def wait_for(self, *patterns: Pattern, timeout_s: float) -> bool:
        """Wait until the patterns hold, but at most `timeout_s`; return whether they hold.

        Raises:
            UnknownNameError: if a pattern uses a type that is not declared.
        """
        self.snapshot().match(*patterns)
        return self._clock.wait_until(lambda: self.snapshot().holds(*patterns), timeout_s)

    # Implementation

    def _create_handle(self, name: str) -> AgentHandle:
        is_closed = False
        wake_subscriptions: list[Subscription] = []

        def check_open() -> None:
            if is_closed:
                raise_closed_error(name)

        def subscribe_to_wakes(handle: AgentHandle, callback: Callable[[Change], object]) -> Subscription:
            check_open()
            wake_subscriptions.append(self._on_wake(handle, callback))
            return wake_subscriptions[-1]

        def close() -> None:
            nonlocal is_closed
            with self._handles_lock:
                if not is_closed:
                    is_closed = True
                    self._release_handle(name)
            for subscription in wake_subscriptions:
                subscription.unsubscribe()

        port = AgentPort(
            apply=partial(self._apply_verb, name),
            begin_transaction=partial(self._transaction, name, check_open),
            subscribe_to_wakes=subscribe_to_wakes,
            prepare_rule=partial(self._prepare_rule, name, check_open),
            close=close,
            check_open=check_open,
        )
        return AgentHandle(name, port)

    def _on_wake(self, handle: AgentHandle, callback: Callable[[Change], object]) -> Subscription:
        wakes = tuple(pattern for agent in self.model.agents if agent.name == handle.name for pattern in agent.wakes)
        return self._watch(
            subjects_of_patterns(self._schema, wakes),
            *watch_functions_for_wakes(self._schema, wakes, callback),
            kept_handle=handle,
        )

    def _prepare_rule(self, agent: str, check_open: Callable[[], None], name: str) -> RuleExecution[Transaction]:
        return RuleExecution(
            self._rule_of(agent, name),
            check_rule=partial(self._check_rule, agent, name),
            begin_transaction=partial(self._transaction, agent, check_open, name),
            take_snapshot=self.snapshot,
            record_state=partial(self.record_rule_state, agent, name),
            subscribe=self.subscribe,
        )

    def _rule_of(self, agent: str, name: str) -> RuleModel:
        rules = {rule.name: rule for model in self.model.agents if model.name == agent for rule in model.rules}
        if name not in rules:
            raise unknown_name_error(f"rule of {agent!r}", name, rules)
        return rules[name]

    @abstractmethod
    def _apply_verb(self, agent: str, verb: Verb, arguments: tuple[Any, ...]) -> Any:
        """Apply one operation as an agent; return the result of the operation."""

    @abstractmethod
    def _transaction(
        self, name: str, check_open: Callable[[], None], rule: str = ""
    ) -> AbstractContextManager[Transaction]:
        """Begin changes of an agent that become visible together, and only if a rule of the agent then allows it."""

    @abstractmethod
    def _check_rule(self, agent: str, rule: str) -> None:
        """Raise `RuleError` if a rule does not allow its action in the present graph."""

    @abstractmethod
    def record_rule_state(self, agent: str, name: str, state: str, message: str) -> None:
        """Record the new state of an agent's rule in the journal."""

    @abstractmethod
    def _release_handle(self, name: str) -> None:
        """Let the agent of a closed handle have another one."""

    def _replace_state(self, before: State, after: State) -> None:
        """Replace the present state. The old state is kept for `at` if it is the last one of its instant."""
        if before.since_s != after.since_s:
            self._past_states.append(before)
        if self._state is not before:
            raise OvertakenError
        self._state = after

    def _watch(
        self,
        subjects: Iterable[ChangeSubject],
        evaluate: Callable[[Snapshot], View[ValueT]],
        notify: Callable[[Snapshot, ValueT], None],
        kept_handle: AgentHandle | None = None,
    ) -> Subscription:
        watched_subjects = list(subjects)

        def end() -> None:
            self._watches.remove(watch, watched_subjects)
            self._held_handles.pop(id(watch), None)

        watch: Watch[ValueT] = Watch(self._clock, self._last_snapshot, evaluate, notify, end)
        if kept_handle is not None:
            self._held_handles[id(watch)] = kept_handle
        self._watches.add(watch, watched_subjects)
        watch.request_evaluation()
        return watch.subscription

    def _last_snapshot(self) -> Snapshot:
        """Return a snapshot for a subscription, also if a copy can no longer be read."""
        return Snapshot(self._schema, self._state, self._clock.now_s())
