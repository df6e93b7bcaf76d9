"""Whether a number can be 0: compared with the values that Python computes for all values of its names."""

from __future__ import annotations

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.solver.zeros import MAX_TRIED_CASES, can_be_zero
from codra_dsl.language.expression import Node, parse
from codra_dsl.language.model import Kind

RANGES = {"a": (0, 4), "b": (-2, 2), "c": (1, 3)}
TYPES = {name: Type(Kind.INT, range=bounds) for name, bounds in RANGES.items()}

numbers = st.recursive(
    st.sampled_from([*RANGES, "1", "2", "3", "0.5"]),
    lambda parts: st.one_of(
        st.builds("({} {} {})".format, parts, st.sampled_from("+-*"), parts),
        st.builds("max({}, {})".format, parts, parts),
        st.builds("({} if {} > {} else {})".format, parts, parts, parts, parts),
    ),
    max_leaves=6,
)


def tree(text: str) -> Node:
    node = parse(text)
    assert isinstance(node, Node)
    return node


@given(numbers)
def test_with_ints_in_small_ranges_the_answer_is_exact(text: str) -> None:
    cases = product(*(range(low, high + 1) for low, high in RANGES.values()))
    is_zero = any(eval(text, {}, dict(zip(RANGES, case, strict=True))) == 0 for case in cases)

    assert can_be_zero(tree(text), TYPES) is is_zero


def test_with_floats_a_zero_at_the_end_of_a_range_is_found_and_another_one_is_undecided() -> None:
    types = {"x": Type(Kind.FLOAT, range=(0.0, 4.0)), "y": Type(Kind.FLOAT)}

    assert can_be_zero(tree("x * x"), types) is True
    assert can_be_zero(tree("y * y"), types) is True
    assert can_be_zero(tree("x * x - 2"), types) is None
    assert can_be_zero(tree("x * x + 1"), types) is False
    assert can_be_zero(tree("x - 2"), types) is True
    assert can_be_zero(tree("x - 5"), types) is False


def test_ints_with_too_many_values_are_not_all_tried() -> None:
    types = {"n": Type(Kind.INT, range=(1, MAX_TRIED_CASES + 1))}

    assert can_be_zero(tree("n - 7"), types) is True
    assert can_be_zero(tree("n * n - 2"), types) is None
