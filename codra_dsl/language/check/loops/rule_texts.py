"""Checks of the text of fuzzy rules (phase 1): every rule can be parsed, and its variables and terms exist."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum, auto
from functools import cached_property

from codra_dsl.language.check.index.parsed_rules import ParsedRule, output_terms
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.check.loops.rule_forms import MAX_WORD_LENGTH, OtherForm, RuleText
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, suggest
from codra_dsl.language.expression import is_name
from codra_dsl.language.expression.tokens import with_escapes
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.source import MAX_LISTED, shown
from codra_dsl.language.fuzzy.words import Hedge
from codra_dsl.language.model import Kind, Output, Variable

_SYNTAX_HELP = "write 'if VARIABLE is TERM then TERM'"
_BEFORE_TERM = re.compile(rf"(?P<name>\w+)\s+is(?:\s+(?:{'|'.join(Hedge)}))*\s+$", re.ASCII)
_THEN = re.compile(r"\bthen\b")
MAX_RELATED_PLACES = 5
"""The maximum number of further places of one name in a finding."""

_TRUTH_WORDS = {"yes": "true", "on": "true", "no": "false", "off": "false"}


class _Kind(Enum):
    """What an unknown name in a rule should be."""

    VARIABLE = auto()
    TERM = auto()
    CONCLUSION = auto()


@dataclass(frozen=True, slots=True)
class _UnknownName:
    """An unknown name in rules.

    Attributes:
        owner: the variable that should have the term, or the section and the name of the metric or action that should
            have the concluded term, or the section of the rules.
    """

    name: str
    kind: _Kind
    owner: tuple[str, ...]


def wrong_rules(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every fuzzy rule can be parsed, and its variables and terms exist. A name is reported once, with all mentions."""
    if spec_index.spec.damaged.get("context") or spec_index.spec.damaged.get("metrics"):
        return
    mentions: dict[_UnknownName, list[tuple[Place, str]]] = {}
    for section, output in spec_index.parsed_rules.outputs:
        reader = _RuleReader(spec_index, section, output)
        for number, rule in enumerate(spec_index.parsed_rules.rules[section, output.name]):
            if not rule.problems:
                continue
            path = f"{section}.{output.name}.rules.{number}"
            form = reader.other_form(rule)
            for problem in reader.problems(rule, None if form is None else form.start):
                if problem.rule.name == "fll-unknown-name":
                    name = reader.unknown_name(rule, problem)
                    mentions.setdefault(name, []).append((rule.place_of(problem), path))
                    continue
                help = reader.help(rule, problem)
                yield finding("fuzzy-rule-syntax", problem.message, rule.place_of(problem), path=path, help=help)
            if form is not None:
                place = rule.phrase.place_between(form.start, form.end)
                message, help = with_escapes(form.message), with_escapes(form.help)
                yield finding("fuzzy-rule-syntax", message, place, path=path, help=help)
    for name, places_and_paths in mentions.items():
        yield _unknown_name_finding(spec_index, name, places_and_paths)


RULE_TEXT_CHECKS = (wrong_rules,)
"""The checks of this module."""


@dataclass(frozen=True)
class _RuleReader:
    """The variables and terms that the rules of one metric or action can use."""

    spec_index: SpecIndex
    section: str
    output: Output

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The variables that the rules can read."""
        readable_variables = self.spec_index.parsed_rules.readable_variables(self.section)
        return {variable.name: variable for variable in readable_variables}

    @cached_property
    def terms(self) -> Mapping[str, list[str]]:
        """The names of the terms of each variable."""
        return {name: _term_names(self.spec_index, variable) for name, variable in self.variables.items()}

    def other_form(self, rule: ParsedRule) -> OtherForm | None:
        """Return the first part of a rule with the form of another language, or None."""
        outputs = [output.name for _, output in self.spec_index.parsed_rules.outputs]
        text = RuleText(rule.phrase.text, self.output.name, outputs, self.variables, self.terms)
        forms = (text.other_form(_offset(problem)) for problem in rule.problems)
        return next((form for form in forms if form is not None), None)

    def problems(self, rule: ParsedRule, end: int | None) -> Iterator[Diagnostic]:
        """Yield the findings of the parser before an offset, without those that follow from the finding before."""
        unknown_end = -1
        for problem in rule.problems:
            start = _offset(problem)
            if end is not None and start >= end:
                return
            is_unknown = problem.rule.name == "fll-unknown-name"
            if is_unknown or unknown_end < 0 or rule.phrase.text[unknown_end:start].strip():
                yield problem
            unknown_end = problem.place.span.end_column - 1 if is_unknown else -1

    def help(self, rule: ParsedRule, problem: Diagnostic) -> str:
        """Return the help for a rule that cannot be parsed."""
        ends_too_early = problem.place.span.end_column - 1 - _offset(problem) == len(rule.phrase.text)
        end_help = f"end it with 'then TERM', with a term of '{self.output.name}'"
        return end_help if ends_too_early else problem.help or _SYNTAX_HELP

    def unknown_name(self, rule: ParsedRule, problem: Diagnostic) -> _UnknownName:
        """Return the name that a finding of the parser is about."""
        span = problem.place.span
        before, name = rule.phrase.text[: span.column - 1], rule.phrase.text[span.column - 1 : span.end_column - 1]
        if _THEN.search(before):
            return _UnknownName(name, _Kind.CONCLUSION, (self.section, self.output.name))
        described = _BEFORE_TERM.search(before, max(0, len(before) - MAX_WORD_LENGTH))
        if described is None:
            return _UnknownName(name, _Kind.VARIABLE, (self.section,))
        return _UnknownName(name, _Kind.TERM, (described["name"],))


def _offset(problem: Diagnostic) -> int:
    """Return where the place of a finding of the parser begins in the rule's text."""
    return problem.place.span.column - 1


