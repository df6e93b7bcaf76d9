"""Supports and cores of terms, compared with the memberships that the runtime computes."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.fuzzy.model import Term
from codra_dsl.language.fuzzy.supports import extent
from codra_dsl.language.fuzzy.words import Shape
from codra_dsl.runtime.loops.fuzzy import terms

SHAPES = [shape for shape in Shape if shape is not Shape.Linear]
NUMBERS = st.integers(-8, 8).map(lambda number: number / 2.0)
HEIGHTS = st.sampled_from((1.0, 0.5))


@st.composite
def some_terms(draw: st.DrawFn, shape: Shape) -> Term:
    """Return a term whose parameters are in the order that FuzzyLite requires."""
    if shape is Shape.Discrete:
        xs = sorted(draw(st.sets(NUMBERS, min_size=2, max_size=5)))
        ys = draw(st.lists(st.sampled_from((0.0, 0.5, 1.0)), min_size=len(xs), max_size=len(xs)))
        points = tuple(value for pair in zip(xs, ys, strict=True) for value in pair)
        return Term(name="t", shape=shape, parameters=points)
    count = len(shape.value.names)
    numbers = tuple(draw(st.lists(NUMBERS, min_size=count, max_size=count, unique=True)))
    if shape in (Shape.Triangle, Shape.Trapezoid, Shape.PiShape, Shape.SShape, Shape.ZShape):
        numbers = tuple(sorted(numbers))
    if shape in (Shape.Bell, Shape.Cosine, Shape.Gaussian, Shape.Spike):  # a centre, then widths
        numbers = (numbers[0], *(abs(number) + 0.5 for number in numbers[1:]))
    if shape is Shape.Constant:
        return Term(name="t", shape=shape, parameters=(draw(st.sampled_from((0.0, 0.5, 1.0))),))
    height = draw(HEIGHTS) if shape.value.has_height else 1.0
    return Term(name="t", shape=shape, parameters=numbers, height=height)


def degree(term: Term, x: float) -> float:
    """Return the degree of a number as the runtime computes it."""
    function = getattr(terms, term.shape.value.function)
    if term.shape is Shape.Discrete:
        return float(function(x, term.parameters[::2], term.parameters[1::2]))
    height = (term.height,) if term.shape.value.has_height else ()
    return float(function(x, *term.parameters, *height))


BOUNDED = [
    *(Shape.Arc, Shape.Binary, Shape.Concave, Shape.Constant, Shape.Discrete, Shape.PiShape, Shape.Ramp),
    *(Shape.Rectangle, Shape.SemiEllipse, Shape.SShape, Shape.Trapezoid, Shape.Triangle, Shape.ZShape),
]
"""The shapes whose degree is never rounded to 0 or 1, unless it is exactly 0 or 1."""


@pytest.mark.parametrize("shape", BOUNDED)
@given(data=st.data())
def test_support_and_core_agree_with_the_degree(shape: Shape, data: st.DataObject) -> None:
    term = data.draw(some_terms(shape))
    x = data.draw(NUMBERS.map(lambda number: number + 0.25) | NUMBERS)
    term_extent, exact_degree = extent(term), degree(term, x)

    assert term_extent.holds(x) == (exact_degree > 0.0)
    assert term_extent.is_full_at(x) == (exact_degree >= 1.0)


@pytest.mark.parametrize("shape", [shape for shape in SHAPES if shape not in BOUNDED])
@given(data=st.data())
def test_the_support_of_a_smooth_term_covers_all_degrees_above_zero(shape: Shape, data: st.DataObject) -> None:
    term = data.draw(some_terms(shape))
    x = data.draw(NUMBERS)
    term_extent, exact_degree = extent(term), degree(term, x)

    assert term_extent.holds(x) or not exact_degree > 0.0
    assert not term_extent.is_full_at(x) or math.isnan(exact_degree) or exact_degree == pytest.approx(1.0)


@pytest.mark.parametrize("shape", SHAPES)
@given(data=st.data())
def test_between_its_ends_support_and_core_of_a_term_do_not_change(shape: Shape, data: st.DataObject) -> None:
    term_extent = extent(data.draw(some_terms(shape)))
    ends = (-10.0, *term_extent.ends, 10.0)
    low, high = data.draw(st.sampled_from([pair for pair in pairwise(ends) if pair[0] < pair[1]]))
    shares = data.draw(st.tuples(*[st.sampled_from((0.1, 0.3, 0.5, 0.9))] * 2))
    one, other = (low + share * (high - low) for share in shares)

    assert (term_extent.holds(one), term_extent.is_full_at(one)) == (
        term_extent.holds(other),
        term_extent.is_full_at(other),
    )
