"""Agents at work: what wakes them, and how their rules are kept (P2, section 3.1: before, during, after)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from enum import StrEnum
from typing import Generic, Self, TypeVar

from codra_dsl.logic import Term
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.knowledge.declarations import Absence, Path, Pattern, RuleModel
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.watches import Change
from codra_dsl.runtime.values.condition_text import spoken

TransactionT_co = TypeVar("TransactionT_co", covariant=True)


class RuleError(PermissionError):
    """An agent would have begun what its rule does not allow now."""


class RuleState(StrEnum):
    """What becomes of a rule of an agent."""

    BEGUN = "begun"
    BROKEN = "broken"
    FULFILLED = "fulfilled"
    UNFULFILLED = "unfulfilled"


class RuleExecution(Generic[TransactionT_co]):
    """A rule of an agent under way, from the beginning to the end of a `with` statement.

    What must hold before is enforced: the action does not begin without it. What must hold during and after is
    observed: whether it does stands in `became`, and in the record.

    Attributes:
        rule: as it is declared.
        became: the latest of what became of it; None before it has begun.
    """

    def __init__(
        self,
        rule: RuleModel,
        *,
        begin: Callable[[Callable[[Snapshot], str]], None],
        transact: Callable[[Callable[[], None]], AbstractContextManager[TransactionT_co]],
        take: Callable[[], Snapshot],
        tell: Callable[[str, str], None],
        subscribe: Callable[..., Subscription],
    ) -> None:
        """Be ready to begin.

        Args:
            rule: as it is declared.
            begin: is told how to find what is lacking; it raises `RuleError` if something is.
            transact: begins a transaction, and is told what must raise nothing as its changes become visible.
            take: takes a snapshot of the present.
            tell: tells the record what became of the rule.
            subscribe: subscribes to patterns.
        """
        self.rule = rule
        self.became: RuleState | None = None
        self._begin = begin
        self._transact = transact
        self._take = take
        self._tell_record = tell
        self._subscribe = subscribe
        self._subscription: Subscription | None = None
        self._has_held = False
        self._is_over = False
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        if self.became is not None:
            raise RuntimeError("what has begun once is not begun again: call acting() anew")
        self._check_before()
        self._tell(RuleState.BEGUN, "")
        if self.rule.during:
            self._subscription = self._subscribe(self._look, *self.rule.during)
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._is_over = True
        if self._subscription is not None:
            self._subscription.unsubscribe()
        missing = lacking(self._take(), self.rule.after)
        self._tell(RuleState.UNFULFILLED if missing else RuleState.FULFILLED, missing)

    def transaction(self) -> AbstractContextManager[TransactionT_co]:
        """Begin changes that become visible together, and only if what must hold before still does at that instant.

        So nobody can come between the check and the first change.

        Raises:
            RuleError: at the end of the `with` statement, if it does not; then nothing becomes visible.
        """
        return self._transact(self._check_before)

    @property
    def may_go_on(self) -> bool:
        """Return whether what must hold during the action has not ceased to hold before what it is to bring about."""
        return self.became is not RuleState.BROKEN

    def _check_before(self) -> None:
        self._begin(lambda snapshot: lacking(snapshot, self.rule.before))

    def _look(self, change: Change) -> None:
        """Notice that what must hold during the action does not any more, once it did."""
        with self._lock:
            if change.matches or self._is_over or not self._has_held:
                self._has_held = self._has_held or bool(change.matches)
                return
            missing = lacking(change.snapshot, self.rule.during)
            is_done = not lacking(change.snapshot, self.rule.after)
            if not is_done and self.became is RuleState.BEGUN:
                self._tell(RuleState.BROKEN, missing)

    def _tell(self, became: RuleState, message: str) -> None:
        self.became = became
        self._tell_record(str(became), message)


def lacking(snapshot: Snapshot, patterns: Sequence[Pattern]) -> str:
    """Return the first pattern that does not hold by itself, or that they do not hold together; empty if they do."""
    if snapshot.holds(*patterns):
        return ""
    alone = next((pattern for pattern in patterns if not snapshot.holds(pattern)), None)
    return "they do not hold together" if alone is None else f"{_text(alone)} does not hold{_because(snapshot, alone)}"


def _because(snapshot: Snapshot, pattern: Pattern) -> str:
    """Return what is there that must not be, or of which there is none; empty where the pattern says enough."""
    if isinstance(pattern, Absence):
        found = snapshot.match(pattern.path)[0].edges
        edges = " and ".join(f"{origin} -{label}-> {target}" for origin, label, target in found)
        return f": there is {edges}" if edges else ""
    places = pattern.places if isinstance(pattern, Path) else ()
    for place in places:
        if place.name and place.name not in snapshot:
            return f": there is no {place.name}"
        if place.type and not snapshot.nodes(place.type):
            return f": there is no {place.type}"
    return ""


def _text(pattern: Pattern) -> str:
    """Return a pattern as a spec would say it, numbers in SI units."""
    return spoken(str(pattern)) if isinstance(pattern, Term) else str(pattern)
