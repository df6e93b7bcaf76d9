"""Output variables: what the conclusions of rules, taken together, come to as one number.

An output knows its conclusions, one for each time that a rule names it, in the order in which rules act; it is asked
with the degree of each. `None` is the degree of a conclusion whose rule does not act.
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
from codra_dsl.runtime.loops.fuzzy.sampled import OF_SAMPLES, Norm, Samples

Degrees = Sequence[float | None]
Membership = Callable[[float], float]
Defuzzify = Callable[[Samples, Samples], float]


class Inference(NamedTuple):
    """What one call of an engine comes to.

    Attributes:
        values: of the outputs, in the engine's order; NaN is unknown.
        strengths: of the rules, weighted, as they were before their block's activation chose among them.
    """

    values: tuple[float, ...]
    strengths: tuple[float, ...]


def settled(degree: float) -> float:
    """Return the degree with which a conclusion counts: 0 if it is NaN, and infinite ones as their nearest end."""
    if degree - degree == 0.0:
        return degree
    return 1.0 if degree > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """That a rule says an output is a term: the term's index, and what implies it."""

    term: int
    implication: Norm


@dataclass(frozen=True, kw_only=True)
class Integral:
    """An output whose conclusions are fuzzy sets: Mamdani's and Larsen's methods.

    Attributes:
        minimum: with `maximum` the range that is sampled, in the unit of the output.
        memberships: of its terms.
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
        """Where it is sampled."""
        return midpoints(self.minimum, self.maximum, self.resolution)

    @cached_property
    def terms(self) -> tuple[Samples, ...]:
        """The samples of its terms."""
        points = self.points.tolist()
        return tuple(np.array([membership(x) for x in points]) for membership in self.memberships)

    @cached_property
    def is_plain(self) -> bool:
        """Whether all samples are degrees from 0 to 1, so that what acts with degree 0 changes nothing."""
        return all(bool(np.all((samples >= 0.0) & (samples <= 1.0))) for samples in self.terms)

    @cached_property
    def is_clipped(self) -> bool:
        """Whether the strongest conclusion of a term is all that counts of it."""
        plain_norms = all(each.implication is norms.minimum for each in self.conclusions)
        return self.is_plain and self.aggregation is norms.maximum and plain_norms

    def value(self, degrees: Degrees) -> float:
        """Return the output, NaN where no conclusion holds at any point."""
        if self.is_clipped:
            samples = self._clipped(degrees)
        else:
            with np.errstate(all="ignore"):
                samples = self.aggregated(degrees)
        return math.nan if samples is None else self.defuzzify(self.points, samples)

    def _clipped(self, degrees: Degrees) -> Samples | None:
        strongest: dict[int, float] = {}
        for conclusion, degree in zip(self.conclusions, degrees, strict=True):
            if degree is not None and degree > strongest.get(conclusion.term, 0.0):
                strongest[conclusion.term] = settled(degree)
        samples = None
        for term, degree in strongest.items():
            each = np.minimum(self.terms[term], degree)
            samples = each if samples is None else np.maximum(samples, each, out=each)
        return samples

    def aggregated(self, degrees: Degrees) -> Samples | None:
        """Return the samples of all conclusions together; None where none acts."""
        aggregate, samples = OF_SAMPLES[self.aggregation], None
        for conclusion, degree in zip(self.conclusions, degrees, strict=True):
            if degree is None:
                continue
            counted = settled(degree)
            if counted == 0.0 and self.is_plain:
                continue
            each = OF_SAMPLES[conclusion.implication](counted, self.terms[conclusion.term])
            samples = aggregate(np.zeros(self.resolution) if samples is None else samples, each)
        return samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighted:
    """An output whose conclusions are numbers: the methods of Takagi-Sugeno and Tsukamoto.

    Attributes:
        aggregation: of the degrees of one term.
        conclusions: the index of the term, of each.
    """

    aggregation: Norm
    conclusions: tuple[int, ...]

    def average(self, degrees: Degrees, values: Sequence[float | Membership]) -> float:
        """Return the mean of the terms' values, weighted by their degrees; NaN where nothing acts."""
        weights, total = self._sums(degrees, values)
        return total / weights if weights != 0.0 else math.nan

    def sum(self, degrees: Degrees, values: Sequence[float | Membership]) -> float:
        """Return the sum of the terms' values times their degrees; NaN where nothing acts."""
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
    """Return the degree of each term that some conclusion names, aggregated, in the order of the first ones."""
    groups: dict[int, float] = {}
    for term, degree in zip(conclusions, degrees, strict=True):
        if degree is not None:
            counted = settled(degree)
            groups[term] = settled(aggregation(groups[term], counted)) if term in groups else counted
    return groups


def degree_so_far(aggregation: Norm, degrees: Degrees) -> float:
    """Return how far an output is a term by the conclusions before this rule: what a rule about an output asks."""
    return grouped(aggregation, (0,) * len(degrees), degrees).get(0, 0.0)


def shaped(output: Integral, memberships: tuple[Membership, ...]) -> Integral:
    """Return an output with terms that depend on the inputs of one call."""
    return replace(output, memberships=memberships)


def clipped(value: float, minimum: float, maximum: float) -> float:
    """Return the nearest value in a range; NaN stays NaN."""
    if value < minimum:
        return minimum
    return maximum if value > maximum else value


def known(value: float, *substitutes: float) -> float:
    """Return the value, or if it is NaN the first substitute that is none: the previous value, the default."""
    if value == value:
        return value
    return next((each for each in substitutes if each == each), value)
