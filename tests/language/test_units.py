from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.units import (
    ONE,
    UNITS,
    Quantity,
    Unit,
    convert,
    duration_help,
    parse_duration,
    parse_number,
    parse_quantity,
    parse_unit,
    ratio,
    suggest_unit,
    units_help,
)

SYMBOLS = sorted(UNITS)


def unit(text: str) -> Unit:
    parsed_unit = parse_unit(text)
    assert parsed_unit is not None, text
    return parsed_unit


def compound_units() -> st.SearchStrategy[str]:
    return st.builds(
        lambda first, rest: first + "".join(operator + symbol for operator, symbol in rest),
        st.sampled_from([*SYMBOLS, *(f"1/{symbol}" for symbol in SYMBOLS)]),
        st.lists(st.tuples(st.sampled_from("*/"), st.sampled_from(SYMBOLS)), max_size=3),
    )


@pytest.mark.parametrize(
    ("value", "source", "target", "expected"),
    [
        (7, "cm", "mm", 70.0),
        (0.3, "cm", "mm", 3.0),
        (1, "km/h", "m/s", 1 / 3.6),
        (2, "min", "s", 120.0),
        (1, "h", "min", 60.0),
        (250, "g", "kg", 0.25),
        (180, "deg", "rad", math.pi),
        (math.pi, "rad", "deg", 180.0),
        (90, "deg/s", "deg/min", 5400.0),
        (3, "percent/min", "percent/s", 0.05),
        (1, "N*m", "W*s", 1.0),
        (1, "V*A", "W", 1.0),
        (60, "1/min", "1/s", 1.0),
        (5, "lux", "lux", 5.0),
    ],
)
def test_equal_dimensions_convert_exactly(value: float, source: str, target: str, expected: float) -> None:
    assert unit(source).dimension == unit(target).dimension
    assert convert(value, unit(source), unit(target)) == expected


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("m", "s"),
        ("rad", "m/m"),
        ("percent", "m/m"),
        ("deg", "percent"),
        ("N", "W"),
        ("m/s", "s/m"),
        ("lux", "percent"),
    ],
)
def test_units_of_different_quantities_have_different_dimensions(one: str, other: str) -> None:
    assert unit(one).dimension != unit(other).dimension


@pytest.mark.parametrize(
    "text", ["", "1", "M", "sec", "m / s", "m//s", "m/", "/s", "s^2", "m2", "°", "kg m", "2/s", "Δ"]
)
def test_other_texts_are_not_units(text: str) -> None:
    assert parse_unit(text) is None


@pytest.mark.parametrize(
    ("text", "suggestion"),
    [
        ("seconds", "s"),
        ("Sec", "s"),
        ("degrees", "deg"),
        ("degree/sec", "deg/s"),
        ("%", "percent"),
        ("%/min", "percent/min"),
        ("°", "deg"),
        ("meter", "m"),
        ("m / s", "m/s"),
        ("m2", "m*m"),
        ("m^2", "m*m"),
        ("kg*m2", "kg*m*m"),
        ("m/s2", "m/s/s"),
        ("m/s^2", "m/s/s"),
        ("Hz", "1/s"),
        ("KM", "km"),
        ("persent", "percent"),
        ("radd", "rad"),
    ],
)
def test_a_near_unit_is_suggested(text: str, suggestion: str) -> None:
    assert suggest_unit(text) == suggestion
    assert parse_unit(suggestion) is not None
    assert units_help(text) == f"did you mean '{suggestion}'?"


@pytest.mark.parametrize(
    "text", ["", "markers", "/", "parsec", "degC", "K", "kW", "mg", "MB", "*" * 50, "m" * 5000, "x*y", "m/qqqq"]
)
def test_all_units_are_listed_if_no_unit_is_near(text: str) -> None:
    assert suggest_unit(text) is None
    assert "percent" in units_help(text)


@given(compound_units(), compound_units())
def test_products_and_quotients_multiply_and_divide(one: str, other: str) -> None:
    left, right = unit(one), unit(other)
    assert (left * right) / right == left
    assert (left / right) * right == left
    assert parse_unit(str(left)) == left


