"""P2's Deep State Representation: one graph that all agents write and read (P2, sections 3.1 to 3.3).

The graph is a value, of which each write makes another version. Versions share all that is in both, and histories know
with which version each reading came: so a snapshot is a reference, reading takes no lock, and nobody sees half a write.
"""

from __future__ import annotations

import threading
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
from codra_dsl.runtime.errors import AgentTakenError, unknown
from codra_dsl.runtime.geometry import Transform
from codra_dsl.runtime.knowledge import handshake
from codra_dsl.runtime.knowledge.agent_handle import AgentHandle, AgentPort, Transaction, closed
from codra_dsl.runtime.knowledge.change_set import ChangeRecord, ChangeSet, Touched
from codra_dsl.runtime.knowledge.context_link import ContextLink, Refused
from codra_dsl.runtime.knowledge.declarations import TASK, KnowledgeModel, Pattern
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import reads
from codra_dsl.runtime.knowledge.operations import HANDLERS, SET, Operation, Verb, operations_of
from codra_dsl.runtime.knowledge.permissions import START, Audit, Refusal
from codra_dsl.runtime.knowledge.rule_execution import RuleError, RuleExecution
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import State
from codra_dsl.runtime.knowledge.watches import Change, View, Watch, Watches, of_attribute, of_matches, of_wakes
from codra_dsl.runtime.values.cell import Reading

ResultT = TypeVar("ResultT")
SeenT = TypeVar("SeenT")

MOST_PAST = 4_096
"""Instants at which the graph changed that `at` can go back."""


class _OvertakenError(Exception):
    """While something was written, the same thread wrote something else: in the handler of a signal, for example."""


