"""Output variables: one number from the conclusions of all rules.

An output has one conclusion for each mention of the output in a rule, in the order in which the rules act. The value
of the output is computed from the degrees of its conclusions. The degree of a conclusion is `None` if the conclusion's
rule does not act.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from codra_dsl.runtime.loops.fuzzy import norms
from codra_dsl.runtime.loops.fuzzy.defuzzifiers import midpoints
from codra_dsl.runtime.loops.fuzzy.sampled import NORMS_OF_SAMPLES, Norm, Samples

Degrees = Sequence[float | None]
Membership = Callable[[float], float]
Defuzzify = Callable[[Samples, Samples], float]


class Inference(NamedTuple):
    """The result of one call of an engine.

    Attributes:
        values: the values of the outputs, in the engine's order; NaN is unknown.
        strengths: the weighted strengths of the rules, before the activation of their block selects among them.
    """

    values: tuple[float, ...]
    strengths: tuple[float, ...]


def usable_degree(degree: float) -> float:
    """Return the degree that is used for a conclusion: 0 for NaN, 1 for infinity, and 0 for minus infinity."""
    if degree - degree == 0.0:
        return degree
    return 1.0 if degree > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """A rule's conclusion that an output is a term: the index of the term, and the implication."""

    term: int
    implication: Norm


@dataclass(frozen=True, kw_only=True)
class Integral:
    """An output whose conclusions are fuzzy sets: Mamdani's and Larsen's methods.

    Attributes:
        minimum: the lower end of the range that is sampled, in the unit of the output; `maximum` is the upper end.
        memberships: the membership functions of the output's terms.
    """

    minimum: float
    maximum: float
    resolution: int
    defuzzify: Defuzzify
    aggregation: Norm
    memberships: tuple[Membership, ...]
    conclusions: tuple[Conclusion, ...]

    @cached_property
    def points(self) -> Samples:
        """The points at which the range is sampled."""
        return midpoints(self.minimum, self.maximum, self.resolution)

    @cached_property
    def terms(self) -> tuple[Samples, ...]:
        """The samples of the output's terms."""
        points = self.points.tolist()
        return tuple(np.array([membership(x) for x in points]) for membership in self.memberships)

    @cached_property
    def is_plain(self) -> bool:
        """Whether all samples are degrees from 0 to 1.

        If so, a conclusion with degree 0 changes nothing and can be left out.
        """
        return all(bool(np.all((samples >= 0.0) & (samples <= 1.0))) for samples in self.terms)

    @cached_property
    def is_clipped(self) -> bool:
        """Whether only the strongest conclusion of each term has an effect."""
        are_implications_minimum = all(conclusion.implication is norms.minimum for conclusion in self.conclusions)
        return self.is_plain and self.aggregation is norms.maximum and are_implications_minimum

    def value(self, degrees: Degrees) -> float:
        """Return the output; NaN if no conclusion holds at any point."""
        if self.is_clipped:
            samples = self._clipped_samples(degrees)
        else:
            with np.errstate(all="ignore"):
                samples = self.aggregated(degrees)
        return math.nan if samples is None else self.defuzzify(self.points, samples)

    def _clipped_samples(self, degrees: Degrees) -> Samples | None:
        strongest_degrees: dict[int, float] = {}
        for conclusion, degree in zip(self.conclusions, degrees, strict=True):
            if degree is not None and degree > strongest_degrees.get(conclusion.term, 0.0):
                strongest_degrees[conclusion.term] = usable_degree(degree)
        samples = None
        for term, degree in strongest_degrees.items():
            clipped_samples = np.minimum(self.terms[term], degree)
            samples = clipped_samples if samples is None else np.maximum(samples, clipped_samples, out=clipped_samples)
        return samples

    def aggregated(self, degrees: Degrees) -> Samples | None:
        """Return the aggregated samples of all conclusions; None if no conclusion acts."""
        aggregate, samples = NORMS_OF_SAMPLES[self.aggregation], None
        for conclusion, degree in zip(self.conclusions, degrees, strict=True):
            if degree is None:
                continue
            used_degree = usable_degree(degree)
            if used_degree == 0.0 and self.is_plain:
                continue
            implied_samples = NORMS_OF_SAMPLES[conclusion.implication](used_degree, self.terms[conclusion.term])
            samples = aggregate(np.zeros(self.resolution) if samples is None else samples, implied_samples)
        return samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighted:
    """An output whose conclusions are numbers: the methods of Takagi-Sugeno and Tsukamoto.

    Attributes:
        aggregation: the norm that aggregates the degrees of one term.
        conclusions: the index of the term of each conclusion.
    """

    aggregation: Norm
    conclusions: tuple[int, ...]

    def average(self, degrees: Degrees, values: Sequence[float | Membership]) -> float:
        """Return the mean of the terms' values, weighted by their degrees; NaN if no rule acts."""
        weights, total = self._sums(degrees, values)
        return total / weights if weights != 0.0 else math.nan

    def sum(self, degrees: Degrees, values: Sequence[float | Membership]) -> float:
        """Return the sum of the terms' values times their degrees; NaN if no rule acts."""
        weights, total = self._sums(degrees, values)
        return total / weights * weights if weights != 0.0 else math.nan

    def _sums(self, degrees: Degrees, values: Sequence[float | Membership]) -> tuple[float, float]:
        weights = total = 0.0
        for term, degree in grouped(self.aggregation, self.conclusions, degrees).items():
            value = values[term]
            weights += degree
            total += degree * (value(degree) if callable(value) else value)
        return weights, total


def grouped(aggregation: Norm, conclusions: Sequence[int], degrees: Degrees) -> dict[int, float]:
    """Return a mapping from each term with a conclusion that acts to its degree, in the order of the conclusions."""
    degrees_by_term: dict[int, float] = {}
    for term, degree in zip(conclusions, degrees, strict=True):
        if degree is not None:
            used_degree = usable_degree(degree)
            degrees_by_term[term] = (
                usable_degree(aggregation(degrees_by_term[term], used_degree))
                if term in degrees_by_term
                else used_degree
            )
    return degrees_by_term


def degree_so_far(aggregation: Norm, degrees: Degrees) -> float:
    """Return the degree that a rule reads for a term of an output; it follows from conclusions of earlier rules."""
    return grouped(aggregation, (0,) * len(degrees), degrees).get(0, 0.0)


def shaped(output: Integral, memberships: tuple[Membership, ...]) -> Integral:
    """Return an output with terms that depend on the inputs of one call."""
    return replace(output, memberships=memberships)


def clipped(value: float, minimum: float, maximum: float) -> float:
    """Return the value, limited to a range; NaN stays NaN."""
    if value < minimum:
        return minimum
    return maximum if value > maximum else value


def known(value: float, *substitutes: float) -> float:
    """Return the value or, if it is NaN, the first substitute that is not NaN.

    The substitutes are the previous value and then the default.
    """
    if value == value:
        return value
    return next((substitute for substitute in substitutes if substitute == substitute), value)
