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

_FEW = 20
"""Integers below this are counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaledNumber:
    """Scale the numbers of a condition, wherever a spec has that condition.

    Attributes:
        condition: the text of the condition, e.g. `distance < 1.6 m`.
        variables: the end of the names of the variables that the condition identifies; empty for a condition of
            `accept_when`.
    """

    condition: str
    variables: str
    factor: float

    def __str__(self) -> str:
        """Return the description of the variant in a report."""
        return f"'{self.condition}' with {self.factor:g} times its numbers"

    def __call__(self, spec: Spec) -> Spec:
        """Return the spec with scaled numbers."""
        return replace(spec, perception=tuple(map(self._scale_algorithm, spec.perception)))

    def _scale_algorithm(self, algorithm: Algorithm) -> Algorithm:
        if not self.variables:
            return replace(algorithm, accept_when=tuple(map(self._scale_if_meant, algorithm.accept_when)))
        return replace(algorithm, identifies=tuple(map(self._scale_identification, algorithm.identifies)))

    def _scale_identification(self, entry: Identification) -> Identification:
        if not entry.variable.name.endswith(self.variables):
            return entry
        match entry.by:
            case Condition():
                return replace(entry, by=self._scale_if_meant(entry.by))
            case Hysteresis(enter=enter, leave=leave):
                return replace(
                    entry,
                    by=replace(
                        entry.by,
                        enter=self._scale_if_meant(enter),
                        leave=None if leave is None else self._scale_if_meant(leave),
                    ),
                )
            case _:
                return entry

    def _scale_if_meant(self, condition: Condition) -> Condition:
        return _scale_numbers(condition, self.factor) if condition.text == self.condition else condition


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaledValidity:
    """Scale `valid_for` of all variables that are not valid for ever."""

    factor: float

    def __str__(self) -> str:
        """Return the description of the variant in a report."""
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
        """Return the description of the variant in a report."""
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
        smaller: the edit that halves the numbers; counts are rounded up.
        larger: the edit that makes the numbers one and a half times as large; counts are rounded up.
    """

    name: str
    smaller: SpecEdit
    larger: SpecEdit


HALF, ONE_AND_A_HALF = 0.5, 1.5


def parameters(spec: Spec, besides: str) -> Sequence[Parameter]:
    """Return the parameters of a spec: the numbers of its conditions (each text once), its validities and its periods.

    Args:
        spec: a spec with one or more machines.
        besides: conditions of algorithms whose names end with this are left out.
    """
    conditions: dict[tuple[str, str], None] = {}
    for algorithm in (algorithm for algorithm in spec.perception if not algorithm.name.endswith(besides)):
        conditions |= {(condition.text, ""): None for condition in algorithm.accept_when if _numbers(condition)}
        for entry in algorithm.identifies:
            conditions |= {
                (condition.text, _variable_end(entry)): None for condition in _conditions(entry) if _numbers(condition)
            }
    numbers = [
        Parameter(
            name=f"{text} ({variables.strip('_')})" if variables else text,
            smaller=ScaledNumber(condition=text, variables=variables, factor=HALF),
            larger=ScaledNumber(condition=text, variables=variables, factor=ONE_AND_A_HALF),
        )
        for text, variables in conditions
    ]
    if any(variable.valid_for_s < FOREVER_S for variable in spec.context):
        smaller, larger = (ScaledValidity(factor=factor) for factor in (HALF, ONE_AND_A_HALF))
        numbers.append(Parameter(name="valid_for", smaller=smaller, larger=larger))
    if spec.observers:
        sooner, later = (ScaledPeriod(factor=factor) for factor in (HALF, ONE_AND_A_HALF))
        numbers.append(Parameter(name="period of observers", smaller=sooner, larger=later))
    return numbers


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


def _numbers(condition: Condition) -> Sequence[Number]:
    tree = condition.tree
    return () if tree is None else [node for node in walk(tree) if isinstance(node, Number)]


def _scale_numbers(condition: Condition, factor: float) -> Condition:
    """Return a condition with all literals scaled."""
    text = condition.text
    for number in reversed(_numbers(condition)):
        literal_text = text[number.start : number.end]
        _, blank, unit = literal_text.partition(" ")
        text = f"{text[: number.start]}{_scaled_literal(number.value, factor)}{blank}{unit}{text[number.end :]}"
    tree = parse(text)
    assert not isinstance(tree, SyntaxProblem), text
    return replace(condition, text=text, tree=tree, letters=None)


def _scaled_literal(value: float, factor: float) -> str:
    """Return a scaled literal; a count stays an integer."""
    if isinstance(value, int) and value < _FEW:
        return str(max(math.ceil(value * factor), 1))
    return f"{value * factor:.6g}"
