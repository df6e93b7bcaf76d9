"""How the context manager answers: decisions on variables, and previews of skills (P1, section 3.3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar

from codra_dsl.isolation.error_text import type_name
from codra_dsl.logic import Value
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.context.decisions import DecisionRequest, PreviewRequest
from codra_dsl.runtime.context.pending_decision import DecisionState, PendingDecision, PendingPreview
from codra_dsl.runtime.context.shadow import ShadowReport, shadow_report
from codra_dsl.runtime.journal import EventLog
from codra_dsl.runtime.locked_clock import LockedClock
from codra_dsl.runtime.values.model import SkillModel, VariableModel
from codra_dsl.runtime.values.previews import PreviewAnswer

VariableName = TypeVar("VariableName", bound=str)
SkillName = TypeVar("SkillName", bound=str)


class AnsweringContext(Generic[VariableName, SkillName]):
    """Answers decisions on variables, and previews of skills.

    Attributes:
        record: the event log.
        commands: executes the commands of programs, one step each.
    """

    record: EventLog
    commands: Commands
    _clock: LockedClock

    def decide(
        self,
        name: VariableName,
        otherwise: Callable[[], Any],
        *,
        max_age_s: float = math.inf,
        since_s: float = -math.inf,
        wait_up_to_s: float = 0.0,
        shadow: bool = False,
    ) -> Any:
        """Answer a decision from context, or fall back to sequential perception (P1, section 3.3).

        Args:
            name: the variable that the decision needs.
            otherwise: looks as the robot did without observers. It returns a value of the variable, or None or NaN if
                it found no value. The value is kept as evidence of the main execution if the main execution may `set`
                the variable.
            max_age_s: the largest permitted age of the evidence.
            since_s: the taking of the evidence must have begun at or after this instant, e.g. the end of an action.
            wait_up_to_s: how long to wait for observers before falling back.
            shadow: look in any case, return the value of the look, and record whether the context agrees. The value is
                not stored, so the look does not affect the context.

        Returns:
            The value from context, or the return value of `otherwise`. NaN is no value, so None is returned for it.

        Raises:
            NotOfTypeError: if `otherwise` returns a value of another type.
        """
        pending_decision = self.ask(
            name, max_age_s=max_age_s, since_s=since_s, wait_up_to_s=wait_up_to_s, shadow=shadow
        )
        try:
            if pending_decision.wait(math.inf) is DecisionState.ANSWERED:
                return pending_decision.value
            acquired_value = otherwise()
        except BaseException as error:
            pending_decision.abandon(type_name(error))
            raise
        accepted_value = pending_decision.record_result(acquired_value)
        return None if accepted_value is None else acquired_value  # NaN is accepted as no value

    def shadow_report(self) -> ShadowReport:
        """Return how often context agreed with the robot's looks in shadow mode, according to the event log."""
        return shadow_report(self.record)

    def ask(
        self,
        name: VariableName,
        *,
        max_age_s: float = math.inf,
        since_s: float | Mapping[str, float] = -math.inf,
        wait_up_to_s: float = 0.0,
        shadow: bool = False,
    ) -> PendingDecision:
        """Return a pending decision: the same as `decide`, but in steps, for a main execution that must not block.

        The arguments are those of `decide`. For a derived variable, `since_s` can also be one instant for each of some
        of its inputs; other names have no effect. If a look is necessary, the main execution looks between two steps.
        """
        request = self._decision_request(name, max_age_s, since_s, wait_up_to_s, shadow=shadow)
        return PendingDecision(
            self.commands.ask(request),
            commands=self.commands,
            clock=self._clock,
            context=self.commands.decision_context,
            convert=self._convert,
        )

    def can_answer(
        self, name: VariableName, *, max_age_s: float = math.inf, since_s: float | Mapping[str, float] = -math.inf
    ) -> bool:
        """Return whether context would answer a decision on a variable now; no event is recorded.

        The arguments are those of `ask`.
        """
        request, context = self._decision_request(name, max_age_s, since_s, 0.0), self.commands.decision_context
        return request.permits(context.reading(name), context, self._clock.now_s())

    def preview(
        self,
        skill: SkillName,
        otherwise: Callable[[str], object] | None = None,
        *,
        max_age_s: float = math.inf,
        since_s: float | Mapping[str, float] = -math.inf,
        wait_up_to_s: float = 0.0,
    ) -> PreviewAnswer:
        """Answer the whole preview of a skill: it holds, is violated, or is unknown. This is one decision.

        A condition that does not hold is reported even if other variables are unknown. The preview does not declare
        its variables: `expect` the skill before.

        Args:
            skill: the skill that comes next.
            otherwise: looks for a variable that is still unknown after the wait. It is called with the name of the
                variable, and returns a value, or None or NaN if it found no value. It is called for one variable after
                the other, only until the preview is decided. A value is kept as evidence of the main execution if the
                main execution may `set` the variable. Without `otherwise` there is no look.
            max_age_s: the largest permitted age of the evidence of each variable.
            since_s: the taking of the evidence must have begun at or after this instant; also one instant for each of
                some variables, which can be inputs of derived variables. Other names have no effect.
            wait_up_to_s: how long to wait for observers if the preview is unknown.

        Raises:
            UnknownNameError: if the spec has no such skill.
            NotOfTypeError: if `otherwise` returns a value of another type.
        """
        pending_preview = self.ask_preview(
            skill, max_age_s=max_age_s, since_s=since_s, wait_up_to_s=wait_up_to_s, looks=otherwise is not None
        )
        try:
            pending_preview.wait(math.inf)
            while pending_preview.missing and otherwise is not None:
                pending_preview.record_result(otherwise(pending_preview.missing[0]))
        except BaseException as error:
            pending_preview.abandon(type_name(error))
            raise
        return pending_preview.answer

    def ask_preview(
        self,
        skill: SkillName,
        *,
        max_age_s: float = math.inf,
        since_s: float | Mapping[str, float] = -math.inf,
        wait_up_to_s: float = 0.0,
        looks: bool = False,
    ) -> PendingPreview:
        """Return a pending preview: the same as `preview`, but in steps, for a main execution that must not block.

        The arguments are those of `preview`. If `looks`, the main execution looks between two steps.
        """
        model = self._skill(skill)
        limits_s = since_s if isinstance(since_s, Mapping) else dict.fromkeys(model.preview, since_s)
        request = PreviewRequest(
            skill=skill,
            max_age_s=float(max_age_s),
            since_s=self._limits_s(limits_s, model.preview),
            wait_up_to_s=float(wait_up_to_s),
            looks=looks,
        )
        return PendingPreview(
            self.commands.ask_preview(request),
            commands=self.commands,
            clock=self._clock,
            context=self.commands.decision_context,
            convert=self._convert,
        )

    def _convert(self, name: str, value: object) -> Value | None:
        return self._model(name).type.convert(value)

    def _decision_request(
        self,
        name: str,
        max_age_s: float,
        since_s: float | Mapping[str, float],
        wait_up_to_s: float,
        *,
        shadow: bool = False,
    ) -> DecisionRequest:
        variable = self._model(name).name
        limits_s = self._limits_s(since_s, (variable,)) if isinstance(since_s, Mapping) else float(since_s)
        return DecisionRequest(
            variable=variable,
            max_age_s=float(max_age_s),
            since_s=limits_s,
            wait_up_to_s=float(wait_up_to_s),
            shadow=shadow,
        )

    def _limits_s(self, since_s: Mapping[str, float], names: Iterable[str]) -> Mapping[str, float]:
        """Return the instants that limit the evidence of some variables and of their inputs."""
        relevant_names = self.commands.with_inputs(names)
        limits_s = {name: float(instant_s) for name, instant_s in since_s.items() if name in relevant_names}
        return {name: instant_s for name, instant_s in limits_s.items() if instant_s != -math.inf}

    def _model(self, name: str) -> VariableModel:
        """Return the declaration of a variable.

        Raises:
            UnknownNameError: if the spec has no such variable.
        """
        raise NotImplementedError

    def _skill(self, name: str) -> SkillModel:
        """Return the declaration of a skill.

        Raises:
            UnknownNameError: if the spec has no such skill.
        """
        raise NotImplementedError
