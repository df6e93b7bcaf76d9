"""Edits that turn the spec of an experiment into the specs of its arms. Each edit is a frozen value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from codra_dsl.language.model import (
    FOREVER_S,
    Access,
    Algorithm,
    Condition,
    Hysteresis,
    Identification,
    ObserverSetting,
    Reference,
    Refresh,
    Spec,
)

SpecEdit = Callable[[Spec], Spec]
"""A function that turns a spec into another spec. The function is a frozen value, so that it can be sent to a process
and described in a report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WithoutConditions:
    """Remove all knowledge of when perception can be trusted (P1, section 4.1): functions are called unconditionally.

    The functions, their arguments and results, and the meaning of the results for variables stay the same. All skills
    are removed, so every variable that has an algorithm gets its observer.

    Attributes:
        pause_s: the minimum time between two jobs of an algorithm that needs a slot; 0 to look again immediately.
    """

    pause_s: float = 0.0

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        pause = f", {self.pause_s} s between two jobs of the same algorithm" if self.pause_s else ""
        return f"no conditions{pause}"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec without conditions and skills. The spec must have no alternatives."""
        algorithms = tuple(self._without_conditions(algorithm) for algorithm in spec.perception)
        return replace(spec, perception=algorithms, skills=(), observers=_settings_without_pause(spec, algorithms))

    def _without_conditions(self, algorithm: Algorithm) -> Algorithm:
        needs_slot = any(usage.access is Access.SLOT for usage in algorithm.uses)
        pause_s = self.pause_s if needs_slot else 0.0
        return replace(algorithm, observable_when=(), accept_when=(), min_interval_s=pause_s)


def _settings_without_pause(spec: Spec, algorithms: tuple[Algorithm, ...]) -> tuple[ObserverSetting, ...]:
    """Return settings that give every tree a period of 0 s and the same priority. Every tree keeps its name."""
    variables_with_setting = {reference.name for setting in spec.observers for reference in setting.identifies}
    settings = [replace(setting, period_s=0.0, priority=0) for setting in spec.observers]
    for algorithm in algorithms:
        variables = tuple(
            Reference(name=entry.variable.name, place=entry.variable.place) for entry in algorithm.identifies
        )
        if not variables_with_setting & {reference.name for reference in variables}:
            variables_with_setting |= {reference.name for reference in variables}
            settings.append(
                ObserverSetting(name=algorithm.name, place=algorithm.place, identifies=variables, period_s=0.0)
            )
    return tuple(settings)


@dataclass(frozen=True, slots=True, kw_only=True)
class WithoutAlternatives:
    """Keep only the algorithm with the lowest rank for each variable."""

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return "no alternatives"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec without the algorithms of higher rank."""
        first_ranks: dict[str, int] = {}
        for algorithm in spec.perception:
            for entry in algorithm.identifies:
                name = entry.variable.name
                first_ranks[name] = min(first_ranks.get(name, algorithm.rank), algorithm.rank)
        first_algorithms = tuple(
            algorithm
            for algorithm in spec.perception
            if all(algorithm.rank == first_ranks[entry.variable.name] for entry in algorithm.identifies)
        )
        return replace(spec, perception=first_algorithms)


@dataclass(frozen=True, slots=True, kw_only=True)
class WithFunction:
    """Call another perception function instead of one function, with the same arguments and results.

    Attributes:
        function: the replaced function, as `package.module:function`.
        other_function: the function that is called instead.
    """

    function: str
    other_function: str

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return f"{self.other_function.rpartition(':')[2]} instead of {self.function.rpartition(':')[2]}"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with the other function."""
        algorithms = (
            replace(algorithm, call=self.other_function) if algorithm.call == self.function else algorithm
            for algorithm in spec.perception
        )
        return replace(spec, perception=tuple(algorithms))


@dataclass(frozen=True, slots=True, kw_only=True)
class WithMinimumInterval:
    """Set the minimum time between the starts of two jobs of some algorithms.

    Attributes:
        algorithms: the suffix of the names of the algorithms.
    """

    algorithms: str
    min_interval_s: float

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return f"*{self.algorithms} at most once in {self.min_interval_s:g} s"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with this `min_interval`."""
        algorithms = (
            replace(algorithm, min_interval_s=self.min_interval_s)
            if algorithm.name.endswith(self.algorithms)
            else algorithm
            for algorithm in spec.perception
        )
        return replace(spec, perception=tuple(algorithms))


