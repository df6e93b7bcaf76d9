"""The engines of the reference values, in FLL; together they use every construct of FuzzyLite.

`python tests/data/fuzzy/engines.py` writes them to the folder of this file.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

FOLDER = Path(__file__).parent

TNORMS = "AlgebraicProduct BoundedDifference DrasticProduct EinsteinProduct HamacherProduct Minimum NilpotentMinimum"
SNORMS = (
    "AlgebraicSum BoundedSum DrasticSum EinsteinSum HamacherSum Maximum NilpotentMaximum NormalizedSum UnboundedSum"
)
HEDGES = "any extremely not seldom somewhat very"
INTEGRALS = "Bisector Centroid LargestOfMaximum MeanOfMaximum SmallestOfMaximum"
ACTIVATIONS = (
    "General",
    "First",
    "First 2 0.3",
    "Last",
    "Last 2 0.3",
    "Highest",
    "Highest 2",
    "Lowest",
    "Lowest 2",
    "Proportional",
    "Threshold",
    "Threshold < 0.4",
    "Threshold <= 0.5",
    "Threshold == 0.5",
    "Threshold != 0.5",
    "Threshold >= 0.5",
    "Threshold > 0.25",
)

TERMS = (
    "Arc 0.2 0.8",
    "Arc 0.8 0.2 0.5",
    "Bell 0.5 0.2 3",
    "Bell 0.3 0.1 -2 0.7",
    "Binary 0.5 inf",
    "Binary 0.5 -inf 0.6",
    "Concave 0.4 0.5",
    "Concave 0.6 0.5 0.9",
    "Cosine 0.5 0.6",
    "Cosine 0.2 0.5 0.4",
    "Discrete 0.1 0.0 0.3 1.0 0.6 0.4 0.9 0.2",
    "Discrete 0.2 0.3 0.5 0.3 0.5 0.9 0.8 0.1 0.5",
    "Gaussian 0.5 0.2",
    "Gaussian 0.1 0.4 0.8",
    "GaussianProduct 0.4 0.1 0.6 0.2",
    "GaussianProduct 0.7 0.2 0.3 0.1 0.9",
    "PiShape 0.1 0.4 0.6 0.9",
    "PiShape 0.2 0.7 0.4 0.8 0.6",
    "Ramp 0.2 0.7",
    "Ramp 0.9 0.4 0.8",
    "Ramp 0.5 0.5",
    "Rectangle 0.3 0.7",
    "Rectangle 0.8 0.4 0.3",
    "SemiEllipse 0.2 0.8",
    "SemiEllipse 0.9 0.3 0.7",
    "Sigmoid 0.5 20",
    "Sigmoid 0.4 -15 0.9",
    "SigmoidDifference 0.3 20 25 0.7",
    "SigmoidDifference 0.5 -10 15 0.4 0.8",
    "SigmoidProduct 0.3 20 -25 0.7",
    "SigmoidProduct 0.6 10 -15 0.4 0.6",
    "Spike 0.5 0.6",
    "Spike 0.2 -0.9 0.5",
    "SShape 0.2 0.8",
    "SShape 0.1 0.6 0.7",
    "Trapezoid 0.1 0.3 0.6 0.9",
    "Trapezoid -inf 0.3 0.5 0.8 0.6",
    "Trapezoid 0.2 0.4 0.6 inf",
    "Triangle 0.1 0.5 0.9",
    "Triangle 0.3 0.3 0.9 0.7",
    "Triangle -inf 0.4 0.8",
    "Triangle 0.2 0.4 inf",
    "ZShape 0.2 0.8",
    "ZShape 0.3 0.9 0.5",
    "Constant 0.4",
    "Linear 0.25 0.5 0.1",
    "Function 0.5 * x + 0.1",
)

FORMULAS = (
    "x + a * b - a / b",
    "~x + .-a - .+b",
    "! gt(a, 0.5) + a ^ 2 ** b",
    "(a + b) % 0.3 * x",
    "gt(a, b) + 2 * ge(a, b) + 4 * eq(a, b) + 8 * neq(a, b) + 16 * le(a, b) + 32 * lt(a, b)",
    "min(a, b) + 10 * max(a, x)",
    "acos(a) + asin(b) * atan(x)",
    "ceil(3 * a) + floor(5 * b) + round(2 * x)",
    "sin(a) + cos(b) + tan(x)",
    "sinh(a) + cosh(b) + tanh(x)",
    "exp(a) + abs(~b) + fabs(x)",
    "log(a) + log10(b) + log1p(x)",
    "sqrt(a) + pow(b, 1.5) + atan2(a, b)",
    "acosh(1 + a) + asinh(b) + atanh(a / 2)",
    "fmod(a, 0.3) + pi * b",
    "(a and b) + (a or x) * 2",
    "2 ^ .- a - b * (x - 0.5) / pi",
)

THIRDS = ("low Ramp 0.5 0.0", "middle Triangle 0.1 0.5 0.9", "high Ramp 0.5 1.0")
FIFTHS = tuple(f"t{at} Triangle {at / 4 - 0.3} {at / 4} {at / 4 + 0.3}" for at in range(5))


def variable(kind: str, name: str, terms: Iterable[str], *keys: str, ends: str = "0.0 1.0") -> list[str]:
    return [
        f"{kind}: {name}",
        f"  range: {ends}",
        *(f"  {key}" for key in keys),
        *(f"  term: {term}" for term in terms),
    ]


def input_variable_lines(name: str, terms: Iterable[str], *keys: str, ends: str = "0.0 1.0") -> list[str]:
    return variable("InputVariable", name, terms, *keys, ends=ends)


def output_variable_lines(
    name: str, terms: Iterable[str], defuzzifier: str, *keys: str, aggregation: str = "Maximum", ends: str = "0.0 1.0"
) -> list[str]:
    default = [f"defuzzifier: {defuzzifier}", f"aggregation: {aggregation}"]
    return variable("OutputVariable", name, terms, *default, *keys, ends=ends)


def block(
    *rules: str,
    conjunction: str = "Minimum",
    disjunction: str = "Maximum",
    implication: str = "Minimum",
    activation: str = "General",
) -> list[str]:
    words = [f"conjunction: {conjunction}", f"disjunction: {disjunction}", f"implication: {implication}"]
    lines = [*words, f"activation: {activation}", *(f"rule: {rule}" for rule in rules)]
    return ["RuleBlock:", *(f"  {line}" for line in lines)]


def sets(shapes: Iterable[str]) -> list[str]:
    return [f"s{at} {shape}" for at, shape in enumerate(shapes)]


ONE = ("one Constant 1.0",)


def terms_asked() -> list[str]:
    """Return an engine with each shape as a term of an input; the output is its degree."""
    count = range(len(TERMS))
    lines = input_variable_lines("a", sets(TERMS)) + input_variable_lines("b", ())
    for at in count:
        lines += output_variable_lines(f"o{at}", ONE, "WeightedSum", aggregation="none")
    return lines + block(*(f"if a is s{at} then o{at} is one" for at in count))


def terms_concluded() -> list[str]:
    """Return an engine with each shape as a term of an output, clipped by a rule."""
    lines = input_variable_lines("a", THIRDS) + input_variable_lines("b", THIRDS)
    rules = []
    for at, shape in enumerate(TERMS):
        lines += output_variable_lines(f"o{at}", (f"s {shape}", "other Triangle 0.0 0.2 0.4"), "Centroid 100")
        rules.append(f"if a is high then o{at} is s with 0.8")
        rules.append(f"if b is low then o{at} is other")
    return lines + block(*rules)


def terms_inverted() -> list[str]:
    """Return an engine with each monotone shape by Tsukamoto's method, and every other shape by its inverse."""
    lines, rules = input_variable_lines("a", FIFTHS) + input_variable_lines("b", FIFTHS), []
    plain = [shape for shape in TERMS if shape.split()[0] not in ("Constant", "Linear", "Function")]
    for at, shape in enumerate(plain):
        lines += output_variable_lines(f"o{at}", (f"s {shape}",), "WeightedAverage", aggregation="none")
        rules.append(f"if a is t2 then o{at} is s")
    monotone = ("Arc 0.2 0.8", "Concave 0.4 0.5", "Ramp 0.2 0.7", "Sigmoid 0.5 20", "SShape 0.2 0.8", "ZShape 0.9 0.1")
    lines += output_variable_lines("sum", sets(monotone), "WeightedSum Tsukamoto", aggregation="none")
    lines += output_variable_lines("mean", sets(monotone), "WeightedAverage Tsukamoto", aggregation="AlgebraicSum")
    lines += output_variable_lines("values", sets(monotone), "WeightedAverage TakagiSugeno", aggregation="Maximum")
    for at in range(len(monotone)):
        side = "a" if at % 2 else "b"
        rules.append(f"if {side} is t{at % 5} then sum is s{at} and mean is s{at} and values is s{at}")
        rules.append(f"if {side} is not t{at % 5} then mean is s{at} and values is s{at} with 0.5")
    return lines + block(*rules)


