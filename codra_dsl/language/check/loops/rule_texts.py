"""Checks of the text of fuzzy rules (phase 1): every rule can be parsed, and its variables and terms exist."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.language.check.index.parsed_rules import ParsedRule
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.loops.rule_names import RULE_SYNTAX_HELP, Mistake, RuleNames
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression.tokens import with_escapes

_PARENTHESIS = re.compile(r"""[()]|"[^"]*"|'[^']*'""")

MAX_RELATED_PLACES = 5
"""The maximum number of further places of one name in a finding."""


def wrong_rules(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every fuzzy rule can be parsed, and its variables and terms exist. A name is reported once, with all mentions."""
    if spec_index.spec.damaged.get("context") or spec_index.spec.damaged.get("metrics"):
        return
    unknown_names: dict[tuple[str, str], Diagnostic] = {}
    for section, output in spec_index.parsed_rules.outputs:
        names = RuleNames(spec_index, section, output)
        for number, rule in enumerate(spec_index.parsed_rules.rules[section, output.name]):
            path = f"{section}.{output.name}.rules.{number}"
            for mistake in _mistakes(rule, names) if rule.problems else ():
                diagnostic = _finding(mistake, rule, path)
                if not mistake.is_unknown_name:
                    yield diagnostic
                    continue
                first = unknown_names.setdefault((diagnostic.message, diagnostic.help), diagnostic)
                if first is not diagnostic and len(first.related) < MAX_RELATED_PLACES:
                    also_here = Related("also here", diagnostic.place)
                    unknown_names[diagnostic.message, diagnostic.help] = replace(
                        first, related=(*first.related, also_here)
                    )
    yield from unknown_names.values()


RULE_TEXT_CHECKS = (wrong_rules,)
"""The checks of this module."""


def _mistakes(rule: ParsedRule, names: RuleNames) -> Iterator[Mistake]:
    """Yield the mistakes in each part of a rule.

    Findings of the parser are left out in parts with other mistakes, and after a part that the parser cannot read.
    Parentheses enclose several parts, so they are checked in the complete rule.
    """
    # slow to import, because of its regular expressions, and needed only if the parser could not read a rule
    from codra_dsl.language.check.loops.rule_clauses import MAX_LENGTH, RuleText  # noqa: PLC0415

    text = rule.phrase.text
    parts = RuleText(text, names).parts() if len(text) <= MAX_LENGTH else ()
    problems = dict(_parser_mistake(text, problem, names) for problem in rule.problems)
    for mistake in _unmatched_parentheses(text):
        problems.pop(mistake.start, None)
        yield mistake
    for end, mistakes in (*parts, (len(text) + 1, [])):
        in_part = [problems.pop(offset) for offset in sorted(problems) if offset < end]
        yield from mistakes or in_part
        if not all(mistake.is_unknown_name for mistake in mistakes):
            problems.clear()


def _unmatched_parentheses(text: str) -> Iterator[Mistake]:
    openings: list[re.Match[str]] = []
    for match in _PARENTHESIS.finditer(text):
        if match[0] == "(":
            openings.append(match)
        elif match[0] == ")" and openings:
            openings.pop()
        elif match[0] == ")":
            yield Mistake(*match.span(), "')' closes nothing", "remove it or add '('")
    for opening in openings:
        yield Mistake(*opening.span(), "'(' is never closed", "add ')'")


def _parser_mistake(text: str, problem: Diagnostic, names: RuleNames) -> tuple[int, Mistake]:
    """Return a finding of the parser, and the offset at which the parser found it."""
    span = problem.place.span
    start, end = span.column - 1, span.end_column - 1
    if end - start == len(text):
        help = f"end it with 'then TERM', with a term of '{names.output.name}'"
        return len(text), Mistake(start, end, problem.message, help)
    is_unknown_name = problem.rule.name == "fll-unknown-name"
    help = problem.help or RULE_SYNTAX_HELP
    return start, Mistake(start, end, problem.message, help, is_unknown_name=is_unknown_name)


def _finding(mistake: Mistake, rule: ParsedRule, path: str) -> Diagnostic:
    return finding(
        "unknown-in-fuzzy-rule" if mistake.is_unknown_name else "fuzzy-rule-syntax",
        with_escapes(mistake.message),
        rule.phrase.place_between(mistake.start, mistake.end),
        path=path,
        help=with_escapes(mistake.help),
        related=mistake.related,
    )
