"""Forms of other languages in fuzzy rules, such as `if gap < 2 m then low`, with the form that rules have.

A rule describes variables by terms. Everything else, such as a comparison, a distance or a duration, is declared as a
variable, which the rule then reads.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.traps import quote_text
from codra_dsl.language.model import Kind, Variable

MAX_WORD_LENGTH = 200
"""The maximum length of the words of a rule that are read."""

_OPERATORS = "<=|>=|==|!=|<|>|="
_OPERAND = r"(?P<operand>[^()]{1,200}?)(?=\s+(?:and|or|then|for)\b|\s*\)|$)"
_CALL = re.compile(r"(?P<function>distance|in_view|count|exists|known|age|abs|min|max)\s*\([^()]*\)", re.ASCII)
_COMPARED = re.compile(rf"\s*(?P<operator>{_OPERATORS})\s*{_OPERAND}", re.ASCII)
_COMPARISON = re.compile(
    rf"(?P<name>\w+)(?:\s*(?:\bis\s+)?(?P<operator>{_OPERATORS})\s*|\s+is\s+(?=[0-9])){_OPERAND}", re.ASCII
)
_CHOICE = re.compile(r"(?P<name>\w+)\s+(?:is\s+)?in\s*\((?P<values>[^()]*)\)", re.ASCII)
_NEGATION = re.compile(r"not\b(?:\s+(?P<name>\w+)(?:\s+is\s+(?P<term>\w+))?)?", re.ASCII)
_IS = re.compile(r"\bis\s+$")
_DURATION = re.compile(r"for\s+(?P<time>[0-9.]+\s*(?:ms|s|min|h)\b)", re.ASCII)
_DESCRIPTION = re.compile(r"(?P<name>\w+)(?:\s+is(?:\s+(?!and\b|or\b)\w+){1,3})?\s*$", re.ASCII)
_TERM = re.compile(r"\s+is\s+(?:not\s+)?(?P<term>\w+)", re.ASCII)
_CONCLUSION = re.compile(r"(?P<name>\w+)\s*(?:==?|:|\bis\b|\s)\s*(?P<term>\w+)", re.ASCII)
_LAST_WORD = re.compile(r"[^\s()]+(?:\s+is)?\s*$")
_NUMBER = re.compile(r"-?[0-9.]+")
_THEN = re.compile(r"\bthen\b")
_WORDS_AFTER_CONDITION = ("then", "and", "or", ")", "")
_LOGIC = {"&&": "and", "&": "and", "||": "or", "|": "or"}
_ARITHMETIC = ("else", "+", "-", "*", "/")
_NUMBERS = {
    "distance": ("type: float, unit: m, range: [0, 10], ", ", resolution: 10 cm", "close", "ramp 2 1"),
    "count": ("type: int, range: [0, 10], ", "", "many", "ramp 0 3"),
}
"""For functions whose value is a number: keys of a variable with this value, and a term with its shape."""


@dataclass(frozen=True, slots=True)
class OtherForm:
    """A part of a rule that has the form of another language; `start` and `end` are offsets in the rule's text."""

    start: int
    end: int
    message: str
    help: str


