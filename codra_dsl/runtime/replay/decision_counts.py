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
    """The decisions of a run on one variable, or the previews of one skill, or their sum over all names.

    Context answers a preview if it decides, without a look, whether the preview holds.

    Attributes:
        decisions: the number of decisions that the run made.
        recorded: the number of decisions for which context had the answer in the run. In shadow mode, the main
            execution looks even if context has the answer.
        replayed: the number of decisions for which context has the answer in the replay.
        gained: decisions for which only the replay has an answer from context.
        lost: decisions for which only the run had an answer from context.
        other_value: decisions for which both had an answer from context, with different values; previews with different
            outcomes.
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
        value: this answer; the outcome of a preview.
    """

    is_context: bool | None
    value: Value | None = None
    is_assumed: bool = False


class _Question(NamedTuple):
    """A decision on a variable, or on the preview of a skill, by its kind and name, and when it was asked."""

    kind: Kind
    name: str
    asked_s: float


def _question(decision: Decision) -> _Question:
    return _Question(decision.kind, decision.name, decision.asked_s)


class DecisionComparison:
    """Compares the decisions of a run, as they are read from its journal, with those of its replay."""

    def __init__(self, from_s: float) -> None:
        """Ignore decisions that were asked before an instant."""
        self._from_s = from_s
        self._recorded: dict[_Question, deque[_Answer]] = defaultdict(deque)
        self._replayed: dict[_Question, deque[_Answer]] = defaultdict(deque)
        self._ended_questions: set[_Question] = set()
        self._doubtful_questions: set[_Question] = set()
        self._counts: dict[tuple[Kind, str], Counter[str]] = defaultdict(Counter)

    def add_recorded(self, event: Event) -> None:
        """Add a decision or preview of the run."""
        question = _Question(event.kind, event.name, float(event.details["asked_s"]))
        if event.what == "answered" or event.kind is Kind.PREVIEW:
            self._ended_questions.add(question)
        is_context = event.what in ("answered", "shadowed")
        value = event.details.get("outcome" if event.kind is Kind.PREVIEW else "value")
        self._recorded[question].append(_Answer(is_context, value if is_context else None))
        self._match(question)

    def add_replayed(self, decision: Decision, undetermined: Undetermined) -> None:
        """Add a decision of the replay that context has answered, or for which the main execution begins to look."""
        if isinstance(decision, Preview) and decision.looked:
            return  # it was added when the main execution began to look
        question, variables = _question(decision), decision.variables
        if not isinstance(decision, Preview) and decision.reading.source == OPERATOR:
            variables = ()  # the journal shows all overrides
        if question in self._doubtful_questions or not undetermined.variables.isdisjoint(variables):
            answer = _Answer(None)
        else:
            value = str(decision.answer.outcome) if isinstance(decision, Preview) else decision.reading.content
            is_assumed = not undetermined.assumed_variables.isdisjoint(variables)
            answer = _Answer(decision.is_decided, value if decision.is_decided else None, is_assumed)
        self._replayed[question].append(answer)
        self._match(question)

    def doubt_if_ended(self, decision: Decision) -> None:
        """Count a decision of the replay as unknown, if the run has ended it already."""
        question = _question(decision)
        if question in self._ended_questions:
            self._doubtful_questions.add(question)

    def take_recorded_end(self, decision: Decision) -> bool:
        """Return whether the run, as far as it was read, ended a decision without a further look; forget this."""
        question = _question(decision)
        has_ended = question in self._ended_questions
        self._ended_questions.discard(question)
        return has_ended

    def counts(self, kind: Kind) -> Mapping[str, DecisionCounts]:
        """Return the counts of the decisions on each variable, or of the previews of each skill.

        A decision that the replay could not ask or answer is unknown.
        """
        for question in [question for question in self._recorded if question.kind is kind]:
            for answer in self._recorded.pop(question):
                self._count(question, answer, _Answer(None))
        names = sorted(name for counted_kind, name in self._counts if counted_kind is kind)
        return {name: DecisionCounts(**self._counts[kind, name]) for name in names}

    def _match(self, question: _Question) -> None:
        if self._recorded[question] and self._replayed[question]:
            self._count(question, self._recorded[question].popleft(), self._replayed[question].popleft())
        for answers in (self._recorded, self._replayed):
            if not answers[question]:
                del answers[question]

    def _count(self, question: _Question, recorded: _Answer, replayed: _Answer) -> None:
        if question.asked_s < self._from_s:
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
        self._counts[question.kind, question.name].update(name for name, is_true in facts.items() if is_true)


def total(counts: Mapping[str, DecisionCounts]) -> DecisionCounts:
    """Return the sum of the counts of all variables or skills."""
    names = DecisionCounts.__dataclass_fields__
    return DecisionCounts(**{name: sum(getattr(row, name) for row in counts.values()) for name in names})
