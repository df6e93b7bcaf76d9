"""Mistakes in the parts of a fuzzy rule, with the form that was probably meant.

A rule describes variables by terms: `if gap is close and bumped is true then low`. The rule is cut at `and`, `or` and
`then`, so that a mistake in one part hides none in the others. A part without a term, such as `gap < 2 m`, is read as
an expression over context, which a derived variable can have.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.language.check.loops.rule_names import Mistake, RuleNames
from codra_dsl.language.diagnostics import Related
from codra_dsl.language.expression import (
    Arithmetic,
    Compare,
    Fallback,
    In,
    Name,
    Node,
    Number,
    is_name,
    names_in,
    parse_derivation,
    reads_of,
    to_text,
)
from codra_dsl.language.expression.poses import map_parts
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.words import Hedge
from codra_dsl.language.load.yaml.traps import quote_text
from codra_dsl.language.model import Kind

MAX_LENGTH = 1000
"""The maximum length of a rule that is read part by part."""

_FLAGS = re.ASCII | re.DOTALL
_OPENING = re.compile(r"\s*(?P<word>if|when|while)\b", _FLAGS | re.IGNORECASE)
_JOINT = re.compile(
    r"""(?:"[^"]*"|'[^']*'|\bbetween\b[^()]+?\band\b)|(?P<joint>\b(?:and|or|then)\b|&&?|\|\|?|,(?![^()]*\)))""", _FLAGS
)
_OTHER_JOINTS = {"&&": "'and'", "&": "'and'", "||": "'or'", "|": "'or'", ",": "'and' or 'or'"}
_BLANKS_AND_PARENTHESES = "() \t\r\n"

_NAME = r"(?P<name>[A-Za-z]\w*)"
_HEDGE = "|".join(Hedge)
_HEDGES = rf"(?:(?:{_HEDGE})\s+)*"
_WORD = r"""(?P<words>"[^"]*"|'[^']*'|[A-Za-z]\w*)"""
_WORDS = r"\((?P<words>[^()\d]+)\)"
_NOT_BEFORE_TERM, _IS_MISSING = "'not' must be directly before a term", "'is' joins a variable and its term"
_ONE_TERM = "a description of '{name}' has one term"
_DESCRIPTIONS = tuple(
    (re.compile(pattern, _FLAGS), hedge, message)
    for pattern, hedge, message in (
        (rf"{_NAME}\s+is\s+{_HEDGES}(?:any|(?P<words>(?![-\d<>=!]|(?:{_HEDGE})\b)[^\s()]+))", "", ""),
        (rf"{_NAME}(?:\s+is(?:\s+(?:{_HEDGE}))*)?", "", "a rule needs a term of '{name}'"),
        (rf"not\s+{_NAME}(?:\s+is\s+{_WORD})?", "not ", _NOT_BEFORE_TERM),
        (rf"{_NAME}\s*(?:==?|:)\s*{_WORD}", "", _IS_MISSING),
        (rf"{_NAME}\s*(?:!=|<>)\s*{_WORD}", "not ", _IS_MISSING),
        (rf"{_NAME}\s+(?:is\s+)?in\s*{_WORDS}", "", _ONE_TERM),
        (rf"{_NAME}\s+(?:is\s+)?not\s+in\s*{_WORDS}", "not ", _ONE_TERM),
    )
)
"""Forms of a variable with its terms: each with its hedge and its mistake; the first form is right."""

_EXPRESSIONS = tuple(
    (re.compile(pattern, _FLAGS), replacement)
    for pattern, replacement in (
        (r"(\w+)\s+is\s+between\s+(.+?)\s+and\s+(.+)", r"\2 <= \1 <= \3"),
        (r"\bis\s+(?:less|smaller|lower|below|under)(?:\s+than)?\b", "<"),
        (r"\bis\s+(?:more|greater|larger|higher|above|over)(?:\s+than)?\b", ">"),
        (r"\bis\s+(?=[<>=!]|in\b)", ""),
        (r"\bis\s+(?=-?\d)|(?<![<>=!])=(?!=)", "=="),
    )
)
"""Forms that neither rules nor expressions have, and how they are written in expressions."""

_DURATION = re.compile(r"(?P<held>.+?)\s+(?P<duration>for(?:\s+(?P<time>[0-9.]+\s*(?:ms|s|min|h)))?\b.*)", _FLAGS)
_EXPRESSION_AND_TERM = re.compile(rf"(?P<expression>.+?)(?:\s+is\s+{_HEDGES}(?P<term>[A-Za-z]\w*))?", _FLAGS)
_NUMBERS = {
    "distance": ("type: float, unit: m, range: [0, 10], ", ", resolution: 10 cm", "close", "ramp 2 1"),
    "count": ("type: int, range: [0, 10], ", "", "many", "ramp 0 3"),
}
"""For functions whose value is a number: keys of a variable with this value, and a term with its shape."""