@given(compound_units(), st.floats(1e-6, 1e6))
def test_converting_there_and_back_keeps_the_value(text: str, value: float) -> None:
    base = Unit(unit(text).dimension)
    there = convert(value, unit(text), base)
    assert math.isclose(convert(there, base, unit(text)), value, rel_tol=1e-12)
    assert math.isclose(there, value * ratio(unit(text), base), rel_tol=1e-12)


@given(st.sampled_from(SYMBOLS), st.integers(-1000, 1000), st.integers(0, 99))
def test_a_decimal_number_is_exact_as_written(symbol: str, integer: int, hundredths: int) -> None:
    written = f"{integer}.{hundredths:02}"
    exact = Fraction(written) * UNITS[symbol].factor
    if UNITS[symbol].degrees == 0:
        assert convert(float(written), UNITS[symbol], Unit(UNITS[symbol].dimension)) == float(exact)


def test_the_unit_of_a_bare_number_is_one() -> None:
    assert unit("m") / unit("m") == ONE
    assert str(unit("m/s") * unit("s")) == "m"
    assert str(unit("N*m") / unit("s")) == "W"


@pytest.mark.parametrize(
    ("text", "value", "si"),
    [
        ("20 cm", 20, 0.2),
        ("-90 deg", -90, -math.pi / 2),
        ("5s", 5, 5.0),
        ("1.5 km/h", 1.5, 1.5 / 3.6),
        ("1e3 mm", 1e3, 1.0),
    ],
)
def test_a_quantity_is_a_number_and_a_unit(text: str, value: float, si: float) -> None:
    quantity = parse_quantity(text)
    assert isinstance(quantity, Quantity)
    assert quantity.value == value
    assert math.isclose(quantity.si, si)


@pytest.mark.parametrize(
    "text", ["", "5", "m", "5 parsec", "five m", "5 m/x", "1e200 m", "05 m", "5. m", "+5 m", "5\nm "]
)
def test_other_texts_are_not_quantities(text: str) -> None:
    assert parse_quantity(text) is None


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("500 ms", 0.5),
        ("5 s", 5.0),
        ("2min", 120.0),
        ("0.5 h", 1800.0),
        ("forever", math.inf),
        ("0 s", 0.0),
        ("-1 s", -1.0),
    ],
)
def test_a_duration_is_a_quantity_of_time(text: str, seconds: float) -> None:
    assert parse_duration(text) == seconds


@pytest.mark.parametrize(
    ("text", "help_text"),
    [
        ("5", "a duration has a unit: '5 s', '5 ms', '5 min' or '5 h'"),
        ("5 sec", "did you mean '5 s'?"),
        ("2 Minutes", "did you mean '2 min'?"),
        ("infinity", "did you mean 'forever'?"),
        ("Forever", "did you mean 'forever'?"),
        ("2,5 s", "did you mean '2.5 s'?"),
        ("4 Hz", "a duration is a time: did you mean '0.25 s'?"),
        ("5 m", "did you mean '5 min'?"),
        ("soon", "a duration is a number with ms, s, min or h, such as '500 ms', or 'forever'"),
    ],
)
def test_the_help_for_an_invalid_duration_suggests_a_valid_one(text: str, help_text: str) -> None:
    assert parse_duration(text) is None
    assert duration_help(text, "forever") == help_text


def test_forever_is_not_suggested_where_a_time_must_be_finite() -> None:
    assert duration_help("never") == "a duration is a number with ms, s, min or h, such as '500 ms'"


@given(st.text(max_size=60))
def test_any_text_gets_an_answer(text: str) -> None:
    for parse in (parse_unit, parse_quantity, parse_duration, suggest_unit):
        parse(text)
    assert units_help(text)
    assert duration_help(text)


@pytest.mark.parametrize(
    ("text", "number"), [("12", 12), ("12.0", 12.0), ("1e2", 100.0), ("9" * 200, None), ("1e999", None)]
)
def test_a_number_is_an_int_only_if_it_is_written_as_one(text: str, number: float | None) -> None:
    assert parse_number(text) == number
    assert type(parse_number(text)) is type(number)