def norms() -> list[str]:
    """Return an engine with each norm in each of its roles."""
    lines = input_variable_lines("a", THIRDS) + input_variable_lines("b", (*THIRDS, "sharp Rectangle 0.4 0.6"))
    blocks: list[str] = []
    for at, norm in enumerate(TNORMS.split()):
        lines += output_variable_lines(f"and{at}", ONE, "WeightedSum", aggregation="none")
        lines += output_variable_lines(f"then{at}", THIRDS, "Centroid 50")
        rules = (f"if a is high and b is middle and b is sharp or b is low and a is middle then and{at} is one",)
        rules += (f"if a is low then then{at} is low", f"if b is middle then then{at} is high with 0.7")
        blocks += block(*rules, conjunction=norm, implication=norm)
    for at, norm in enumerate(SNORMS.split()):
        lines += output_variable_lines(f"or{at}", ONE, "WeightedSum", aggregation="none")
        lines += output_variable_lines(f"sum{at}", FIFTHS, "Centroid 50", aggregation=norm)
        lines += output_variable_lines(f"group{at}", ONE, "WeightedSum", aggregation=norm)
        rules = (f"if a is high or b is middle or a is middle and b is sharp then or{at} is one and group{at} is one",)
        rules += (f"if a is low then sum{at} is t1 and group{at} is one", f"if b is middle then sum{at} is t2")
        rules += (f"if b is high then sum{at} is t2 and group{at} is one with 0.6",)
        blocks += block(*rules, disjunction=norm, implication="AlgebraicProduct")
    return lines + blocks


