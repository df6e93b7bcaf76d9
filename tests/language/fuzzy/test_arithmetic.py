"""The laws of norms, hedges and terms, on numbers and on rows of samples."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.fuzzy.dialects import snake_case
from codra_dsl.language.fuzzy.words import Shape, SNorm, TNorm
from codra_dsl.runtime.loops.fuzzy import hedges, norms, terms
from codra_dsl.runtime.loops.fuzzy.outputs import usable_degree
from codra_dsl.runtime.loops.fuzzy.sampled import NORMS_OF_SAMPLES

Norm = Callable[[float, float], float]

degrees = st.floats(0.0, 1.0) | st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0])
numbers = st.floats(-50.0, 50.0) | st.sampled_from([0.0, 1.0, -1.0, 10.0, math.inf, -math.inf])
TNORMS = [getattr(norms, snake_case(word)) for word in TNorm]
SNORMS = [getattr(norms, snake_case(word)) for word in SNorm]
DUALS = [
    (norms.algebraic_product, norms.algebraic_sum),
    (norms.bounded_difference, norms.bounded_sum),
    (norms.drastic_product, norms.drastic_sum),
    (norms.einstein_product, norms.einstein_sum),
    (norms.hamacher_product, norms.hamacher_sum),
    (norms.minimum, norms.maximum),
]
SHAPES = [shape for shape in Shape if shape not in (Shape.Discrete, Shape.Linear, Shape.Constant)]
INVERSES = [shape for shape in Shape if shape.value.is_monotone]


@pytest.mark.parametrize("norm", TNORMS + SNORMS)
@given(a=degrees, b=degrees, c=degrees)
def test_norms_commute_and_grow_with_either_side(norm: Norm, a: float, b: float, c: float) -> None:
    low, high = sorted((b, c))

    assert norm(a, b) == pytest.approx(norm(b, a), abs=1e-12)
    assert norm(a, low) <= norm(a, high) + 1e-12


@pytest.mark.parametrize("norm", TNORMS)
@given(a=degrees, b=degrees)
def test_one_is_neutral_and_zero_absorbing_for_a_t_norm(norm: Norm, a: float, b: float) -> None:
    assert norm(a, 1.0) == pytest.approx(a, abs=1e-12)
    assert norm(a, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert norm(a, b) <= min(a, b) + 1e-12


@pytest.mark.parametrize("norm", SNORMS)
@given(a=degrees, b=degrees)
def test_zero_is_neutral_for_an_s_norm_and_it_is_never_below_its_operands(norm: Norm, a: float, b: float) -> None:
    assert norm(a, 0.0) == pytest.approx(a, abs=1e-12)
    assert norm(a, b) >= max(a, b) - 1e-12


@pytest.mark.parametrize(("t_norm", "s_norm"), DUALS)
@given(a=degrees, b=degrees)
def test_de_morgan_holds_between_a_t_norm_and_its_dual(t_norm: Norm, s_norm: Norm, a: float, b: float) -> None:
    """Use sixteenths, where 1 - x is exact, because the drastic norms are not continuous."""
    a, b = round(a * 16) / 16, round(b * 16) / 16

    assert 1.0 - t_norm(a, b) == pytest.approx(s_norm(1.0 - a, 1.0 - b), abs=1e-12)


@pytest.mark.parametrize("norm", TNORMS + SNORMS)
@given(pairs=st.lists(st.tuples(degrees, degrees), min_size=1, max_size=20))
def test_norms_of_samples_are_the_norms_of_their_degrees(norm: Norm, pairs: list[tuple[float, float]]) -> None:
    left, right = (np.array(operand) for operand in zip(*pairs, strict=True))
    with np.errstate(all="ignore"):
        norm_values = NORMS_OF_SAMPLES[norm](left, right)

    assert norm_values.tolist() == pytest.approx([norm(a, b) for a, b in pairs], abs=1e-12)


@pytest.mark.parametrize("norm", [norms.minimum, norms.maximum, norms.bounded_sum, norms.bounded_difference])
@given(a=degrees)
def test_a_missing_degree_stays_missing(norm: Norm, a: float) -> None:
    assert math.isnan(norm(a, math.nan))
    assert math.isnan(norm(math.nan, a))


@pytest.mark.parametrize("hedge", [hedges.extremely, hedges.seldom, hedges.somewhat, hedges.very])
@given(a=degrees, b=degrees)
def test_hedges_keep_the_order_of_degrees_and_stay_degrees(hedge: Callable[[float], float], a: float, b: float) -> None:
    low, high = sorted((a, b))

    assert 0.0 <= hedge(low) <= hedge(high) + 1e-12 <= 1.0 + 1e-12


@given(a=degrees)
def test_very_is_less_and_somewhat_is_more(a: float) -> None:
    assert hedges.very(a) <= a <= hedges.somewhat(a)
    assert hedges.very(hedges.somewhat(a)) == pytest.approx(a, abs=1e-12)
    assert hedges.not_(hedges.not_(a)) == pytest.approx(a, abs=1e-12)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
@given(x=numbers, corners=st.lists(st.floats(-20.0, 20.0), min_size=4, max_size=4), height=st.floats(0.1, 1.0))
def test_memberships_lie_between_zero_and_the_height(
    shape: Shape, x: float, corners: list[float], height: float
) -> None:
    count = len(shape.value.names)
    membership = getattr(terms, shape.value.function)(x, *sorted(corners)[:count], height)

    assert math.isnan(membership) or -1e-12 <= membership <= height + 1e-12


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
def test_every_membership_of_a_missing_input_is_missing(shape: Shape) -> None:
    count = len(shape.value.names)

    assert math.isnan(getattr(terms, shape.value.function)(math.nan, *(0.1, 0.4, 0.6, 0.9)[:count]))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.name)
@given(
    x=st.floats(allow_nan=True, allow_infinity=True),
    parameters=st.lists(st.floats(allow_nan=False), min_size=5, max_size=5),
)
def test_memberships_never_raise_for_any_corners(shape: Shape, x: float, parameters: list[float]) -> None:
    count = len(shape.value.names)

    assert isinstance(getattr(terms, shape.value.function)(x, *parameters[:count], parameters[4]), float)


@pytest.mark.parametrize("shape", INVERSES, ids=lambda shape: shape.name)
@given(a=st.floats(-1.0, 2.0), b=st.floats(-1.0, 2.0))
def test_monotone_terms_never_fall(shape: Shape, a: float, b: float) -> None:
    membership = getattr(terms, shape.value.function)
    low, high = sorted((a, b))
    rise = membership(high, 0.2, 0.8) - membership(low, 0.2, 0.8)

    assert (-rise if shape is Shape.ZShape else rise) >= -1e-12


@pytest.mark.parametrize("shape", INVERSES, ids=lambda shape: shape.name)
@given(degree=st.floats(0.01, 0.69), ends=st.sampled_from([(0.2, 0.8), (0.8, 0.2)]))
def test_an_inverse_undoes_its_term(shape: Shape, degree: float, ends: tuple[float, float]) -> None:
    if shape in (Shape.SShape, Shape.ZShape):
        ends = (0.2, 0.8)
    function = shape.value.function
    x = getattr(terms, f"{function}_inverse")(degree, *ends, 0.7)

    assert getattr(terms, function)(x, *ends, 0.7) == pytest.approx(degree, abs=1e-9)


def test_a_conclusion_always_has_a_number() -> None:
    assert [usable_degree(degree) for degree in (0.3, 1.5, math.nan, math.inf, -math.inf)] == [0.3, 1.5, 0.0, 1.0, 0.0]
