"""P2's Deep State Representation: one graph that all agents write and read (P2, sections 3.1 to 3.3).

The graph is an immutable value; each write creates a new version. A snapshot is therefore a reference, reading takes no
lock, and no reader sees a part of a transaction.

Versions share their unchanged parts. The newest version of a map holds a dictionary; each older version holds a link
to the next version and the differences from it. Histories are shared as well, and store the version of each reading;
access to an older version skips newer readings. So writing an attribute copies no node, a write costs the same for
every size of graph, and the newest version is read directly. Only reading many elements of an old snapshot copies its
map.
"""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from itertools import chain
from typing import Any, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.errors import AgentTakenError, unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.geometry import Transform
from codra_dsl.runtime.knowledge import handshake
from codra_dsl.runtime.knowledge.agent_handle import AgentHandle, AgentPort, Transaction, raise_closed_error
from codra_dsl.runtime.knowledge.change_set import ChangeRecord, ChangeSet, ChangeSubject
from codra_dsl.runtime.knowledge.context_link import ContextLink, RefusedWrite
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel, Pattern
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import subjects_of_patterns
from codra_dsl.runtime.knowledge.operations import HANDLERS, SET, Operation, Verb
from codra_dsl.runtime.knowledge.permissions import GRAPH_WRITER, Audit, Refusal
from codra_dsl.runtime.knowledge.rule_execution import RuleError, RuleExecution
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
from codra_dsl.runtime.values.declarations import OPERATOR

ResultT = TypeVar("ResultT")
ValueT = TypeVar("ValueT")

MAX_PAST_INSTANTS = 4_096
"""The maximum number of instants with changes that `at` can go back."""