def hedges() -> list[str]:
    """Return an engine with each hedge alone and before every hedge, in antecedents and conclusions."""
    lines, rules = input_variable_lines("a", FIFTHS), []
    words = HEDGES.split()
    pairs = [(word,) for word in words] + [(one, other) for one in words for other in words if one != "any"]
    for at, pair in enumerate(pairs):
        lines += output_variable_lines(f"o{at}", ONE, "WeightedSum", aggregation="none")
        term = "" if "any" in pair else "t1"
        rules.append(f"if a is {' '.join(pair)} {term} then o{at} is one")
    for at, word in enumerate(words):
        lines += output_variable_lines(f"c{at}", (*THIRDS, *FIFTHS), "Centroid 40")
        rules.append(f"if a is t1 then c{at} is {word} low and c{at} is very t3")
        rules.append(f"if a is t2 then c{at} is not {word} high")
    return lines + block(*rules)


def defuzzifiers() -> list[str]:
    """Return an engine with each integral at several resolutions."""
    lines, rules = input_variable_lines("a", FIFTHS) + input_variable_lines("b", THIRDS), []
    for at, defuzzifier in enumerate(INTEGRALS.split()):
        for size in ("", " 1", " 7", " 100"):
            name = f"o{at}{size.strip()}"
            lines += output_variable_lines(name, FIFTHS, f"{defuzzifier}{size}", ends="-0.5 1.25")
            rules += [f"if a is t{index} then {name} is t{4 - index}" for index in (0, 2, 3)]
            rules.append(f"if b is not low and a is t4 then {name} is t1 with 0.9")
    return lines + block(*rules)


