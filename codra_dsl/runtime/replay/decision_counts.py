"""How the decisions of a run were answered, and how they would have been answered in a replay."""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from codra_dsl.logic import Value
from codra_dsl.runtime.context.decisions import Decision, Preview
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.replay.undetermined import Undetermined
from codra_dsl.runtime.values.declarations import OPERATOR


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
        assumed: decisions, among all others, whose answer rests on an assumption: the package looks when the run
            looked, and an algorithm receives the same values of context-variables as in the run.
    """

    decisions: int = 0
    recorded: int = 0
    replayed: int = 0
    gained: int = 0
    lost: int = 0
    other_value: int = 0
    unknown: int = 0
    assumed: int = 0


class _Answer(NamedTuple):
    """How one decision was answered, or would have been answered.

    Attributes:
        is_context: whether context has the answer; None if the journal does not show this.
        value: this answer.
    """

    is_context: bool | None
    value: Value | None = None
    is_assumed: bool = False


_DecisionKey = tuple[str, float]
"""The variable or skill of a decision, and the instant of the question."""


class DecisionComparison:
    """Compares the decisions of a run, as they are read from its journal, with those of its replay."""

    def __init__(self, from_s: float) -> None:
        """Count only decisions whose questions were not asked before an instant."""
        self._from_s = from_s
        self._recorded: dict[_DecisionKey, deque[_Answer]] = defaultdict(deque)
        self._replayed: dict[_DecisionKey, deque[_Answer]] = defaultdict(deque)
        self._ended_keys: set[_DecisionKey] = set()
        self._doubtful_keys: set[_DecisionKey] = set()
        self._counts: dict[str, Counter[str]] = defaultdict(Counter)

    def add_recorded(self, event: Event) -> None:
        """Add a decision or preview of the run. Previews are not counted."""
        key = (event.name, float(event.details["asked_s"]))
        if event.what == "answered" or event.kind is Kind.PREVIEW:
            self._ended_keys.add(key)
        if event.kind is Kind.DECISION:
            is_context = event.what in ("answered", "shadowed")
            self._recorded[key].append(_Answer(is_context, event.details.get("value") if is_context else None))
            self._match(key)

    def add_replayed(self, decision: Decision, undetermined: Undetermined) -> None:
        """Add a decision of the replay that context has answered, or for which the main execution begins to look."""
        if isinstance(decision, Preview):
            return
        key = (decision.name, decision.asked_s)
        is_observed = decision.reading.source != OPERATOR  # the journal shows all overrides
        if (is_observed and decision.name in undetermined.variables) or key in self._doubtful_keys:
            answer = _Answer(None)
        else:
            value = decision.reading.content if decision.is_decided else None
            is_assumed = is_observed and decision.name in undetermined.assumed_variables
            answer = _Answer(decision.is_decided, value, is_assumed)
        self._replayed[key].append(answer)
        self._match(key)

    def doubt_if_ended(self, decision: Decision) -> None:
        """Count a decision of the replay as unknown, if the run has ended it already."""
        key = (decision.name, decision.asked_s)
        if key in self._ended_keys:
            self._doubtful_keys.add(key)

    def take_recorded_end(self, decision: Decision) -> bool:
        """Return whether the run, as far as it was read, ended a decision without a further look; forget this."""
        key = (decision.name, decision.asked_s)
        has_ended = key in self._ended_keys
        self._ended_keys.discard(key)
        return has_ended

    def counts(self) -> Mapping[str, DecisionCounts]:
        """Return the counts of each variable. A decision that the replay could not ask or answer is unknown."""
        for key, answers in self._recorded.items():
            for answer in answers:
                self._count(key, answer, _Answer(None))
        self._recorded.clear()
        return {variable: DecisionCounts(**self._counts[variable]) for variable in sorted(self._counts)}

    def _match(self, key: _DecisionKey) -> None:
        if self._recorded[key] and self._replayed[key]:
            self._count(key, self._recorded[key].popleft(), self._replayed[key].popleft())
        for answers in (self._recorded, self._replayed):
            if not answers[key]:
                del answers[key]

    def _count(self, key: _DecisionKey, recorded: _Answer, replayed: _Answer) -> None:
        variable, asked_s = key
        if asked_s < self._from_s:
            return
        has_both = recorded.is_context and replayed.is_context
        facts = {
            "decisions": True,
            "recorded": recorded.is_context,
            "replayed": replayed.is_context,
            "gained": replayed.is_context and not recorded.is_context,
            "lost": recorded.is_context and replayed.is_context is False,
            "other_value": has_both and recorded.value != replayed.value,
            "unknown": replayed.is_context is None,
            "assumed": replayed.is_assumed,
        }
        self._counts[variable].update(name for name, is_true in facts.items() if is_true)


def total(counts: Mapping[str, DecisionCounts]) -> DecisionCounts:
    """Return the sum of the counts of all variables."""
    names = DecisionCounts.__dataclass_fields__
    return DecisionCounts(**{name: sum(getattr(row, name) for row in counts.values()) for name in names})
