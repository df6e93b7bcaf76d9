"""How the decisions of a run were answered, and how they would have been answered in a replay."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from codra_dsl.logic import Value
from codra_dsl.runtime.context.decisions import ValueDecision
from codra_dsl.runtime.journal.events import Event


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionCounts:
    """The decisions of a run on one variable, or on all variables.

    Attributes:
        decisions: the number of decisions that the run made.
        recorded: the number of decisions for which context had the answer in the run. In shadow mode, the main
            execution looks even if context has the answer.
        replayed: the number of decisions for which context has the answer in the replay.
        gained: decisions for which only the replay has an answer from context.
        lost: decisions for which only the run had an answer from context.
        other_value: decisions for which both had an answer from context, with different values.
        unknown: decisions for which the journal does not show how they would have been answered.
        assumed: decisions, among all others, whose answer assumes that the package looks when the run looked.
    """

    decisions: int = 0
    recorded: int = 0
    replayed: int = 0
    gained: int = 0
    lost: int = 0
    other_value: int = 0
    unknown: int = 0
    assumed: int = 0


class _Answer(StrEnum):
    CONTEXT = "context"
    LOOK = "look"
    UNKNOWN = "unknown"


class _Answered(NamedTuple):
    """How one decision was answered, or would have been answered."""

    answer: _Answer
    value: Value | None = None
    is_assumed: bool = False


_DecisionKey = tuple[str, float]
"""The variable of a decision, and the instant of the question."""


class DecisionComparison:
    """Compares the decisions of a run, as they are read from its journal, with those of its replay."""

    def __init__(self, is_in_range: Callable[[float], bool]) -> None:
        """Count only decisions whose questions were asked in a range of time."""
        self._is_in_range = is_in_range
        self._recorded: dict[_DecisionKey, deque[_Answered]] = defaultdict(deque)
        self._replayed: dict[_DecisionKey, deque[_Answered]] = defaultdict(deque)
        self._answered_keys: set[_DecisionKey] = set()
        self._counts: dict[str, dict[str, int]] = {}

    def add_recorded(self, event: Event) -> None:
        """Add a decision of the run."""
        key = (event.name, float(event.details["asked_s"]))
        has_answer = event.what in ("answered", "shadowed")
        if event.what == "answered":
            self._answered_keys.add(key)
        value = event.details.get("value")
        self._recorded[key].append(_Answered(_Answer.CONTEXT, value) if has_answer else _Answered(_Answer.LOOK))
        self._match(key)

    def add_replayed(self, decision: ValueDecision, *, is_determined: bool, is_assumed: bool) -> None:
        """Add a decision of the replay that context has answered, or for which the main execution begins to look."""
        key = (decision.request.variable, decision.asked_s)
        if not is_determined:
            answered = _Answered(_Answer.UNKNOWN)
        elif decision.is_decided:
            answered = _Answered(_Answer.CONTEXT, decision.reading.content, is_assumed)
        else:
            answered = _Answered(_Answer.LOOK, None, is_assumed)
        self._replayed[key].append(answered)
        self._match(key)

    def take_recorded_answer(self, decision: ValueDecision) -> bool:
        """Return whether the run, as far as it was read, answered a decision without a look; forget this answer."""
        key = (decision.request.variable, decision.asked_s)
        was_answered = key in self._answered_keys
        self._answered_keys.discard(key)
        return was_answered

    def counts(self) -> Mapping[str, DecisionCounts]:
        """Return the counts of each variable. A decision that the replay could not ask or answer is unknown."""
        for key, answers in self._recorded.items():
            for answered in answers:
                self._count(key, answered, _Answered(_Answer.UNKNOWN))
        self._recorded.clear()
        return {variable: DecisionCounts(**self._counts[variable]) for variable in sorted(self._counts)}

    def _match(self, key: _DecisionKey) -> None:
        if self._recorded[key] and self._replayed[key]:
            self._count(key, self._recorded[key].popleft(), self._replayed[key].popleft())
        for answers in (self._recorded, self._replayed):
            if not answers[key]:
                del answers[key]

    def _count(self, key: _DecisionKey, recorded: _Answered, replayed: _Answered) -> None:
        variable, asked_s = key
        if not self._is_in_range(asked_s):
            return
        was_context, is_context = recorded.answer is _Answer.CONTEXT, replayed.answer is _Answer.CONTEXT
        counts = self._counts.setdefault(variable, dict.fromkeys(DecisionCounts.__dataclass_fields__, 0))
        counts["decisions"] += 1
        counts["recorded"] += was_context
        counts["replayed"] += is_context
        counts["gained"] += is_context and not was_context
        counts["lost"] += was_context and replayed.answer is _Answer.LOOK
        counts["other_value"] += was_context and is_context and recorded.value != replayed.value
        counts["unknown"] += replayed.answer is _Answer.UNKNOWN
        counts["assumed"] += replayed.is_assumed


def total(counts: Mapping[str, DecisionCounts]) -> DecisionCounts:
    """Return the sum of the counts of all variables."""
    names = DecisionCounts.__dataclass_fields__
    return DecisionCounts(**{name: sum(getattr(row, name) for row in counts.values()) for name in names})