@dataclass(frozen=True, slots=True)
class RuleText:
    """The text of a rule.

    Attributes:
        output: the metric or action of the rule.
        outputs: all metrics and actions.
        variables: the variables that the rule can read.
        terms: the terms of these variables.
    """

    text: str
    output: str
    outputs: Collection[str]
    variables: Mapping[str, Variable]
    terms: Mapping[str, Sequence[str]]

    def other_form(self, offset: int) -> OtherForm | None:
        """Return the form of another language that explains why the rule cannot be read at an offset, or None."""
        if _THEN.search(self.text[:offset]):
            return self._conclusion(offset)
        last_word = self._before(_LAST_WORD, offset)
        starts = [offset] if last_word is None else [offset, last_word.start()]
        finders = (self._call, self._comparison, self._choice, self._negation)
        forms = [find(start) for start in starts for find in finders]
        forms += [find(offset) for find in (self._opening, self._duration, self._operation, self._bare_name)]
        return next((form for form in forms if form is not None), None)

    def _before(self, pattern: re.Pattern[str], offset: int) -> re.Match[str] | None:
        """Return the match of a pattern that ends at an offset; longer words than MAX_WORD_LENGTH are cut."""
        return pattern.search(self.text, max(0, offset - MAX_WORD_LENGTH), offset)

    def _word(self, offset: int) -> str:
        return (self.text[offset : offset + MAX_WORD_LENGTH].split(maxsplit=1) or [""])[0]

    def _conclusion(self, offset: int) -> OtherForm | None:
        word, last_word = self._word(offset), self._before(_LAST_WORD, offset)
        start = offset if last_word is None or last_word[0].split()[0] == "then" else last_word.start()
        conclusion = _CONCLUSION.match(self.text, start)
        if word in ("and", "else") or word.endswith(","):
            help = "write a rule of its own for the other conclusion"
            return OtherForm(offset, offset + len(word), "a rule has one conclusion", help)
        if conclusion is None or conclusion["name"] not in self.outputs:
            return None
        message, is_own = "a rule concludes a term of its own metric or action", conclusion["name"] == self.output
        help = f"write 'then {conclusion['term']}'" if is_own else f"write the rule under '{conclusion['name']}'"
        return OtherForm(*conclusion.span(), message, help)

    def _call(self, start: int) -> OtherForm | None:
        call = _CALL.match(self.text, start)
        if call is None:
            return None
        compared, term = _COMPARED.match(self.text, call.end()), _TERM.match(self.text, call.end())
        end = call.end() if compared is None else compared.end()
        is_number = compared is None and call["function"] in (*_NUMBERS, "age", "abs", "min", "max")
        help = (
            _derived_number_help(call["function"], call[0], None if term is None else term["term"])
            if is_number
            else _derived_bool_help(self.text[start:end])
        )
        return OtherForm(start, end, f"a rule reads variables, not '{self.text[start:end]}'", help)

    def _comparison(self, start: int) -> OtherForm | None:
        comparison = _COMPARISON.match(self.text, start)
        variable = None if comparison is None else self.variables.get(comparison["name"])
        if comparison is None or variable is None:
            return None
        name, operator, operand = comparison["name"], comparison["operator"] or "==", comparison["operand"]
        value = operand.strip("\"'")
        value = value.lower() if variable.type.kind is Kind.BOOL else value
        if value in self.terms[name] or variable.type.kind in (Kind.BOOL, Kind.ENUM):
            negation = "not " if operator == "!=" else ""
            help = f"write '{name} is {negation}{value if value in self.terms[name] else self._term(name)}'"
        else:
            help = f"write for example '{self._described(name)}', with a term of '{name}'"
            if not self.terms[name]:
                help = f"add 'terms' to '{name}', and write '{self._described(name)}'"
            if not variable.is_derived:
                unit_text = f" {variable.type.unit}" if variable.type.unit and _NUMBER.fullmatch(operand) else ""
                limit = f"{name} {'==' if operator == '=' else operator} {operand}{unit_text}"
                help += f"; or {_derived_bool_help(limit)}"
        return OtherForm(*comparison.span(), f"a rule cannot compare '{name}' with '{operator}'", help)

    def _choice(self, start: int) -> OtherForm | None:
        choice = _CHOICE.match(self.text, start)
        if choice is None:
            return None
        values = [value.strip(" \"'") for value in choice["values"].split(",")]
        meant = " or ".join(f"{choice['name']} is {value}" for value in values)
        return OtherForm(*choice.span(), "a rule has no 'in'", f"write '({meant})'")

    def _negation(self, start: int) -> OtherForm | None:
        negation = _NEGATION.match(self.text, start)
        if negation is None or self._before(_IS, start):
            return None
        name, term = negation["name"] or "VARIABLE", negation["term"]
        is_bool = name in self.variables and self.variables[name].type.kind is Kind.BOOL
        meant = f"{name} is false" if is_bool and term is None else f"{name} is not {term or self._term(name)}"
        return OtherForm(*negation.span(), "'not' stands before a term", f"write '{meant}'")

    def _opening(self, offset: int) -> OtherForm | None:
        word = self._word(offset)
        is_synonym = not self.text[:offset].strip() and word != "if" and word.lower() in ("if", "when", "while")
        return (
            OtherForm(offset, offset + len(word), f"a rule begins with 'if', not with '{word}'", "write 'if' instead")
            if is_synonym
            else None
        )

    def _duration(self, offset: int) -> OtherForm | None:
        if self._word(offset) != "for":
            return None
        duration, described = _DURATION.match(self.text, offset), self._before(_DESCRIPTION, offset)
        variable = None if described is None else self.variables.get(described["name"])
        is_bool = variable is not None and variable.type.kind is Kind.BOOL
        held = variable.name if variable is not None and is_bool else "BOOL"
        time = "5 s" if duration is None else duration["time"]
        help = f"declare 'NAME: {{type: bool, held: {held}, for: {time}}}' in 'context', and write 'NAME is true'"
        if not is_bool:
            help += "; BOOL is a bool with a condition under 'derived'"
        end = offset + len("for") if duration is None else duration.end()
        return OtherForm(offset, end, "a rule cannot state for how long something holds", help)

    def _operation(self, offset: int) -> OtherForm | None:
        word = self._word(offset)
        if word in _LOGIC:
            return OtherForm(offset, offset + len(word), f"'{word}' is not an operator", f"write '{_LOGIC[word]}'")
        if word.endswith(",") and len(word) > 1:
            return OtherForm(offset, offset + len(word), "',' does not join conditions", "write 'and' or 'or' instead")
        if word not in _ARITHMETIC:
            return None
        opening, closing = self.text.rfind("(", 0, offset), self.text.find(")", offset)
        start, end = (opening, closing + 1) if opening >= 0 and closing >= 0 else (offset, offset + len(word))
        expression = self.text[start + 1 : end - 1] if end - start > len(word) else "EXPRESSION"
        help = _derived_number_help("", expression, None)
        return OtherForm(start, end, "a rule reads variables, not expressions", help)

    def _bare_name(self, offset: int) -> OtherForm | None:
        word = self._before(_LAST_WORD, offset)
        name = "" if word is None else word[0].strip()
        if word is None or name not in self.variables or self._word(offset) not in _WORDS_AFTER_CONDITION:
            return None
        is_bool = self.variables[name].type.kind is Kind.BOOL
        meant = f"{name} is true" if is_bool else self._described(name)
        message = f"a rule needs a term of '{name}'"
        return OtherForm(word.start(), word.start() + len(name), message, f"write '{meant}'")

    def _described(self, name: str) -> str:
        return f"{name} is {self._term(name)}"

    def _term(self, name: str) -> str:
        return next(iter(self.terms.get(name, ())), "TERM")


def _derived_number_help(function: str, expression: str, term: str | None) -> str:
    if function not in _NUMBERS:
        declaration = f"declare a number NAME with 'derived: {expression}', 'range' and 'terms'"
        return f"{declaration} in 'context', and write 'NAME is {term or 'TERM'}'"
    before, after, example_term, shape = _NUMBERS[function]
    term = term or example_term
    declaration = f"NAME: {{{before}derived: {_in_braces(expression)}{after}, terms: {{{term}: {shape}}}}}"
    return f"declare '{declaration}' in 'context', and write 'NAME is {term}'"


def _derived_bool_help(expression: str) -> str:
    declaration = f"NAME: {{type: bool, derived: {_in_braces(expression)}}}"
    return f"declare '{declaration}' in 'context', and write 'NAME is true'"


def _in_braces(expression: str) -> str:
    """Return an expression as a value in braces."""
    if "," not in expression and expression[0] not in "\"'":
        return expression
    return quote_text(expression) if '"' in expression else f'"{expression}"'