def activations() -> list[str]:
    """Return an engine with each activation and its parameters, for fuzzy sets and for numbers."""
    lines, blocks = input_variable_lines("a", FIFTHS) + input_variable_lines("b", FIFTHS), []
    numbers = ("p Constant 0.0", "q Constant 1.0", "r Constant 4.0")
    for at, activation in enumerate(ACTIVATIONS):
        lines += output_variable_lines(f"set{at}", FIFTHS, "Centroid 50", aggregation="AlgebraicSum")
        lines += output_variable_lines(f"number{at}", numbers, "WeightedAverage", "default: -1.0", aggregation="none")
        rules = [f"if a is t{index} then set{at} is t{index} and number{at} is p" for index in range(3)]
        rules += [f"if b is t{index} or a is t4 then set{at} is t{index} and number{at} is r" for index in (2, 3)]
        rules.append(f"if b is t1 and a is not t3 then number{at} is q with 0.5")
        blocks += block(*rules, activation=activation)
    return lines + blocks


def formulas() -> list[str]:
    """Return an engine with each operator and function: as a number, as a fuzzy set and as a term of an input."""
    lines = input_variable_lines("a", (*THIRDS, "wave Function 0.5 + 0.5 * sin(6 * x) * b")) + input_variable_lines(
        "b", THIRDS
    )
    rules = []
    for at, formula in enumerate(FORMULAS):
        lines += output_variable_lines(f"o{at}", (f"f Function {formula}",), "WeightedAverage", aggregation="none")
        rules.append(f"if a is low then o{at} is f")
    lines += output_variable_lines("sheet", ("f Function a * exp(~x) * b", "p Ramp 0.0 1.0"), "Centroid 20")
    lines += output_variable_lines("plane", ("l Linear 0.3 0.2 0.1", "p Ramp 1.0 0.0"), "Centroid 20")
    lines += output_variable_lines("later", ("f Function sheet + 2 * o0 + 0.1 * later",), "WeightedSum", "default: 0.5")
    for name, term in (("sheet", "f"), ("sheet", "p"), ("plane", "l"), ("plane", "p"), ("later", "f")):
        rules.append(f"if a is wave or b is middle then {name} is {term}")
    return lines + block(*rules, disjunction="AlgebraicSum")


def takagi_sugeno() -> list[str]:
    """Return an engine with constants, planes and formulas, as means and sums, with several conclusions for a term."""
    terms = ("c Constant 0.25", "l Linear 1.0 -0.5", "k Linear 0.5 2.0 -0.25", "f Function a * b + x")
    lines = input_variable_lines("a", FIFTHS) + input_variable_lines("b", FIFTHS)
    blocks: list[str] = []
    for at, norm in enumerate(("none", "Maximum", "AlgebraicSum", "UnboundedSum")):
        lines += output_variable_lines(f"mean{at}", terms, "WeightedAverage", aggregation=norm)
        lines += output_variable_lines(f"sum{at}", terms, "WeightedSum TakagiSugeno", aggregation=norm)
        both = [f"mean{at} is {name} and sum{at} is {name}" for name in "clkf"]
        rules = [f"if a is t{index} and b is t{(index + 2) % 5} then {both[index % 4]}" for index in range(5)]
        rules += [f"if a is t{index} or b is not t{index} then {both[index % 4]} with 0.3" for index in range(3)]
        blocks += block(*rules, conjunction="AlgebraicProduct", disjunction="AlgebraicSum")
    return lines + blocks


