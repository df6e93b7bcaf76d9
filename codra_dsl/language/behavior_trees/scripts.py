"""Parse scripts of BehaviorTree.CPP: text -> syntax trees of the condition language, and assignments with such trees.

The operators, from loosest to tightest binding: `a ? b : c`, `||` or `&&`, comparisons, `+ -`, `* /`, then `! -`.
Comparisons form chains. Operations that the condition language does not have, such as those on bits, are refused with
their place.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable

from codra_dsl.language.expression.tree import (
    And,
    Arithmetic,
    Choice,
    Compare,
    Comparison,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
)
from codra_dsl.language.frozen import dataclass

MAX_DEPTH = 40
"""The maximum nesting depth of a script."""

MAX_STATEMENTS = 100

_TOKEN = re.compile(
    r"""(?P<blank>\s+)
    |(?P<number>0[xX][0-9a-fA-F]+|(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)
    |(?P<text>'[^']*')
    |(?P<name>[A-Za-z_@][A-Za-z0-9_]*)
    |(?P<symbol>:=|\.\.|\+=|-=|\*=|/=|==|!=|<=|>=|&&|\|\||[-+*/<>=!?:;()&|^~])""",
    re.VERBOSE,
)
_ASSIGNMENTS = frozenset({":=", "=", "+=", "-=", "*=", "/="})
_LOGICAL_OPERATORS = frozenset({"&&", "||"})
_COMPARISONS = frozenset(Comparison)
_BIT_OPERATORS = frozenset({"&", "|", "^", "~"})
_MAX_NUMBER_LETTERS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """A statement: `entry := value`, which also creates the entry, or `entry = value` if `creates` is false."""

    entry: str
    value: Node
    creates: bool


@dataclass(frozen=True, slots=True)
class ScriptProblem:
    """Why a script cannot be compiled; `start` and `end` are offsets in its text."""

    rule: str
    message: str
    help: str
    start: int
    end: int


class _ScriptError(Exception):
    def __init__(self, problem: ScriptProblem) -> None:
        super().__init__(problem.message)
        self.problem = problem


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    start: int
    end: int


def parse_condition(text: str) -> Node | ScriptProblem:
    """Return the syntax tree of a script that is a condition, or its problem. This function never raises."""
    try:
        return _Parser(_tokens(text)).condition()
    except _ScriptError as error:
        return error.problem


def parse_script(text: str) -> tuple[Statement, ...] | ScriptProblem:
    """Return the statements of a script that writes entries, or its problem. This function never raises."""
    try:
        return _Parser(_tokens(text)).statements()
    except _ScriptError as error:
        return error.problem


def _tokens(text: str) -> list[_Token]:
    tokens: list[_Token] = []
    position = 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            help_text = "put texts between '...'" if text[position] in "\"'" else "remove it"
            raise _script_error(f"unexpected {text[position]!r} in a script", position, position + 1, help_text)
        kind = str(match.lastgroup)
        if kind != "blank":
            tokens.append(_Token(kind, match[0], position, match.end()))
        position = match.end()
    tokens.append(_Token("end", "", len(text), len(text)))
    return tokens


def _script_error(message: str, start: int, end: int, help_text: str, rule: str = "script-syntax") -> _ScriptError:
    return _ScriptError(ScriptProblem(rule, message, help_text, start, end))


class _Parser:
    """Reads one script."""

    def __init__(self, tokens: list[_Token]) -> None:
        self._tokens = tokens
        self._position = 0
        self._depth = 0

    def condition(self) -> Node:
        """Return the complete text as a condition."""
        node = self._choice()
        token = self._next_token
        if token.text in _ASSIGNMENTS:
            raise _script_error(
                "a condition cannot assign",
                token.start,
                token.end,
                "write '==' to compare",
                "script-unsupported",
            )
        if token.kind != "end":
            raise self._unexpected_token_error()
        return node

    def statements(self) -> tuple[Statement, ...]:
        """Return the complete text as statements."""
        statements: list[Statement] = []
        while self._next_token.kind != "end":
            statements.append(self._statement())
            if len(statements) > MAX_STATEMENTS:
                help_text = "make it an action of the robot"
                raise _script_error(f"more than {MAX_STATEMENTS} statements", 0, 1, help_text, "script-unsupported")
            if self._next_token.text == ";":
                self._take()
            elif self._next_token.kind != "end":
                raise self._unexpected_token_error()
        if not statements:
            raise _script_error(
                "the script is empty", 0, self._next_token.end, "write a statement such as done := true"
            )
        return tuple(statements)

    @property
    def _next_token(self) -> _Token:
        return self._tokens[self._position]

    def _take(self) -> _Token:
        token = self._tokens[self._position]
        self._position += token.kind != "end"
        return token

    def _statement(self) -> Statement:
        first = self._take()
        sign = self._take()
        if first.kind != "name" or first.text in ("true", "false") or sign.text not in _ASSIGNMENTS:
            raise _script_error(
                "a statement assigns to an entry",
                first.start,
                max(first.end, first.start + 1),
                "write entry := value; use a condition to only read an entry",
                "script-unsupported",
            )
        value = self._choice()
        if len(sign.text) == 2 and sign.text != ":=":
            entry = Name(start=first.start, end=first.end, name=first.text)
            value = Arithmetic(start=first.start, end=value.end, operator=sign.text[0], left=entry, right=value)
        return Statement(entry=first.text, value=value, creates=sign.text == ":=")

    def _choice(self) -> Node:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            token = self._next_token
            raise _script_error(
                "the script is nested too deeply", token.start, token.end, "split it", "script-unsupported"
            )
        condition = self._logical_expression()
        if self._next_token.text == "?":
            self._take()
            then = self._choice()
            self._expect(":")
            otherwise = self._choice()
            condition = Choice(
                start=condition.start, end=otherwise.end, then=then, condition=condition, otherwise=otherwise
            )
        self._depth -= 1
        return condition

    def _logical_expression(self) -> Node:
        """Read operands joined by `&&` or by `||`.

        The two operators cannot be mixed, because the library evaluates both of them from left to right.
        """
        operands = [self._comparison()]
        operator = self._next_token.text
        while self._next_token.text in _LOGICAL_OPERATORS:
            token = self._next_token
            if token.text != operator:
                message = "'&&' and '||' side by side are evaluated from left to right, not as in C"
                help_text = "group them with parentheses"
                raise _script_error(message, token.start, token.end, help_text, "script-unsupported")
            self._take()
            operands.append(self._comparison())
        if len(operands) == 1:
            return operands[0]
        kind = And if operator == "&&" else Or
        return kind(start=operands[0].start, end=operands[-1].end, operands=tuple(operands))

    def _comparison(self) -> Node:
        first = self._arithmetic_chain(("+", "-"), lambda: self._arithmetic_chain(("*", "/"), self._unary_expression))
        rest: list[tuple[Comparison, Node]] = []
        while self._next_token.text in _COMPARISONS:
            operator = Comparison(self._take().text)
            rest.append(
                (
                    operator,
                    self._arithmetic_chain(
                        ("+", "-"), lambda: self._arithmetic_chain(("*", "/"), self._unary_expression)
                    ),
                )
            )
        return Compare(start=first.start, end=rest[-1][1].end, first=first, rest=tuple(rest)) if rest else first

    def _arithmetic_chain(self, operators: Iterable[str], read_operand: Callable[[], Node]) -> Node:
        left = read_operand()
        operator_count = 0
        while self._next_token.text in operators:
            operator = self._take().text
            right = read_operand()
            left = Arithmetic(start=left.start, end=right.end, operator=operator, left=left, right=right)
            operator_count += 1
            if operator_count > MAX_DEPTH:
                raise _script_error("the script is too long", left.start, left.end, "split it", "script-unsupported")
        return left

    def _unary_expression(self) -> Node:
        """Read signs and their operand."""
        signs: list[_Token] = []
        while self._next_token.text in ("!", "-"):
            signs.append(self._take())
        if len(signs) > MAX_DEPTH:
            raise _script_error("the script is nested too deeply", signs[0].start, signs[0].end, "remove signs")
        node = self._operand()
        for sign in reversed(signs):
            kind = Not if sign.text == "!" else Negative
            node = kind(start=sign.start, end=node.end, operand=node)
        return node

    def _operand(self) -> Node:
        token = self._take()
        start, end = token.start, token.end
        if token.kind == "number":
            return Number(start=start, end=end, value=_number(token), unit=None)
        if token.kind == "text":
            return Text(start=start, end=end, value=token.text[1:-1])
        if token.text in ("true", "false"):
            return Truth(start=start, end=end, value=token.text == "true")
        if token.kind == "name":
            return Name(start=start, end=end, name=token.text)
        if token.text == "(":
            node = self._choice()
            self._expect(")")
            return node
        self._position -= token.kind != "end"
        raise self._unexpected_token_error()

    def _expect(self, sign: str) -> None:
        if self._next_token.text != sign:
            raise self._unexpected_token_error()
        self._take()

    def _unexpected_token_error(self) -> _ScriptError:
        token = self._next_token
        if token.kind == "end":
            return _script_error("the script ends too early", max(token.start - 1, 0), token.end, "complete it")
        if token.text in _BIT_OPERATORS:
            help_text = "use &&, || and !, or compute it in an action of the robot"
            message = f"'{token.text}' works on bits, which conditions do not support"
            return _script_error(message, token.start, token.end, help_text, "script-unsupported")
        if token.text == "..":
            return _script_error("'..' joins texts", token.start, token.end, "write '+'", "script-unsupported")
        return _script_error(f"unexpected {token.text!r}", token.start, token.end, "remove it, or add an operator")


def _number(token: _Token) -> int | float:
    text = token.text
    if len(text) > _MAX_NUMBER_LETTERS:
        raise _script_error("the number is too long", token.start, token.end, "shorten it", "script-unsupported")
    if text[:2].lower() == "0x":
        return int(text, 16)
    value = int(text) if text.isdigit() else float(text)
    if math.isinf(value):
        raise _script_error(
            "the number is too large", token.start, token.end, "write a smaller one", "script-unsupported"
        )
    return value
