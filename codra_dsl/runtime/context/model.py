"""The model of a complete spec in generated code: the context C_M and the forest F (P1, Equations 3, 11)."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.runtime.observers.observer import ObserverModel
from codra_dsl.runtime.values.declarations import MAIN, OBSERVER
from codra_dsl.runtime.values.model import ResourceModel, SkillModel, VariableModel


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextModel:
    """A complete compiled spec."""

    name: str
    variables: tuple[VariableModel, ...]
    observers: tuple[ObserverModel, ...]
    skills: tuple[SkillModel, ...] = ()
    resources: tuple[ResourceModel, ...] = ()

    @property
    def observed_variables(self) -> frozenset[str]:
        """Return the variables that observers identify, and the derived variables, whose inputs may have observers."""
        identified_variables = (name for observer in self.observers for name in observer.identifies)
        derived_variables = (variable.name for variable in self.variables if variable.derived is not None)
        return frozenset((*identified_variables, *derived_variables))

    @property
    def agents(self) -> frozenset[str]:
        """Return the agents that may write variables."""
        written_variables = (variable for variable in self.variables if variable.derived is None)
        return frozenset(source for variable in written_variables for source in variable.sources) - {MAIN, OBSERVER}
