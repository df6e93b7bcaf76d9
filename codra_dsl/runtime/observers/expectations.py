"""What skills expect while they act, and whether it comes true: judged by what context holds, when it holds it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.observers.store import Store
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.evidence import ContextNow
from codra_dsl.runtime.values.model import ExpectationModel, SkillModel


class Outcome(StrEnum):
    """What came of an expectation."""

    MET = "met"
    VIOLATED = "violated"
    NOT_SEEN = "not_seen"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What came of one expectation of a skill.

    Attributes:
        skill: whose expectation it is.
        variable: of which something is expected.
        expected: the expectation as the spec says it.
        outcome: `NOT_SEEN` if it was neither seen to come true nor seen to be violated.
        instant_s: when that was clear; of what may still come true, when it was asked.
        value: of the variable at that instant; None if it was unknown.
    """

    skill: str
    variable: str
    expected: str
    outcome: Outcome
    instant_s: float
    value: Value | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """What came of all that a skill expects. It has no truth value: what was not seen is neither.

    Attributes:
        skill: that acted.
        verdicts: one for each expectation, in the order of the spec.
    """

    skill: str
    verdicts: tuple[Verdict, ...]

    @property
    def met(self) -> tuple[Verdict, ...]:
        """Return what came true."""
        return self._of(Outcome.MET)

    @property
    def violated(self) -> tuple[Verdict, ...]:
        """Return what did not come true, or did not stay so."""
        return self._of(Outcome.VIOLATED)

    @property
    def not_seen(self) -> tuple[Verdict, ...]:
        """Return what was neither seen to come true nor seen to be violated."""
        return self._of(Outcome.NOT_SEEN)

    @property
    def all_met(self) -> bool:
        """Return whether everything that the skill expects came true."""
        return len(self.met) == len(self.verdicts)

    def _of(self, outcome: Outcome) -> tuple[Verdict, ...]:
        return tuple(verdict for verdict in self.verdicts if verdict.outcome is outcome)

    def __bool__(self) -> bool:
        raise TypeError(f"a verification has no truth value: ask .all_met, .violated or .not_seen of {self.skill!r}")


class _Watched:
    """One expectation of a skill that acts, or has acted."""

    def __init__(self, model: ExpectationModel, skill: str, since_s: float) -> None:
        self.model = model
        self.skill = skill
        self.since_s = since_s
        self.outcome: Outcome | None = None
        self.is_over = False
        self.told: Verdict | None = None
        self.timer: Timer | None = None

    @property
    def is_settled(self) -> bool:
        """Return whether nothing can change its outcome."""
        return self.is_over or self.outcome in (Outcome.MET, Outcome.VIOLATED)

    def judged(self, holds: Value | None, *, at_end: bool) -> Outcome | None:
        """Return its outcome once the condition holds, does not, or is unknown; None if that is still open.

        Args:
            holds: whether the condition holds now; None if the variable is unknown.
            at_end: whether the time is over in which it is to come true, or to stay so.
        """
        is_late = at_end or self.outcome is Outcome.NOT_SEEN
        if holds is None:
            return Outcome.NOT_SEEN if at_end else None
        if self.model.is_to_become:
            return Outcome.MET if holds is True else Outcome.VIOLATED if is_late else None
        return Outcome.VIOLATED if holds is not True else Outcome.MET if is_late else None


