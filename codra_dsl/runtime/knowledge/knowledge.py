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
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.errors import AgentTakenError, unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.knowledge.agent_handle import AgentHandle, Transaction
from codra_dsl.runtime.knowledge.change_set import ChangeRecord, ChangeSet, ChangeSubject
from codra_dsl.runtime.knowledge.context_link import ContextLink, RefusedWrite
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.operations import HANDLERS, SET, Operation, Verb
from codra_dsl.runtime.knowledge.permissions import GRAPH_WRITER, Audit, Refusal
from codra_dsl.runtime.knowledge.rule_execution import RuleError, explain_missing
from codra_dsl.runtime.knowledge.shared_graph import GraphChange, SharedGraph
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import OvertakenError, State
from codra_dsl.runtime.values.cell import Override, Reading
from codra_dsl.runtime.values.declarations import OPERATOR

ResultT = TypeVar("ResultT")

Follower = Callable[[GraphChange], object]
"""Called with each change, in the step of the change; it must neither wait nor raise an exception."""


class Knowledge(SharedGraph):
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
        schema = GraphSchema(model, () if context_link is None else context_link.variables)
        # Every write holds this lock. With a context manager, this is the lock of the steps, also for the context.
        write_lock = new_lock() if context_link is None else context_link.clock
        self._step_clock: Clock = clock if context_link is None else context_link.clock
        super().__init__(schema, State.empty(self._step_clock.now_s()), clock=clock, write_lock=write_lock)
        self._context_link = context_link
        self._step_now_s = self._step_clock.now_s
        self._readings_in_commit: Sequence[Reading[Value]] = ()
        self._audit = Audit()
        self._followers: tuple[Follower, ...] = ()
        self.on_change: Callable[[Collection[ChangeSubject]], None] | None = None
        self._handles: weakref.WeakValueDictionary[str, AgentHandle] = weakref.WeakValueDictionary()
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

    # For the context manager, for copies and for replays

    def follow_changes(self, follower: Follower) -> tuple[State, Subscription]:
        """Return the present state, and call a function with each change from now on until the subscription ends."""

        def end() -> None:
            with self._write_lock:
                self._followers = tuple(other for other in self._followers if other is not follower)

        with self._write_lock:
            self._followers = (*self._followers, follower)
            return self._state, Subscription(end)

    def abandon_tasks(self, agent: str) -> None:
        """Abort the tasks that an agent executes now, because its program is lost."""
        tasks = [task.name for task in self.model.tasks if task.by == agent]
        self.write_as(agent, [Operation(Verb.ABANDON, (task,)) for task in tasks])

    def mirror(self, reading: Reading[Value]) -> None:
        """Add a reading of a context-variable to the graph, regardless of its writer; the caller must be in a step."""
        if self._readings_in_commit and any(other_reading is reading for other_reading in self._readings_in_commit):
            return  # the graph itself wrote this reading, together with other changes
        change_set = ChangeSet(self._schema, self._state, self._step_now_s(), reading.source)
        node = self._schema.nodes_by_variable[reading.name]
        change_set.add_reading(node, change_set.history(node, reading.name), reading)
        self._publish(change_set, variable=reading.name, reading=reading)
        self._watches.request_evaluations(change_set.changed_subjects)

    def mirror_override(self, variable: str, override: Override | None) -> None:
        """Let an override hide the readings of a context-variable; None ends it. The caller must be in a step."""
        change_set = ChangeSet(self._schema, self._state, self._step_now_s(), OPERATOR)
        change_set.set_override(self._schema.nodes_by_variable[variable], variable, override)
        self._publish(change_set, variable=variable, reading=override)
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

    def _check_rule(self, agent: str, rule: str) -> None:
        with self._write_lock:
            missing_text = explain_missing(self.step_snapshot(), self._rule_of(agent, rule).before)
            if missing_text:
                message = f"the rule {rule!r} of {agent!r} cannot begin: {missing_text}"
                self._record_refusal(agent, RefusedWrite(f"{agent}.{rule}", message))
                raise RuleError(message)

    def record_rule_state(self, agent: str, name: str, state: str, message: str) -> None:
        """Record the new state of an agent's rule in the journal."""
        if self._context_link is not None:
            with self._write_lock:
                self._context_link.record_rule_state(agent, name, state, message)

    @contextmanager
    def _transaction(self, name: str, check_open: Callable[[], None], rule: str = "") -> Iterator[Transaction]:
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
            with self._write_lock:  # nothing can change between the check of the rule and the write
                if rule:
                    self._check_rule(name, rule)
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
                if verb is SET and not self._needs_operations and self._append_value(agent, arguments):
                    return None
                records: list[ChangeRecord] | None = None if self._context_link is None else []
                change_set = ChangeSet(self._schema, self._state, self._step_now_s(), agent, records)
                result = HANDLERS[verb](change_set, *arguments)
            except PermissionError as error:
                self._record_refusal(agent, self._make_refused_write(Operation(verb, arguments), str(error)))
                raise
            try:
                if change_set.changed_subjects:
                    self._commit(change_set, (Operation(verb, arguments),) if self._needs_operations else ())
            except OvertakenError:
                return self._apply_verb(agent, verb, arguments)
        return result

    def _append_value(self, agent: str, arguments: tuple[Any, ...]) -> bool:
        """Append a value to the history of an attribute, without a change set.

        This fast path applies to an attribute that was written before, in a graph whose changes are not recorded.

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
            self._publish(change_set, operations)
        else:
            if change_set.agent != GRAPH_WRITER:
                context_link.write_input(change_set.agent, operations)
            self._publish(change_set, operations)
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

    def _publish(
        self,
        change_set: ChangeSet,
        operations: Sequence[Operation] = (),
        variable: str = "",
        reading: Reading[Value] | None = None,
    ) -> None:
        """Make the state of a change set the present one, and call the followers with the change."""
        before = self._state
        if not change_set.starts_from(before):
            raise OvertakenError
        try:
            self._replace_state(before, change_set.state())
        except BaseException:  # an interrupt
            change_set.undo()
            raise
        for follower in self._followers:
            change = (self._state.version, change_set.now_s, change_set.agent, tuple(operations), variable, reading)
            follower(GraphChange(*change))

    @property
    def _needs_operations(self) -> bool:
        """Return whether a journal or a follower needs each change as operations."""
        return self._context_link is not None or bool(self._followers)

    def _release_handle(self, name: str) -> None:
        self._handles.pop(name, None)

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
        self.write_as(GRAPH_WRITER, [Operation(Verb.EXPIRE, (task,))])
