"""Nodes for a py_trees tree of the main execution: conditions and decisions on context, and skills around subtrees.

No node waits inside a tick: decisions start with `codra.ask` and are polled. `tree.setup(codra=codra, clock=clock)`
passes the context manager and the clock to the nodes, and reports names that the spec does not declare. If a branch of
higher priority interrupts another branch, the declarations of the interrupted branch are withdrawn.

P1, section 3.3: the main execution declares what its skills need, and asks context before it perceives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from codra_dsl.runtime import (
    Clock,
    ContextManager,
    DecisionState,
    PendingDecision,
    PendingPreview,
    PreviewOutcome,
    Reading,
    Skill,
    UnknownNameError,
)
from codra_dsl.runtime.values.model import SkillModel

__all__ = ["Acting", "ContextIs", "Decide", "DuringSkill", "Expecting", "PreviewHolds"]

Manager = ContextManager[Any, Any]


class _ContextNode(Behaviour):
    """A node that uses the context manager and its clock."""

    _setup_arguments: tuple[Manager, Clock] | None = None

    def setup(self, **kwargs: Any) -> None:
        """Receive `codra` and `clock`.

        Raises:
            TypeError: if one of them is missing, or if an acting part is not inside a skill.
            UnknownNameError: if the spec lacks the variable or a skill of this node.
        """
        missing_names = [name for name in ("codra", "clock") if name not in kwargs]
        if missing_names:
            missing_text = " and ".join(missing_names)
            raise TypeError(f"{self.name!r} needs {missing_text}: call tree.setup(codra=codra, clock=clock)")
        self._setup_arguments = kwargs["codra"], kwargs["clock"]
        self._check_setup()

    def _check_setup(self) -> None:
        """Check the names in this node."""
        raise NotImplementedError

    @property
    def _codra(self) -> Manager:
        return self._require_setup()[0]

    @property
    def _clock(self) -> Clock:
        return self._require_setup()[1]

    def _skill_model(self, name: str) -> SkillModel:
        skills = self._codra.skills()
        if name not in skills:
            raise UnknownNameError(f"the spec has no skill {name!r}; it has {', '.join(map(repr, skills)) or 'none'}")
        return skills[name]

    def _require_setup(self) -> tuple[Manager, Clock]:
        if self._setup_arguments is None:
            raise RuntimeError(f"{self.name!r} was not set up: call tree.setup(codra=codra, clock=clock) first")
        return self._setup_arguments


class ContextIs(_ContextNode):
    """A condition on a variable: SUCCESS if it holds, FAILURE if not.

    The node only reads the variable and records no event. So it can be a child of a reactive composite, which checks it
    at each tick. While the variable is unknown, the status is RUNNING, for at most `wait_up_to_s`; after this time, the
    status is the argument `unknown`.
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
            name: the name of the node.
            variable: the context-variable.
            holds: returns whether a value satisfies the condition; by default, whether the value is true.
            unknown: the status when the variable is unknown and the wait is over.
            wait_up_to_s: how long the node waits for observers.
            max_age_s: a value with older evidence is treated as unknown.
        """
        super().__init__(name)
        self._variable = variable
        self._holds = holds or _is_true
        self._unknown_status = unknown
        self._wait_up_to_s = wait_up_to_s
        self._max_age_s = max_age_s
        self._wait_start_s = -math.inf

    def _check_setup(self) -> None:
        self._codra.get(self._variable)

    def initialise(self) -> None:
        """Start the wait."""
        self._wait_start_s = self._clock.now_s()

    def update(self) -> Status:
        """Read the variable."""
        now_s, reading = self._clock.now_s(), self._codra.get(self._variable)
        limits_s = _action_ends_s(self)
        if reading.known and self._codra.can_answer(self._variable, max_age_s=self._max_age_s, since_s=limits_s):
            self.feedback_message = f"{reading.value!r}"
            return _status(self._holds(reading.value))
        self.feedback_message = _unknown_text(reading)
        return Status.RUNNING if now_s < self._wait_start_s + self._wait_up_to_s else self._unknown_status


class Decide(_ContextNode, Decorator):
    """A decision that is answered from context, or by a subtree that looks.

    The subtree is the robot's own perception. It runs only if context does not answer. The status is SUCCESS if the
    answer holds, FAILURE if not, and the argument `unknown` if the subtree did not see the value. For each decision,
    however many ticks it takes, the event log contains one event, which states how the decision was answered.
    """

    def __init__(
        self,
        name: str,
        child: Behaviour,
        variable: str,
        *,
        result: Callable[[], object],
        holds: Callable[[Any], bool] | None = None,
        unknown: Status = Status.FAILURE,
        wait_up_to_s: float = 0.0,
        max_age_s: float = math.inf,
        shadow: bool = False,
    ) -> None:
        """Make a decision.

        Args:
            name: the name of the node.
            child: the subtree that looks; it ends in SUCCESS if it could look.
            variable: the context-variable of the decision.
            result: returns the value that the child saw, or None; called after the child succeeded.
            holds: returns whether a value satisfies the decision; by default, whether the value is true.
            unknown: the status if neither context nor the child knows the value.
            wait_up_to_s: how long the node waits for observers before the child looks.
            max_age_s: a value with older evidence is treated as unknown.
            shadow: the child always looks, and the event log records whether context agrees.
        """
        super().__init__(name, child)
        self._variable = variable
        self._read_result = result
        self._holds = holds or _is_true
        self._unknown_status = unknown
        self._wait_up_to_s = wait_up_to_s
        self._max_age_s = max_age_s
        self._shadow = shadow
        self._pending_decision: PendingDecision | None = None

    def _check_setup(self) -> None:
        self._codra.get(self._variable)

    def initialise(self) -> None:
        """Start the decision, unless it is already pending."""
        if self._pending_decision is None:
            self._pending_decision = self._codra.ask(
                self._variable,
                max_age_s=self._max_age_s,
                since_s=_action_ends_s(self),
                wait_up_to_s=self._wait_up_to_s,
                shadow=self._shadow,
            )

    def tick(self) -> Iterator[Behaviour]:
        """Tick the subtree only if it must look."""
        if self.status is not Status.RUNNING:
            self.initialise()
        assert self._pending_decision is not None
        if self._pending_decision.poll() is DecisionState.LOOKING:
            yield from super().tick()
        else:
            yield from Behaviour.tick(self)

    def update(self) -> Status:
        """Return the status of the answer, or RUNNING while observers or the subtree look for the value."""
        assert self._pending_decision is not None
        match self._pending_decision.state:
            case DecisionState.WAITING:
                self.feedback_message = "waiting for observers"
                return Status.RUNNING
            case DecisionState.ANSWERED:
                return self._answer(self._pending_decision.value, "from context")
        if self.decorated.status is Status.RUNNING:
            self.feedback_message = "looking"
            return Status.RUNNING
        seen_value = self._read_result() if self.decorated.status is Status.SUCCESS else None
        return self._answer(self._pending_decision.record_result(seen_value), "from looking")

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - the same for every status
        """Discard the pending decision; if it has no answer, abandon it."""
        if self._pending_decision is not None:
            self._pending_decision.abandon("interrupted")
            self._pending_decision = None

    def _answer(self, value: object, answer_source: str) -> Status:
        if value is None:
            self.feedback_message = "unknown: looking gave no value"
            return self._unknown_status
        self.feedback_message = f"{value!r}, {answer_source}"
        return _status(self._holds(value))


class PreviewHolds(_ContextNode):
    """The preview of a skill as one decision: SUCCESS if it holds, FAILURE if it is violated.

    While the preview is unknown, the status is RUNNING, for at most `wait_up_to_s`; after this time, the status is the
    argument `unknown`. `feedback_message` is the answer with its reason. The event log contains one event for each
    decision, so put the node under a composite with memory.
    """

    def __init__(
        self,
        name: str,
        skill: str,
        *,
        unknown: Status = Status.FAILURE,
        wait_up_to_s: float = 0.0,
        max_age_s: float = math.inf,
    ) -> None:
        """Make a decision on the preview of a skill.

        Args:
            name: the name of the node.
            skill: the skill that comes next.
            unknown: the status when the preview is unknown and the wait is over.
            wait_up_to_s: how long the node waits for observers.
            max_age_s: a value with older evidence is treated as unknown.
        """
        super().__init__(name)
        self._skill = skill
        self._unknown_status = unknown
        self._wait_up_to_s = wait_up_to_s
        self._max_age_s = max_age_s
        self._pending_preview: PendingPreview | None = None

    def _check_setup(self) -> None:
        self._skill_model(self._skill)

    def initialise(self) -> None:
        """Start the decision."""
        self._pending_preview = self._codra.ask_preview(
            self._skill,
            max_age_s=self._max_age_s,
            since_s=_action_ends_s(self),
            wait_up_to_s=self._wait_up_to_s,
        )

    def update(self) -> Status:
        """Return the status of the answer, or RUNNING while observers look for variables."""
        assert self._pending_preview is not None
        is_waiting = self._pending_preview.poll() is DecisionState.WAITING
        answer = self._pending_preview.answer
        self.feedback_message = str(answer)
        if is_waiting:
            return Status.RUNNING
        return self._unknown_status if answer.outcome is PreviewOutcome.UNKNOWN else _status(answer.holds)

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - the same for every status
        """Discard the pending preview; if it has no answer, abandon it."""
        if self._pending_preview is not None:
            self._pending_preview.abandon("interrupted")
            self._pending_preview = None


class DuringSkill(_ContextNode, Decorator):
    """A subtree that is a skill: the variables that the skill previews and monitors are declared while it runs."""

    def __init__(self, name: str, child: Behaviour, skill: str) -> None:
        """Make the subtree a skill of the spec."""
        super().__init__(name, child)
        self._skill = skill
        self._changes: frozenset[str] = frozenset()
        self._last_action_end_s = -math.inf
        self._stack = ExitStack()
        self._running_skill: Skill | None = None

    def _check_setup(self) -> None:
        self._changes = frozenset(self._skill_model(self._skill).changes)

    def initialise(self) -> None:
        """Begin the skill."""
        self._stack.close()  # if an earlier tick raised an exception, the skill of that tick has not ended yet
        self._last_action_end_s = -math.inf
        self._running_skill = self._stack.enter_context(self._codra.skill(self._skill))

    def update(self) -> Status:
        """Return the status of the subtree."""
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - the same for every status
        """Stop the subtree, and then end the skill."""
        if self.decorated.status is Status.RUNNING:
            self.decorated.stop(Status.INVALID)
        self._running_skill = None
        self._stack.close()

    @property
    def running_skill(self) -> Skill:
        """Return the running skill.

        Raises:
            RuntimeError: if the skill is not running.
        """
        if self._running_skill is None:
            raise RuntimeError(f"skill {self._skill!r} is not running")
        return self._running_skill

    def note_action(self, instant_s: float) -> None:
        """Record when an action of the skill ended."""
        self._last_action_end_s = instant_s

    @property
    def action_ends_s(self) -> Mapping[str, float]:
        """Return when the last action of the skill ended, for each variable that the skill changes.

        The instant is minus infinity if no action has ended yet.
        """
        return dict.fromkeys(self._changes, self._last_action_end_s)


class Acting(_ContextNode, Decorator):
    """The acting part of a skill: the variables that the skill changes are unknown from the start of this part.

    Later conditions and decisions in the skill use only evidence whose observation began after the end of this part.
    """

    def __init__(self, name: str, child: Behaviour) -> None:
        """Make the subtree the acting part of the `DuringSkill` above it."""
        super().__init__(name, child)
        self._stack = ExitStack()
        self._skill_node: DuringSkill | None = None

    def _check_setup(self) -> None:
        self._skill_node = next(_skills_above(self), None)
        if self._skill_node is None:
            raise TypeError(f"{self.name!r} acts outside of a skill: put a DuringSkill around it")

    def initialise(self) -> None:
        """Begin the action."""
        assert self._skill_node is not None
        self._stack.close()
        self._stack.enter_context(self._skill_node.running_skill.acting())
        self._stack.callback(self._end)

    def update(self) -> Status:
        """Return the status of the subtree."""
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:  # noqa: ARG002 - the same for every status
        """End the action."""
        if self.decorated.status is Status.RUNNING:
            self.decorated.stop(Status.INVALID)
        self._stack.close()

    def _end(self) -> None:
        assert self._skill_node is not None
        self._skill_node.note_action(self._clock.now_s())


class Expecting(_ContextNode, Decorator):
    """A subtree that is followed by skills. The previews of these skills are declared from the start of the subtree.

    The declaration is withdrawn if the subtree fails or is interrupted, and when a later `Expecting` node of the tree
    expects other skills.
    """

    def __init__(self, name: str, child: Behaviour, *skills: str) -> None:
        """Expect skills of the spec after the subtree."""
        super().__init__(name, child)
        self._skills = skills
        self._is_latest = False

    def _check_setup(self) -> None:
        for skill in self._skills:
            self._skill_model(skill)

    def initialise(self) -> None:
        """Expect the skills."""
        for node in _root(self).iterate():
            if isinstance(node, Expecting):
                node._is_latest = node is self
        self._codra.expect(*self._skills)

    def update(self) -> Status:
        """Return the status of the subtree."""
        return self.decorated.status

    def terminate(self, new_status: Status) -> None:
        """Withdraw the expectation, unless the subtree succeeded or a later node expects skills."""
        if new_status is not Status.SUCCESS and self._is_latest:
            self._is_latest = False
            self._codra.expect()


def _root(node: Behaviour) -> Behaviour:
    return node if node.parent is None else _root(node.parent)


def _skills_above(node: Behaviour) -> Iterator[DuringSkill]:
    """Yield the skills that contain a node, the innermost first."""
    ancestor = node.parent
    while ancestor is not None:
        if isinstance(ancestor, DuringSkill):
            yield ancestor
        ancestor = ancestor.parent


def _action_ends_s(node: Behaviour) -> Mapping[str, float]:
    """Return, for each variable that a skill around a node changes, when the last action that changes it ended.

    Evidence from before this instant is not used.
    """
    ends_s: dict[str, float] = {}
    for skill in _skills_above(node):
        for variable, end_s in skill.action_ends_s.items():
            ends_s[variable] = max(end_s, ends_s.get(variable, -math.inf))
    return ends_s


def _is_true(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{value!r} is neither true nor false: pass a condition, as in holds=lambda value: ...")
    return value


def _status(holds: bool) -> Status:
    return Status.SUCCESS if holds else Status.FAILURE


def _unknown_text(reading: Reading[Any]) -> str:
    if reading.known:
        return "unknown: its evidence is too old"
    return f"unknown: {reading.reason}" + (f" ({reading.detail})" if reading.detail else "")
