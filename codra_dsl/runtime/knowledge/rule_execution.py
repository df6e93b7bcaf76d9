"""Execution of the rules of agents (P2, section 3.1: before, during, after).

The runtime enforces `before`, and only observes `during` and `after`: whether an action has its intended effect depends
on the world and not on the runtime.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from enum import StrEnum
from typing import Generic, Self, TypeVar

from codra_dsl.logic import Term
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.knowledge.declarations import Absence, Path, Pattern, RuleModel
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.watches import Change
from codra_dsl.runtime.values.condition_text import format_condition

TransactionT_co = TypeVar("TransactionT_co", covariant=True)


class RuleError(PermissionError):
    """An agent tried to begin an action that its rule does not allow now."""


class RuleState(StrEnum):
    """The states of a rule execution."""

    BEGUN = "begun"
    BROKEN = "broken"
    FULFILLED = "fulfilled"
    UNFULFILLED = "unfulfilled"


class RuleExecution(Generic[TransactionT_co]):
    """The execution of an agent's rule, from the beginning to the end of a `with` statement.

    The `before` patterns are enforced: the action does not begin unless they hold. The `during` and `after` patterns
    are observed: the result is in `state` and in the event log.

    Attributes:
        rule: the declaration of the rule.
        state: the latest state; None before the execution has begun.
        check_before: raises `RuleError` if a `before` pattern does not hold now.
    """

    def __init__(
        self,
        rule: RuleModel,
        *,
        check_rule: Callable[[], None],
        begin_transaction: Callable[[], AbstractContextManager[TransactionT_co]],
        take_snapshot: Callable[[], Snapshot],
        record_state: Callable[[str, str], None],
        subscribe: Callable[..., Subscription],
    ) -> None:
        """Prepare the execution.

        Args:
            rule: the declaration of the rule.
            check_rule: raises `RuleError` if a `before` pattern does not hold.
            begin_transaction: begins a transaction whose changes become visible only if the `before` patterns hold.
            take_snapshot: returns a snapshot of the present graph.
            record_state: records the new state of the rule in the event log.
            subscribe: subscribes to patterns.
        """
        self.rule = rule
        self.state: RuleState | None = None
        self.check_before = check_rule
        self._begin_transaction = begin_transaction
        self._take_snapshot = take_snapshot
        self._record_state = record_state
        self._subscribe = subscribe
        self._subscription: Subscription | None = None
        self._has_held = False
        self._is_over = False
        self._lock = new_lock()

    def __enter__(self) -> Self:
        if self.state is not None:
            raise RuntimeError("this execution of the rule has already begun: call acting() again for another one")
        self.check_before()
        self._set_state(RuleState.BEGUN, "")
        if self.rule.during:
            self._subscription = self._subscribe(self._check_during, *self.rule.during)
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._is_over = True
        if self._subscription is not None:
            self._subscription.unsubscribe()
        missing_text = explain_missing(self._take_snapshot(), self.rule.after)
        self._set_state(RuleState.UNFULFILLED if missing_text else RuleState.FULFILLED, missing_text)

    def transaction(self) -> AbstractContextManager[TransactionT_co]:
        """Begin changes that become visible together, and only if the `before` patterns still hold at that instant.

        No other write can come between the check of these patterns and the changes.

        Raises:
            RuleError: at the end of the `with` statement, if a `before` pattern does not hold. Then no change becomes
                visible.
        """
        return self._begin_transaction()

    @property
    def may_go_on(self) -> bool:
        """Return whether the rule is not broken. A rule is broken if `during` ceases to hold before `after` holds."""
        return self.state is not RuleState.BROKEN

    def _check_during(self, change: Change) -> None:
        """Break the rule if the `during` patterns have held and no longer hold before the `after` patterns hold."""
        with self._lock:
            if change.matches or self._is_over or not self._has_held:
                self._has_held = self._has_held or bool(change.matches)
                return
            missing_text = explain_missing(change.snapshot, self.rule.during)
            is_done = not explain_missing(change.snapshot, self.rule.after)
            if not is_done and self.state is RuleState.BEGUN:
                self._set_state(RuleState.BROKEN, missing_text)

    def _set_state(self, state: RuleState, message: str) -> None:
        self.state = state
        self._record_state(str(state), message)


def explain_missing(snapshot: Snapshot, patterns: Sequence[Pattern]) -> str:
    """Return why there is no match in which all of the patterns hold; empty if there is such a match.

    The reason is the first pattern that does not hold by itself, if there is such a pattern.
    """
    if snapshot.holds(*patterns):
        return ""
    unmet_pattern = next((pattern for pattern in patterns if not snapshot.holds(pattern)), None)
    return (
        "each pattern holds by itself, but there is no match in which all of them hold"
        if unmet_pattern is None
        else f"{_pattern_text(unmet_pattern)} does not hold{_explanation(snapshot, unmet_pattern)}"
    )


def _explanation(snapshot: Snapshot, pattern: Pattern) -> str:
    """Return the unwanted edges, or the missing node or type of nodes; empty if the pattern explains enough."""
    if isinstance(pattern, Absence):
        edge_keys = snapshot.match(pattern.path)[0].edges
        edges_text = " and ".join(f"{origin} -{label}-> {target}" for origin, label, target in edge_keys)
        return f": there is {edges_text}" if edges_text else ""
    places = pattern.places if isinstance(pattern, Path) else ()
    for place in places:
        if place.name and place.name not in snapshot:
            return f": there is no {place.name}"
        if place.type and not snapshot.nodes(place.type):
            return f": there is no {place.type}"
    return ""


def _pattern_text(pattern: Pattern) -> str:
    """Return a pattern in the notation of specs, with numbers in SI units."""
    return format_condition(str(pattern)) if isinstance(pattern, Term) else str(pattern)