_CONCLUSION = re.compile(
    rf"\s*(?:(?P<name>(?!(?:{_HEDGE})\b)\w+)\s*(?P<sign>==?|:|\bis\b|\s)\s*)?{_HEDGES}(?P<term>[^\s(),]+)"
    r"(?:\s+with\s+[^\s(),]+)?(?:\s*(?P<rest>(?:,|\b(?:and|or|else)\b).*))?\s*",
    _FLAGS,
)


@dataclass(frozen=True, slots=True)
class RuleText:
    """The text of a rule, and the names that the rule can use."""

    text: str
    names: RuleNames

    def parts(self) -> Iterator[tuple[int, list[Mistake]]]:
        """Yield, for each part of the rule, the offset of its end and the mistakes in it."""
        opening = _OPENING.match(self.text)
        if opening is None:
            return
        start, mistakes = opening.end(), list[Mistake]()
        if opening["word"] != "if":
            message = f"a rule begins with 'if', not with '{opening['word']}'"
            mistakes = [Mistake(*opening.span("word"), message, "write 'if' instead")]
        for match in _JOINT.finditer(self.text, start):
            joint = match["joint"]
            if joint is None:
                continue
            mistakes += self._clause(start, match.start())
            if joint in _OTHER_JOINTS:
                help = f"write {_OTHER_JOINTS[joint]} instead"
                mistakes.append(Mistake(*match.span(), f"'{joint}' does not join conditions", help))
            yield match.end(), mistakes
            start, mistakes = match.end(), []
            if joint == "then":
                yield len(self.text), list(self._conclusion(start))
                return
        yield len(self.text), [*mistakes, *self._clause(start, len(self.text))]

    def _conclusion(self, start: int) -> Iterator[Mistake]:
        conclusion = _CONCLUSION.fullmatch(self.text, start)
        if conclusion is None or conclusion["name"] in self.names.conclusions:
            return
        name, term, own = conclusion["name"], conclusion["term"], self.names.output.name
        if name is not None and name not in self.names.outputs:
            yield Mistake(*conclusion.span("name"), *self.names.unknown_conclusion(name), is_unknown_name=True)
        elif name is not None and name != own:
            message, help = f"a rule of '{own}' concludes only terms of '{own}'", f"write the rule under '{name}'"
            yield Mistake(conclusion.start("name"), conclusion.end("term"), message, help)
        elif name is not None and conclusion["sign"] != "is":
            message, help = "a conclusion is a term", f"write 'then {term}' or 'then {own} is {term}'"
            yield Mistake(conclusion.start("name"), conclusion.end("term"), message, help)
        elif term not in self.names.conclusions:
            yield Mistake(*conclusion.span("term"), *self.names.unknown_conclusion(term), is_unknown_name=True)
        if conclusion["rest"]:
            help = "write a rule of its own for the other conclusion"
            yield Mistake(*conclusion.span("rest"), "a rule has one conclusion", help)

    def _clause(self, start: int, end: int) -> Iterator[Mistake]:
        start, end = self._inside_parentheses(start, end)
        if held := _DURATION.fullmatch(self.text, start, end):
            yield self._duration(held)
            return
        for form, hedge, message in _DESCRIPTIONS:
            if described := form.fullmatch(self.text, start, end):
                yield from self._description(described, hedge, message)
                return
        if start < end:
            yield from self._expression(start, end)

    def _inside_parentheses(self, start: int, end: int) -> tuple[int, int]:
        """Return a range without the blanks around its text, and without parentheses that enclose it or other parts."""
        inside = self.text[start:end].strip(_BLANKS_AND_PARENTHESES)
        inside_start, surplus = self.text.index(inside, start), inside.count("(") - inside.count(")")
        start = max(start, inside_start + min(0, surplus))
        return start, min(end, inside_start + len(inside) + max(0, surplus))

    def _duration(self, held: re.Match[str]) -> Mistake:
        """Return the mistake of `DESCRIPTION for 5 s`."""
        variable = held["held"] if self.names.is_bool(held["held"]) else "BOOL"
        help = _declaration(f"type: bool, held: {variable}, for: {held['time'] or '5 s'}", "true")
        help += "; BOOL is a bool with a condition under 'derived'" if variable == "BOOL" else ""
        return Mistake(*held.span("duration"), "a rule cannot state for how long something holds", help)

    def _description(self, match: re.Match[str], hedge: str, message: str) -> Iterator[Mistake]:
        """Yield the mistake in a description of a variable by terms; the message is empty for the form of rules."""
        names, name, words = self.names, match["name"], match.groupdict().get("words") or ""
        if name not in names.variables:
            yield Mistake(*match.span("name"), *names.unknown_variable(name), is_unknown_name=True)
            return
        terms = [names.intended_term(name, word.strip()) for word in words.split(",")] if words else []
        if None in terms or (words and not message and terms != [words]):
            related = (Related("declared here", names.variables[name].place),)
            yield Mistake(*match.span("words"), *names.unknown_term(name, words), is_unknown_name=True, related=related)
        elif message:
            operator = " and " if hedge else " or "
            intended_text = operator.join(f"{name} is {hedge}{term}" for term in terms) or names.example(name, hedge)
            help = f"write '({intended_text})'" if len(terms) > 1 else f"write '{intended_text}'"
            yield Mistake(*match.span(), message.format(name=name), help)

    def _expression(self, start: int, end: int) -> Iterator[Mistake]:
        """Yield the mistake of `gap < 2 m`, of `min(gap, 2 m) is close`, and of other expressions."""
        clause = _EXPRESSION_AND_TERM.fullmatch(self.text, start, end)
        assert clause is not None
        expression, span = clause["expression"], clause.span("expression")
        for form, replacement in _EXPRESSIONS:
            expression = form.sub(replacement, expression)
        tree = parse_derivation(expression)
        words = expression.split()[:1]
        if isinstance(tree, Node):
            words = [name.name for name in names_in(tree) if name.pose_comparison is None]
        unknown_name = next((word for word in words if is_name(word) and word not in self.names.variables), None)
        if unknown_name is not None:
            place = re.compile(rf"\b{unknown_name}\b", re.ASCII).search(self.text, start)
            name_span = span if place is None else place.span()
            yield Mistake(*name_span, *self.names.unknown_variable(unknown_name), is_unknown_name=True)
        elif isinstance(tree, Compare | In) and len(set(words)) == 1:
            yield Mistake(*span, f"a rule describes '{words[0]}' by a term", self._comparison_help(tree, words[0]))
        elif isinstance(tree, Node):
            message = f"a rule reads variables, not '{clause['expression']}'"
            yield Mistake(*span, message, _declaration_help(tree, clause["term"]))
        elif expression.startswith("not"):
            yield Mistake(*span, _NOT_BEFORE_TERM, "write 'VARIABLE is not TERM'")

    def _comparison_help(self, tree: Compare | In, name: str) -> str:
        """Return the help for a comparison of a variable with numbers."""
        variable, description = self.names.variables[name], f"'{self.names.example(name)}'"
        help = f"write for example {description}, with a term of '{name}'"
        if not self.names.terms(name):
            help = f"add 'terms' to '{name}', and write {description}"
        if variable.type.kind not in (Kind.INT, Kind.FLOAT) or variable.is_derived:
            return help
        return (
            f"{help}; or {_declaration_help(map_parts(tree, lambda part: _with_unit(part, variable.type.unit)), None)}"
        )