class Knowledge:
    """The graph. Threads may share it.

    Attributes:
        model: what was declared.
        moved: is told what each change touched, in the same step; for the context manager.
    """

    def __init__(self, model: KnowledgeModel, *, clock: Clock, context_link: ContextLink | None = None) -> None:
        """Make the graph that is there from the start.

        Args:
            model: what a spec was compiled to.
            clock: real or simulated time; not one that holds a lock while events happen.
            context_link: what it has in common with a context manager; None if it is a graph by itself.

        Raises:
            ValueError: if the declarations contradict each other.
            LookupError: if they use what they do not declare.
        """
        self._schema = GraphSchema(model, () if context_link is None else context_link.variables)
        self.model = self._schema.model
        self._clock = clock
        self._now_s = clock.now_s
        self._context_link = context_link
        # Whoever writes takes this turn. With a context manager it is a step, which holds the one lock of both sides.
        self._steps: Clock = clock if context_link is None else context_link.steps
        self._step_now_s = self._steps.now_s
        self._turn: AbstractContextManager[object] = threading.RLock() if context_link is None else context_link.steps
        self._state = State.empty(self._step_now_s())
        self._past: deque[State] = deque(maxlen=MOST_PAST - 1)
        self._held: Sequence[Reading[Value]] = ()
        self._audit = Audit()
        self._watches = Watches()
        self.moved: Callable[[Collection[Touched]], None] | None = None
        self._handles: weakref.WeakValueDictionary[str, AgentHandle] = weakref.WeakValueDictionary()
        self._handles_lock = threading.Lock()
        self._woken: dict[int, AgentHandle] = {}  # who is called back has not dropped its handle
        self._write(START, partial(_begin, self.model))

    # Writing

    def as_agent(self, name: str) -> AgentHandle:
        """Return the handle through which an agent writes; while it is open nobody else can write under this name.

        It is closed by `close`, at the end of its `with` statement, or when nobody holds it any more.

        Raises:
            UnknownNameError: if no such agent is declared.
            AgentTakenError: if a handle of the agent is open.
        """
        if name not in self._schema.agents:
            raise unknown("agent", name, self._schema.agents)
        with self._handles_lock:
            if name not in self._handles:
                handle = self._handle(name)
                self._handles[name] = handle
                return handle
        why = f"the agent {name!r} is taken: its handle must be closed before there is another"
        with self._turn:
            self._refuse(name, Refused(name, why))
        raise AgentTakenError(why)

    def refusals(self) -> tuple[Refusal, ...]:
        """Return the writes that were refused, the oldest first, as far as the audit goes back."""
        return self._audit.refusals()

    # Reading

    def snapshot(self) -> Snapshot:
        """Return the graph as it is now, for good."""
        return Snapshot(self._schema, self._state, self._now_s())

    def at(self, instant_s: float) -> Snapshot:
        """Return the graph as it was at an instant, with what was known of it then.

        Raises:
            ValueError: if the instant lies in the future, or before all that is still held.
        """
        if not instant_s <= self._now_s():
            raise ValueError(f"it is {self._now_s()} now: what is at {instant_s} is not known yet")
        with self._turn:
            states = chain((self._state,), reversed(self._past))
            found = next((state for state in states if state.since_s <= instant_s), None)
            begin_s = self._past[0].since_s if self._past else self._state.since_s
        if found is None:
            raise ValueError(f"the graph is held from {begin_s} s on, not from {instant_s}: a journal has the rest")
        return Snapshot(self._schema, found, instant_s)

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return what is known of an attribute of a node now; it raises what `Snapshot.get` does."""
        return Snapshot(self._schema, self._state, self._now_s()).get(name, attribute)

    def transform(self, target: str, source: str, instant_s: float | None = None) -> Transform:
        """Return where one node stands in another, now or at an instant; it raises what `Snapshot.transform` does."""
        return self._state.frames.transform(target, source, self._now_s() if instant_s is None else instant_s)

    # Waiting and being told

    def subscribe(self, callback: Callable[[Change], object], *patterns: Pattern) -> Subscription:
        """Call back when patterns hold in other ways than before, and first if they hold now.

        The callback runs without any lock, one call at a time: in real time in a thread of its own, in simulated time
        as an event at the instant of the change, which must not wait. What it raises is logged. It is told how things
        are when it is free, not each step that led there.

        Raises:
            UnknownNameError: if a pattern names a type that is not declared.
        """
        self.snapshot().match(*patterns)
        return self._watch(reads(self._schema, patterns), *of_matches(self._schema, patterns, callback))

    def follow(self, name: str, attribute: str, callback: Callable[[Reading[Any]], object]) -> Subscription:
        """Call back, as `subscribe` does, with what an attribute of a node is, and whenever there is newer evidence.

        Raises:
            AbsentError: if there is no such node.
            UnknownNameError: if nodes of its type have no such attribute.
        """
        self.get(name, attribute)
        return self._watch([(name, attribute)], *of_attribute(name, attribute, callback))

    def wait_for(self, *patterns: Pattern, timeout_s: float) -> bool:
        """Wait until patterns hold; return whether they came to.

        Raises:
            UnknownNameError: if a pattern names a type that is not declared.
        """
        self.snapshot().match(*patterns)
        return self._clock.wait_until(lambda: self.snapshot().holds(*patterns), timeout_s)

    # For the context manager and for replays

    def mirror(self, reading: Reading[Value]) -> None:
        """Take a reading of a context-variable, of whoever wrote it; the caller is in a step."""
        if self._held and any(each is reading for each in self._held):
            return  # it is in the graph already, with all that was written with it
        change_set = ChangeSet(self._schema, self._state, self._step_now_s(), reading.source)
        node = self._schema.variables[reading.name]
        change_set.take_in(node, change_set.history(node, reading.name), reading)
        self._hold_draft(change_set)
        self._watches.changed(change_set.touched)

    def in_step(self) -> Snapshot:
        """Return the graph as it is at the instant of the present step."""
        return Snapshot(self._schema, self._state, self._steps.now_s())

    def take_down(self, agent: str, why: str) -> None:
        """Take down, for the audit, a write of a context-variable that the context has refused and told."""
        self._audit.refuse(Refusal(instant_s=self._now_s(), agent=agent, why=why))

    def redo(self, agent: str, plain: Iterable[list[Any]]) -> None:
        """Do again, as one, what a journal tells that an agent did.

        Raises:
            LookupError: if it cannot be done; ValueError, TypeError, PermissionError and RuntimeError likewise.
        """
        operations = operations_of(plain)

        def do(change_set: ChangeSet) -> None:
            for operation in operations:
                operation.apply(change_set)

        self._write(agent, do, operations)

    def refuse_again(self, agent: str, refused: Refused) -> None:
        """Tell again what a journal tells of a write that was refused."""
        with self._turn:
            self._refuse(agent, refused)

    # Within

    def _handle(self, name: str) -> AgentHandle:
        is_closed = False
        wakes: list[Subscription] = []

        def check() -> None:
            if is_closed:
                closed(name)

        def wake(handle: AgentHandle, callback: Callable[[Change], object]) -> Subscription:
            check()
            wakes.append(self._on_wake(handle, callback))
            return wakes[-1]

        def close() -> None:
            nonlocal is_closed
            with self._handles_lock:
                if not is_closed:
                    is_closed = True
                    self._handles.pop(name, None)
            for subscription in wakes:
                subscription.unsubscribe()

        port = AgentPort(
            commit=partial(self._do, name),
            transact=lambda: self._transaction(name, check, _nothing),
            wake=wake,
            act=partial(self._acting, name, check),
            close=close,
            check_open=check,
        )
        return AgentHandle(name, port)

    def _on_wake(self, handle: AgentHandle, callback: Callable[[Change], object]) -> Subscription:
        wakes = tuple(pattern for each in self.model.agents if each.name == handle.name for pattern in each.wakes)
        return self._watch(reads(self._schema, wakes), *of_wakes(self._schema, wakes, callback), for_whom=handle)

    def _acting(self, agent: str, check: Callable[[], None], name: str) -> RuleExecution[Transaction]:
        rules = {rule.name: rule for each in self.model.agents if each.name == agent for rule in each.rules}
        if name not in rules:
            raise unknown(f"rule of {agent!r}", name, rules)
        return RuleExecution(
            rules[name],
            begin=partial(self._begin_rule, agent, name),
            transact=partial(self._transaction, agent, check),
            take=self.snapshot,
            tell=partial(self.write_rule, agent, name),
            subscribe=self.subscribe,
        )

    def _begin_rule(self, agent: str, name: str, lacking: Callable[[Snapshot], str]) -> None:
        """Refuse to begin what a rule does not allow in the present graph."""
        with self._turn:
            missing = lacking(self.in_step())
            if missing:
                why = f"the rule {name!r} of {agent!r} cannot begin: {missing}"
                self._refuse(agent, Refused(f"{agent}.{name}", why))
                raise RuleError(why)

    def write_rule(self, agent: str, name: str, became: str, message: str) -> None:
        """Tell the journal what became of a rule of an agent."""
        if self._context_link is not None:
            with self._turn:
                self._context_link.write_rule(agent, name, became, message)

    @contextmanager
    def _transaction(self, name: str, check: Callable[[], None], allow: Callable[[], None]) -> Iterator[Transaction]:
        check()
        base = self._state
        change_set = ChangeSet(self._schema, base, self._now_s(), name)

        def attempt(operation: Operation) -> Any:
            change_set.now_s = self._step_now_s()  # evidence may have been taken since the transaction began
            try:
                return operation.apply(change_set)
            except PermissionError as error:
                self._refuse(name, self._refused(operation, str(error)))
                raise

        transaction = Transaction(attempt, self._turn)
        try:
            yield transaction
        finally:
            transaction.end()
        transaction.check()
        if change_set.touched:
            check()
            with self._turn:  # so that what `allow` finds is still so
                allow()
                self._write(name, partial(self._take, base, change_set, transaction), transaction.operations)

    def _take(self, base: State, change_set: ChangeSet, transaction: Transaction, present: ChangeSet) -> None:
        """Take over what a transaction has made of the graph; make it again if that is not the present graph.

        In a step of a context manager it is made again in any case, so that all of it is of the instant of the step.
        """
        if self._context_link is None and present.is_of(base):
            present.take(change_set)
        else:
            transaction.again(present)

    def _write(
        self, agent: str, change: Callable[[ChangeSet], ResultT], operations: Sequence[Operation] = ()
    ) -> ResultT:
        """Apply a change, and tell those who watch."""
        with self._turn:
            change_set = ChangeSet(
                self._schema, self._state, self._step_now_s(), agent, None if self._context_link is None else []
            )
            try:
                result = change(change_set)
            except PermissionError as error:
                self._refuse(agent, self._refused(change_set.operation, str(error)))
                raise
            try:
                if change_set.touched:
                    self._commit(change_set, operations)
            except _OvertakenError:
                return self._write(agent, change, operations)
        return result

    def _do(self, agent: str, verb: Verb, given: tuple[Any, ...]) -> Any:
        """Do one thing as an agent, and tell those who watch; return what the agent is told.

        As `_write`, for what is done most: it makes an operation only where somebody is told of it.
        """
        with self._turn:
            try:
                if verb is SET and self._context_link is None and self._append(agent, given):
                    return None
                notes: list[ChangeRecord] | None = None if self._context_link is None else []
                change_set = ChangeSet(self._schema, self._state, self._step_now_s(), agent, notes)
                result = HANDLERS[verb](change_set, *given)
            except PermissionError as error:
                self._refuse(agent, self._refused(Operation(verb, given), str(error)))
                raise
            try:
                if change_set.touched:
                    self._commit(change_set, () if self._context_link is None else (Operation(verb, given),))
            except _OvertakenError:
                return self._do(agent, verb, given)
        return result

    def _append(self, agent: str, given: tuple[Any, ...]) -> bool:
        """Set an attribute that was written before, in a graph by itself: its history takes it, without a draft.

        Returns:
            Whether that was possible; if not, nothing has been done.
        """
        name, attribute, value, evidence_s = given
        state = self._state
        node = state.nodes.get(name)
        if node is None:
            return False
        history = node.histories.get(attribute)
        if history is None or agent not in history.declared.permissions.writers:
            return False
        after = state.next(self._step_now_s())
        reading = history.written(agent, after.since_s, value, evidence_s, state.version)
        if self._state is not state:
            return False
        try:
            longer = history.with_reading(reading, after.version)
            if longer is not history:
                after.nodes = state.nodes.with_entry(name, node.with_history(longer))
            self._hold(state, after)
        except BaseException as error:  # an interrupt
            history.cut(reading)
            if isinstance(error, _OvertakenError):
                return False
            raise
        self._watches.changed([(name, attribute)])
        self._clock.notify()
        return True

    def _commit(self, change_set: ChangeSet, operations: Sequence[Operation]) -> None:
        """Put what a draft has become in the place of the present state; tell the journal, the context, who watches."""
        context_link = self._context_link
        if context_link is None:
            self._hold_draft(change_set)
        else:
            context_link.write_input(change_set.agent, operations)
            self._hold_draft(change_set)
            self._held = change_set.shared
            try:
                context_link.commit(change_set, self._state.version)
            finally:
                self._held = ()
        for instant_s, handover in change_set.deadlines:
            self._steps.call_at(instant_s, partial(self._expire, handover.task))
        if self.moved is not None:
            self.moved(change_set.touched)
        self._watches.changed(change_set.touched)
        self._clock.notify()

    def _hold_draft(self, change_set: ChangeSet) -> None:
        """Put the state that a draft makes in the place of the present one."""
        before = self._state
        if not change_set.is_of(before):
            raise _OvertakenError
        try:
            self._hold(before, change_set.state())
        except BaseException:  # an interrupt
            change_set.undo()
            raise

    def _hold(self, before: State, after: State) -> None:
        """Put a state in the place of the present one, which is kept for `at` if it is the last of its instant."""
        if before.since_s != after.since_s:
            self._past.append(before)
        if self._state is not before:
            raise _OvertakenError
        self._state = after

    def _refused(self, operation: Operation, why: str) -> Refused:
        if self._context_link is None:
            return Refused(operation.subject, why)
        return self._context_link.refused(operation, why, self._schema.variables)

    def _refuse(self, agent: str, refused: Refused) -> None:
        """Take down a refusal; the caller has the turn."""
        self._audit.refuse(Refusal(instant_s=self._steps.now_s(), agent=agent, why=refused.why))
        if self._context_link is not None:
            self._context_link.refuse(agent, refused)

    def _expire(self, task: str) -> None:
        self._write(START, lambda change_set: handshake.expire(change_set, task))

    def _watch(
        self,
        touched: Iterable[Touched],
        look: Callable[[Snapshot], View[SeenT]],
        tell: Callable[[Snapshot, SeenT], None],
        for_whom: AgentHandle | None = None,
    ) -> Subscription:
        keys = list(touched)

        def end() -> None:
            self._watches.remove(watch, keys)
            self._woken.pop(id(watch), None)

        watch: Watch[SeenT] = Watch(self._clock, self.snapshot, look, tell, end)
        if for_whom is not None:
            self._woken[id(watch)] = for_whom
        self._watches.add(watch, keys)
        watch.changed()
        return watch.subscription


def _nothing() -> None:
    pass


def _begin(model: KnowledgeModel, change_set: ChangeSet) -> None:
    """Write what is there from the start."""
    for node in model.nodes:
        change_set.insert_node(node.name, node.type, node.values)
    for task in model.tasks:
        change_set.insert_node(task.name, TASK, {})
    for edge in model.edges:
        change_set.begin_edge(edge)
