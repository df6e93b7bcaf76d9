"""Three-valued logic and arithmetic: truth tables, unknown values, the text of a term, and when ages flip."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import (
    FLIP_STEP_S,
    Term,
    Value,
    age,
    choose,
    first_of,
    known,
    literal,
    maximum,
    minimum,
    reads_ages,
    value,
)
from codra_dsl.runtime.values.conditions import between, confirmed


@dataclass
class Values:
    """A scope in which missing names are unknown."""

    values: Mapping[str, Value | None] = field(default_factory=dict)
    ages_s: Mapping[str, float] = field(default_factory=dict)

    def value(self, name: str) -> Value | None:
        return self.values.get(name)

    def age_s(self, name: str) -> float | None:
        return self.ages_s.get(name)


def result(term: Term, **values: Value | None) -> Value | None:
    return term.evaluate(Values(values))


T, F, U = True, False, None
A, B, C, X, Y = value("a"), value("b"), value("c"), value("x"), value("y")

AND = {(T, T): T, (T, F): F, (T, U): U, (F, T): F, (F, F): F, (F, U): F, (U, T): U, (U, F): F, (U, U): U}
OR = {(T, T): T, (T, F): T, (T, U): T, (F, T): T, (F, F): F, (F, U): U, (U, T): T, (U, F): U, (U, U): U}


@pytest.mark.parametrize(("a", "b"), list(AND))
def test_and_and_or_are_kleenes(a: bool | None, b: bool | None) -> None:
    assert result(A & B, a=a, b=b) is AND[a, b]
    assert result(A | B, a=a, b=b) is OR[a, b]


@pytest.mark.parametrize(("a", "expected"), [(T, F), (F, T), (U, U)], ids=repr)
def test_not_is_kleenes(a: bool | None, expected: bool | None) -> None:
    assert result(~A, a=a) is expected


@given(st.lists(st.sampled_from([T, F, U]), min_size=3, max_size=3))
def test_de_morgan_holds_with_unknown(values: list[bool | None]) -> None:
    scope = dict(zip("abc", values, strict=True))
    assert result(~(A & B & C), **scope) is result(~A | ~B | ~C, **scope)
    assert result(~(A | B | C), **scope) is result(~A & ~B & ~C, **scope)


Truth = st.recursive(
    st.sampled_from([A, B, C]),
    lambda inner: st.one_of(
        st.builds(lambda one: ~one, inner),
        st.builds(lambda one, two: one & two, inner, inner),
        st.builds(lambda one, two: one | two, inner, inner),
        st.builds(choose, inner, inner, inner),
    ),
    max_leaves=12,
)


@given(Truth, st.lists(st.sampled_from([T, F, U]), min_size=3, max_size=3))
def test_a_known_result_is_the_same_for_every_value_of_the_unknown_inputs(
    term: Term, values: list[bool | None]
) -> None:
    scope = dict(zip("abc", values, strict=True))
    certain = result(term, **scope)
    if certain is not None:
        for filled in itertools.product([T, F], repeat=3):
            turned_out = {
                name: old if old is not None else new for (name, old), new in zip(scope.items(), filled, strict=True)
            }
            assert result(term, **turned_out) is certain


def test_a_condition_holds_only_when_it_is_certainly_true() -> None:
    assert [A.holds(Values({"a": truth})) for truth in (T, F, U)] == [True, False, False]


def test_a_negated_condition_over_an_unknown_variable_does_not_hold() -> None:
    assert not (~A).holds(Values())


# Unknown values


@pytest.mark.parametrize(
    "term",
    [
        X < 1,
        X == X,
        X != 1,
        X + 1,
        1 - X,
        -X,
        abs(X),
        minimum(X, 1),
        maximum(1, X),
        X.is_in(1, 2),
        age("x") > 1,
        choose(1, X, 2),
        first_of(("a", X)),
        between(X, X),
        confirmed(X, 2, 3),
        ~X,
    ],
    ids=repr,
)
def test_terms_of_an_unknown_value_are_unknown(term: Term) -> None:
    assert result(term) is None
    assert result(term, x=math.nan) is None


def test_known_is_never_unknown() -> None:
    assert [result(known("x"), x=constant) for constant in (0, False, "", None, math.nan)] == [
        True,
        True,
        True,
        False,
        False,
    ]


@pytest.mark.parametrize(
    "term",
    [
        X / 0,
        X / (Y - Y),
        X * 1e308 * 10.0,
        -X * 1e308 - 1e308,
        (X * 1e308 * 10.0) - (X * 1e308 * 10.0),
        literal(10**400) * 1.5,
        literal(10**400) * literal(10**400),
        literal(math.inf) - literal(math.inf),
        literal(math.nan),
        literal(math.nan) == literal(math.nan),
        literal("a") + 1,
    ],
    ids=repr,
)
def test_division_by_zero_overflow_and_nan_are_unknown(term: Term) -> None:
    assert result(term, x=2, y=3.0) is None


def test_an_infinite_value_can_be_compared() -> None:
    """For example, a range finder measures infinity without an echo."""
    assert result(X > 1.5, x=math.inf) is True


def test_a_choice_under_an_unknown_condition_is_known_if_both_sides_agree() -> None:
    assert result(choose(X, A, Y), x=1, y=1) == 1
    assert result(choose(X, A, Y), x=1, y=2) is None
    assert result(choose(X, A, Y), x=1, a=True) == 1
    assert result(choose(X, A, Y), x=1, y=2, a=False) == 2


def test_the_first_case_that_holds_wins_and_an_unknown_one_before_it_hides_it() -> None:
    term = first_of(("low", X < 1), ("middle", X < Y), ("high", literal(True)))
    assert [result(term, x=number, y=5) for number in (0, 3, 9)] == ["low", "middle", "high"]
    assert result(term, x=3) is None
    assert result(first_of(("low", X < 1)), x=3) is None


def test_between_enter_and_leave_the_value_is_open() -> None:
    term = between(X > 0.6, X < 0.4)
    assert [result(term, x=number) for number in (0.7, 0.5, 0.3, None)] == [True, None, False, None]


def test_an_enum_is_in_its_members() -> None:
    assert result(X.is_in("open", "ajar"), x="ajar") is True
    assert result(X.is_in("open", "ajar"), x="shut") is False


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_arithmetic_gives_the_result_of_python_or_unknown(x: float, y: float) -> None:
    for term, expected in [(X + Y, x + y), (X - Y, x - y), (X * Y, x * y), (-X, -x), (abs(X), abs(x))]:
        assert result(term, x=x, y=y) == (expected if math.isfinite(expected) else None)
    assert result(X / Y, x=x, y=y) == (x / y if y and math.isfinite(x / y) else None)
    assert (result(minimum(X, Y), x=x, y=y), result(maximum(X, Y), x=x, y=y)) == (min(x, y), max(x, y))


# Terms as text


NAMES = st.sampled_from(["x", "y", "markers"])
CONSTANTS = st.one_of(
    st.booleans(), st.integers(-9, 9), st.floats(), st.text(alphabet="ab'\"\\\n{é", max_size=4), st.just(-0.0)
)
TERMS = st.recursive(
    st.one_of(st.builds(value, NAMES), st.builds(known, NAMES), st.builds(age, NAMES), st.builds(literal, CONSTANTS)),
    lambda inner: st.one_of(
        *(
            st.builds(operation, inner, inner)
            for operation in [
                lambda one, two: one < two,
                lambda one, two: one >= two,
                lambda one, two: one == two,
                lambda one, two: one & two,
                lambda one, two: one | two,
                lambda one, two: one + two,
                lambda one, two: one - two,
                lambda one, two: one * two,
                lambda one, two: one / two,
                between,
                minimum,
            ]
        ),
        st.builds(lambda one: ~one, inner),
        st.builds(lambda one: -one, inner),
        st.builds(abs, inner),
        st.builds(lambda one, options: one.is_in(*options), inner, st.lists(CONSTANTS, min_size=1, max_size=3)),
        st.builds(choose, inner, inner, inner),
        st.builds(first_of, st.tuples(CONSTANTS, inner), st.tuples(CONSTANTS, inner)),
        st.builds(maximum, inner, inner, inner),
    ),
    max_leaves=10,
)
WORDS = {
    "abs": abs,
    "age": age,
    "between": between,
    "choose": choose,
    "first_of": first_of,
    "float": float,
    "known": known,
    "literal": literal,
    "maximum": maximum,
    "minimum": minimum,
    "value": value,
}


@given(TERMS)
def test_the_text_of_a_term_builds_an_equal_term(term: Term) -> None:
    assert repr(eval(repr(term), {"__builtins__": {}} | WORDS)) == repr(term)


VALUES = st.sampled_from([None, True, False, 0, 3, -2.5, "a"])


@given(TERMS, VALUES, VALUES, st.floats(0, 20))
def test_the_text_of_a_term_builds_a_term_with_the_same_meaning(
    term: Term, x: Value | None, y: Value | None, age_s: float
) -> None:
    scope = Values({"x": x, "y": y}, {"x": age_s})

    def outcome(one: Term) -> object:
        try:
            return repr(one.evaluate(scope))
        except TypeError:  # a text beside a number: the checker refuses such terms
            return TypeError

    assert outcome(eval(repr(term), {"__builtins__": {}} | WORDS)) == outcome(term)


def test_chains_of_the_same_operator_are_flat() -> None:
    assert repr((A & B) & C) == repr(A & (B & C)) == "value('a') & value('b') & value('c')"
    assert repr((A | B) & ~C) == "(value('a') | value('b')) & ~value('c')"


def test_a_term_is_no_truth_value() -> None:
    with pytest.raises(TypeError, match=r"use & \| ~ to combine"):
        bool(0 < X < 3)


def test_a_term_names_the_variables_that_it_reads() -> None:
    term = choose(X + 1, known("a") | (age("b") > 3), first_of(("m", ~C)))
    assert term.variables() == {"x", "a", "b", "c"}


# Ages


EIGHTHS = st.integers(0, 240).map(lambda eighths: eighths / 8)


@given(st.lists(st.tuples(st.sampled_from("<>"), EIGHTHS, st.booleans()), min_size=1, max_size=4), EIGHTHS)
def test_between_flips_a_condition_over_an_age_does_not_change(
    comparisons: list[tuple[str, float, bool]], age_s: float
) -> None:
    terms = [age("x") < limit if sign == "<" else literal(limit) <= age("x") for sign, limit, _ in comparisons]
    term = terms[0]
    for other, (_, _, is_and) in zip(terms[1:], comparisons[1:], strict=True):
        term = term & other if is_and else term | other
    wait_s = term.flips_s(Values(ages_s={"x": age_s}))
    before = term.evaluate(Values(ages_s={"x": age_s}))
    until_s = 60.0 if wait_s is None else wait_s
    for share in (0.0, 0.3, 0.9, 0.999):
        between_s = age_s + share * until_s
        if between_s < age_s + until_s:
            assert term.evaluate(Values(ages_s={"x": between_s})) is before


@pytest.mark.parametrize(
    "term", [age("x") > 10.0, age("x") >= 10.0, age("x") <= 10.0, literal(10.0) < age("x")], ids=repr
)
def test_stepping_from_flip_to_flip_finds_the_other_side(term: Term) -> None:
    age_s, steps = 4.0, 0
    while (wait_s := term.flips_s(Values(ages_s={"x": age_s}))) is not None:
        age_s, steps = age_s + wait_s, steps + 1
    assert age_s == pytest.approx(10.0, abs=2 * FLIP_STEP_S)
    assert steps <= 3
    assert term.evaluate(Values(ages_s={"x": age_s})) is not term.evaluate(Values(ages_s={"x": 4.0}))


def test_a_limit_can_be_a_variable_and_an_unknown_comparison_does_not_flip() -> None:
    term = ~known("x") | (age("x") > Y * 2.0)
    assert term.flips_s(Values({"x": 1, "y": 5.0}, {"x": 4.0})) == 6.0
    assert term.flips_s(Values({"y": 5.0})) is None
    assert term.flips_s(Values({"x": 1}, {"x": 4.0})) is None
    assert (age("x") > age("y")).flips_s(Values(ages_s={"x": 1.0, "y": 2.0})) is None


def test_a_condition_without_an_age_changes_with_variables_only() -> None:
    assert reads_ages(~known("x") | (age("x") > 10.0))
    assert not reads_ages(~known("x") | (X > 10.0))
    assert (X > 10.0).flips_s(Values({"x": 4.0})) is None
