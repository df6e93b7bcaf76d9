"""Check that a well-formed engine can be computed."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import (
    And,
    Antecedent,
    AnyTerm,
    Call,
    Engine,
    Formula,
    FormulaTerm,
    Name,
    Or,
    OutputVariable,
    RuleBlock,
)
from codra_dsl.language.fuzzy.words import Shape, Weighting


@dataclass(frozen=True, slots=True)
class EngineProblem:
    """One mistake in an engine.

    Attributes:
        location: the faulty part: `("engine",)`, `("variable", name)`, `("term", variable, name)` or
            `("block", index)`.
        rule: the name of the rule of the finding.
    """

    location: tuple[object, ...]
    rule: str
    message: str
    help: str


def engine_problems(engine: Engine) -> Iterator[EngineProblem]:
    """Yield all mistakes that prevent the computation of an engine."""
    if not engine.outputs:
        yield EngineProblem(("engine",), "fll-missing", "the engine has no outputs", "write an OutputVariable")
    for output in engine.outputs:
        if output.is_enabled:
            yield from _output_problems(output, engine)
    for index, block in enumerate(engine.blocks):
        if block.is_enabled:
            yield from _block_problems(index, block, engine)
    for variable in engine.variables:
        for term in variable.terms:
            yield from _term_problems(("term", variable.name, term.name), term, engine)


def _output_problems(output: OutputVariable, engine: Engine) -> Iterator[EngineProblem]:
    location = ("variable", output.name)
    if output.defuzzifier is None:
        yield EngineProblem(
            location, "fll-missing", "the output has no defuzzifier", "write one, such as 'Centroid 100'"
        )
        return
    if not output.defuzzifier.method.is_weighted:
        if output.aggregation is None:
            yield EngineProblem(
                location, "fll-missing", "an integral needs an aggregation", "write one, such as 'Maximum'"
            )
        if output.maximum - output.minimum == float("inf"):
            yield EngineProblem(location, "fll-missing", "an integral needs a finite range", "write its 'range'")
        return
    terms = concluded_terms(output, engine)
    weightings = {natural_weighting(term) for term in terms}
    if output.defuzzifier.weighting is Weighting.AUTOMATIC and len(weightings) > 1:
        help = "write TakagiSugeno or Tsukamoto after the defuzzifier"
        yield EngineProblem(location, "fll-unfit-term", "rules conclude terms of several kinds", help)
    if output.defuzzifier.weighting is Weighting.TSUKAMOTO:
        for term in terms:
            if natural_weighting(term) is not Weighting.TSUKAMOTO:
                place = ("term", output.name, term.name)
                help = "use Arc, Concave, Ramp, Sigmoid, SShape or ZShape"
                yield EngineProblem(place, "fll-unfit-term", f"'{term.name}' is not monotone", help)


def concluded_terms(output: OutputVariable, engine: Engine) -> tuple[AnyTerm, ...]:
    """Return the terms of an output that some rule concludes."""
    names = {
        conclusion.term
        for block in engine.blocks
        if block.is_enabled
        for rule in block.rules
        for conclusion in rule.conclusions
        if conclusion.variable == output.name
    }
    return tuple(term for term in output.terms if term.name in names)


def natural_weighting(term: AnyTerm) -> Weighting:
    """Return the default weighting of a term; AUTOMATIC means that its membership function is applied to its degree."""
    if isinstance(term, FormulaTerm) or term.shape in (Shape.Constant, Shape.Linear):
        return Weighting.TAKAGI_SUGENO
    return Weighting.TSUKAMOTO if term.shape.value.is_monotone else Weighting.AUTOMATIC


def _block_problems(index: int, block: RuleBlock, engine: Engine) -> Iterator[EngineProblem]:
    location = ("block", index)
    if block.activation is None:
        yield EngineProblem(location, "fll-missing", "the block has no activation", "write 'activation: General'")
    connectives = {kind for rule in block.rules for kind in _connectives(rule.antecedent)}
    if And in connectives and block.conjunction is None:
        yield EngineProblem(
            location, "fll-missing", "'and' needs a conjunction", "write a 'conjunction', such as Minimum"
        )
    if Or in connectives and block.disjunction is None:
        yield EngineProblem(
            location, "fll-missing", "'or' needs a disjunction", "write a 'disjunction', such as Maximum"
        )
    integral_outputs = {
        output.name for output in engine.outputs if output.defuzzifier and not output.defuzzifier.method.is_weighted
    }
    concluded_variables = {conclusion.variable for rule in block.rules for conclusion in rule.conclusions}
    if concluded_variables & integral_outputs and block.implication is None:
        yield EngineProblem(
            location, "fll-missing", "'then' needs an implication", "write an 'implication', such as Minimum"
        )


def _connectives(antecedent: Antecedent) -> Iterator[type]:
    pending = [antecedent]
    while pending:
        part = pending.pop()
        if isinstance(part, And | Or):
            yield type(part)
            pending += [part.left, part.right]


def _term_problems(location: tuple[object, ...], term: AnyTerm, engine: Engine) -> Iterator[EngineProblem]:
    if isinstance(term, FormulaTerm):
        known_names = {"x"} | {variable.name for variable in engine.variables}
        for name in sorted(names_in(term.formula) - known_names):
            help = "a formula may use x and the variables of the engine"
            yield EngineProblem(location, "fll-unknown-name", f"unknown variable '{name}' in the formula", help)
    elif term.shape is Shape.Linear and len(term.parameters) - len(engine.inputs) not in (0, 1):
        count = len(engine.inputs)
        help = f"write {count} coefficients, one for each input, and optionally a constant"
        yield EngineProblem(location, "fll-wrong-term", f"{len(term.parameters)} coefficients for {count} inputs", help)


def names_in(formula: Formula) -> frozenset[str]:
    """Return the variables in a formula."""
    if isinstance(formula, Name):
        return frozenset({formula.name})
    if isinstance(formula, Call):
        return frozenset[str]().union(*map(names_in, formula.operands))
    return frozenset()


def depends_on_inputs(output: OutputVariable, engine: Engine) -> bool:
    """Return whether the membership of a concluded term of an output depends on the engine's variables."""
    return any(
        names_in(term.formula) - {"x"} if isinstance(term, FormulaTerm) else term.shape is Shape.Linear
        for term in concluded_terms(output, engine)
    )
