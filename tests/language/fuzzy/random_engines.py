"""Random engines for properties, with any terms, norms, hedges, activations and defuzzifiers."""

from __future__ import annotations

from hypothesis import strategies as st

from codra_dsl.language.fuzzy.model import (
    Activation,
    And,
    Antecedent,
    Defuzzifier,
    Engine,
    InputVariable,
    Or,
    OutputVariable,
    Proposition,
    Rule,
    RuleBlock,
    Term,
)
from codra_dsl.language.fuzzy.words import Comparator, Defuzzification, Hedge, Method, Shape, SNorm, TNorm, Weighting

INPUTS = ("a", "b", "c")
OUTPUTS = ("p", "q")
TERMS = ("one", "two", "three")

corners = st.floats(-0.5, 1.5).map(lambda value: round(value, 3)) | st.sampled_from([0.0, 0.25, 0.5, 1.0])
widths = st.sampled_from([-20.0, -3.0, 0.1, 0.5, 2.0, 15.0])
heights = st.sampled_from([1.0, 1.0, 0.5, 0.9, 1.5])
_FREE = frozenset({"slope", "width", "standard_deviation", "standard_deviation_a", "standard_deviation_b"})
_STEEP = frozenset({"rising", "falling"})


@st.composite
def shaped(draw: st.DrawFn, name: str, shapes: list[Shape]) -> Term:
    shape = draw(st.sampled_from(shapes))
    if shape is Shape.Discrete:
        xs = sorted(draw(st.lists(corners, min_size=1, max_size=5)))
        ys = draw(st.lists(st.floats(0.0, 1.0), min_size=len(xs), max_size=len(xs)))
        numbers = tuple(number for pair in zip(xs, ys, strict=True) for number in pair)
        return Term(name=name, shape=shape, parameters=numbers)
    if shape is Shape.Linear:
        return Term(name=name, shape=shape, parameters=tuple(draw(st.lists(corners, min_size=3, max_size=4))))
    form = shape.value
    drawn = sorted(draw(st.lists(corners, min_size=len(form.names), max_size=len(form.names))))
    if draw(st.integers(0, 9)) == 0:
        drawn.reverse()
    steep = _FREE | _STEEP
    numbers = tuple(draw(widths) if key in steep else value for key, value in zip(form.names, drawn, strict=True))
    return Term(name=name, shape=shape, parameters=numbers, height=draw(heights) if form.has_height else 1.0)


def propositions(variables: tuple[str, ...]) -> st.SearchStrategy[Proposition]:
    hedges = st.lists(st.sampled_from([hedge for hedge in Hedge if hedge is not Hedge.ANY]), max_size=2).map(tuple)
    return st.builds(Proposition, variable=st.sampled_from(variables), term=st.sampled_from(TERMS), hedges=hedges)


antecedents: st.SearchStrategy[Antecedent] = st.recursive(
    propositions((*INPUTS, *INPUTS, *OUTPUTS))
    | st.builds(Proposition, variable=st.sampled_from(INPUTS), hedges=st.just((Hedge.ANY,))),
    lambda inner: st.builds(And, inner, inner) | st.builds(Or, inner, inner),
    max_leaves=4,
)
rules = st.builds(
    Rule,
    antecedent=antecedents,
    conclusions=st.lists(propositions(OUTPUTS), min_size=1, max_size=2).map(tuple),
    weight=st.sampled_from([1.0, 1.0, 0.5, 0.3]),
)


def plain_activation(activation: Activation) -> Activation:
    """Return the activation without parameters that its method does not have in FLL."""
    method = activation.method
    counts = method in (Method.FIRST, Method.LAST, Method.HIGHEST, Method.LOWEST)
    limits = method in (Method.FIRST, Method.LAST, Method.THRESHOLD)
    return Activation(
        method=method,
        rules=activation.rules if counts else 1,
        threshold=activation.threshold if limits else 0.0,
        comparator=activation.comparator if method is Method.THRESHOLD else Comparator.MORE,
    )


activations = st.builds(
    Activation,
    method=st.sampled_from(Method),
    rules=st.integers(1, 3),
    threshold=st.sampled_from([0.0, 0.25, 0.5]),
    comparator=st.sampled_from(Comparator),
).map(plain_activation)

blocks = st.builds(
    RuleBlock,
    conjunction=st.sampled_from(TNorm),
    disjunction=st.sampled_from(SNorm),
    implication=st.sampled_from(TNorm),
    activation=activations,
    rules=st.lists(rules, min_size=1, max_size=5).map(tuple),
)

_NUMBERS = [Shape.Constant, Shape.Linear]
_SETS = [shape for shape in Shape if shape not in _NUMBERS]
_MONOTONE = [shape for shape in Shape if shape.value.is_monotone]


@st.composite
def outputs(draw: st.DrawFn, name: str) -> OutputVariable:
    method = draw(st.sampled_from(Defuzzification))
    weighting, shapes = Weighting.AUTOMATIC, _SETS
    if method.is_weighted:
        weighting = draw(st.sampled_from(Weighting))
        shapes = _MONOTONE if weighting is Weighting.TSUKAMOTO else draw(st.sampled_from([_NUMBERS, _MONOTONE]))
        defuzzifier = Defuzzifier(method=method, weighting=weighting)
    else:
        defuzzifier = Defuzzifier(method=method, resolution=draw(st.sampled_from([1, 7, 20])))
    return OutputVariable(
        name=name,
        minimum=-0.5,
        maximum=draw(st.sampled_from([0.5, 1.5])),
        is_locked=draw(st.booleans()),
        default=draw(st.sampled_from([None, None, 0.25])),
        aggregation=draw(st.sampled_from(SNorm)),
        defuzzifier=defuzzifier,
        terms=tuple(draw(shaped(term, shapes)) for term in TERMS),
    )


@st.composite
def engines(draw: st.DrawFn) -> Engine:
    """Return an engine of three inputs and two outputs, which can be computed."""
    inputs = tuple(
        InputVariable(
            name=name,
            minimum=0.0,
            maximum=1.0,
            is_locked=draw(st.booleans()),
            terms=tuple(draw(shaped(term, [*_SETS, Shape.Constant])) for term in TERMS),
        )
        for name in INPUTS
    )
    return Engine(
        name="random",
        inputs=inputs,
        outputs=tuple(draw(outputs(name)) for name in OUTPUTS),
        blocks=tuple(draw(st.lists(blocks, min_size=1, max_size=2))),
    )