@dataclass(frozen=True, slots=True, kw_only=True)
class WithRefresh:
    """Set `refresh` of all variables: `periodic` or `on_event`."""

    refresh: Refresh

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return f"refresh: {self.refresh.value}"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with this `refresh` for all variables."""
        return replace(spec, context=tuple(replace(variable, refresh=self.refresh) for variable in spec.context))


@dataclass(frozen=True, slots=True, kw_only=True)
class WithoutValidity:
    """Let every value stay valid for ever, as P1's flag `known` does (section 3.3)."""

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return "no valid_for"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec without any `valid_for`."""
        return replace(spec, context=tuple(replace(variable, valid_for_s=FOREVER_S) for variable in spec.context))


@dataclass(frozen=True, slots=True, kw_only=True)
class WithoutChanges:
    """Remove `changes` from all skills: a value that an action makes out of date stays known."""

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return "no changes"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec without any `changes`."""
        return replace(spec, skills=tuple(replace(skill, changes=()) for skill in spec.skills))


@dataclass(frozen=True, slots=True, kw_only=True)
class WithConfirmation:
    """Require several results to agree before a value is accepted, for variables with a condition or a hysteresis.

    Attributes:
        needed_results: how many of the compared results have to agree.
        compared_results: how many of the latest results are compared. 1 of 1 removes confirmation.
        variables: the suffixes of the names of the variables that need confirmation.
    """

    needed_results: int
    compared_results: int
    variables: tuple[str, ...]

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return (
            f"confirm: {self.needed_results} of {self.compared_results} for"
            f" {', '.join(f'*{name}' for name in self.variables)}"
        )

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with this `confirm`."""
        return replace(spec, perception=tuple(map(self._with_confirmations, spec.perception)))

    def _with_confirmations(self, algorithm: Algorithm) -> Algorithm:
        entries = (
            self._confirmed_entry(entry) if entry.variable.name.endswith(self.variables) else entry
            for entry in algorithm.identifies
        )
        return replace(algorithm, identifies=tuple(entries))

    def _confirmed_entry(self, entry: Identification) -> Identification:
        confirm = (self.needed_results, self.compared_results) if self.compared_results > 1 else None
        if isinstance(entry.by, Hysteresis):
            return replace(entry, by=replace(entry.by, confirm=confirm))
        if isinstance(entry.by, Condition) and confirm:
            by = Hysteresis(enter=entry.by, leave=None, confirm=confirm, place=entry.by.place)
            return replace(entry, by=by)
        return entry


@dataclass(frozen=True, slots=True, kw_only=True)
class WithoutCondition:
    """Remove a condition from `observable_when` (a precondition) and from `accept_when` (a refinement).

    Attributes:
        algorithm: the suffix of the names of the algorithms that lose the condition, e.g. `_lid` for the lids of all
            machines.
        condition: the suffix of the text of the condition, e.g. `_lid_in_FOV`.
    """

    algorithm: str
    condition: str

    def __str__(self) -> str:
        """Return the description of the edit for a report."""
        return f"*{self.algorithm} without *{self.condition}"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec without the condition.

        Raises:
            ValueError: if no algorithm with this suffix has the condition.
        """
        algorithms = tuple(map(self._edited_algorithm, spec.perception))
        if algorithms == spec.perception:
            raise ValueError(f"no algorithm *{self.algorithm} has a condition *{self.condition}")
        return replace(spec, perception=algorithms)

    def _edited_algorithm(self, algorithm: Algorithm) -> Algorithm:
        if not algorithm.name.endswith(self.algorithm):
            return algorithm
        return replace(
            algorithm,
            observable_when=self._without_condition(algorithm.observable_when),
            accept_when=self._without_condition(algorithm.accept_when),
        )

    def _without_condition(self, conditions: tuple[Condition, ...]) -> tuple[Condition, ...]:
        return tuple(condition for condition in conditions if not condition.text.endswith(self.condition))
