"""The two forms of an engine's arithmetic: with numbers, and with bounds.

One code generator writes both functions of an engine, and the functions differ only in the dialect. So properties that
are proven for one function also hold for the other.
"""

from __future__ import annotations

import math
import re
from enum import Enum, auto

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import Call, Formula, Name, Number

_INLINE_OPERATORS = ("+", "-", "*")


class Kind(Enum):
    """The kinds of functions that compute with numbers; one function of `bounds` per kind applies them to bounds."""

    IMAGE = auto()
    INVERSE = auto()
    NORM = auto()
    HEDGE = auto()


def literal(value: float | str) -> str:
    """Return a value as a Python literal."""
    if isinstance(value, str):
        is_plain = value.isascii() and value.isprintable() and '"' not in value and "\\" not in value
        return f'"{value}"' if is_plain else ascii(value)
    if math.isinf(value):
        return "math.inf" if value > 0 else "-math.inf"
    return repr(value)


def snake_case(word: str) -> str:
    """Return the name of the run-time function for a word of FuzzyLite."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", word).lower()


def tuple_of(parts: list[str]) -> str:
    """Return the source of a tuple."""
    return f"({parts[0]},)" if len(parts) == 1 else f"({', '.join(parts)})"


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """How generated source calls the run-time arithmetic.

    Attributes:
        value_type: the type of a value.
        inference_type: the type of an inference.
        activations: the module of the activation functions.
        outputs: the module of the functions for outputs.
        clip_function: the function that limits a value to a range.
        first_known_function: the function that returns the first known value.
    """

    value_type: str
    inference_type: str
    activations: str
    outputs: str
    clip_function: str
    first_known_function: str
    has_numbers: bool

    def call(self, kind: Kind, function: str, *operands: str) -> str:
        """Return the source that calls a function of `terms`, `norms` or `hedges`."""
        if self.has_numbers:
            return f"{function}({', '.join(operands)})"
        return f"bounds.{kind.name.lower()}({', '.join((function, *operands))})"

    def number(self, value: float) -> str:
        """Return the source of a constant."""
        return literal(value) if self.has_numbers else f"bounds.point({literal(value)})"

    def times(self, factor: float, value: str) -> str:
        """Return the source of a product with a constant."""
        if self.has_numbers:
            return f"{literal(factor)} * {value}"
        return f"bounds.times({literal(factor)}, {value})"

    def linear(self, inputs: list[str], coefficients: tuple[float, ...]) -> str:
        """Return the source of a linear combination of inputs."""
        module = "terms" if self.has_numbers else "bounds"
        return f"{module}.linear({tuple_of(inputs)}, {tuple_of([literal(value) for value in coefficients])})"

    def formula(self, part: Formula, names: dict[str, str]) -> str:
        """Return the source of a formula, given the local names of variables."""
        if isinstance(part, Number):
            return self.number(part.value)
        if isinstance(part, Name):
            return names[part.name]
        assert isinstance(part, Call)
        operands = [self.formula(operand, names) for operand in part.operands]
        if self.has_numbers and part.function in _INLINE_OPERATORS:
            return f"({operands[0]} {part.function} {operands[1]})"
        module = "formulas" if self.has_numbers else "bounded_formulas"
        return f"{module}.calculate({', '.join([literal(part.function), *operands])})"


NUMBERS = Dialect(
    value_type="float",
    inference_type="Inference",
    activations="activations",
    outputs="outputs",
    clip_function="outputs.clipped",
    first_known_function="outputs.known",
    has_numbers=True,
)
BOUNDS = Dialect(
    value_type="Bounds",
    inference_type="BoundedInference",
    activations="bounded_activations",
    outputs="bounded_outputs",
    clip_function="bounds.clipped",
    first_known_function="bounds.known",
    has_numbers=False,
)
