"""Write an engine as FLL. The same engine gives the same bytes, and reading these bytes gives an equal engine."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.fuzzy.model import (
    DEFAULT_RESOLUTION,
    Activation,
    And,
    Antecedent,
    AnyTerm,
    Defuzzifier,
    Engine,
    FormulaTerm,
    Or,
    OutputVariable,
    Proposition,
    Rule,
    RuleBlock,
    Variable,
)
from codra_dsl.language.fuzzy.words import FORMULA, Method, Weighting


def write_fll(engine: Engine) -> str:
    """Return an engine in the FuzzyLite Language, with the shortest exact form of each number."""
    lines = [_line("Engine", engine.name), *_description(engine.description)]
    for variable in engine.inputs:
        lines += [_line("InputVariable", variable.name), *_range(variable), *_terms(variable)]
    for output in engine.outputs:
        lines += [_line("OutputVariable", output.name), *_range(output), *_output(output), *_terms(output)]
    for block in engine.blocks:
        lines += [_line("RuleBlock", block.name), *_block(block)]
    return "".join(f"{line}\n" for line in lines)


def _line(key: str, value: str) -> str:
    return f"{key}: {value}".rstrip()


def _description(text: str) -> Iterator[str]:
    if text:
        yield _line("  description", text)


def _flag(value: bool) -> str:
    return "true" if value else "false"


def number_text(value: float) -> str:
    """Return a number in FLL."""
    return repr(float(value))


def _range(variable: Variable) -> Iterator[str]:
    yield from _description(variable.description)
    yield f"  enabled: {_flag(variable.is_enabled)}"
    yield f"  range: {number_text(variable.minimum)} {number_text(variable.maximum)}"
    yield f"  lock-range: {_flag(variable.is_locked)}"


def _output(output: OutputVariable) -> Iterator[str]:
    yield f"  aggregation: {output.aggregation or 'none'}"
    yield f"  defuzzifier: {_defuzzifier(output.defuzzifier)}"
    yield f"  default: {'nan' if output.default is None else number_text(output.default)}"
    yield f"  lock-previous: {_flag(output.keeps_previous)}"


def _defuzzifier(defuzzifier: Defuzzifier | None) -> str:
    if defuzzifier is None:
        return "none"
    if defuzzifier.method.is_weighted:
        kind = "" if defuzzifier.weighting is Weighting.AUTOMATIC else f" {defuzzifier.weighting}"
        return f"{defuzzifier.method}{kind}"
    points = "" if defuzzifier.resolution == DEFAULT_RESOLUTION else f" {defuzzifier.resolution}"
    return f"{defuzzifier.method}{points}"


def _terms(variable: Variable) -> Iterator[str]:
    for term in variable.terms:
        yield f"  term: {term.name} {_term(term)}"


def _term(term: AnyTerm) -> str:
    if isinstance(term, FormulaTerm):
        return f"{FORMULA} {term.text}"
    numbers = [*term.parameters, *([term.height] if term.height != 1.0 else [])]
    return " ".join([term.shape.name, *map(number_text, numbers)])


def _block(block: RuleBlock) -> Iterator[str]:
    yield from _description(block.description)
    yield f"  enabled: {_flag(block.is_enabled)}"
    yield f"  conjunction: {block.conjunction or 'none'}"
    yield f"  disjunction: {block.disjunction or 'none'}"
    yield f"  implication: {block.implication or 'none'}"
    yield f"  activation: {_activation(block.activation)}"
    for rule in block.rules:
        yield f"  rule: {rule_text(rule)}"


def _activation(activation: Activation | None) -> str:
    if activation is None:
        return "none"
    if activation.method in (Method.FIRST, Method.LAST):
        return f"{activation.method} {activation.rules} {number_text(activation.threshold)}"
    if activation.method in (Method.HIGHEST, Method.LOWEST):
        return f"{activation.method} {activation.rules}"
    if activation.method is Method.THRESHOLD:
        return f"{activation.method} {activation.comparator} {number_text(activation.threshold)}"
    return str(activation.method)


def rule_text(rule: Rule) -> str:
    """Return a rule in FLL, only with the parentheses that are necessary."""
    weight = "" if rule.weight == 1.0 else f" with {number_text(rule.weight)}"
    conclusions = " and ".join(map(_proposition, rule.conclusions))
    return f"if {_antecedent(rule.antecedent)} then {conclusions}{weight}"


def _antecedent(part: Antecedent) -> str:
    if isinstance(part, Proposition):
        return _proposition(part)
    if isinstance(part, Or):
        right = _antecedent(part.right)
        return f"{_antecedent(part.left)} or {f'({right})' if isinstance(part.right, Or) else right}"
    left, right = _antecedent(part.left), _antecedent(part.right)
    left = f"({left})" if isinstance(part.left, Or) else left
    return f"{left} and {f'({right})' if isinstance(part.right, And | Or) else right}"


def _proposition(part: Proposition) -> str:
    words = [part.variable, "is", *map(str, part.hedges), *([part.term] if part.term else [])]
    return " ".join(words)
