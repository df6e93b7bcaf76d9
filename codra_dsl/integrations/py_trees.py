"""Nodes for a py_trees tree that acts: conditions and decisions on context, and skills around subtrees.

None of them waits inside a tick. What they need of the running program comes with
`tree.setup(codra=codra, clock=clock)`; names that the spec lacks are reported there. A branch that is interrupted by
one of higher priority takes back what it declared.

P1, section 3.3: the main execution declares what its skills need, and asks context before it perceives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from codra_dsl.runtime import Clock, ContextManager, DecisionState, PendingDecision, Reading, Skill, UnknownNameError

__all__ = ["Acting", "ContextIs", "Decide", "DuringSkill", "Expecting"]

Manager = ContextManager[Any, Any]


@dataclass(frozen=True, slots=True)
class _Running:
    """What `setup` hands to a node."""

    codra: Manager
    clock: Clock


class ContextIs(Behaviour):
    """A condition on what is known of a variable: SUCCESS if it holds, FAILURE if not.

    It reads and records nothing, so that it may stand in a reactive composite, which asks it at each tick. While the
    variable is unknown it is RUNNING, for `wait_up_to_s` at most, and then what `unknown` says.
    """

    def __init__(
        self,
        name: str,
        variable: str,
        *,
        holds: Callable[[Any], bool] | None = None,
        unknown: Status = Status.FAILURE,
        wait_up_to_s: float = 0.0,
        max_age_s: float = math.inf,
    ) -> None:
        """Make a condition.

        Args:
            name: of the node.
            variable: that it is about.
            holds: whether a value will do; by default, whether it is true.
            unknown: the status when the variable is unknown and the wait is over.
            wait_up_to_s: how long it waits for observers.
            max_age_s: older evidence counts as unknown.
        """
        super().__init__(name)
        self._variable = variable
        self._holds = holds or _is_true
        self._unknown = unknown
        self._wait_up_to_s = wait_up_to_s
        self._max_age_s = max_age_s
        self._asked_s = -math.inf
        self._running: _Running | None = None

    def setup(self, **kwargs: Any) -> None:
        """Take `codra` and `clock`.

        Raises:
            TypeError: if one of them is missing.
            UnknownNameError: if the spec has no such variable.
        """
        self._running = _taken(self, kwargs)
        self._running.codra.get(self._variable)

    def initialise(self) -> None:
        """Begin to wait."""
        self._asked_s = _of(self, self._running).clock.now_s()

    def update(self) -> Status:
        """Read the variable."""
        running = _of(self, self._running)
        now_s, reading = running.clock.now_s(), running.codra.get(self._variable)
        is_fresh = reading.known and reading.age_s(now_s) <= self._max_age_s
        if is_fresh and reading.start_s >= _acted_s(self, self._variable):
            self.feedback_message = f"{reading.value!r}"
            return _status(self._holds(reading.value))
        self.feedback_message = _unknown(reading)
        return Status.RUNNING if now_s < self._asked_s + self._wait_up_to_s else self._unknown


class Decide(Decorator):
    """A decision that is answered from context, or by a subtree that looks.

    The subtree, the robot's own perception, runs only when context does not answer: it goes before the decision as it
    did before there were observers. SUCCESS if the answer holds, FAILURE if not; `unknown` if nothing was found.
    Each decision is in the record, with how it was answered.
    """

    def __init__(
        self,
        name: str,
        child: Behaviour,
        variable: str,
        *,
        found: Callable[[], object],
        holds: Callable[[Any], bool] | None = None,
        unknown: Status = Status.FAILURE,
        wait_up_to_s: float = 0.0,
        max_age_s: float = math.inf,
        shadow: bool = False,
    ) -> None:
        """Make a decision.

        Args:
            name: of the node.
            child: looks, and ends in SUCCESS if it could.
            variable: that the decision is about.
            found: returns what the child saw, a value of the variable or None; asked when the child succeeded.
            holds: whether a value will do; by default, whether it is true.
            unknown: the status when neither context nor the child knows.
            wait_up_to_s: how long it waits for observers before the child looks.
            max_age_s: older evidence does not do.
            shadow: the child looks in any case, and the record says whether context agrees.
        """
        super().__init__(name, child)
        self._variable = variable
        self._found = found
        self._holds = holds or _is_true
        self._unknown = unknown
        self._wait_up_to_s = wait_up_to_s
        self._max_age_s = max_age_s
        self._shadow = shadow
        self._question: PendingDecision | None = None
        self._running: _Running | None = None

    def setup(self, **kwargs: Any) -> None:
        """Take `codra` and `clock`.

        Raises:
            TypeError: if one of them is missing.
            UnknownNameError: if the spec has no such variable.
        """
        self._running = _taken(self, kwargs)
        self._running.codra.get(self._variable)

    def initialise(self) -> None:
        """Ask, unless this decision was asked already."""
        if self._question is None:
            self._question = _of(self, self._running).codra.ask(
                self._variable,
                max_age_s=self._max_age_s,
                since_s=_acted_s(self, self._variable),
                wait_up_to_s=self._wait_up_to_s,
                shadow=self._shadow,
            )

    def tick(self) -> Iterator[Behaviour]:
        """Tick the subtree only if it has to look."""
        if self.status is not Status.RUNNING:
            self.initialise()
        assert self._question is not None
        if self._question.poll() is DecisionState.LOOKING:
            yield from super().tick()
        else:
            yield from Behaviour.tick(self)

    def update(self) -> Status:
        """Answer, wait, or go on looking."""
        assert self._question is not None
        match self._question.step:
            case DecisionState.WAITING:
                self.feedback_message = "waiting for observers"
                return Status.RUNNING
            case DecisionState.ANSWERED:
                return self._answer(self._question.value, "from context")
        if self.decorated.status is Status.RUNNING:
            self.feedback_message = "looking"
            return Status.RUNNING
        found = self._found() if self.decorated.status is Status.SUCCESS else None
        self._question.found(found)
        return self._answer(found, "found by looking")

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - however it ends
        """Forget the question; one that was not answered is given up."""
        if self._question is not None:
            self._question.abandon("interrupted")
            self._question = None

    def _answer(self, value: object, how: str) -> Status:
        if value is None:
            self.feedback_message = "unknown: looking found nothing"
            return self._unknown
        self.feedback_message = f"{value!r}, {how}"
        return _status(self._holds(value))


class DuringSkill(Decorator):
    """A subtree that is a skill: what the skill previews and monitors is declared while it is current."""

    def __init__(self, name: str, child: Behaviour, skill: str) -> None:
        """Make the subtree a skill of the spec."""
        super().__init__(name, child)
        self._skill = skill
        self._changes: frozenset[str] = frozenset()
        self._acted_s = -math.inf
        self._stack = ExitStack()
        self._begun: Skill | None = None
        self._running: _Running | None = None

    def setup(self, **kwargs: Any) -> None:
        """Take `codra` and `clock`.

        Raises:
            TypeError: if one of them is missing.
            UnknownNameError: if the spec has no such skill.
        """
        self._running = _taken(self, kwargs)
        self._changes = frozenset(_skill_of(self._running.codra, self._skill).changes)

    def initialise(self) -> None:
        """Begin the skill."""
        self._stack.close()  # a tick that raised did not end it
        self._acted_s = -math.inf
        self._begun = self._stack.enter_context(_of(self, self._running).codra.skill(self._skill))

    def update(self) -> Status:
        """Be what the subtree is."""
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - however it ends
        """End the skill, after what runs in it."""
        if self.decorated.status is Status.RUNNING:
            self.decorated.stop(Status.INVALID)
        self._begun = None
        self._stack.close()

    @property
    def begun(self) -> Skill:
        """Return the skill under way.

        Raises:
            RuntimeError: if none is.
        """
        if self._begun is None:
            raise RuntimeError(f"skill {self._skill!r} is not under way")
        return self._begun

    def note_action(self, instant_s: float) -> None:
        """Take down when an action of the skill ended."""
        self._acted_s = instant_s

    def acted_s(self, variable: str) -> float:
        """Return when the skill last ended an action that changes a variable; minus infinity if it did not."""
        return self._acted_s if variable in self._changes else -math.inf


class Acting(Decorator):
    """The part of a skill that acts: what the skill changes is unknown from its start.

    Conditions and decisions further on in the skill count only evidence that began to be taken after its end.
    """

    def __init__(self, name: str, child: Behaviour) -> None:
        """Make the subtree the acting part of the `DuringSkill` above it."""
        super().__init__(name, child)
        self._stack = ExitStack()
        self._during: DuringSkill | None = None
        self._running: _Running | None = None

    def setup(self, **kwargs: Any) -> None:
        """Take `codra` and `clock`, and find the skill.

        Raises:
            TypeError: if one of them is missing, or no `DuringSkill` is above.
        """
        self._running = _taken(self, kwargs)
        self._during = next(_skills_above(self), None)
        if self._during is None:
            raise TypeError(f"{self.name!r} acts outside of a skill: put a DuringSkill around it")

    def initialise(self) -> None:
        """Begin to act."""
        assert self._during is not None
        self._stack.close()
        self._stack.enter_context(self._during.begun.acting())
        self._stack.callback(self._end)

    def update(self) -> Status:
        """Be what the subtree is."""
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - however it ends
        """End the action."""
        if self.decorated.status is Status.RUNNING:
            self.decorated.stop(Status.INVALID)
        self._stack.close()

    def _end(self) -> None:
        assert self._during is not None
        self._during.note_action(_of(self, self._running).clock.now_s())


class Expecting(Decorator):
    """A subtree after which skills come: what they preview is declared from its start.

    It is taken back if the subtree fails or is interrupted, and when a later `Expecting` of the tree expects others.
    """

    def __init__(self, name: str, child: Behaviour, *skills: str) -> None:
        """Let skills of the spec come after the subtree."""
        super().__init__(name, child)
        self._skills = skills
        self._was_last = False
        self._running: _Running | None = None

    def setup(self, **kwargs: Any) -> None:
        """Take `codra` and `clock`.

        Raises:
            TypeError: if one of them is missing.
            UnknownNameError: if the spec has no such skill.
        """
        self._running = _taken(self, kwargs)
        for skill in self._skills:
            _skill_of(self._running.codra, skill)

    def initialise(self) -> None:
        """Expect the skills."""
        for node in _root(self).iterate():
            if isinstance(node, Expecting):
                node._was_last = node is self
        _of(self, self._running).codra.expect(*self._skills)

    def update(self) -> Status:
        """Be what the subtree is."""
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:
        """Expect nothing any more, unless the subtree came to its goal or a later one expects something."""
        if new_status is not Status.SUCCESS and self._was_last:
            self._was_last = False
            _of(self, self._running).codra.expect()


def _taken(node: Behaviour, kwargs: dict[str, Any]) -> _Running:
    missing = [name for name in ("codra", "clock") if name not in kwargs]
    if missing:
        raise TypeError(f"{node.name!r} needs {' and '.join(missing)}: call tree.setup(codra=codra, clock=clock)")
    return _Running(kwargs["codra"], kwargs["clock"])


def _of(node: Behaviour, running: _Running | None) -> _Running:
    if running is None:
        raise RuntimeError(f"{node.name!r} was not set up: call tree.setup(codra=codra, clock=clock) first")
    return running


def _skill_of(codra: Manager, name: str) -> Any:
    skills = codra.skills()
    if name not in skills:
        raise UnknownNameError(f"the spec has no skill {name!r}; it has {', '.join(map(repr, skills)) or 'none'}")
    return skills[name]


def _root(node: Behaviour) -> Behaviour:
    return node if node.parent is None else _root(node.parent)


def _skills_above(node: Behaviour) -> Iterator[DuringSkill]:
    """Yield the skills that a node is part of, from the inside."""
    above = node.parent
    while above is not None:
        if isinstance(above, DuringSkill):
            yield above
        above = above.parent


def _acted_s(node: Behaviour, variable: str) -> float:
    """Return since when evidence for a variable counts, for a node within skills."""
    return max((skill.acted_s(variable) for skill in _skills_above(node)), default=-math.inf)


def _is_true(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{value!r} is neither true nor false: say what will do, as in holds=lambda value: ...")
    return value


def _status(holds: bool) -> Status:
    return Status.SUCCESS if holds else Status.FAILURE


def _unknown(reading: Reading[Any]) -> str:
    if reading.known:
        return "unknown: its evidence is too old"
    return f"unknown: {reading.reason}" + (f" ({reading.detail})" if reading.detail else "")
