"""The fuzzy rules of a spec, read: which words there are, and what each rule says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from codra_dsl.diagnostics import Diagnostic, Place, Span
from codra_dsl.fuzzy.antecedents import parse_rule_about
from codra_dsl.fuzzy.model import Rule, Term, propositions
from codra_dsl.fuzzy.source import Findings, Word
from codra_dsl.fuzzy.words import Defuzzification, Shape
from codra_dsl.model import Inference, Kind, Output, Phrase, Spec, Variable

_USUAL = (
    Term(name="low", shape=Shape.Ramp, parameters=(0.5, 0.2)),
    Term(name="medium", shape=Shape.Triangle, parameters=(0.2, 0.5, 0.8)),
    Term(name="high", shape=Shape.Ramp, parameters=(0.5, 0.8)),
)
_USUAL_NUMBERS = tuple(
    Term(name=name, shape=Shape.Constant, parameters=(value,))
    for name, value in (("low", 0.0), ("medium", 0.5), ("high", 1.0))
)


@dataclass(frozen=True, slots=True)
class ReadRule:
    """A rule of a metric or an action.

    Attributes:
        rule: None where it says nothing that could be understood.
        problems: findings of the parser; their columns count the letters of the rule's text from 1.
    """

    phrase: Phrase
    rule: Rule | None
    problems: tuple[Diagnostic, ...]

    def place_of(self, found: Diagnostic) -> Place:
        """Return where a finding of the parser stands in the spec."""
        span = found.place.span
        return self.phrase.place_between(span.column - 1, span.end_column - 1)


class RuleBook:
    """The rules of all metrics and actions. Each table is made when it is first asked for."""

    def __init__(self, spec: Spec) -> None:
        self._spec = spec

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The context-variables by name, those that loops bring along with them."""
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
    def rules(self) -> Mapping[tuple[str, str], tuple[ReadRule, ...]]:
        """The rules of each metric and action, by section and name."""
        return {
            (section, output.name): tuple(self._read(section, output, phrase) for phrase in output.rules)
            for section, output in self.outputs
        }

    def named(self, section: str, output: str) -> tuple[str, ...]:
        """Return the variables that the rules of an output name, in order."""
        read = (each.rule for each in self.rules[section, output] if each.rule is not None)
        return tuple(dict.fromkeys(each.variable for rule in read for each in propositions(rule.antecedent)))

    @cached_property
    def is_whole(self) -> bool:
        """Whether every rule could be understood."""
        return not any(each.problems for rules in self.rules.values() for each in rules)

    def followed(self, names: Iterable[str]) -> frozenset[str]:
        """Return all that the rules read, and these names; of a rate also the variable that it follows from."""
        read = {*names, *(name for key in self.rules for name in self.named(*key))}
        rates = (self.variables[name].rate for name in read if name in self.variables)
        return frozenset(read | {rate.of.name for rate in rates if rate is not None})

    def seen(self, section: str) -> Iterator[Variable]:
        """Yield what the rules of metrics, or of actions, can name: context, courses, and for actions also metrics."""
        for variable in self._spec.context:
            is_share = variable.is_derived and variable.type.kind is Kind.FLOAT
            if not is_share or (section == "actions" and variable.name in self.metrics):
                yield variable

    def terms(self, variable: Variable) -> tuple[Term, ...]:
        """Return the words for the values of a variable."""
        if variable.name in self.metrics and variable.is_derived:
            terms = tuple(each.term for each in self.metrics[variable.name].terms)
            return _USUAL if not terms or any(each.shape is Shape.Constant for each in terms) else terms
        if variable.type.kind in (Kind.BOOL, Kind.ENUM):
            return tuple(
                Term(name=name, shape=Shape.Rectangle, parameters=(index - 0.5, index + 0.5))
                for index, name in enumerate(members(variable))
            )
        return tuple(each.term for each in variable.terms)

    def _read(self, section: str, output: Output, phrase: Phrase) -> ReadRule:
        findings = Findings()
        names = self._words[section]
        terms = frozenset(term.name for term in output_terms(output))
        word = Word(phrase.text, Place(Span("", 1, 1, 1, len(phrase.text) + 1)))
        rule = parse_rule_about(word, names, output.name, terms, findings)
        return ReadRule(phrase, rule, findings.all())

    @cached_property
    def _words(self) -> Mapping[str, Mapping[str, frozenset[str]]]:
        return {
            section: {each.name: frozenset(term.name for term in self.terms(each)) for each in self.seen(section)}
            for section in ("metrics", "actions")
        }


def members(variable: Variable) -> tuple[str, ...]:
    """Return the values that count as 0, 1, ... in rules; none for numbers and texts."""
    return ("false", "true") if variable.type.kind is Kind.BOOL else variable.type.values


def output_terms(output: Output) -> tuple[Term, ...]:
    """Return the words for the value of a metric or a weight."""
    if output.terms:
        return tuple(each.term for each in output.terms)
    return _USUAL_NUMBERS if output.method.inference is Inference.TAKAGI_SUGENO else _USUAL


def defuzzifier_of(output: Output) -> Defuzzification:
    """Return how the conclusions about a metric or a weight become a number."""
    if output.method.defuzzifier is not None:
        return output.method.defuzzifier
    is_mamdani = output.method.inference is Inference.MAMDANI
    return Defuzzification.CENTROID if is_mamdani else Defuzzification.WEIGHTED_AVERAGE


def range_of(variable: Variable) -> tuple[float, float] | None:
    """Return all that a variable can be, as a number; None where it does not say."""
    count = len(members(variable))
    return (0.0, float(count - 1)) if count else variable.type.range
