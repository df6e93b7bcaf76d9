"""The words of FLL: FuzzyLite's names for its constructs."""

from __future__ import annotations

from enum import Enum, StrEnum

from codra_dsl.language.frozen import dataclass

KEYWORDS = frozenset({"if", "is", "then", "and", "or", "with"})
"""The keywords of a rule, which cannot be names."""


class TNorm(StrEnum):
    """The operators for `and`, and for the implication of a concluded term."""

    ALGEBRAIC_PRODUCT = "AlgebraicProduct"
    BOUNDED_DIFFERENCE = "BoundedDifference"
    DRASTIC_PRODUCT = "DrasticProduct"
    EINSTEIN_PRODUCT = "EinsteinProduct"
    HAMACHER_PRODUCT = "HamacherProduct"
    MINIMUM = "Minimum"
    NILPOTENT_MINIMUM = "NilpotentMinimum"


class SNorm(StrEnum):
    """The operators for `or`, and for the aggregation of conclusions."""

    ALGEBRAIC_SUM = "AlgebraicSum"
    BOUNDED_SUM = "BoundedSum"
    DRASTIC_SUM = "DrasticSum"
    EINSTEIN_SUM = "EinsteinSum"
    HAMACHER_SUM = "HamacherSum"
    MAXIMUM = "Maximum"
    NILPOTENT_MAXIMUM = "NilpotentMaximum"
    NORMALIZED_SUM = "NormalizedSum"
    UNBOUNDED_SUM = "UnboundedSum"


class Hedge(StrEnum):
    """A word before a term, which modifies its degree."""

    ANY = "any"
    EXTREMELY = "extremely"
    NOT = "not"
    SELDOM = "seldom"
    SOMEWHAT = "somewhat"
    VERY = "very"


class Method(StrEnum):
    """The activation method: which rules of a block act."""

    GENERAL = "General"
    FIRST = "First"
    LAST = "Last"
    HIGHEST = "Highest"
    LOWEST = "Lowest"
    PROPORTIONAL = "Proportional"
    THRESHOLD = "Threshold"


class Comparator(StrEnum):
    """The comparison with a threshold."""

    LESS = "<"
    AT_MOST = "<="
    EQUAL = "=="
    DIFFERENT = "!="
    AT_LEAST = ">="
    MORE = ">"


class Defuzzification(StrEnum):
    """The method that turns the conclusions about an output into one number."""

    BISECTOR = "Bisector"
    CENTROID = "Centroid"
    LARGEST_OF_MAXIMUM = "LargestOfMaximum"
    MEAN_OF_MAXIMUM = "MeanOfMaximum"
    SMALLEST_OF_MAXIMUM = "SmallestOfMaximum"
    WEIGHTED_AVERAGE = "WeightedAverage"
    WEIGHTED_SUM = "WeightedSum"

    @property
    def is_weighted(self) -> bool:
        """Whether each conclusion is a number rather than a fuzzy set."""
        return self in (Defuzzification.WEIGHTED_AVERAGE, Defuzzification.WEIGHTED_SUM)


class Weighting(StrEnum):
    """How a conclusion becomes a number, for methods whose conclusions are numbers."""

    AUTOMATIC = "Automatic"
    TAKAGI_SUGENO = "TakagiSugeno"
    TSUKAMOTO = "Tsukamoto"


@dataclass(frozen=True, slots=True)
class Form:
    """The parameters of a shape.

    Attributes:
        function: the name of its membership function at run time.
        names: the names of its parameters; empty if the number of parameters varies.
        has_height: whether a height may follow the parameters.
    """

    function: str
    names: tuple[str, ...]
    has_height: bool = True
    is_monotone: bool = False


_ENDS = ("start", "end")
_CORNERS = ("bottom_left", "top_left", "top_right", "bottom_right")
_SIGMOIDS = ("left", "rising", "falling", "right")


class Shape(Enum):
    """The shape of a term. `Function` is not a shape: terms with this word are formulas."""

    Arc = Form("arc", _ENDS, is_monotone=True)
    Bell = Form("bell", ("center", "width", "slope"))
    Binary = Form("binary", ("start", "direction"))
    Concave = Form("concave", ("inflection", "end"), is_monotone=True)
    Constant = Form("constant", ("value",), has_height=False)
    Cosine = Form("cosine", ("center", "width"))
    Discrete = Form("discrete", ())
    Gaussian = Form("gaussian", ("mean", "standard_deviation"))
    GaussianProduct = Form("gaussian_product", ("mean_a", "standard_deviation_a", "mean_b", "standard_deviation_b"))
    Linear = Form("linear", (), has_height=False)
    PiShape = Form("pi_shape", _CORNERS)
    Ramp = Form("ramp", _ENDS, is_monotone=True)
    Rectangle = Form("rectangle", _ENDS)
    SemiEllipse = Form("semi_ellipse", _ENDS)
    Sigmoid = Form("sigmoid", ("inflection", "slope"), is_monotone=True)
    SigmoidDifference = Form("sigmoid_difference", _SIGMOIDS)
    SigmoidProduct = Form("sigmoid_product", _SIGMOIDS)
    Spike = Form("spike", ("center", "width"))
    SShape = Form("s_shape", _ENDS, is_monotone=True)
    Trapezoid = Form("trapezoid", _CORNERS)
    Triangle = Form("triangle", ("left", "top", "right"))
    ZShape = Form("z_shape", _ENDS, is_monotone=True)


FORMULA = "Function"
"""The word of FLL for a term that is a formula."""