def _with_unit(part: Node, unit: str | None) -> Node:
    return replace(part, unit=unit) if isinstance(part, Number) and part.unit is None else part


def _declaration_help(tree: Node, term: str | None) -> str:
    """Return the help for an expression that must be declared as a variable, so that a rule can state a term of it."""
    expression, function = to_text(tree), reads_of(tree.name)[0] if isinstance(tree, Name) else ""
    if function in _NUMBERS:
        before, after, example_term, shape = _NUMBERS[function]
        term = term or example_term
        return _declaration(f"{before}derived: {_in_braces(expression)}{after}, terms: {{{term}: {shape}}}", term)
    value = tree.otherwise if isinstance(tree, Fallback) else tree
    if isinstance(value, Arithmetic | Number) or term not in (None, "true", "false"):
        declaration = f"declare a number NAME with 'derived: {expression}', 'range' and 'terms' in 'context'"
        return f"{declaration}, and write 'NAME is {term or 'TERM'}'"
    return _declaration(f"type: bool, derived: {_in_braces(expression)}", "true")


def _declaration(keys: str, term: str) -> str:
    return f"declare 'NAME: {{{keys}}}' in 'context', and write 'NAME is {term}'"


def _in_braces(expression: str) -> str:
    """Return an expression as a value in braces."""
    if "," not in expression and expression[0] not in "\"'":
        return expression
    return quote_text(expression) if '"' in expression else f'"{expression}"'
