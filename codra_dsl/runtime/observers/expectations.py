"""The expectations of skills while they act, and their outcomes, judged by the context alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.values.conditions_held import ContextNow
from codra_dsl.runtime.values.model import ExpectationModel, SkillModel


class Outcome(StrEnum):
    """The outcome of an expectation."""

    MET = "met"
    VIOLATED = "violated"
    NOT_SEEN = "not_seen"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The outcome of one expectation of a skill.

    Attributes:
        skill: the skill with the expectation.
        variable: the variable of the expectation.
        expected: the expectation as written in the spec.
        outcome: `NOT_SEEN` if it was neither observed to come true nor observed to be violated.
        instant_s: when the outcome was decided; for an expectation that is still open, the instant of the query.
        value: the value of the variable at that instant; None if it was unknown.
    """

    skill: str
    variable: str
    expected: str
    outcome: Outcome
    instant_s: float
    value: Value | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """The outcomes of all expectations of a skill. It has no truth value, because an outcome may be `NOT_SEEN`.

    Attributes:
        skill: the skill that acted.
        verdicts: one per expectation, in the order of the spec.
    """

    skill: str
    verdicts: tuple[Verdict, ...]

    @property
    def met(self) -> tuple[Verdict, ...]:
        """Return the expectations that came true."""
        return self._with_outcome(Outcome.MET)

    @property
    def violated(self) -> tuple[Verdict, ...]:
        """Return the expectations that did not come true, or did not stay true."""
        return self._with_outcome(Outcome.VIOLATED)

    @property
    def not_seen(self) -> tuple[Verdict, ...]:
        """Return the expectations that were neither observed to come true nor observed to be violated."""
        return self._with_outcome(Outcome.NOT_SEEN)

    @property
    def all_met(self) -> bool:
        """Return whether all expectations of the skill came true."""
        return len(self.met) == len(self.verdicts)

    def _with_outcome(self, outcome: Outcome) -> tuple[Verdict, ...]:
        return tuple(verdict for verdict in self.verdicts if verdict.outcome is outcome)

    def __bool__(self) -> bool:
        raise TypeError(f"a verification has no truth value: use .all_met, .violated or .not_seen of {self.skill!r}")


class _WatchedExpectation:
    """The state of one expectation of a skill that acts, or has acted."""

    def __init__(self, model: ExpectationModel, skill: str, since_s: float) -> None:
        self.model = model
        self.skill = skill
        self.since_s = since_s
        self.outcome: Outcome | None = None
        self.is_over = False
        self.verdict: Verdict | None = None
        self.timer: Timer | None = None

    @property
    def is_final(self) -> bool:
        """Return whether the outcome is final."""
        return self.is_over or self.outcome in (Outcome.MET, Outcome.VIOLATED)

    def determine_outcome(self, truth: Value | None, *, at_end: bool) -> Outcome | None:
        """Return the outcome, given whether the condition holds; None if the outcome is still open.

        Args:
            truth: whether the condition holds now; None if the variable is unknown.
            at_end: whether the time in which the condition is to become true, or to stay true, is over.
        """
        is_late = at_end or self.outcome is Outcome.NOT_SEEN
        if truth is None:
            return Outcome.NOT_SEEN if at_end else None
        if self.model.is_to_become:
            return Outcome.MET if truth is True else Outcome.VIOLATED if is_late else None
        return Outcome.VIOLATED if truth is not True else Outcome.MET if is_late else None