def outputs() -> list[str]:
    """Return an engine with the options of outputs, disabled parts, and rules about outputs."""
    lines = (
        input_variable_lines("a", FIFTHS, "lock-range: true")
        + input_variable_lines("b", THIRDS)
        + input_variable_lines("c", THIRDS, "enabled: false")
    )
    narrow = ("peak Triangle 0.1 0.2 0.3", "edge Triangle 0.8 0.9 1.0")
    lines += output_variable_lines("kept", narrow, "Centroid 30", "lock-previous: true")
    lines += output_variable_lines("kept_or", narrow, "Centroid 30", "lock-previous: true", "default: 0.4")
    lines += output_variable_lines("usual", narrow, "Bisector 30", "default: 0.7")
    lines += output_variable_lines(
        "locked", ("big Constant 9.0", "small Constant -9.0"), "WeightedSum", "lock-range: true"
    )
    lines += output_variable_lines("off", narrow, "Centroid 30", "enabled: false")
    lines += output_variable_lines("second", narrow, "Centroid 30", aggregation="AlgebraicSum")
    lines += output_variable_lines("third", ONE, "WeightedSum", aggregation="none")
    rules = ["if a is t0 and b is low then kept is peak and kept_or is peak and usual is peak"]
    rules += ["if a is t4 and b is high then kept is edge and kept_or is edge and off is edge and usual is very edge"]
    rules += ["if b is low then locked is big", "if a is t3 or c is low then locked is small"]
    rules += ["if a is t1 or a is t3 then second is peak", "if b is middle then second is peak and off is not peak"]
    first = block(*rules)
    about = ["if second is peak and kept is not edge then third is one", "if off is peak then third is one"]
    about += ["if second is edge or a is t2 then second is edge with 0.5", "if second is edge then third is one"]
    unused = block("if a is t0 then third is one")
    unused.insert(1, "  enabled: false")
    chained = [f"if third is one and a is t{at} then second is peak" for at in range(3)]
    return lines + first + block(*about) + unused + block(*chained, activation="First 2 0.1")


def hybrid() -> list[str]:
    """Return an engine with fuzzy sets, numbers and inverses."""
    lines = input_variable_lines("a", FIFTHS, ends="-1.0 2.0") + input_variable_lines("b", THIRDS)
    lines += output_variable_lines("mamdani", FIFTHS, "MeanOfMaximum 64", aggregation="BoundedSum")
    lines += output_variable_lines("sugeno", ("c Constant 0.2", "l Linear 0.1 0.9 0.0"), "WeightedAverage")
    lines += output_variable_lines("tsukamoto", ("up Ramp 0.0 1.0", "down Ramp 1.0 0.0"), "WeightedAverage")
    rules = ["if a is t1 and b is somewhat low then mamdani is t0 and sugeno is c and tsukamoto is up"]
    rules += ["if a is t2 or b is high then mamdani is t3 and sugeno is l and tsukamoto is down with 0.9"]
    rules += ["if a is any and (b is low or b is middle) then mamdani is t2"]
    return lines + block(*rules, implication="AlgebraicProduct")


_METRICS = ("low Ramp 0.6 0.2", "medium Triangle 0.2 0.5 0.8", "high Ramp 0.4 0.8")
CONTEXT = {
    "person_distance": ("0.0 10.0", ("close Ramp 2.5 1.0", "near Triangle 1.0 3.0 5.0", "far Ramp 3.0 6.0")),
    "person_speed": ("0.0 3.0", ("slow Ramp 1.0 0.3", "brisk Triangle 0.5 1.2 2.0", "fast Ramp 1.2 2.0")),
    "battery": ("0.0 100.0", ("empty Ramp 30.0 10.0", "half Triangle 20.0 50.0 80.0", "full Ramp 60.0 90.0")),
    "drain": ("0.0 5.0", ("calm Ramp 2.0 0.5", "usual Triangle 0.5 1.5 3.0", "steep Ramp 2.0 4.0")),
    "load": ("0.0 1.0", ("empty Ramp 0.4 0.1", "partial Triangle 0.2 0.5 0.8", "full Ramp 0.7 0.95")),
    "progress": ("0.0 1.0", ("begun Ramp 0.5 0.1", "under_way Triangle 0.2 0.5 0.8", "done Ramp 0.6 0.95")),
}
"""The inputs of the first stage in the shape of P2: six inputs with three terms each."""


