"""The parsed fuzzy rules of a spec, and the terms that the rules can use.

`check` parses the fuzzy rules, because `check` knows the variables and terms of the rules. It uses the parser of FLL.
Each character of a rule keeps its place in the spec, so that findings of the parser point into the spec.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

from codra_dsl.language.diagnostics import Diagnostic, Place, Span
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.antecedents import parse_rule_about
from codra_dsl.language.fuzzy.model import Rule, Term, propositions
from codra_dsl.language.fuzzy.source import Findings, Word
from codra_dsl.language.fuzzy.words import Defuzzification, Shape
from codra_dsl.language.model import Inference, Kind, Output, Phrase, Spec, Variable

_DEFAULT_TERMS = (
    Term(name="low", shape=Shape.Ramp, parameters=(0.5, 0.2)),
    Term(name="medium", shape=Shape.Triangle, parameters=(0.2, 0.5, 0.8)),
    Term(name="high", shape=Shape.Ramp, parameters=(0.5, 0.8)),
)
_DEFAULT_CONSTANTS = tuple(
    Term(name=name, shape=Shape.Constant, parameters=(value,))
    for name, value in (("low", 0.0), ("medium", 0.5), ("high", 1.0))
)


@dataclass(frozen=True, slots=True)
class ParsedRule:
    """A rule of a metric or an action.

    Attributes:
        rule: the parsed rule; None if it could not be parsed.
        problems: findings of the parser. Their columns are positions in the rule's text; the first character is 1.
    """

    phrase: Phrase
    rule: Rule | None
    problems: tuple[Diagnostic, ...]

    def place_of(self, problem: Diagnostic) -> Place:
        """Return the place of a finding of the parser in the spec."""
        span = problem.place.span
        return self.phrase.place_between(span.column - 1, span.end_column - 1)


class ParsedRules:
    """The rules of all metrics and actions. Each table is built on first use."""

    def __init__(self, spec: Spec) -> None:
        self._spec = spec

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The context-variables by name, including the variables that loops add."""
        return {variable.name: variable for variable in reversed(self._spec.context)}

    @cached_property
    def metrics(self) -> Mapping[str, Output]:
        """The metrics by name."""
        return {metric.name: metric for metric in self._spec.metrics}

    @cached_property
    def outputs(self) -> tuple[tuple[str, Output], ...]:
        """All metrics and actions, each with its section."""
        return (
            *(("metrics", metric) for metric in self._spec.metrics),
            *(("actions", action) for action in self._spec.actions),
        )

    @cached_property
    def rules(self) -> Mapping[tuple[str, str], tuple[ParsedRule, ...]]:
        """A mapping from the section and the name of each metric and action to its rules."""
        return {
            (section, output.name): tuple(self._read(section, output, phrase) for phrase in output.rules)
            for section, output in self.outputs
        }

    def input_names(self, section: str, output: str) -> tuple[str, ...]:
        """Return the variables in the rules of an output, in the order of the rules."""
        rules = (rule.rule for rule in self.rules[section, output] if rule.rule is not None)
        return tuple(
            dict.fromkeys(proposition.variable for rule in rules for proposition in propositions(rule.antecedent))
        )

    @cached_property
    def is_fully_parsed(self) -> bool:
        """Whether every rule could be parsed."""
        return not any(rule.problems for rules in self.rules.values() for rule in rules)

    @cached_property
    def read_names(self) -> frozenset[str]:
        """The names that the rules read."""
        return frozenset(name for key in self.rules for name in self.input_names(*key))

    def readable_variables(self, section: str) -> Iterator[Variable]:
        """Yield the variables that rules of a section can read: context, courses and, for actions, metrics."""
        for variable in self._spec.context:
            is_share = variable.is_derived and variable.type.kind is Kind.FLOAT
            if not is_share or (section == "actions" and variable.name in self.metrics):
                yield variable

    def terms(self, variable: Variable) -> tuple[Term, ...]:
        """Return the terms of a variable."""
        if variable.name in self.metrics and variable.is_derived:
            terms = tuple(output_term.term for output_term in self.metrics[variable.name].terms)
            return _DEFAULT_TERMS if not terms or any(term.shape is Shape.Constant for term in terms) else terms
        if variable.type.kind in (Kind.BOOL, Kind.ENUM):
            return tuple(
                Term(name=name, shape=Shape.Rectangle, parameters=(index - 0.5, index + 0.5))
                for index, name in enumerate(members(variable))
            )
        return tuple(variable_term.term for variable_term in variable.terms)

    def _read(self, section: str, output: Output, phrase: Phrase) -> ParsedRule:
        findings = Findings()
        names = self._terms_by_variable[section]
        terms = frozenset(term.name for term in output_terms(output))
        word = Word(phrase.text, Place(Span("", 1, 1, 1, len(phrase.text) + 1)))
        rule = parse_rule_about(word, names, output.name, terms, findings)
        return ParsedRule(phrase, rule, findings.all())

    @cached_property
    def _terms_by_variable(self) -> Mapping[str, Mapping[str, frozenset[str]]]:
        return {
            section: {
                variable.name: frozenset(term.name for term in self.terms(variable))
                for variable in self.readable_variables(section)
            }
            for section in ("metrics", "actions")
        }


def members(variable: Variable) -> tuple[str, ...]:
    """Return the values of a bool or an enum, which rules treat as the numbers 0, 1, ...; () for other types."""
    return ("false", "true") if variable.type.kind is Kind.BOOL else variable.type.values


def output_terms(output: Output) -> tuple[Term, ...]:
    """Return the terms of a metric or a weight."""
    if output.terms:
        return tuple(output_term.term for output_term in output.terms)
    return _DEFAULT_CONSTANTS if output.method.inference is Inference.TAKAGI_SUGENO else _DEFAULT_TERMS


def defuzzifier_of(output: Output) -> Defuzzification:
    """Return the defuzzification method of a metric or a weight."""
    if output.method.defuzzifier is not None:
        return output.method.defuzzifier
    is_mamdani = output.method.inference is Inference.MAMDANI
    return Defuzzification.CENTROID if is_mamdani else Defuzzification.WEIGHTED_AVERAGE


def range_of(variable: Variable) -> tuple[float, float] | None:
    """Return the range of a variable as numbers; None if the variable declares no range."""
    count = len(members(variable))
    return (0.0, float(count - 1)) if count else variable.type.range