class Expectations:
    """The expectations of running skills.

    Callers hold the context manager's lock, except for `is_settled` and `verification`.

    From the start of acting, an expectation is judged whenever the context changes, and when its time is over. It is
    judged by the context alone, so outcomes follow from the journal.

    A variable that the skill changes is unknown from the start of acting until newer evidence arrives. If the variable
    of an expectation was not observed in time, the outcome is `NOT_SEEN`, neither met nor violated, and the first later
    observation decides.
    """

    def __init__(
        self, store: Store, clock: Clock, event_writer: EventWriter, on_verdict: Callable[[int, Verdict], None]
    ) -> None:
        """Start without expectations.

        Args:
            store: holds the variables.
            clock: the clock for the deadlines.
            event_writer: records each outcome.
            on_verdict: called with the number of the skill and each verdict.
        """
        self._store = store
        self._clock = clock
        self._event_writer = event_writer
        self._on_verdict = on_verdict
        self._expectations_by_skill: dict[int, tuple[_WatchedExpectation, ...]] = {}
        self._expectations_by_variable: dict[str, list[tuple[int, _WatchedExpectation]]] = {}

    def act(self, number: int, skill: SkillModel) -> None:
        """Start the expectations of a skill now. Open expectations of an earlier acting end as `NOT_SEEN`."""
        self.finish(number)
        now_s = self._clock.now_s()
        watched_expectations = tuple(_WatchedExpectation(model, skill.name, now_s) for model in skill.expects)
        self._expectations_by_skill[number] = watched_expectations
        for expectation in watched_expectations:
            self._expectations_by_variable.setdefault(expectation.model.variable, []).append((number, expectation))
            if expectation.model.within_s < math.inf:
                expectation.timer = self._clock.call_at(
                    now_s + expectation.model.within_s, self._deadline_callback(number, expectation)
                )
            self._judge(number, expectation, at_end=False)

    def acted(self, number: int) -> None:
        """Judge the expectations that were to stay true while the skill acted."""
        for expectation in self._expectations_by_skill.get(number, ()):
            if not expectation.model.is_to_become:
                self._judge(number, expectation, at_end=True)

    def finish(self, number: int) -> None:
        """End the skill; its open expectations end as `NOT_SEEN`, and no later observation changes an outcome."""
        for expectation in self._expectations_by_skill.pop(number, ()):
            if expectation.outcome is None:
                self._conclude(number, expectation, Outcome.NOT_SEEN)
            expectation.is_over = True
            if expectation.timer is not None:
                expectation.timer.cancel()
            other_entries = [
                entry
                for entry in self._expectations_by_variable[expectation.model.variable]
                if entry[1] is not expectation
            ]
            self._expectations_by_variable[expectation.model.variable] = other_entries

    def changed(self, variable: str) -> None:
        """Judge the expectations of a variable that has a new reading."""
        for number, expectation in self._expectations_by_variable.get(variable, ()):
            self._judge(number, expectation, at_end=False)

    def is_settled(self, number: int) -> bool:
        """Return whether all expectations of a skill have an outcome. Any thread may call this, without the lock."""
        return all(expectation.outcome is not None for expectation in self._expectations_by_skill.get(number, ()))

    def verification(self, number: int, skill: str) -> Verification:
        """Return the present outcomes of all expectations of a skill. Any thread may call this, without the lock.

        Raises:
            RuntimeError: if the skill has not acted, or has ended.
        """
        expectations = self._expectations_by_skill.get(number)
        if expectations is None:
            raise RuntimeError(f"skill {skill!r} has ended, or has not acted: its expectations start with `acting`")
        return Verification(
            skill=skill,
            verdicts=tuple(expectation.verdict or self._verdict(expectation) for expectation in expectations),
        )

    # Internal

    def _deadline_callback(self, number: int, expectation: _WatchedExpectation) -> Callable[[], None]:
        return lambda: self._judge(number, expectation, at_end=True)

    def _judge(self, number: int, expectation: _WatchedExpectation, *, at_end: bool) -> None:
        if expectation.is_final:
            return
        now_s = self._clock.now_s()
        outcome = expectation.determine_outcome(
            expectation.model.condition.evaluate(ContextNow(self._store.cells, now_s)), at_end=at_end
        )
        if outcome is not None and outcome is not expectation.outcome:
            self._conclude(number, expectation, outcome)

    def _conclude(self, number: int, expectation: _WatchedExpectation, outcome: Outcome) -> None:
        expectation.outcome = outcome
        verdict = expectation.verdict = self._verdict(expectation)
        reading = self._store.reading(verdict.variable)
        self._event_writer.write(
            Kind.EXPECTATION,
            verdict.variable,
            outcome,
            skill=expectation.skill,
            expected=verdict.expected,
            acting_s=expectation.since_s,
            value=reading.content,
            reason=reading.reason,
            detail=reading.detail,
            source=reading.source,
        )
        self._on_verdict(number, verdict)

    def _verdict(self, expectation: _WatchedExpectation) -> Verdict:
        return Verdict(
            skill=expectation.skill,
            variable=expectation.model.variable,
            expected=expectation.model.text,
            outcome=expectation.outcome or Outcome.NOT_SEEN,
            instant_s=self._clock.now_s(),
            value=self._store.reading(expectation.model.variable).content,
        )


def unseen_variables(verification: Verification) -> Iterable[str]:
    """Return the unknown variables of expectations without a decided outcome, each variable once."""
    return dict.fromkeys(verdict.variable for verdict in verification.not_seen if verdict.value is None)