class Knowledge:
    """The knowledge graph. Threads may share it.

    Attributes:
        model: the declarations.
        on_change: a callback of the context manager, called in the step of each change with the subjects of the change.
    """

    def __init__(self, model: KnowledgeModel, *, clock: Clock, context_link: ContextLink | None = None) -> None:
        """Create the initial graph.

        Args:
            model: the compiled declarations of a spec.
            clock: real or simulated time; it must not be a clock that holds a lock during events.
            context_link: the link to the context manager of the graph; None for a graph without one.

        Raises:
            ValueError: if the declarations contradict each other.
            LookupError: if the declarations use names that are not declared.
        """
        self._schema = GraphSchema(model, () if context_link is None else context_link.variables)
        self.model = self._schema.model
        self._clock = clock
        self._now_s = clock.now_s
        self._context_link = context_link
        # Every write holds this lock. With a context manager, this is the lock of the steps, also for the context.
        self._step_clock: Clock = clock if context_link is None else context_link.clock
        self._step_now_s = self._step_clock.now_s
        self._write_lock: AbstractContextManager[object] = new_lock() if context_link is None else context_link.clock
        self._state = State.empty(self._step_now_s())
        self._past_states: deque[State] = deque(maxlen=MAX_PAST_INSTANTS - 1)
        self._readings_in_commit: Sequence[Reading[Value]] = ()
        self._audit = Audit()
        self._watches = Watches()
        self.on_change: Callable[[Collection[ChangeSubject]], None] | None = None
        self._handles: weakref.WeakValueDictionary[str, AgentHandle] = weakref.WeakValueDictionary()
        self._handles_lock = new_lock()
        self._held_handles: dict[int, AgentHandle] = {}  # handles that a subscription keeps alive
        self._write(GRAPH_WRITER, lambda change_set: change_set.insert_initial_graph(self.model))

    # Writing

    def as_agent(self, name: str) -> AgentHandle:
        """Return the handle with which an agent writes. While this handle is open, the agent can have no other handle.

        The handle is closed by `close`, at the end of its `with` statement, or when it is garbage-collected.

        Raises:
            UnknownNameError: if no such agent is declared.
            AgentTakenError: if a handle of the agent is open.
        """
        if name not in self._schema.agents:
            raise unknown_name_error("agent", name, self._schema.agents)
        with self._handles_lock:
            if name not in self._handles:
                handle = self._create_handle(name)
                self._handles[name] = handle
                return handle
        message = f"the agent {name!r} already has an open handle: close it before you open another"
        with self._write_lock:
            self._record_refusal(name, RefusedWrite(name, message))
        raise AgentTakenError(message)

    def refusals(self) -> tuple[Refusal, ...]:
        """Return the refused writes that the audit still holds, the oldest first."""
        return self._audit.refusals()

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
        return self._state.frames.transform(target, source, self._now_s() if instant_s is None else instant_s)

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

    # For the context manager and for replays

    def mirror(self, reading: Reading[Value]) -> None:
        """Add a reading of a context-variable to the graph, regardless of its writer; the caller must be in a step."""
        if self._readings_in_commit and any(other_reading is reading for other_reading in self._readings_in_commit):
            return  # the graph itself wrote this reading, together with other changes
        change_set = ChangeSet(self._schema, self._state, self._step_now_s(), reading.source)
        node = self._schema.nodes_by_variable[reading.name]
        change_set.add_reading(node, change_set.history(node, reading.name), reading)
        self._publish(change_set)
        self._watches.request_evaluations(change_set.changed_subjects)

    def mirror_override(self, variable: str, override: Override | None) -> None:
        """Let an override hide the readings of a context-variable; None ends it. The caller must be in a step."""
        change_set = ChangeSet(self._schema, self._state, self._step_now_s(), OPERATOR)
        change_set.set_override(self._schema.nodes_by_variable[variable], variable, override)
        self._publish(change_set)
        self._watches.request_evaluations(change_set.changed_subjects)

    def step_snapshot(self) -> Snapshot:
        """Return a snapshot of the graph at the instant of the present step."""
        return Snapshot(self._schema, self._state, self._step_clock.now_s())

    def audit_refusal(self, agent: str, message: str) -> None:
        """Add a refused write of a context-variable to the audit; the context has already recorded this refusal."""
        self._audit.add(Refusal(instant_s=self._now_s(), agent=agent, why=message))

    def write_as(self, agent: str, operations: Sequence[Operation]) -> None:
        """Apply operations of an agent as one change, also without a handle.

        Raises:
            LookupError: if an operation fails; ValueError, TypeError, PermissionError and RuntimeError likewise.
        """
        self._write(agent, lambda change_set: [operation.apply(change_set) for operation in operations], operations)

    def replay_refusal(self, agent: str, refused_write: RefusedWrite) -> None:
        """Repeat a refusal from a journal."""
        with self._write_lock:
            self._record_refusal(agent, refused_write)

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
                    self._handles.pop(name, None)
            for subscription in wake_subscriptions:
                subscription.unsubscribe()

        port = AgentPort(
            apply=partial(self._apply_verb, name),
            begin_transaction=lambda: self._transaction(name, check_open, lambda: None),
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
        rules = {rule.name: rule for model in self.model.agents if model.name == agent for rule in model.rules}
        if name not in rules:
            raise unknown_name_error(f"rule of {agent!r}", name, rules)
        return RuleExecution(
            rules[name],
            check_rule=partial(self._check_rule, agent, name),
            begin_transaction=partial(self._transaction, agent, check_open),
            take_snapshot=self.snapshot,
            record_state=partial(self.record_rule_state, agent, name),
            subscribe=self.subscribe,
        )

    def _check_rule(self, agent: str, name: str, explain_missing: Callable[[Snapshot], str]) -> None:
        """Raise `RuleError` if a rule does not allow its action in the present graph."""
        with self._write_lock:
            missing_text = explain_missing(self.step_snapshot())
            if missing_text:
                message = f"the rule {name!r} of {agent!r} cannot begin: {missing_text}"
                self._record_refusal(agent, RefusedWrite(f"{agent}.{name}", message))
                raise RuleError(message)

    def record_rule_state(self, agent: str, name: str, state: str, message: str) -> None:
        """Record the new state of an agent's rule in the journal."""
        if self._context_link is not None:
            with self._write_lock:
                self._context_link.record_rule_state(agent, name, state, message)

    @contextmanager
    def _transaction(
        self, name: str, check_open: Callable[[], None], check_allowed: Callable[[], None]
    ) -> Iterator[Transaction]:
        check_open()
        base_state = self._state
        change_set = ChangeSet(self._schema, base_state, self._now_s(), name)

        def attempt(operation: Operation) -> Any:
            change_set.now_s = self._step_now_s()  # evidence may have been taken since the transaction began
            try:
                return operation.apply(change_set)
            except PermissionError as error:
                self._record_refusal(name, self._make_refused_write(operation, str(error)))
                raise

        transaction = Transaction(attempt, self._write_lock)
        try:
            yield transaction
        finally:
            transaction.end()
        transaction.check()
        if change_set.changed_subjects:
            check_open()
            with self._write_lock:  # nothing can change between `check_allowed` and the write
                check_allowed()
                self._write(
                    name, partial(self._adopt_transaction, base_state, change_set, transaction), transaction.operations
                )

    def _adopt_transaction(
        self, base_state: State, change_set: ChangeSet, transaction: Transaction, present_change_set: ChangeSet
    ) -> None:
        """Take over the changes of a transaction; apply them again if the graph has changed meanwhile.

        With a context manager the changes are always applied again, so that all of them have the instant of the step.
        """
        if self._context_link is None and present_change_set.starts_from(base_state):
            present_change_set.adopt(change_set)
        else:
            transaction.reapply(present_change_set)

    def _write(
        self, agent: str, apply_changes: Callable[[ChangeSet], ResultT], operations: Sequence[Operation] = ()
    ) -> ResultT:
        """Apply changes and notify the watches."""
        with self._write_lock:
            change_set = ChangeSet(
                self._schema, self._state, self._step_now_s(), agent, None if self._context_link is None else []
            )
            try:
                result = apply_changes(change_set)
            except PermissionError as error:
                self._record_refusal(agent, self._make_refused_write(change_set.operation, str(error)))
                raise
            try:
                if change_set.changed_subjects:
                    self._commit(change_set, operations)
            except OvertakenError:
                return self._write(agent, apply_changes, operations)
        return result

    def _apply_verb(self, agent: str, verb: Verb, arguments: tuple[Any, ...]) -> Any:
        """Apply one operation as an agent and notify the watches; return the result of the operation.

        This is a fast form of `_write`: it creates an `Operation` only if a journal or an error needs one.
        """
        with self._write_lock:
            try:
                if verb is SET and self._context_link is None and self._append_value(agent, arguments):
                    return None
                records: list[ChangeRecord] | None = None if self._context_link is None else []
                change_set = ChangeSet(self._schema, self._state, self._step_now_s(), agent, records)
                result = HANDLERS[verb](change_set, *arguments)
            except PermissionError as error:
                self._record_refusal(agent, self._make_refused_write(Operation(verb, arguments), str(error)))
                raise
            try:
                if change_set.changed_subjects:
                    self._commit(change_set, () if self._context_link is None else (Operation(verb, arguments),))
            except OvertakenError:
                return self._apply_verb(agent, verb, arguments)
        return result

    def _append_value(self, agent: str, arguments: tuple[Any, ...]) -> bool:
        """Append a value to the history of an attribute, without a change set.

        This fast path applies to an attribute that was written before, in a graph without a context manager.

        Returns:
            Whether the value was appended; if not, nothing has changed.
        """
        name, attribute, value, evidence_s = arguments
        state = self._state
        node = state.nodes.get(name)
        if node is None:
            return False
        history = node.histories.get(attribute)
        if history is None or agent not in history.attribute.permissions.writers:
            return False
        after = state.next(self._step_now_s())
        reading = history.make_reading(agent, after.since_s, value, evidence_s, state.version)
        if self._state is not state:
            return False
        try:
            updated_history = history.with_reading(reading, after.version)
            if updated_history is not history:
                after.nodes = state.nodes.with_entry(name, node.with_history(updated_history))
            self._replace_state(state, after)
        except BaseException as error:  # an interrupt
            history.remove(reading)
            if isinstance(error, OvertakenError):
                return False
            raise
        self._watches.request_evaluations([(name, attribute)])
        self._clock.notify()
        return True

    def _commit(self, change_set: ChangeSet, operations: Sequence[Operation]) -> None:
        """Make a change set the present state, and notify the journal, the context and the watches."""
        context_link = self._context_link
        if context_link is None:
            self._publish(change_set)
        else:
            context_link.write_input(change_set.agent, operations)
            self._publish(change_set)
            self._readings_in_commit = change_set.context_readings
            try:
                context_link.commit(change_set, self._state.version)
            finally:
                self._readings_in_commit = ()
        for instant_s, handover in change_set.deadlines:
            self._step_clock.call_at(instant_s, partial(self._expire_task, handover.task))
        if self.on_change is not None:
            self.on_change(change_set.changed_subjects)
        self._watches.request_evaluations(change_set.changed_subjects)
        self._clock.notify()

    def _publish(self, change_set: ChangeSet) -> None:
        """Make the state of a change set the present one."""
        before = self._state
        if not change_set.starts_from(before):
            raise OvertakenError
        try:
            self._replace_state(before, change_set.state())
        except BaseException:  # an interrupt
            change_set.undo()
            raise

    def _replace_state(self, before: State, after: State) -> None:
        """Replace the present state. The old state is kept for `at` if it is the last one of its instant."""
        if before.since_s != after.since_s:
            self._past_states.append(before)
        if self._state is not before:
            raise OvertakenError
        self._state = after

    def _make_refused_write(self, operation: Operation, message: str) -> RefusedWrite:
        if self._context_link is None:
            return RefusedWrite(operation.subject, message)
        return self._context_link.make_refused_write(operation, message, self._schema.nodes_by_variable)

    def _record_refusal(self, agent: str, refused_write: RefusedWrite) -> None:
        """Record a refusal; the caller holds the lock for writes."""
        self._audit.add(Refusal(instant_s=self._step_clock.now_s(), agent=agent, why=refused_write.message))
        if self._context_link is not None:
            self._context_link.record_refusal(agent, refused_write)

    def _expire_task(self, task: str) -> None:
        self._write(GRAPH_WRITER, lambda change_set: handshake.expire(change_set, task))

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

        watch: Watch[ValueT] = Watch(self._clock, self.snapshot, evaluate, notify, end)
        if kept_handle is not None:
            self._held_handles[id(watch)] = kept_handle
        self._watches.add(watch, watched_subjects)
        watch.request_evaluation()
        return watch.subscription
