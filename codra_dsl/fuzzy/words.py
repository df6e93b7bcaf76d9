"""What FuzzyLite calls its constructs: the words of FLL."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, StrEnum

KEYWORDS = frozenset({"if", "is", "then", "and", "or", "with"})
"""The words of a rule, which name nothing else."""


class TNorm(StrEnum):
    """What `and` means, and what a rule makes of the term that it concludes."""

    ALGEBRAIC_PRODUCT = "AlgebraicProduct"
    BOUNDED_DIFFERENCE = "BoundedDifference"
    DRASTIC_PRODUCT = "DrasticProduct"
    EINSTEIN_PRODUCT = "EinsteinProduct"
    HAMACHER_PRODUCT = "HamacherProduct"
    MINIMUM = "Minimum"
    NILPOTENT_MINIMUM = "NilpotentMinimum"


class SNorm(StrEnum):
    """What `or` means, and how conclusions add up."""

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
    """A word before a term."""

    ANY = "any"
    EXTREMELY = "extremely"
    NOT = "not"
    SELDOM = "seldom"
    SOMEWHAT = "somewhat"
    VERY = "very"


class Method(StrEnum):
    """Which rules of a block act."""

    GENERAL = "General"
    FIRST = "First"
    LAST = "Last"
    HIGHEST = "Highest"
    LOWEST = "Lowest"
    PROPORTIONAL = "Proportional"
    THRESHOLD = "Threshold"


class Comparator(StrEnum):
    """How a threshold compares."""

    LESS = "<"
    AT_MOST = "<="
    EQUAL = "=="
    DIFFERENT = "!="
    AT_LEAST = ">="
    MORE = ">"


class Defuzzification(StrEnum):
    """How the conclusions about an output become one number."""

    BISECTOR = "Bisector"
    CENTROID = "Centroid"
    LARGEST_OF_MAXIMUM = "LargestOfMaximum"
    MEAN_OF_MAXIMUM = "MeanOfMaximum"
    SMALLEST_OF_MAXIMUM = "SmallestOfMaximum"
    WEIGHTED_AVERAGE = "WeightedAverage"
    WEIGHTED_SUM = "WeightedSum"

    @property
    def is_weighted(self) -> bool:
        """Whether conclusions count as numbers and not as fuzzy sets."""
        return self in (Defuzzification.WEIGHTED_AVERAGE, Defuzzification.WEIGHTED_SUM)


class Weighting(StrEnum):
    """What number a conclusion comes to, where conclusions count as numbers."""

    AUTOMATIC = "Automatic"
    TAKAGI_SUGENO = "TakagiSugeno"
    TSUKAMOTO = "Tsukamoto"


@dataclass(frozen=True, slots=True)
class Form:
    """The parameters of a shape.

    Attributes:
        function: the name of its membership function at run time.
        names: of its parameters; a shape whose number is open has none.
        has_height: whether one more number may follow.
    """

    function: str
    names: tuple[str, ...]
    has_height: bool = True
    is_monotone: bool = False


_ENDS = ("start", "end")
_CORNERS = ("bottom_left", "top_left", "top_right", "bottom_right")
_SIGMOIDS = ("left", "rising", "falling", "right")


class Shape(Enum):
    """A term's shape; `Function` is no shape, its terms are formulas."""

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
"""What FLL calls a term that is a formula."""
