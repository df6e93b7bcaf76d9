"""Read the expectations of a skill while it acts: `NAME`, `NAME becomes VALUE within D`, `NAME stays VALUE`."""

from __future__ import annotations

import math
import re

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Compare, Comparison, Name, Not, parse
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.conditions import build_condition, condition_text, report_syntax
from codra_dsl.language.load.yaml.nodes import ScalarNode
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.load.yaml.source_offsets import cut
from codra_dsl.language.model import Condition, Expectation, Expected, Letters, Reference
from codra_dsl.language.units import duration_help, parse_duration

_WORDS = re.compile(r"(?P<name>\S+)(?:\s+(?P<verb>\S+)(?:\s+(?P<rest>.*))?)?", re.DOTALL)
_WITHIN = re.compile(r"\s*(?<!\S)within(?:\s+(?P<duration>[^\"']*))?$")
_OTHER_TIME = re.compile(r"\s+(?P<word>in|for|after|for at least|at most)\s+(?P<duration>[0-9][^\"']*)$")
_COMPARISON_OPERATOR = re.compile(r"<=|>=|==|!=|<|>")
_VERB_SYNONYMS = {"is": "stays", "remains": "stays", "keeps": "stays", "gets": "becomes", "turns": "becomes"}


def read_expectation(reader: Reader, node: ScalarNode, index: int) -> Expectation | None:
    """Return the expectation in an entry of `monitor`. If the entry has a wrong form, report this and return None."""
    return _Entry(reader, node, index).expectation()


class _Entry:
    """One entry of `monitor`: its text on one line, with the positions of its letters."""

    def __init__(self, reader: Reader, node: ScalarNode, index: int) -> None:
        self._reader = reader
        self._node = node
        self._steps = ("monitor", str(index))
        self._text, self._runs = condition_text(reader, node)
        self._letters = Letters(reader.origin.place, self._runs)

    def expectation(self) -> Expectation | None:
        """Return the expectation, or None if the entry is invalid."""
        words = _WORDS.fullmatch(self._text)
        if self._node.reported or words is None:
            self._reader.damage("monitor")
            return None
        variable = Reference(name=words["name"], place=self._place(*words.span("name")))
        place = self._reader.origin.of(self._node)
        if words["verb"] not in ("becomes", "stays") and (intended_text := self._intended_expectation()):
            self._fail(f"{shown(self._text)} is not an expectation", f"write '{intended_text}'", 0, len(self._text))
            return None
        if words["verb"] is None:
            return Expectation(variable=variable, expected=Expected.WATCHED, place=place)
        if words["verb"] not in ("becomes", "stays"):
            self._report_unknown_verb(words)
            return None
        expected = Expected(words["verb"])
        start, end = words.span("rest") if words["rest"] else (len(self._text), len(self._text))
        time_limit = _WITHIN.search(self._text, start)
        if expected is Expected.STAYS:
            time_limit = time_limit or _OTHER_TIME.search(self._text, start)
        within_s = self._within(expected, time_limit)
        if time_limit is None and expected is Expected.BECOMES:
            return None
        condition = self._condition(variable, start, end if time_limit is None else time_limit.start())
        if condition is None or (within_s is None and expected is Expected.BECOMES):
            return None
        return Expectation(variable=variable, expected=expected, condition=condition, within_s=within_s, place=place)

    def _place(self, start: int, end: int) -> Place:
        return self._letters.place(start, end) or self._reader.origin.of(self._node)

    def _fail(self, message: str, help_text: str, start: int, end: int, rule: str = "monitor") -> None:
        self._reader.fail(rule, message, self._place(start, end), help_text, *self._steps)

    def _intended_expectation(self) -> str | None:
        """Return the expectation that was probably intended by a condition, such as `x stays true` for `x == true`."""
        time_limit = _WITHIN.search(self._text)
        end = len(self._text) if time_limit is None else time_limit.start()
        match parse(self._text[:end]):
            case Not(operand=Name(name=name)):
                value = "false"
            case Compare(first=Name(name=name), rest=((operator, right),)):
                value = self._text[right.start : end]
                value = value if operator is Comparison.EQUAL else f"{operator} {value}"
            case _:
                return None
        return f"{name} {'stays' if time_limit is None else 'becomes'} {value}{self._text[end:]}"

    def _report_unknown_verb(self, words: re.Match[str]) -> None:
        verb = words["verb"]
        suggestion = _VERB_SYNONYMS.get(verb.casefold()) or self._reader.findings.nearest(verb, ("becomes", "stays"))
        help_text = (
            f"did you mean '{suggestion}'?"
            if suggestion
            else "write NAME, NAME becomes VALUE within D, or NAME stays VALUE"
        )
        self._fail(f"{shown(verb)} is not an expectation", help_text, *words.span("verb"))

    def _within(self, expected: Expected, time_limit: re.Match[str] | None) -> float | None:
        """Return the time limit for a variable to become a value; report a missing or misplaced limit."""
        if expected is Expected.STAYS:
            if time_limit is not None:
                self._report_unexpected_limit(time_limit)
            return None
        if time_limit is None:
            self._report_missing_limit()
            return None
        text = time_limit["duration"] or ""
        duration = parse_duration(text)
        if duration is None or not 0 < duration < math.inf:
            help_text = duration_help(text) if duration is None else "give a time above 0 s"
            message = f"'within' takes a duration, not {shown(text)}" if text else "'within' takes a duration"
            self._fail(message, help_text, *_trimmed_span(time_limit), rule="duration")
            return None
        return duration

    def _report_unexpected_limit(self, time_limit: re.Match[str]) -> None:
        """Report a time limit after `stays`."""
        word = shown(time_limit["word"] if time_limit.re is _OTHER_TIME else "within")
        self._fail(
            f"'stays' does not take {word}",
            "remove the time limit: 'stays' applies as long as the skill acts",
            *_trimmed_span(time_limit),
        )

    def _report_missing_limit(self) -> None:
        """Report a missing time limit after `becomes`."""
        other = _OTHER_TIME.search(self._text)
        if other is not None:
            help_text = f"write 'within' instead of {shown(other['word'])}"
        elif any(self._reader.findings.nearest(word, ["within"]) for word in self._text.split()[2:]):
            help_text = "did you mean 'within'?"
        else:
            help_text = f"add a time limit: {self._text} within 5 s"
        self._fail("'becomes' needs a 'within'", help_text, 0, len(self._text))

    def _condition(self, variable: Reference, start: int, end: int) -> Condition | None:
        """Return the condition that the variable is expected to meet, or None after a finding."""
        value = self._text[start:end].strip()
        if not value:
            self._fail(
                "the expected value is missing", "write true, false, a number, a quoted text or a comparison", 0, end
            )
            return None
        head = f"{variable.name} " if _COMPARISON_OPERATOR.match(value) else f"{variable.name} == "
        runs = (*cut(self._runs, 0, len(variable.name), 0), *cut(self._runs, start, end, len(head)))
        condition = build_condition(self._reader, self._node, head + value, runs, self._steps)
        tree = condition.tree
        if tree is None:
            report_syntax(self._reader, self._node, condition, self._steps)
            return None
        if not isinstance(tree, Compare) or len(tree.rest) != 1 or not isinstance(tree.first, Name):
            self._fail(f"{shown(value)} is not one value", "write one value or one comparison", start, end)
            return None
        return condition


def _trimmed_span(match: re.Match[str]) -> tuple[int, int]:
    text = match[0]
    return match.start() + len(text) - len(text.lstrip()), match.end()
