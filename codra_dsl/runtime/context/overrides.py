"""Overrides: the operator's own readings of variables, for a limited time and with a reason.

For example, the sensor of a door is broken, and the operator sees that the door is open.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from codra_dsl.runtime.values.model import VariableModel, real, text

if TYPE_CHECKING:
    from codra_dsl.runtime.context.commands import Commands

MAX_OVERRIDE_S = 86_400.0
"""The longest override, 24 hours: a robot should not trust a forgotten override for longer."""

VariableName = TypeVar("VariableName", bound=str)


class Overrides(ABC, Generic[VariableName]):
    """The calls of the context manager with which an operator overrides variables.

    Attributes:
        commands: executes the commands.
    """

    commands: Commands

    @abstractmethod
    def _model(self, name: str) -> VariableModel:
        """Return the declaration of a variable, or raise `UnknownNameError`."""

    def override(self, name: VariableName, value: Any, *, for_s: float, reason: str) -> None:
        """Give a variable a value as the operator, or make it unknown, for some time. It replaces an earlier override.

        The override outranks all sources of the variable, and a skill that changes the variable does not end it.
        Observers and other sources continue during the override. When it ends, the variable has their reading again.
        An override is not evidence: a decision with `since_s` does not accept it.

        Args:
            name: the variable; it need not be declared, and may have any source.
            value: its value; None, or NaN for a number, makes the variable unknown.
            for_s: how long the override lasts, in seconds; more than zero, and at most `MAX_OVERRIDE_S`.
            reason: why the operator overrides the variable, for `why`, the journal and `Reading.detail`.

        Raises:
            NotOfTypeError: if the value does not have the declared type.
            ValueError: if the duration is not above zero or is too long, or the reason is not a text or is empty.
        """
        content = None if value is None else self._model(name).type.convert(value)
        self.commands.override(self._model(name).name, content, checked_duration_s(for_s), _checked_reason(reason))

    def clear_override(self, name: VariableName) -> None:
        """End the override of a variable, if there is one; the variable has the reading of its sources again."""
        self.commands.clear_override(self._model(name).name)


def checked_duration_s(for_s: object) -> float:
    """Return the duration of an override.

    Raises:
        ValueError: if an override cannot last so long.
    """
    duration_s = real().convert(for_s)
    if not isinstance(duration_s, float) or not 0 < duration_s <= MAX_OVERRIDE_S:
        max_text = f"at most {MAX_OVERRIDE_S / 3600:g} h ({MAX_OVERRIDE_S:g} s)"
        raise ValueError(f"an override lasts for more than 0 s and {max_text}: override again before it ends")
    return duration_s


def _checked_reason(reason: object) -> str:
    checked_reason = text().convert(reason)
    if not isinstance(checked_reason, str) or not checked_reason.strip():
        raise ValueError("an override needs a reason, such as 'sensor broken'")
    return checked_reason
