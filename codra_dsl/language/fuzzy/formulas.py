"""Formulas of `Function` terms: text -> tree, with FuzzyLite's precedences."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import Call, Formula, Name, Number
from codra_dsl.language.fuzzy.source import Findings, Word, shown, split

MAX_TOKENS = 500
"""The maximum number of words, numbers and signs in a formula."""


@dataclass(frozen=True, slots=True)
class Operator:
    """How an operator binds: an operator with a higher precedence binds tighter."""

    operands: int
    precedence: int
    is_right_associative: bool = False


OPERATORS: Mapping[str, Operator] = MappingProxyType(
    {
        "!": Operator(1, 100, is_right_associative=True),
        "~": Operator(1, 100, is_right_associative=True),
        "^": Operator(2, 90, is_right_associative=True),
        "**": Operator(2, 90, is_right_associative=True),
        ".-": Operator(1, 90, is_right_associative=True),
        ".+": Operator(1, 90, is_right_associative=True),
        "*": Operator(2, 80),
        "/": Operator(2, 80),
        "%": Operator(2, 80),
        "+": Operator(2, 70),
        "-": Operator(2, 70),
        "and": Operator(2, 60),
        "or": Operator(2, 50),
    }
)
"""The operators of formulas. A minus sign before a number is written as `~` or `.-`."""

_UNARY_FUNCTIONS = (
    "acos asin atan ceil cos cosh exp abs fabs floor log log10 round sin sinh sqrt tan tanh log1p acosh asinh atanh"
)
_BINARY_FUNCTIONS = "gt ge eq neq le lt min max pow atan2 fmod"
FUNCTIONS: Mapping[str, int] = MappingProxyType(
    {"pi": 0} | dict.fromkeys(_UNARY_FUNCTIONS.split(), 1) | dict.fromkeys(_BINARY_FUNCTIONS.split(), 2)
)
"""The functions of formulas, each with its number of operands."""

_TOKEN = r"\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?|\*\*|\.-|\.\+|[!~^*/%+\-(),]|\w+|\S"
MAX_DEPTH = 40
"""The maximum nesting depth of a formula."""

_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf", re.ASCII)
_TIGHTEST = 100


def parse_formula(word: Word, findings: Findings) -> Formula | None:
    """Return the tree of a formula, or None after a finding."""
    tokens = list(split(word, _TOKEN))
    if len(tokens) > MAX_TOKENS:
        findings.add("fll-too-large", f"a formula of more than {MAX_TOKENS} parts", word.place, "split it")
        return None
    postfix = _postfix(tokens, findings)
    return None if postfix is None else _tree(word, postfix, findings)


def _postfix(tokens: list[Word], findings: Findings) -> list[Word] | None:
    """Return the tokens in postfix order (Dijkstra's shunting yard)."""
    output: list[Word] = []
    stack: list[Word] = []
    for token in tokens:
        if token.text in FUNCTIONS or token.text == "(":
            stack.append(token)
        elif token.text in OPERATORS:
            while stack and _binds_before(stack[-1].text, OPERATORS[token.text]):
                output.append(stack.pop())
            stack.append(token)
        elif token.text in (",", ")"):
            if not _close_parenthesis(token, output, stack):
                _report_unmatched_parenthesis(token, findings)
                return None
        else:
            output.append(token)
    open_parenthesis = next((token for token in stack if token.text == "("), None)
    if open_parenthesis:
        _report_unmatched_parenthesis(open_parenthesis, findings)
        return None
    return [*output, *reversed(stack)]


def _binds_before(top: str, operator: Operator) -> bool:
    if top == "(":
        return False
    precedence = OPERATORS[top].precedence if top in OPERATORS else _TIGHTEST
    return precedence > operator.precedence or (precedence == operator.precedence and not operator.is_right_associative)


def _close_parenthesis(token: Word, output: list[Word], stack: list[Word]) -> bool:
    while stack and stack[-1].text != "(":
        output.append(stack.pop())
    if not stack:
        return False
    if token.text == ")":
        stack.pop()
        if stack and stack[-1].text in FUNCTIONS:
            output.append(stack.pop())
    return True


def _report_unmatched_parenthesis(token: Word, findings: Findings) -> None:
    findings.add("fll-wrong-formula", f"{shown(token.text)} is unmatched", token.place, "match each parenthesis")


def _tree(word: Word, postfix: list[Word], findings: Findings) -> Formula | None:
    stack: list[tuple[Formula, int]] = []
    for token in postfix:
        operand_count = FUNCTIONS.get(token.text) if token.text in FUNCTIONS else None
        if token.text in OPERATORS:
            operand_count = OPERATORS[token.text].operands
        if operand_count is None:
            leaf = _leaf(token, findings)
            if leaf is None:
                return None
            stack.append((leaf, 1))
            continue
        if operand_count > len(stack):
            help = f"it takes {operand_count} operands; write a minus before a number as '~' or '.-'"
            findings.add("fll-wrong-formula", f"{shown(token.text)} lacks operands", token.place, help)
            return None
        operands = stack[len(stack) - operand_count :]
        depth = 1 + max((operand_depth for _, operand_depth in operands), default=0)
        if depth > MAX_DEPTH:
            findings.add("fll-too-large", f"a formula nested deeper than {MAX_DEPTH}", word.place, "split it")
            return None
        stack[len(stack) - operand_count :] = [(Call(token.text, tuple(operand for operand, _ in operands)), depth)]
    if len(stack) != 1:
        findings.add(
            "fll-wrong-formula", "this is not one formula", word.place, "join the parts of the formula by operators"
        )
        return None
    return stack[0][0]


def _leaf(token: Word, findings: Findings) -> Formula | None:
    if _NUMBER.fullmatch(token.text):
        return Number(float(token.text))
    if token.text.isidentifier():
        return Name(token.text)
    help = "write a number, x, or a variable of the engine"
    findings.add("fll-wrong-formula", f"{shown(token.text)} is not an operand", token.place, help)
    return None
