"""Connect the main execution to the arms of an experiment. At most one arm answers; the other arms only observe."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime import Clock, ContextManager, Reading
from codra_dsl.runtime.values.conditions import Value
from codra_papers.lab.context import ActingSkill

Manager = ContextManager[Any, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedDecision:
    """A decision of the main execution (P1, Figure 7: the rings).

    From `instant_s` to `answered_s` the main execution asks and waits for observers. If context has no answer, the
    main execution looks by itself.

    Attributes:
        instant_s: when the main execution needed the variable.
        variable: the variable that the decision needs.
        skill: the skill that was running; empty if there was none.
        since_s: the earliest instant of evidence that can answer the decision: 0 or less for a preview, the end of the
            action for a decision that monitors the action.
        held: the reading that each arm held at `instant_s`. The key is the name of the arm.
        answer: the value on which the decision was based.
        answered_s: when the main execution had the answer.
        waited_s: how long the main execution waited for the arm that answers.
        looked_s: how long the robot looked by itself; 0 if context answered.
        last_reading: the reading of the arm that answers, at the instant when the arm answered or when the robot began
            to look instead; None if no arm answers.
        has_looked: whether the robot looked by itself.
    """

    instant_s: float
    variable: str
    skill: str
    since_s: float
    held: Mapping[str, Reading[Any]]
    answer: Value | None
    answered_s: float
    waited_s: float
    looked_s: float
    last_reading: Reading[Any] | None
    has_looked: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillSpan:
    """The time in which a skill was running."""

    name: str
    start_s: float
    end_s: float


class Fanout:
    """Passes the skills of the main execution to the arms in `following_arms`, and its values to all arms.

    One arm answers the decisions. If no arm answers, the robot looks for every decision, as P1's robot did while
    observers only watched (section 4.1). In this case, the actions of the robot do not depend on any arm.

    Attributes:
        asked_decisions: the decisions, in order of time.
        skills: the skills that ended, in order of time.
    """

    def __init__(
        self,
        clock: Clock,
        arms: Mapping[str, Manager],
        *,
        following_arms: Sequence[str],
        answering_arm: str | None,
        decision_s: float = 0.0,
    ) -> None:
        """Connect the arms.

        Args:
            clock: the clock of all arms.
            arms: the context managers of the arms. The key is the name of the arm.
            following_arms: the names of the arms that are notified of skills and of the skills that come next.
            answering_arm: the name of the arm that answers; None if no arm answers.
            decision_s: how long it takes to ask the arm that answers.
        """
        self.asked_decisions: list[AskedDecision] = []
        self.skills: list[SkillSpan] = []
        self._clock = clock
        self._arms = arms
        self._following_managers = [arms[name] for name in following_arms]
        self._answering_manager = None if answering_arm is None else arms[answering_arm]
        self._decision_s = decision_s
        self._running_skills: list[str] = []

    @contextmanager
    def skill(self, name: str) -> Iterator[ActingSkill]:
        """Begin a skill in every arm that follows skills, and end it after the `with` block."""
        with ExitStack() as stack:
            skills = [stack.enter_context(manager.skill(name)) for manager in self._following_managers]
            start_s = self._clock.now_s()
            self._running_skills.append(name)
            try:
                yield _SharedSkill(skills)
            finally:
                self._running_skills.pop()
                self.skills.append(SkillSpan(name=name, start_s=start_s, end_s=self._clock.now_s()))

    def expect(self, *skills: str) -> None:
        """Announce which skills come next."""
        for manager in self._following_managers:
            manager.expect(*skills)

    def set(self, name: str, value: Any) -> None:
        """Pass the value of a variable, which the main execution knows by itself, to every arm."""
        for manager in self._arms.values():
            manager.set(name, value)

    def decide(
        self, name: str, otherwise: Callable[[], Any], *, since_s: float = 0.0, wait_up_to_s: float = 0.0
    ) -> Any:
        """Return the answer of the arm that answers, or of a look if no arm answers.

        Record the reading of every arm at the instant of the request.
        """
        asked_s, held = self._clock.now_s(), {arm: manager.get(name) for arm, manager in self._arms.items()}
        self._clock.sleep(0.0 if self._answering_manager is None else self._decision_s)
        wait_start_s = self._clock.now_s()
        look_starts: list[tuple[float, Reading[Any] | None]] = []

        def look() -> Any:
            look_starts.append((self._clock.now_s(), self._last_reading(name)))
            return otherwise()

        if self._answering_manager is None:
            answer = look()
        else:
            answer = self._answering_manager.decide(name, look, since_s=since_s, wait_up_to_s=wait_up_to_s)
        answered_s = self._clock.now_s()
        look_start_s, last_reading = look_starts[0] if look_starts else (answered_s, self._last_reading(name))
        self.asked_decisions.append(
            AskedDecision(
                instant_s=asked_s,
                variable=name,
                skill=self._running_skills[-1] if self._running_skills else "",
                since_s=since_s,
                held=held,
                answer=answer,
                answered_s=answered_s,
                waited_s=look_start_s - wait_start_s,
                looked_s=answered_s - look_start_s,
                last_reading=last_reading,
                has_looked=bool(look_starts),
            )
        )
        return answer

    def _last_reading(self, name: str) -> Reading[Any] | None:
        return None if self._answering_manager is None else self._answering_manager.get(name)

    def slot(self, *resources: str) -> AbstractContextManager[None]:
        """Hold slots of the arm that answers, if there is such an arm. Arms that only observe have their own slots."""
        return nullcontext() if self._answering_manager is None else self._answering_manager.slot(*resources)


class _SharedSkill:
    """A skill that is running in several arms."""

    def __init__(self, skills: Sequence[ActingSkill]) -> None:
        self._skills = skills

    @contextmanager
    def acting(self) -> Iterator[None]:
        with ExitStack() as stack:
            for skill in self._skills:
                stack.enter_context(skill.acting())
            yield