class Expectations:
    """All that skills under way expect. Whoever calls it holds the context manager's lock, but for `verification`.

    An expectation is judged by what context holds from acting on: what the skill changes is unknown then, until newer
    evidence comes. What nobody has seen when its time is over is not seen, and what is seen first afterwards decides.
    """

    def __init__(
        self, store: Store, clock: Clock, event_writer: EventWriter, heard: Callable[[int, Verdict], None]
    ) -> None:
        """Expect nothing yet.

        Args:
            store: holds the variables.
            clock: tells when the time of an expectation is over.
            event_writer: is told each outcome.
            heard: called with each outcome and the number of the skill.
        """
        self._store = store
        self._clock = clock
        self._event_writer = event_writer
        self._heard = heard
        self._of_skill: dict[int, tuple[_Watched, ...]] = {}
        self._of_variable: dict[str, list[tuple[int, _Watched]]] = {}

    def act(self, number: int, skill: SkillModel) -> None:
        """Count from now on; what an earlier acting of the same skill left open stays so."""
        self.finish(number)
        now_s = self._clock.now_s()
        watched = tuple(_Watched(model, skill.name, now_s) for model in skill.expects)
        self._of_skill[number] = watched
        for each in watched:
            self._of_variable.setdefault(each.model.variable, []).append((number, each))
            if each.model.within_s < math.inf:
                each.timer = self._clock.call_at(now_s + each.model.within_s, self._ender(number, each))
            self._judge(number, each, at_end=False)

    def acted(self, number: int) -> None:
        """Judge what was to stay while the skill acted."""
        for each in self._of_skill.get(number, ()):
            if not each.model.is_to_become:
                self._judge(number, each, at_end=True)

    def finish(self, number: int) -> None:
        """End the skill: what is open now nobody watches any more."""
        for each in self._of_skill.pop(number, ()):
            if each.outcome is None:
                self._conclude(number, each, Outcome.NOT_SEEN)
            each.is_over = True
            if each.timer is not None:
                each.timer.cancel()
            others = [entry for entry in self._of_variable[each.model.variable] if entry[1] is not each]
            self._of_variable[each.model.variable] = others

    def changed(self, variable: str) -> None:
        """Judge what is expected of a variable that has another reading."""
        for number, each in self._of_variable.get(variable, ()):
            self._judge(number, each, at_end=False)

    def is_settled(self, number: int) -> bool:
        """Return whether all that a skill expects has an outcome; any thread may ask, without the lock."""
        return all(each.outcome is not None for each in self._of_skill.get(number, ()))

    def verification(self, number: int, skill: str) -> Verification:
        """Return what came of all that a skill expects, by now; any thread may ask, without the lock.

        Raises:
            RuntimeError: if the skill has not acted, or has ended.
        """
        watched = self._of_skill.get(number)
        if watched is None:
            raise RuntimeError(f"skill {skill!r} has ended, or has not acted: what it expects counts from `acting`")
        return Verification(skill=skill, verdicts=tuple(each.told or self._verdict(each) for each in watched))

    # Within

    def _ender(self, number: int, watched: _Watched) -> Callable[[], None]:
        return lambda: self._judge(number, watched, at_end=True)

    def _judge(self, number: int, watched: _Watched, *, at_end: bool) -> None:
        if watched.is_settled:
            return
        now_s = self._clock.now_s()
        outcome = watched.judged(watched.model.condition.evaluate(ContextNow(self._store.cells, now_s)), at_end=at_end)
        if outcome is not None and outcome is not watched.outcome:
            self._conclude(number, watched, outcome)

    def _conclude(self, number: int, watched: _Watched, outcome: Outcome) -> None:
        watched.outcome = outcome
        verdict = watched.told = self._verdict(watched)
        reading = self._store.reading(verdict.variable)
        self._event_writer.write(
            Kind.EXPECTATION,
            verdict.variable,
            outcome,
            skill=watched.skill,
            expected=verdict.expected,
            acting_s=watched.since_s,
            **_told(reading),
        )
        self._heard(number, verdict)

    def _verdict(self, watched: _Watched) -> Verdict:
        return Verdict(
            skill=watched.skill,
            variable=watched.model.variable,
            expected=watched.model.text,
            outcome=watched.outcome or Outcome.NOT_SEEN,
            instant_s=self._clock.now_s(),
            value=self._store.reading(watched.model.variable).content,
        )


def _told(reading: Reading[Value]) -> dict[str, object]:
    return {"value": reading.content, "reason": reading.reason, "detail": reading.detail, "source": reading.source}


def unseen(verification: Verification) -> Iterable[str]:
    """Return the variables about which nothing is known that could decide, each once."""
    return dict.fromkeys(verdict.variable for verdict in verification.not_seen if verdict.value is None)
