"""The model of a complete spec in generated code: the context C_M and the forest F (P1, Equations 3, 11)."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.runtime.observers.observer import ObserverModel
from codra_dsl.runtime.values.model import ResourceModel, SkillModel, VariableModel


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextModel:
    """A complete compiled spec."""

    name: str
    variables: tuple[VariableModel, ...]
    observers: tuple[ObserverModel, ...]
    skills: tuple[SkillModel, ...] = ()
    resources: tuple[ResourceModel, ...] = ()
