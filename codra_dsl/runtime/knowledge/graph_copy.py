"""A copy of a graph that belongs to another program: the program's changes keep it equal to the graph."""

from __future__ import annotations

from collections.abc import Callable

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.plain_graph import PlainGraph, change_of, state_of
from codra_dsl.runtime.knowledge.shared_graph import SharedGraph
from codra_dsl.runtime.knowledge.state import State


class DivergedError(ValueError):
    """A change cannot be applied to a copy, so the copy does not equal its graph."""


class GraphCopy(SharedGraph):
    """A copy of the graph of another program. Reading it needs no message, and each snapshot is consistent.

    The changes of the graph arrive in order, so the copy goes through the same versions as the graph.
    """

    def __init__(self, schema: GraphSchema, *, clock: Clock, check_current: Callable[[], None]) -> None:
        """Begin without a state; changes wait until `join` is called.

        Args:
            schema: the declarations of the graph.
            clock: the clock of the graph's program, as this program sees it.
            check_current: raises ConnectionError if the copy may be out of date; each reading call calls it first.
        """
        super().__init__(schema, State.empty(0.0), clock=clock, write_lock=new_lock())
        self._waiting_changes: list[PlainGraph] | None = []

        def now_s() -> float:
            check_current()
            return clock.now_s()

        self._now_s = now_s

    def join(self, plain: PlainGraph) -> None:
        """Begin with a state of the graph, and apply the changes that have arrived since.

        Raises:
            DivergedError: if the state does not fit to the declarations.
        """
        with self._write_lock:
            try:
                self._state = state_of(plain, self._schema)
            except (ValueError, LookupError, TypeError) as error:
                raise DivergedError(f"the graph does not fit to the declarations: {error}") from None
            waiting_changes, self._waiting_changes = self._waiting_changes or [], None
            for change in waiting_changes:
                self._apply(change)

    def receive(self, plain: PlainGraph) -> None:
        """Apply a change of the graph.

        Raises:
            DivergedError: if the change does not follow the state of the copy.
        """
        with self._write_lock:
            if self._waiting_changes is None:
                self._apply(plain)
            else:
                self._waiting_changes.append(plain)
        self._clock.notify()

    def _apply(self, plain: PlainGraph) -> None:
        before = self._state
        try:
            change = change_of(plain)
            if change.version <= before.version:
                return  # the state that the copy began with contains this change
            if change.version != before.version + 1:
                raise ValueError(f"change {change.version} follows change {before.version}")
            change_set = ChangeSet(self._schema, before, change.instant_s, change.agent)
            change.apply(change_set)
        except (ValueError, LookupError, TypeError, RuntimeError, PermissionError) as error:
            raise DivergedError(f"the copy of the graph differs from the manager's graph: {error}") from None
        self._replace_state(before, change_set.state())
        self._watches.request_evaluations(change_set.changed_subjects)