def _unknown_name_finding(
    spec_index: SpecIndex, unknown: _UnknownName, places_and_paths: list[tuple[Place, str]]
) -> Diagnostic:
    (place, path), *others = places_and_paths
    message, help = _FORMULATIONS[unknown.kind](spec_index, unknown)
    related = [Related("also here", other_place) for other_place, _ in others[:MAX_RELATED_PLACES]]
    if unknown.kind is _Kind.TERM:
        related.insert(0, Related("declared here", spec_index.parsed_rules.variables[unknown.owner[0]].place))
    return finding("unknown-in-fuzzy-rule", message, place, path=path, help=help, related=tuple(related))


def _unknown_variable(spec_index: SpecIndex, unknown: _UnknownName) -> tuple[str, str]:
    """Return message and help for an unknown variable."""
    message, (section,) = f"unknown variable '{unknown.name}'", unknown.owner
    if section == "metrics" and unknown.name in spec_index.parsed_rules.metrics:
        return message, "use it in a rule of an action: rules of metrics read context"
    names = (variable.name for variable in spec_index.parsed_rules.readable_variables(section))
    nearest_name = suggest(unknown.name, sorted(filter(is_name, names)))
    if nearest_name is not None:
        return message, f"did you mean '{nearest_name}'?"
    return message, f"declare '{unknown.name}' under 'context'" if is_name(unknown.name) else _SYNTAX_HELP


def _unknown_term(spec_index: SpecIndex, unknown: _UnknownName) -> tuple[str, str]:
    """Return message and help for a term that a variable does not have."""
    variable = spec_index.parsed_rules.variables[unknown.owner[0]]
    terms = _term_names(spec_index, variable)
    message = f"'{variable.name}' has no term {shown(unknown.name)}"
    bare_name = unknown.name.strip("\"'")
    meant_term = _meant_term(bare_name, variable, terms)
    if meant_term is not None:
        return message, f"did you mean '{meant_term}'?"
    terms_text = f"write {_any_of(terms)}" if terms else ""
    is_declarable = variable.type.kind in (Kind.INT, Kind.FLOAT) and not variable.is_derived and is_name(bare_name)
    if not is_declarable:
        return message, terms_text or "rules read numbers with 'terms', bools and enums"
    low, high = variable.type.range or (0.0, 1.0)
    term_text = f"{bare_name}: ramp {low:g} {high:g}"
    if terms:
        return message, f"{terms_text}, or add a term under 'terms' of '{variable.name}', such as '{term_text}'"
    return message, f"add for example 'terms: {{{term_text}}}' to '{variable.name}'"


def _unknown_conclusion(spec_index: SpecIndex, unknown: _UnknownName) -> tuple[str, str]:
    """Return message and help for a term that a metric or an action does not have."""
    section, name = unknown.owner
    output = next(output for _, output in spec_index.parsed_rules.outputs if output.name == name)
    terms = [term.name for term in output_terms(output)]
    message, nearest_term = f"{USERS[section]} '{name}' has no term {shown(unknown.name)}", suggest(unknown.name, terms)
    if nearest_term is not None:
        return message, f"did you mean '{nearest_term}'?"
    return message, f"write {_any_of(terms)}"


_FORMULATIONS = {
    _Kind.VARIABLE: _unknown_variable,
    _Kind.TERM: _unknown_term,
    _Kind.CONCLUSION: _unknown_conclusion,
}
"""For each kind of unknown name, the function that returns message and help."""


def _meant_term(name: str, variable: Variable, terms: Sequence[str]) -> str | None:
    """Return the term that a name probably means, or None."""
    if name in terms:
        return name
    if variable.type.kind is Kind.BOOL and name.lower() in _TRUTH_WORDS:
        return _TRUTH_WORDS[name.lower()]
    return suggest(name, terms)


def _term_names(spec_index: SpecIndex, variable: Variable) -> list[str]:
    """Return the names of the terms of a variable."""
    return [term.name for term in spec_index.parsed_rules.terms(variable)]


def _any_of(names: Sequence[str]) -> str:
    return " or ".join(f"'{name}'" for name in names[:MAX_LISTED])
