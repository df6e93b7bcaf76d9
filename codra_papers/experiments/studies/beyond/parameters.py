"""The numeric parameters of a spec, and spec variants that make each of them larger or smaller.

Parameters are read from the spec and not listed here, so that numbers added to the spec are varied as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from codra_dsl.language.expression import Number, SyntaxProblem, parse, walk
from codra_dsl.language.model import FOREVER_S, Algorithm, Condition, Hysteresis, Identification, Spec
from codra_papers.experiments.lab.spec_variants import SpecEdit

_MACHINES = ("centrifuge", "pcr_cycler")

_COUNT_LIMIT = 20
"""An integer below this limit is a count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaledNumber:
    """Scale the numbers of a condition, wherever a spec contains the condition.

    Attributes:
        condition: the text of the condition, e.g. `distance < 1.6 m`.
        variables: the suffix of the names of the variables that the condition identifies; empty for a condition of
            `accept_when`.
    """

    condition: str
    variables: str
    factor: float

    def __str__(self) -> str:
        """Return the description of the variant for a report."""
        return f"'{self.condition}' with {self.factor:g} times its numbers"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with scaled numbers."""
        return replace(spec, perception=tuple(map(self._scale_algorithm, spec.perception)))

    def _scale_algorithm(self, algorithm: Algorithm) -> Algorithm:
        if not self.variables:
            return replace(algorithm, accept_when=tuple(map(self._scale_if_equal, algorithm.accept_when)))
        return replace(algorithm, identifies=tuple(map(self._scale_identification, algorithm.identifies)))

    def _scale_identification(self, entry: Identification) -> Identification:
        if not entry.variable.name.endswith(self.variables):
            return entry
        match entry.by:
            case Condition():
                return replace(entry, by=self._scale_if_equal(entry.by))
            case Hysteresis(enter=enter, leave=leave):
                return replace(
                    entry,
                    by=replace(
                        entry.by,
                        enter=self._scale_if_equal(enter),
                        leave=None if leave is None else self._scale_if_equal(leave),
                    ),
                )
            case _:
                return entry

    def _scale_if_equal(self, condition: Condition) -> Condition:
        return _scale_numbers(condition, self.factor) if condition.text == self.condition else condition


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaledValidity:
    """Scale `valid_for` of all variables that are not valid for ever."""

    factor: float

    def __str__(self) -> str:
        """Return the description of the variant for a report."""
        return f"{self.factor:g} times each valid_for"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with scaled `valid_for`."""
        return replace(
            spec,
            context=tuple(
                replace(variable, valid_for_s=variable.valid_for_s * self.factor) for variable in spec.context
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaledPeriod:
    """Scale the periods of all observers that the spec lists under `observers`."""

    factor: float

    def __str__(self) -> str:
        """Return the description of the variant for a report."""
        return f"{self.factor:g} times each period"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with scaled periods."""
        return replace(
            spec,
            observers=tuple(replace(observer, period_s=observer.period_s * self.factor) for observer in spec.observers),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A number of the spec, or numbers that belong together.

    Attributes:
        name: the name in reports.
        smaller_edit: the edit that halves the numbers; counts are rounded up.
        larger_edit: the edit that multiplies the numbers by 1.5; counts are rounded up.
    """

    name: str
    smaller_edit: SpecEdit
    larger_edit: SpecEdit


HALF, ONE_AND_A_HALF = 0.5, 1.5


def parameters(spec: Spec, excluded_suffix: str) -> Sequence[Parameter]:
    """Return the parameters of a spec: the numbers of its conditions (each text once), its validities and its periods.

    Args:
        spec: a spec with one or more machines.
        excluded_suffix: conditions of algorithms with this suffix in their names are left out.
    """
    conditions: dict[tuple[str, str], None] = {}
    for algorithm in (algorithm for algorithm in spec.perception if not algorithm.name.endswith(excluded_suffix)):
        conditions |= {(condition.text, ""): None for condition in algorithm.accept_when if _number_nodes(condition)}
        for entry in algorithm.identifies:
            conditions |= {
                (condition.text, _variable_end(entry)): None
                for condition in _conditions(entry)
                if _number_nodes(condition)
            }
    all_parameters = [
        Parameter(
            name=f"{text} ({variables.strip('_')})" if variables else text,
            smaller_edit=ScaledNumber(condition=text, variables=variables, factor=HALF),
            larger_edit=ScaledNumber(condition=text, variables=variables, factor=ONE_AND_A_HALF),
        )
        for text, variables in conditions
    ]
    if any(variable.valid_for_s < FOREVER_S for variable in spec.context):
        smaller_edit, larger_edit = (ScaledValidity(factor=factor) for factor in (HALF, ONE_AND_A_HALF))
        all_parameters.append(Parameter(name="valid_for", smaller_edit=smaller_edit, larger_edit=larger_edit))
    if spec.observers:
        shorter_edit, longer_edit = (ScaledPeriod(factor=factor) for factor in (HALF, ONE_AND_A_HALF))
        all_parameters.append(Parameter(name="period of observers", smaller_edit=shorter_edit, larger_edit=longer_edit))
    return all_parameters


def _conditions(entry: Identification) -> Sequence[Condition]:
    match entry.by:
        case Condition():
            return (entry.by,)
        case Hysteresis(enter=enter, leave=leave):
            return (enter,) if leave is None else (enter, leave)
        case _:
            return ()


def _variable_end(entry: Identification) -> str:
    """Return a variable's name without the name of its machine."""
    name = entry.variable.name
    return next((name.removeprefix(machine) for machine in _MACHINES if name.startswith(machine)), name)


def _number_nodes(condition: Condition) -> Sequence[Number]:
    tree = condition.tree
    return () if tree is None else [node for node in walk(tree) if isinstance(node, Number)]


def _scale_numbers(condition: Condition, factor: float) -> Condition:
    """Return a condition with all literals scaled."""
    text = condition.text
    for number in reversed(_number_nodes(condition)):
        literal_text = text[number.start : number.end]
        _, blank, unit = literal_text.partition(" ")
        text = f"{text[: number.start]}{_scaled_literal(number.value, factor)}{blank}{unit}{text[number.end :]}"
    tree = parse(text)
    assert not isinstance(tree, SyntaxProblem), text
    return replace(condition, text=text, tree=tree, letters=None)


def _scaled_literal(value: float, factor: float) -> str:
    """Return a scaled literal; a count stays an integer."""
    if isinstance(value, int) and value < _COUNT_LIMIT:
        return str(max(math.ceil(value * factor), 1))
    return f"{value * factor:.6g}"
