"""A fuzzy engine as a frozen value without places: engines with the same content are equal, wherever they were read."""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.words import Comparator, Defuzzification, Hedge, Method, Shape, SNorm, TNorm, Weighting

DEFAULT_RESOLUTION = 1000
"""The default number of points at which a range is sampled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A fuzzy set of a known shape.

    Attributes:
        parameters: the parameters, in the order of the names in the shape's form; for `Discrete` the points x1 y1 x2 y2
            ..., for `Linear` the coefficients.
    """

    name: str
    shape: Shape
    parameters: tuple[float, ...]
    height: float = 1.0


@dataclass(frozen=True, slots=True)
class Number:
    """A number in a formula."""

    value: float


@dataclass(frozen=True, slots=True)
class Name:
    """A variable of the engine in a formula, or `x`, the value whose membership is computed."""

    name: str


@dataclass(frozen=True, slots=True)
class Call:
    """An operator or a function of a formula with its operands."""

    function: str
    operands: tuple[Formula, ...]


Formula = Number | Name | Call


@dataclass(frozen=True, slots=True, kw_only=True)
class FormulaTerm:
    """A term whose membership is a formula of x and of the engine's variables."""

    name: str
    text: str
    formula: Formula


AnyTerm = Term | FormulaTerm


@dataclass(frozen=True, slots=True, kw_only=True)
class InputVariable:
    """An input of an engine.

    Attributes:
        minimum: the lower end of its range, in its unit; `maximum` is the upper end.
        is_locked: whether a value outside of the range is replaced by the nearest end of the range.
    """

    name: str
    minimum: float = -math.inf
    maximum: float = math.inf
    is_locked: bool = False
    is_enabled: bool = True
    terms: tuple[AnyTerm, ...] = ()
    description: str = ""

    def term(self, name: str) -> AnyTerm:
        """Return the term with the given name."""
        return next(term for term in self.terms if term.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Defuzzifier:
    """How the conclusions about an output become a number.

    The resolution applies only to integrals, and the weighting only to weighted methods.
    """

    method: Defuzzification
    resolution: int = DEFAULT_RESOLUTION
    weighting: Weighting = Weighting.AUTOMATIC


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputVariable:
    """An output of an engine.

    Attributes:
        is_locked: whether a value outside of the range is replaced by the nearest end of the range.
        keeps_previous: whether the output keeps its previous value if no rule acts.
        default: the value if no other value is known; None if the output has no default.
    """

    name: str
    minimum: float = -math.inf
    maximum: float = math.inf
    is_locked: bool = False
    is_enabled: bool = True
    keeps_previous: bool = False
    default: float | None = None
    aggregation: SNorm | None = None
    defuzzifier: Defuzzifier | None = None
    terms: tuple[AnyTerm, ...] = ()
    description: str = ""

    def term(self, name: str) -> AnyTerm:
        """Return the term with the given name."""
        return next(term for term in self.terms if term.name == name)


Variable = InputVariable | OutputVariable


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposition:
    """`variable is hedges term`; there is no term if the last hedge is `any`."""

    variable: str
    term: str = ""
    hedges: tuple[Hedge, ...] = ()


@dataclass(frozen=True, slots=True)
class And:
    """A conjunction of two antecedents."""

    left: Antecedent
    right: Antecedent


@dataclass(frozen=True, slots=True)
class Or:
    """A disjunction of two antecedents."""

    left: Antecedent
    right: Antecedent


Antecedent = Proposition | And | Or


def propositions(antecedent: Antecedent) -> Iterator[Proposition]:
    """Yield the propositions of an antecedent from left to right."""
    pending = [antecedent]
    while pending:
        part = pending.pop()
        if isinstance(part, Proposition):
            yield part
        else:
            pending += [part.right, part.left]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """`if antecedent then conclusions with weight`."""

    antecedent: Antecedent
    conclusions: tuple[Proposition, ...]
    weight: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Activation:
    """Which rules act.

    Attributes:
        rules: the maximum number of rules that act, for First, Last, Highest and Lowest.
        threshold: the minimum degree for First and Last; the limit for Threshold.
    """

    method: Method
    rules: int = 1
    threshold: float = 0.0
    comparator: Comparator = Comparator.MORE


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleBlock:
    """Rules that share their operators."""

    name: str = ""
    is_enabled: bool = True
    conjunction: TNorm | None = None
    disjunction: SNorm | None = None
    implication: TNorm | None = None
    activation: Activation | None = None
    rules: tuple[Rule, ...] = ()
    description: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """Inputs, outputs, and the rules between them.

    `read_fll` returns only engines that can be computed. Check an engine made by hand with
    `codra_dsl.language.fuzzy.check`.
    """

    name: str = ""
    inputs: tuple[InputVariable, ...] = ()
    outputs: tuple[OutputVariable, ...] = ()
    blocks: tuple[RuleBlock, ...] = ()
    description: str = ""

    def variable(self, name: str) -> Variable:
        """Return the input or output with the given name."""
        return next(variable for variable in self.variables if variable.name == name)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The inputs and the outputs, in this order."""
        inputs: tuple[Variable, ...] = self.inputs
        return inputs + self.outputs
