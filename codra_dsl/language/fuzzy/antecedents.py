"""Parse the text of a rule: tokens -> tree. Names are checked against the engine's variables and terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

from codra_dsl.language.fuzzy.model import And, Antecedent, Or, Proposition, Rule
from codra_dsl.language.fuzzy.source import Findings, Word, parse_number, shown, split
from codra_dsl.language.fuzzy.words import KEYWORDS, Hedge

MAX_DEPTH = 40
"""The maximum nesting depth of an antecedent. Each consecutive `and` or `or` counts as one level."""

MAX_LEVELS = 100
"""The maximum nesting depth of operators and hedges together; Python allows at most 200 nested parentheses."""

_TOKEN = r"[()]|[^\s()]+"
_HEDGES = frozenset(Hedge)

Names = Mapping[str, frozenset[str]]
"""A mapping from each variable to its terms."""


class _WrongRuleError(Exception):
    """Stops the reading of a rule; the reason has already been reported."""


class Side(Enum):
    """The two sides of `then`."""

    ANTECEDENT = auto()
    CONSEQUENT = auto()


@dataclass(slots=True)
class _Reader:
    """Reads the tokens of a rule from left to right."""

    tokens: list[Word]
    end: Word
    all_terms: Names
    outputs: Names
    findings: Findings
    position: int = 0
    depth: int = 0

    def peek(self) -> str:
        """Return the next token, or an empty text at the end."""
        return self.tokens[self.position].text if self.position < len(self.tokens) else ""

    def take(self) -> Word:
        """Return the next token and advance."""
        if self.position == len(self.tokens):
            self.fail("the rule ends too early", self.end, "write 'if VARIABLE is TERM then VARIABLE is TERM'")
        self.position += 1
        return self.tokens[self.position - 1]

    def fail(self, message: str, word: Word, help: str) -> None:
        """Report a finding and stop reading the rule."""
        self.findings.add("fll-wrong-rule", message, word.place, help)
        raise _WrongRuleError

    def expect(self, keyword: str) -> Word:
        """Read a keyword and return it."""
        word = self.take()
        if word.text == ")" != keyword:
            self.fail("')' closes nothing", word, "remove it or add '('")
        if word.text != keyword:
            help = f"write '{keyword}' {'before it' if word.text[0].isalnum() else 'instead'}"
            self.fail(f"expected '{keyword}', found {shown(word.text)}", word, help)
        return word

    def disjunction(self) -> Antecedent:
        """Read operands joined by `or`."""
        left, depth = self.conjunction(), 0
        while self.peek() == "or":
            word, depth = self.take(), depth + 1
            self.limit(depth, word)
            left = Or(left, self.conjunction())
        return left

    def conjunction(self) -> Antecedent:
        """Read operands joined by `and`."""
        left, depth = self.atom(), 0
        while self.peek() == "and":
            word, depth = self.take(), depth + 1
            self.limit(depth, word)
            left = And(left, self.atom())
        return left

    def condition(self) -> Antecedent:
        """Read the antecedent between `if` and `then`."""
        first = self.expect("if")
        antecedent = self.disjunction()
        self.expect("then")
        self.limit_levels(_levels(antecedent), first)
        return antecedent

    def limit_levels(self, levels: int, word: Word) -> None:
        """Refuse operators and hedges that would be nested too deeply in Python."""
        if levels > MAX_LEVELS:
            message = f"more than {MAX_LEVELS} nested operators and hedges"
            self.findings.add("fll-too-large", message, word.place, "split the rule")
            raise _WrongRuleError

    def limit(self, depth: int, word: Word) -> None:
        """Refuse nesting that is too deep."""
        if self.depth + depth > MAX_DEPTH:
            self.findings.add("fll-too-large", f"nested deeper than {MAX_DEPTH}", word.place, "split the rule")
            raise _WrongRuleError

    def atom(self) -> Antecedent:
        """Read a proposition, or anything in parentheses."""
        if self.peek() != "(":
            return self.proposition(Side.ANTECEDENT)
        self.depth += 1
        opening = self.take()
        self.limit(0, opening)
        inside = self.disjunction()
        if self.peek() in ("then", ""):
            self.fail("'(' is never closed", opening, "add ')'")
        self.expect(")")
        self.depth -= 1
        return inside

    def proposition(self, side: Side) -> Proposition:
        """Read `variable is hedges term`."""
        variable = self.take()
        variables = self.all_terms if side is Side.ANTECEDENT else self.outputs
        if variable.text in KEYWORDS or variable.text in "()":
            self.fail(f"expected a variable, found {shown(variable.text)}", variable, "write a variable before it")
        if variable.text not in variables:
            noun = "variable" if side is Side.ANTECEDENT else "output"
            self.findings.report_unknown("fll-unknown-name", noun, variable, variables)
        self.expect("is")
        return self.hedged_term(variable.text, variables.get(variable.text), side)

    def hedged_term(self, variable: str, terms: frozenset[str] | None, side: Side) -> Proposition:
        """Read the description of a variable: `hedges term`."""
        hedges: list[Hedge] = []
        while self.peek() in _HEDGES:
            word = self.take()
            hedges.append(Hedge(word.text))
            self.limit_levels(len(hedges), word)
            if side is Side.ANTECEDENT and hedges[-1] is Hedge.ANY:
                return Proposition(variable=variable, hedges=tuple(hedges))
        term = self.take()
        if term.text in KEYWORDS or term.text in "()":
            self.fail(f"expected a term, found {shown(term.text)}", term, "write a term before it")
        if terms is not None and term.text not in terms:
            self.findings.report_unknown("fll-unknown-name", f"term of '{variable}'", term, terms | _HEDGES)
        return Proposition(variable=variable, term=term.text, hedges=tuple(hedges))

    def conclusions(self) -> tuple[Proposition, ...]:
        """Read the conclusions after `then`."""
        conclusions = [self.proposition(Side.CONSEQUENT)]
        while self.peek() == "and":
            self.take()
            conclusions.append(self.proposition(Side.CONSEQUENT))
        return tuple(conclusions)

    def weight(self) -> float:
        """Read the optional weight at the end of a rule: `with` and a number."""
        weight = 1.0
        if self.peek() == "with":
            self.take()
            word = self.take()
            parsed_weight = parse_number(word, self.findings)
            if parsed_weight is not None and not 0.0 <= parsed_weight < float("inf"):
                help = "write a weight of 0 or more"
                self.findings.add("fll-wrong-value", f"{shown(word.text)} is not a weight", word.place, help)
            weight = parsed_weight or 0.0
        if self.peek():
            word = self.take()
            self.fail(f"unexpected {shown(word.text)}", word, "end the rule before it")
        return weight


def _levels(antecedent: Antecedent) -> int:
    """Return the maximum nesting depth of operators and hedges."""
    max_level, pending = 0, [(antecedent, 0)]
    while pending:
        part, level = pending.pop()
        if isinstance(part, Proposition):
            max_level = max(max_level, level + len(part.hedges))
        else:
            pending += [(part.left, level + 1), (part.right, level + 1)]
    return max_level


def parse_rule(text: Word, all_terms: Names, outputs: Names, findings: Findings) -> Rule | None:
    """Return a rule, or None if it cannot be read. Unknown names are reported, and the rule keeps them."""
    reader = _Reader(list(split(text, _TOKEN)), text, all_terms, outputs, findings)
    try:
        antecedent = reader.condition()
        return Rule(antecedent=antecedent, conclusions=reader.conclusions(), weight=reader.weight())
    except _WrongRuleError:
        return None


def parse_rule_about(
    text: Word, all_terms: Names, output: str, terms: frozenset[str], findings: Findings
) -> Rule | None:
    """Return a rule about one output, `if ANTECEDENT then HEDGES TERM`; `output is` is allowed before the conclusion.

    Return None if the rule cannot be read. Unknown names are reported, and the rule keeps them.
    """
    reader = _Reader(list(split(text, _TOKEN)), text, all_terms, {output: terms}, findings)
    try:
        antecedent = reader.condition()
        if reader.peek() == output:
            reader.take()
            reader.expect("is")
        conclusion = reader.hedged_term(output, terms, Side.CONSEQUENT)
        return Rule(antecedent=antecedent, conclusions=(conclusion,), weight=reader.weight())
    except _WrongRuleError:
        return None