def store_metrics() -> list[str]:
    """Return the first stage in the shape of P2: 15 rules of ours, from context to three metrics."""
    lines = [line for name, (ends, terms) in CONTEXT.items() for line in input_variable_lines(name, terms, ends=ends)]
    for name in ("safety", "mission_completion", "power_autonomy"):
        lines += output_variable_lines(name, _METRICS, "Centroid 100")
    return lines + block(
        "if person_distance is close then safety is low",
        "if person_distance is near and person_speed is fast then safety is low",
        "if person_distance is near and person_speed is not fast then safety is medium",
        "if person_distance is far and person_speed is fast then safety is medium",
        "if person_distance is far and person_speed is not fast then safety is high",
        "if load is full or progress is done then mission_completion is high",
        "if load is partial and progress is under_way then mission_completion is medium",
        "if load is empty and progress is begun then mission_completion is low",
        "if load is empty and progress is under_way then mission_completion is medium",
        "if load is partial and progress is begun then mission_completion is low with 0.8",
        "if battery is full and drain is not steep then power_autonomy is high",
        "if battery is full and drain is steep then power_autonomy is medium",
        "if battery is half and drain is calm then power_autonomy is medium",
        "if battery is half and drain is not calm then power_autonomy is low with 0.6",
        "if battery is empty then power_autonomy is low",
    )


def store_actions() -> list[str]:
    """Return the second stage in the shape of P2: 20 rules of ours, from context and metrics to four weights."""
    names = ("person_distance", "battery", "load")
    lines = [line for name in names for line in input_variable_lines(name, CONTEXT[name][1], ends=CONTEXT[name][0])]
    for name in ("safety", "mission_completion", "power_autonomy"):
        lines += input_variable_lines(name, _METRICS)
    for name in ("pick", "deliver", "start", "dock"):
        lines += output_variable_lines(name, _METRICS, "Centroid 100")
    return lines + block(
        "if safety is high and load is empty then pick is high",
        "if safety is medium and load is empty then pick is medium",
        "if safety is low then pick is low",
        "if load is full then pick is low",
        "if battery is empty then pick is low with 0.9",
        "if load is full and safety is not low then deliver is high",
        "if load is partial and mission_completion is medium then deliver is medium",
        "if load is empty then deliver is low",
        "if safety is low and load is full then deliver is medium",
        "if power_autonomy is low then deliver is low with 0.5",
        "if safety is low then start is high",
        "if safety is medium and person_distance is close then start is high",
        "if safety is medium and person_distance is not close then start is medium",
        "if safety is high then start is low",
        "if mission_completion is high and load is empty then start is medium",
        "if power_autonomy is low then dock is high",
        "if power_autonomy is medium and mission_completion is high then dock is medium",
        "if power_autonomy is medium and mission_completion is not high then dock is low",
        "if power_autonomy is high then dock is low",
        "if battery is very empty then dock is high",
    )


ENGINES = (
    terms_asked,
    terms_concluded,
    terms_inverted,
    norms,
    hedges,
    defuzzifiers,
    activations,
    formulas,
    takagi_sugeno,
    outputs,
    hybrid,
    store_metrics,
    store_actions,
)


def main() -> None:
    """Write every engine."""
    for make in ENGINES:
        text = "\n".join([f"Engine: {make.__name__}", *make()]) + "\n"
        (FOLDER / f"{make.__name__}.fll").write_text(text, "utf-8")


if __name__ == "__main__":
    main()
