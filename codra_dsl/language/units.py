"""Units of measurement: the known units, which of them can be compared, and the factors between them.

Base units are m, s, kg, A, rad, lux and percent. Angles and percentages have dimensions of their own, so that a bare
number is never mistaken for an angle or a percentage. Factors are exact: `7 cm` is 70 mm, not 70.00000000000001.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import field
from fractions import Fraction
from functools import lru_cache

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.frozen import dataclass

__all__ = [
    "Dimension",
    "Quantity",
    "Unit",
    "convert",
    "parse_duration",
    "parse_number",
    "parse_quantity",
    "parse_unit",
]

MAX_MAGNITUDE = 1e100
"""Larger numbers are refused, so that no conversion between units can overflow."""

MAX_UNIT_LENGTH = 40
_BASE_SYMBOLS = ("m", "s", "kg", "A", "rad", "lux", "percent")

UNIT_TEXT = r"(?:1/)?[A-Za-z]+(?:[*/][A-Za-z]+)*"
"""The syntax of a unit: symbols joined by `*` and `/` without blanks, `1/s` for an inverse."""

NUMBER_TEXT = r"(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?"
"""The syntax of a number, without sign."""

_QUANTITY = re.compile(rf"(-?)({NUMBER_TEXT})[ \t]*({UNIT_TEXT})")
_UNIT = re.compile(UNIT_TEXT)
_SQUARE = re.compile(r"(^|[*/])([A-Za-z]+)(?:\^|\*\*)?2$")


@dataclass(frozen=True, slots=True)
class Dimension:
    """A dimension: the exponent of each base unit, in the order m, s, kg, A, rad, lux, percent."""

    exponents: tuple[int, ...]

    def __mul__(self, other: Dimension) -> Dimension:
        """Return the dimension of a product."""
        return Dimension(tuple(mine + theirs for mine, theirs in zip(self.exponents, other.exponents, strict=True)))

    def __truediv__(self, other: Dimension) -> Dimension:
        """Return the dimension of a quotient."""
        return Dimension(tuple(mine - theirs for mine, theirs in zip(self.exponents, other.exponents, strict=True)))

    def __str__(self) -> str:
        """Return the dimension in base units, e.g. `m/s`; `1` for the dimension of a bare number."""
        powers = tuple(zip(_BASE_SYMBOLS, self.exponents, strict=True))
        numerator = [base for base, power in powers for _ in range(power)]
        denominator = [base for base, power in powers for _ in range(-power)]
        return "/".join(["*".join(numerator) or "1", *denominator])


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit. Its size in base units of its dimension is `factor * (pi / 180) ** degrees`.

    Attributes:
        factor: the rational part of the size.
        degrees: the exponent of pi/180 in the size; 1 for deg.
        text: the unit as written; ignored when units are compared.
    """

    dimension: Dimension
    factor: Fraction = Fraction(1)
    degrees: int = 0
    text: str = field(default="", compare=False)

    def __mul__(self, other: Unit) -> Unit:
        """Return the unit of a product."""
        return _unit_with_name(
            self.dimension * other.dimension, self.factor * other.factor, self.degrees + other.degrees
        )

    def __truediv__(self, other: Unit) -> Unit:
        """Return the unit of a quotient."""
        return _unit_with_name(
            self.dimension / other.dimension, self.factor / other.factor, self.degrees - other.degrees
        )

    def __str__(self) -> str:
        """Return the unit as people write it."""
        return self.text or str(self.dimension)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with its unit, as written."""

    value: int | float
    unit: Unit

    @property
    def si(self) -> float:
        """Return the value in base units (m, s, kg, A, rad, lux, percent)."""
        return convert(self.value, self.unit, Unit(self.unit.dimension))


def _base_dimension(symbol: str) -> Dimension:
    return Dimension(tuple(int(base == symbol) for base in _BASE_SYMBOLS))


ONE = Unit(Dimension((0,) * len(_BASE_SYMBOLS)), text="1")
"""The unit of a bare number."""

_METRE, _SECOND, _KILOGRAM, _AMPERE = (
    _base_dimension("m"),
    _base_dimension("s"),
    _base_dimension("kg"),
    _base_dimension("A"),
)
_NEWTON = _KILOGRAM * _METRE / _SECOND / _SECOND
_WATT = _NEWTON * _METRE / _SECOND

UNITS: Mapping[str, Unit] = {
    unit.text: unit
    for unit in (
        Unit(_METRE, text="m"),
        Unit(_METRE, Fraction(1, 100), text="cm"),
        Unit(_METRE, Fraction(1, 1000), text="mm"),
        Unit(_METRE, Fraction(1000), text="km"),
        Unit(_SECOND, text="s"),
        Unit(_SECOND, Fraction(1, 1000), text="ms"),
        Unit(_SECOND, Fraction(60), text="min"),
        Unit(_SECOND, Fraction(3600), text="h"),
        Unit(_base_dimension("rad"), text="rad"),
        Unit(_base_dimension("rad"), degrees=1, text="deg"),
        Unit(_KILOGRAM, text="kg"),
        Unit(_KILOGRAM, Fraction(1, 1000), text="g"),
        Unit(_NEWTON, text="N"),
        Unit(_WATT / _AMPERE, text="V"),
        Unit(_AMPERE, text="A"),
        Unit(_WATT, text="W"),
        Unit(_base_dimension("lux"), text="lux"),
        Unit(_base_dimension("percent"), text="percent"),
    )
}
"""All units by symbol; their products and quotients are units as well."""

_UNIT_SYNONYMS: Mapping[str, str] = {
    "%": "percent",
    "pct": "percent",
    "°": "deg",
    "º": "deg",
    "degree": "deg",
    "radian": "rad",
    "meter": "m",
    "metre": "m",
    "centimeter": "cm",
    "centimetre": "cm",
    "millimeter": "mm",
    "millimetre": "mm",
    "kilometer": "km",
    "kilometre": "km",
    "sec": "s",
    "sek": "s",
    "second": "s",
    "msec": "ms",
    "millisecond": "ms",
    "minute": "min",
    "hour": "h",
    "hr": "h",
    "hz": "1/s",
    "gram": "g",
    "kilo": "kg",
    "kilogram": "kg",
    "newton": "N",
    "volt": "V",
    "ampere": "A",
    "amp": "A",
    "watt": "W",
    "lx": "lux",
    "mps": "m/s",
    "kmh": "km/h",
    "kph": "km/h",
}


_FOREVER_SYNONYMS = frozenset({"forever", "inf", ".inf", "infinity", "never", "always", "infinite"})
_UNSUPPORTED_UNIT = re.compile(
    r"(?:[kMGTdcmunpµh]|da)(?:[mgsNVAWKJlL]|rad|deg|lux|Hz|Pa|bar)|[dkMG]?[Bb]|[rp]pm|(?:deg|°)?[CFK]|Nm|lm"
)
"""Symbols of unsupported units: they are not misspellings of supported units."""


@lru_cache(maxsize=1024)
def parse_unit(text: str) -> Unit | None:
    """Return the unit of a text such as `mm`, `m/s`, `N*m` or `1/min`, or None if the text is not a unit."""
    known_unit = UNITS.get(text)
    if known_unit is not None or len(text) > MAX_UNIT_LENGTH or not _UNIT.fullmatch(text):
        return known_unit
    unit = ONE
    for operator, symbol in re.findall(r"(^|[*/])([A-Za-z]+)", text.removeprefix("1") if text[0] == "1" else text):
        symbol_unit = UNITS.get(symbol)
        if symbol_unit is None:
            return None
        unit = unit / symbol_unit if operator == "/" else unit * symbol_unit
    return Unit(unit.dimension, unit.factor, unit.degrees, text)


def suggest_unit(text: str) -> str | None:
    """Return the unit that an invalid text most likely means, e.g. `deg` for `degrees`, or None."""
    if len(text) > MAX_UNIT_LENGTH:
        return None
    pieces = re.split(r"([*/])", _SQUARE.sub(_as_product, "".join(text.split())))
    nearest_pieces = [piece if piece in ("*", "/", "1") else _nearest_unit(piece) for piece in pieces]
    suggestion = "".join(piece for piece in nearest_pieces if piece is not None)
    return (
        suggestion if None not in nearest_pieces and suggestion != text and parse_unit(suggestion) is not None else None
    )


def _as_product(square: re.Match[str]) -> str:
    """Return a square without an exponent: `m*m` for `m2`, `/s/s` for `/s^2`."""
    operator, symbol = square.groups()
    return f"{operator}{symbol}{operator or '*'}{symbol}"


def units_help(text: str) -> str:
    """Return the help for a text that is not a unit."""
    suggestion = suggest_unit(text)
    units_text = f"units are {', '.join(UNITS)}, and their products and quotients; for anything else omit the unit"
    return f"did you mean '{suggestion}'?" if suggestion else units_text


@lru_cache(maxsize=1024)
def parse_quantity(text: str) -> Quantity | None:
    """Return the quantity of a text such as `-20 cm`, or None if the text is not a number with a unit."""
    match = _QUANTITY.fullmatch(text)
    if match is None:
        return None
    unit, number = parse_unit(match[3]), parse_number(match[2])
    if unit is None or number is None:
        return None
    return Quantity(-number if match[1] else number, unit)


def parse_number(text: str) -> int | float | None:
    """Return the number in a text, or None if the number is too large.

    The number is an int if the text has no point and no exponent.
    """
    if re.fullmatch(r"[0-9]{1,101}", text):
        number: int | float = int(text)
    else:
        number = float(text)
    return number if number <= MAX_MAGNITUDE else None


def parse_duration(text: str) -> float | None:
    """Return the seconds of a duration such as `500 ms` or `forever`, or None if the text is not a duration.

    The sign is not checked here: whether a duration may be zero or negative depends on its use.
    """
    if text == "forever":
        return math.inf
    quantity = parse_quantity(text)
    return quantity.si if quantity is not None and quantity.unit.dimension == _SECOND else None


def duration_help(text: str, most: str = "finite") -> str:
    """Return the help for a text that is not a duration; `most` is "forever" if `forever` is allowed, else "finite"."""
    text = re.sub(r"(?<=[0-9]),(?=[0-9])", ".", text)
    if parse_quantity(text) is not None:
        minutes = f"{text}in"  # `1 m` for one minute
        suggestion = next((duration for duration in (text, minutes) if parse_duration(duration) is not None), None)
        return f"did you mean '{suggestion}'?" if suggestion else _durations_help(most)
    number = re.match(rf"\s*({NUMBER_TEXT})\s*(.*)", text, re.DOTALL)
    suggestion = suggest_unit(number[2].rstrip()) if number else None
    unit = parse_unit(suggestion) if suggestion else None
    if number and unit and unit.dimension == _SECOND:
        return f"did you mean '{number[1]} {suggestion}'?"
    if number and unit and (unit.dimension * _SECOND) == ONE.dimension and float(number[1]) > 0:
        return f"a duration is a time: did you mean '{1 / (float(number[1]) * float(unit.factor)):g} s'?"
    if number and not number[2]:
        return f"a duration has a unit: '{number[1]} s', '{number[1]} ms', '{number[1]} min' or '{number[1]} h'"
    if most == "forever" and text.strip().casefold() in _FOREVER_SYNONYMS:
        return "did you mean 'forever'?"
    return _durations_help(most)


def _durations_help(most: str) -> str:
    help_text = "a duration is a number with ms, s, min or h, such as '500 ms'"
    return f"{help_text}, or 'forever'" if most == "forever" else help_text


@lru_cache(maxsize=1024)
def convert(value: int | float, source: Unit, target: Unit) -> float:
    """Return a value in another unit of the same dimension, rounded once.

    A float is treated as the decimal number with which it is written, so that `0.3 cm` is exactly 3 mm.
    """
    exact_value = Fraction(repr(value)) * source.factor / target.factor
    degree_exponent = source.degrees - target.degrees
    if degree_exponent == 0:
        return float(exact_value)
    if abs(degree_exponent) == 1:
        return math.radians(float(exact_value)) if degree_exponent == 1 else math.degrees(float(exact_value))
    return float(exact_value) * (math.pi / 180) ** degree_exponent


def ratio(source: Unit, target: Unit) -> float:
    """Return the size of the source unit, measured in the target unit."""
    return convert(1, source, target)


def _nearest_unit(piece: str) -> str | None:
    if piece in UNITS:
        return piece
    folded_piece = piece.casefold()
    for spelling in (folded_piece, folded_piece.removesuffix("s")):
        if spelling in _UNIT_SYNONYMS:
            return _UNIT_SYNONYMS[spelling]
    if _UNSUPPORTED_UNIT.fullmatch(piece):
        return None
    if piece[1:] == piece[:-1] and piece[:1] in UNITS:  # a doubled letter
        return piece[:1]
    case_variants = [symbol for symbol in UNITS if symbol.casefold() == folded_piece]
    return (
        case_variants[0] if len(case_variants) == 1 else suggest(piece, (symbol for symbol in UNITS if len(symbol) > 1))
    )


def _unit_with_name(dimension: Dimension, factor: Fraction, degrees: int) -> Unit:
    """Return a unit; if it equals a unit in `UNITS`, the result has the name of that unit."""
    unnamed_unit = Unit(dimension, factor, degrees, str(dimension) if factor == 1 and degrees == 0 else "")
    return next((unit for unit in UNITS.values() if unit == unnamed_unit), unnamed_unit)
