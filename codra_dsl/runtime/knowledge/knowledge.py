"""P2's Deep State Representation: one graph that all agents write and read (P2, sections 3.1 to 3.3).

The graph is one immutable value. A write makes another value, which shares with the one before all that it did not
change, and puts it in its place: so a snapshot is a reference, reading takes no lock, and nobody sees half a write.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from codra_dsl.runtime.cell import Reading
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.geometry import Transform
from codra_dsl.runtime.knowledge import handshake
from codra_dsl.runtime.knowledge.declarations import TASK, KnowledgeModel, Pattern
from codra_dsl.runtime.knowledge.draft import Draft, Touched
from codra_dsl.runtime.knowledge.matching import reads
from codra_dsl.runtime.knowledge.rights import START, Audit, Refusal
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import State
from codra_dsl.runtime.knowledge.watching import Change, Sight, Watch, Watches, of_attribute, of_matches
from codra_dsl.runtime.knowledge.words import Words
from codra_dsl.runtime.knowledge.writing import AgentHandle, Transaction
from codra_dsl.runtime.names import unknown
from codra_dsl.runtime.subscriptions import Subscription

ResultT = TypeVar("ResultT")
SeenT = TypeVar("SeenT")


class AgentTakenError(PermissionError):
    """An agent was to be taken of which a handle is open."""


class Knowledge:
    """The graph. Threads may share it.

    Attributes:
        model: what was declared.
    """

    def __init__(self, model: KnowledgeModel, *, clock: Clock) -> None:
        """Make the graph that is there from the start.

        Args:
            model: what a spec was compiled to.
            clock: real or simulated time.

        Raises:
            ValueError: if the declarations contradict each other.
            LookupError: if they use what they do not declare.
        """
        self.model = model
        self._words = Words(model)
        self._clock = clock
        self._now_s = clock.now_s
        self._lock = threading.Lock()
        self._state = State()
        self._audit = Audit()
        self._watches = Watches()
        self._handles: weakref.WeakValueDictionary[str, AgentHandle] = weakref.WeakValueDictionary()
        self._write(START, partial(_begin, model))

    # Writing

    def as_agent(self, name: str) -> AgentHandle:
        """Return the handle through which an agent writes; while it is open nobody else can write under this name.

        It is closed by `close`, at the end of its `with` statement, or when nobody holds it any more.

        Raises:
            UnknownNameError: if no such agent is declared.
            AgentTakenError: if a handle of the agent is open.
        """
        if name not in self._words.agents:
            raise unknown("agent", name, self._words.agents)
        with self._lock:
            if name in self._handles:
                why = f"the agent {name!r} is taken: its handle must be closed before there is another"
                self._audit.refuse(Refusal(instant_s=self._now_s(), agent=name, why=why))
                raise AgentTakenError(why)
            handle = self._handle(name)
            self._handles[name] = handle
        return handle

    def refusals(self) -> tuple[Refusal, ...]:
        """Return the writes that were refused, the oldest first, as far as the audit goes back."""
        return self._audit.refusals()

    # Reading

    def snapshot(self) -> Snapshot:
        """Return the graph as it is now, for good."""
        return Snapshot(self._words, self._state, self._now_s())

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return what is known of an attribute of a node now; it raises what `Snapshot.get` does."""
        return Snapshot(self._words, self._state, self._now_s()).get(name, attribute)

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
        return self._watch(reads(self._words, patterns), *of_matches(self._words, patterns, callback))

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

    # Within

    def _handle(self, name: str) -> AgentHandle:
        closed = threading.Event()

        def commit(change: Callable[[Draft], ResultT]) -> ResultT:
            if closed.is_set():
                raise PermissionError(f"this handle of the agent {name!r} is closed")
            return self._write(name, change)

        def close() -> None:
            if not closed.is_set():
                closed.set()
                with self._lock:
                    self._handles.pop(name, None)

        return AgentHandle(name, self._words, commit, lambda: self._transaction(name, commit), close)

    @contextmanager
    def _transaction(self, name: str, commit: Callable[[Callable[[Draft], None]], None]) -> Iterator[Transaction]:
        base = self._state
        draft = Draft(self._words, base, self._now_s(), name)
        transaction = Transaction(self._words, lambda change: self._audited(draft, change))
        try:
            yield transaction
        finally:
            transaction.end()
        transaction.check()
        if draft.touched:
            commit(lambda present: present.take(draft) if present.is_of(base) else transaction.again(present))

    def _write(self, agent: str, change: Callable[[Draft], ResultT]) -> ResultT:
        """Apply a change, and tell those who watch."""
        with self._lock:
            draft = Draft(self._words, self._state, self._now_s(), agent)
            result = self._audited(draft, change)
            if draft.touched:
                self._state = draft.state()
        if draft.touched:
            for instant_s, handover in draft.deadlines:
                self._clock.call_at(instant_s, partial(self._expire, handover.task))
            self._watches.changed(draft.touched)
            self._clock.notify()
        return result

    def _audited(self, draft: Draft, change: Callable[[Draft], ResultT]) -> ResultT:
        try:
            return change(draft)
        except PermissionError as error:
            self._audit.refuse(Refusal(instant_s=draft.now_s, agent=draft.agent, why=str(error)))
            raise

    def _expire(self, task: str) -> None:
        self._write(START, lambda draft: handshake.expire(self._words, draft, task))

    def _watch(
        self,
        touched: Iterable[Touched],
        look: Callable[[Snapshot], Sight[SeenT]],
        tell: Callable[[Snapshot, SeenT], None],
    ) -> Subscription:
        keys = list(touched)
        watch: Watch[SeenT] = Watch(self._clock, self.snapshot, look, tell, lambda: self._watches.remove(watch, keys))
        self._watches.add(watch, keys)
        watch.changed()
        return watch.subscription


def _begin(model: KnowledgeModel, draft: Draft) -> None:
    """Write what is there from the start."""
    for node in model.nodes:
        draft.insert_node(node.name, node.type, node.values)
    for task in model.tasks:
        draft.insert_node(task.name, TASK, {})
    for edge in model.edges:
        draft.begin_edge(edge)
