"""The names that a fuzzy rule can use: variables, their terms, and the terms that the rule can conclude."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from codra_dsl.language.check.index.parsed_rules import output_terms
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.diagnostics import Related, suggest
from codra_dsl.language.expression import is_name
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.source import MAX_LISTED, shown
from codra_dsl.language.model import Kind, Output, Variable

RULE_SYNTAX_HELP = "write 'if VARIABLE is TERM then TERM'"

_TRUTH_WORDS = {"yes": "true", "on": "true", "no": "false", "off": "false"}


@dataclass(frozen=True, slots=True)
class Mistake:
    """A mistake in a rule; `start` and `end` are offsets in the rule's text."""

    start: int
    end: int
    message: str
    help: str
    is_unknown_name: bool = False
    related: tuple[Related, ...] = ()


@dataclass(frozen=True)
class RuleNames:
    """The names that the rules of one metric or action can use. Methods return the message and the help of a finding.

    Attributes:
        section: the section of the output.
        output: the metric or action of the rules.
    """

    spec_index: SpecIndex
    section: str
    output: Output

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The variables that the rules can read."""
        readable_variables = self.spec_index.parsed_rules.readable_variables(self.section)
        return {variable.name: variable for variable in readable_variables}

    @cached_property
    def conclusions(self) -> Sequence[str]:
        """The terms that the rules can conclude."""
        return [term.name for term in output_terms(self.output)]

    @cached_property
    def outputs(self) -> frozenset[str]:
        """The names of all metrics and actions."""
        return frozenset(output.name for _, output in self.spec_index.parsed_rules.outputs)

    def terms(self, variable: str) -> Sequence[str]:
        """Return the terms of a variable."""
        return [term.name for term in self.spec_index.parsed_rules.terms(self.variables[variable])]

    def is_bool(self, variable: str) -> bool:
        """Return whether a name is the name of a bool."""
        return variable in self.variables and self.variables[variable].type.kind is Kind.BOOL

    def example(self, variable: str, hedge: str = "") -> str:
        """Return a description of a variable for helps, such as `gap is not close`."""
        if self.is_bool(variable):
            return f"{variable} is {'false' if hedge else 'true'}"
        return f"{variable} is {hedge}{next(iter(self.terms(variable)), 'TERM')}"

    def intended_term(self, variable: str, word: str) -> str | None:
        """Return the term of a variable that a word probably means, or None."""
        terms, bare_word = self.terms(variable), word.strip("\"'")
        if bare_word in terms:
            return bare_word
        truth = _TRUTH_WORDS.get(bare_word.lower()) if self.is_bool(variable) else None
        return truth or suggest(bare_word, terms)

    def unknown_variable(self, name: str) -> tuple[str, str]:
        """Return message and help for an unknown variable."""
        message = f"unknown variable '{name}'"
        if self.section == "metrics" and name in self.spec_index.parsed_rules.metrics:
            return message, "use it in a rule of an action: rules of metrics read context"
        nearest_name = suggest(name, sorted(filter(is_name, self.variables)))
        declaration = f"declare '{name}' under 'context'" if is_name(name) else RULE_SYNTAX_HELP
        return message, f"did you mean '{nearest_name}'?" if nearest_name is not None else declaration

    def unknown_term(self, name: str, word: str) -> tuple[str, str]:
        """Return message and help for a term that a variable does not have."""
        variable, terms, term = self.variables[name], self.terms(name), self.intended_term(name, word)
        message, bare_word = f"'{name}' has no term {shown(word)}", word.strip("\"'")
        if term is not None:
            return message, f"did you mean '{term}'?"
        help = f"write {_any_of(terms)}" if terms else ""
        if variable.type.kind not in (Kind.INT, Kind.FLOAT) or variable.is_derived or not is_name(bare_word):
            return message, help or "rules read numbers with 'terms', bools and enums"
        low, high = variable.type.range or (0.0, 1.0)
        new_term = f"{bare_word}: ramp {low:g} {high:g}"
        if terms:
            return message, f"{help}, or add a term under 'terms' of '{name}', such as '{new_term}'"
        return message, f"add for example 'terms: {{{new_term}}}' to '{name}'"

    def unknown_conclusion(self, word: str) -> tuple[str, str]:
        """Return message and help for a term that the metric or action does not have."""
        message = f"{USERS[self.section]} '{self.output.name}' has no term {shown(word)}"
        bare_word = word.strip("\"'")
        term = bare_word if bare_word in self.conclusions else suggest(bare_word, self.conclusions)
        return message, f"did you mean '{term}'?" if term is not None else f"write {_any_of(self.conclusions)}"


def _any_of(names: Sequence[str]) -> str:
    return " or ".join(f"'{name}'" for name in names[:MAX_LISTED])
