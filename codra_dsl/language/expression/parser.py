"""Tokens -> syntax tree, by precedence climbing.

The operators, from loosest to tightest binding: `A if C else B`, `or`, `and`, `not`, comparisons and `in`, `+ -`, `*
/`, sign. As in Python, comparisons form chains and `not` applies to a complete comparison.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import IntEnum

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.expression.fallbacks import intended_fallbacks
from codra_dsl.language.expression.tokens import (
    FUNCTIONS,
    WORDS,
    ExpressionError,
    SyntaxProblem,
    Token,
    TokenKind,
    is_name,
    shown,
    tokens,
)
from codra_dsl.language.expression.tree import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Comparison,
    Fallback,
    In,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
    parts,
)
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.units import parse_unit

MAX_DEPTH = 64
"""The maximum nesting depth of a condition."""


class Power(IntEnum):
    """The binding power of an operator: an operator with a larger power binds tighter."""

    CHOICE = 1
    OR = 2
    AND = 3
    NOT = 4
    COMPARE = 5
    SUM = 6
    PRODUCT = 7
    SIGN = 8


_COMPARISONS = frozenset(Comparison)
_POSE_FUNCTIONS = ("distance", "in_view")
_COUNTS = ("count", "exists")
_GRAPH_FUNCTIONS = (*_POSE_FUNCTIONS, *_COUNTS)
_FUNCTION_HELP = {
    "minimum": "did you mean 'min'?",
    "maximum": "did you mean 'max'?",
    "fabs": "did you mean 'abs'?",
    "unknown": "write not known(x)",
    "is_known": "did you mean 'known'?",
    "defined": "did you mean 'known'?",
    **dict.fromkeys(("default", "coalesce", "fallback"), "write x else y, in 'derived'"),
    **{
        name: f"{name}() is allowed only in 'observable_when', 'preview' and 'derived', in patterns of agents, and in"
        " 'always' and 'value' of adaptations"
        for name in _POSE_FUNCTIONS
    },
    **{
        name: f"{name}() is allowed only in 'derived': declare a derived variable, and read that variable here"
        for name in _COUNTS
    },
}


_CHOICE = re.compile(r"\s*if\b(?P<condition>.+?)\bthen\b(?P<then>.+?)\belse\b(?P<otherwise>.+)", re.DOTALL | re.ASCII)
"""The form of a choice in other languages."""

MAX_REWRITTEN_CHOICES = 8
"""The maximum number of choices of this form that the help rewrites."""

_OPERATOR_HELP = {
    "equals": "write '=='",
    "above": "write '>'",
    "over": "write '>'",
    "below": "write '<'",
    "under": "write '<'",
    **dict.fromkeys(("then", "when", "unless"), "write A if CONDITION else B"),
    "between": "write LOW <= x <= HIGH",
    "otherwise": "write 'else'",
    **dict.fromkeys(("becomes", "stays"), "write '=='; 'becomes' and 'stays' are allowed only in 'monitor'"),
    "within": "remove it: only 'becomes' in 'monitor' has a time limit",
}


def parse(text: str, *, allows_fallback: bool = False, reads_context: bool = False) -> Node | SyntaxProblem:
    """Return the tree of a condition, or the problem of an invalid text. This function never raises.

    Args:
        text: the condition.
        allows_fallback: whether `x else y` is allowed: the value y while x is unknown.
        reads_context: whether the condition reads context-variables; then the help of problems suggests variables.
    """
    if is_name(text):  # the most common form
        return Name(start=0, end=len(text), name=text)
    try:
        tree = _Parser(tokens(text)).parse()
    except ExpressionError as error:
        choice = _written_choice(text)
        is_choice = choice is not None and isinstance(parse(choice, allows_fallback=allows_fallback), Node)
        return replace(error.problem, help=f"write '{choice}'") if is_choice else error.problem
    if allows_fallback or "else" not in text:
        return tree
    start, end = next(intended_fallbacks(tree), (0, 0))
    return tree if start == end else _misplaced_fallback(text, start, end, reads_context)


def _written_choice(text: str) -> str | None:
    """Return `A if C else B` for a text `if C then A else B`, in which B can be such a text too."""
    choice = _CHOICE.fullmatch(text) if text.count("then") <= MAX_REWRITTEN_CHOICES else None
    if choice is None:
        return None
    condition, then, otherwise = (part.strip() for part in choice.groups())
    return f"{then} if {condition} else {_written_choice(otherwise) or otherwise}"


def _misplaced_fallback(text: str, start: int, end: int, reads_context: bool) -> SyntaxProblem:
    message = "'x else y' is allowed only in 'derived'"
    help_text = "remove 'else': while a returned value is absent, the result is rejected"
    if reads_context:
        before, after = text[:start], text[end:]
        is_in_parentheses = before.endswith("(") and after.startswith(")")
        rest = f"{before[:-1]}NAME{after[1:]}" if is_in_parentheses else f"{before}NAME{after}"
        help_text = f"declare in 'context' a variable NAME with 'derived: {text[start:end]}', and write '{rest}' here"
    return SyntaxProblem(message, start, end, help_text)


class _Parser:
    """Reads one condition.

    The text of a token is enough to recognise a word or a symbol: no name, number or quoted text is spelled like a word
    or a symbol.
    """

    def __init__(self, all_tokens: tuple[Token, ...]) -> None:
        self._tokens = all_tokens
        self._position = 0
        self._depth = 0

    def parse(self) -> Node:
        """Return the tree of all tokens."""
        if self._is_at_end():
            raise ExpressionError("the condition is empty", 0, self._next_token.end, "write a condition such as x > 3")
        node = self.expression(Power.CHOICE)
        if not self._is_at_end():
            raise self._unexpected_token_error()
        if _depth(node) > MAX_DEPTH:
            raise _too_deep_error(node.start, node.end)
        return node

    def expression(self, power: Power) -> Node:
        """Return the longest expression from the next token on. Its operators bind at least as tightly as `power`."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise _too_deep_error(self._next_token.start, self._next_token.end)
        node = self._operand(power)
        while (infix := self._infix()) is not None and infix.power >= power:
            node = infix.read(self, node)
        self._depth -= 1
        return node

    def choice(self, then: Node) -> Node:
        """Read `if C else B` after `A`."""
        opening = self._take()
        condition = self.expression(Power.OR)
        if self._next_token.text != "else":
            raise ExpressionError("'if' without 'else'", opening.start, opening.end, "write A if CONDITION else B")
        self._take()
        otherwise = self.expression(Power.CHOICE)
        return Choice(start=then.start, end=otherwise.end, then=then, condition=condition, otherwise=otherwise)

    def fallback(self, value: Node) -> Node:
        """Read `else B` after `A`."""
        self._take()
        otherwise = self.expression(Power.CHOICE)
        return Fallback(start=value.start, end=otherwise.end, value=value, otherwise=otherwise)

    def disjunction(self, first: Node) -> Node:
        """Read `or b or c` after `a`."""
        operands = self._operands(first, "or", Power.AND)
        return Or(start=first.start, end=operands[-1].end, operands=operands)

    def conjunction(self, first: Node) -> Node:
        """Read `and b and c` after `a`."""
        operands = self._operands(first, "and", Power.NOT)
        return And(start=first.start, end=operands[-1].end, operands=operands)

    def comparison(self, first: Node) -> Node:
        """Read `< b < c`, the links of a chain of comparisons, after `a`."""
        rest: list[tuple[Comparison, Node]] = []
        while self._next_token.text in _COMPARISONS:
            operator = Comparison(self._take().text)
            rest.append((operator, self.expression(Power.SUM)))
            if len(rest) > MAX_DEPTH:  # generated code joins the links by nested `&` operations
                raise _too_deep_error(first.start, rest[-1][1].end)
        if self._next_token.text in ("in", "not"):
            raise self._mixed_chain_error()
        return Compare(start=first.start, end=rest[-1][1].end, first=first, rest=tuple(rest))

    def membership(self, item: Node) -> Node:
        """Read `in (a, b)` or `not in (a, b)` after `x`."""
        negated = self._next_token.text == "not"
        if negated:
            self._take()
        self._take()
        if self._next_token.text != "(":
            token = self._next_token
            raise ExpressionError("a list is missing after 'in'", token.start, token.end, "write x in (1, 2) or x == 1")
        options, end = self._bracketed_expressions()
        if not options:
            raise ExpressionError(
                "the list after 'in' is empty", item.start, end, "list the allowed values: x in (1, 2)"
            )
        if self._next_token.text in _COMPARISONS:
            raise self._mixed_chain_error()
        return In(start=item.start, end=end, item=item, options=options, negated=negated)

    def arithmetic(self, left: Node) -> Node:
        """Read one `+ b`, `- b`, `* b` or `/ b` after `a`."""
        operator = self._take().text
        right = self.expression(Power.PRODUCT if operator in "+-" else Power.SIGN)
        return Arithmetic(start=left.start, end=right.end, operator=operator, left=left, right=right)

    @property
    def _next_token(self) -> Token:
        return self._tokens[self._position]

    def _is_at_end(self) -> bool:
        return self._next_token.kind is TokenKind.END

    def _take(self) -> Token:
        token = self._tokens[self._position]
        self._position += 1
        return token

    def _infix(self) -> _Infix | None:
        token = self._next_token
        if token.text == "not" and self._tokens[self._position + 1].text != "in":
            return None
        return _INFIX.get(token.text)

    def _operands(self, first: Node, word: str, power: Power) -> tuple[Node, ...]:
        operands = [first]
        while self._next_token.text == word:
            self._take()
            operands.append(self.expression(power))
        return tuple(operands)

    def _operand(self, power: Power) -> Node:
        token = self._next_token
        start, end = token.start, token.end
        match token.kind, token.text:
            case TokenKind.NUMBER, _ if not isinstance(token.value, str):
                node: Node = Number(start=start, end=end, value=token.value, unit=token.unit)
            case TokenKind.TEXT, _:
                node = Text(start=start, end=end, value=str(token.value))
            case TokenKind.WORD, "true" | "false":
                node = Truth(start=start, end=end, value=token.text == "true")
            case TokenKind.NAME, _:
                return self._name_or_call()
            case _:
                return self._prefix_expression(power)
        self._take()
        return node

    def _prefix_expression(self, power: Power) -> Node:
        token = self._next_token
        if token.text == "(":
            return self._parenthesized_expression()
        if token.text == "-":
            self._take()
            operand = self.expression(Power.SIGN)
            return Negative(start=token.start, end=operand.end, operand=operand)
        if token.text == "not":
            if power > Power.NOT:
                raise ExpressionError("'not' needs parentheses here", token.start, token.end, "write (not x)")
            self._take()
            operand = self.expression(Power.NOT)
            return Not(start=token.start, end=operand.end, operand=operand)
        raise self._missing_operand_error()

    def _parenthesized_expression(self) -> Node:
        opening = self._take()
        node = self.expression(Power.CHOICE)
        if self._next_token.text == ",":
            token = self._next_token
            raise ExpressionError("a list is allowed only after 'in'", opening.start, token.end, "write x in (1, 2)")
        self._close(opening)
        return node

    def _close(self, opening: Token) -> int:
        """Read the closing parenthesis and return its end offset."""
        if self._is_at_end():
            raise ExpressionError("'(' is never closed", opening.start, opening.end, "add ')'")
        if self._next_token.text != ")":
            raise self._unexpected_token_error()
        return self._take().end

    def _bracketed_expressions(self) -> tuple[tuple[Node, ...], int]:
        """Return the expressions between parentheses and the end offset; a trailing comma is allowed."""
        opening = self._take()
        expressions: list[Node] = []
        while self._next_token.text != ")":
            if self._is_at_end():
                break
            expressions.append(self.expression(Power.CHOICE))
            if self._next_token.kind in (TokenKind.NAME, TokenKind.NUMBER, TokenKind.TEXT):
                raise self._missing_comma_error()
            if self._next_token.text != ",":
                break
            self._take()
        return tuple(expressions), self._close(opening)

    def _name_or_call(self) -> Node:
        token = self._take()
        is_call = self._next_token.text == "("
        if not is_call and token.text in FUNCTIONS:
            raise ExpressionError(f"'{token.text}' is a function", token.start, token.end, f"write {token.text}(...)")
        if not is_call:
            return Name(start=token.start, end=token.end, name=token.text)
        if token.text not in FUNCTIONS:
            raise _unknown_function_error(token)
        arguments, end = self._bracketed_expressions()
        return _check_call(Call(start=token.start, end=end, function=token.text, arguments=arguments))

    def _missing_operand_error(self) -> ExpressionError:
        token = self._next_token
        if token.text == "else" and self._position and self._tokens[self._position - 1].text == "or":
            before = self._tokens[self._position - 1]
            return ExpressionError("'or else' is not an operator", before.start, token.end, "write x else y")
        if token.text in ("if", "else"):
            return ExpressionError(f"unexpected '{token.text}'", token.start, token.end, "write A if CONDITION else B")
        if self._position == 0 and token.text != ")":
            return ExpressionError(
                f"a value is missing before '{token.text}'", token.start, token.end, "begin the condition with a value"
            )
        if self._position == 0:
            return ExpressionError("')' closes nothing", token.start, token.end, "remove it")
        before = self._tokens[self._position - 1]
        help_text = "complete the condition" if token.kind is TokenKind.END else f"add a value before '{token.text}'"
        return ExpressionError(f"a value is missing after '{before.text}'", before.start, before.end, help_text)

    def _unexpected_token_error(self) -> ExpressionError:
        token = self._next_token
        lower_text = token.text.lower()
        if token.kind is TokenKind.NAME and lower_text in WORDS:
            return ExpressionError(
                f"'{token.text}' is not an operator", token.start, token.end, f"write '{lower_text}'"
            )
        if token.text == ")":
            return ExpressionError("')' closes nothing", token.start, token.end, "remove it or add '('")
        before, after = self._tokens[self._position - 1], self._tokens[min(self._position + 1, len(self._tokens) - 1)]
        is_between_numbers = before.kind is after.kind is TokenKind.NUMBER
        if token.text == "," and is_between_numbers and (before.end, after.start) == (token.start, token.end):
            return ExpressionError(
                "',' is not a decimal point", before.start, after.end, f"write {before.text}.{after.text}"
            )
        if token.text == ",":
            help_text = "join the conditions with 'and' or 'or'; or write each condition as an item of its own"
            return ExpressionError("unexpected ','", token.start, token.end, help_text)
        operator_help = _OPERATOR_HELP.get(lower_text) or _OPERATOR_HELP.get(before.text.lower())
        help_text = operator_help or "join conditions with 'and' or 'or', compare values with '==' or '<'"
        if parse_unit(token.text) is not None and before.kind is TokenKind.NAME:
            help_text = f"remove '{token.text}': {before.text} already has the unit of its declaration"
        return ExpressionError(f"an operator is missing before {shown(token.text)}", token.start, token.end, help_text)

    def _missing_comma_error(self) -> ExpressionError:
        token = self._next_token
        return ExpressionError(
            f"a ',' is missing before {shown(token.text)}", token.start, token.end, "put ',' between values"
        )

    def _mixed_chain_error(self) -> ExpressionError:
        token = self._next_token
        help_text = "put one of the comparisons in parentheses or join them with 'and'"
        return ExpressionError("'in' cannot be part of a chain of comparisons", token.start, token.end, help_text)


@dataclass(frozen=True, slots=True)
class _Infix:
    """An infix operator and the method that reads the rest of its expression."""

    power: Power
    read: Callable[[_Parser, Node], Node]


_INFIX: Mapping[str, _Infix] = {
    "if": _Infix(Power.CHOICE, _Parser.choice),
    "else": _Infix(Power.CHOICE, _Parser.fallback),
    "or": _Infix(Power.OR, _Parser.disjunction),
    "and": _Infix(Power.AND, _Parser.conjunction),
    "in": _Infix(Power.COMPARE, _Parser.membership),
    "not": _Infix(Power.COMPARE, _Parser.membership),
    **{operator.value: _Infix(Power.COMPARE, _Parser.comparison) for operator in Comparison},
    "+": _Infix(Power.SUM, _Parser.arithmetic),
    "-": _Infix(Power.SUM, _Parser.arithmetic),
    "*": _Infix(Power.PRODUCT, _Parser.arithmetic),
    "/": _Infix(Power.PRODUCT, _Parser.arithmetic),
}


def _unknown_function_error(token: Token) -> ExpressionError:
    suggestion = suggest(token.text, (*FUNCTIONS, *_GRAPH_FUNCTIONS))
    default_help = f"did you mean '{suggestion}'?" if suggestion else f"functions are {', '.join(sorted(FUNCTIONS))}"
    help_text = _FUNCTION_HELP.get(token.text, default_help)
    return ExpressionError(f"unknown function {shown(token.text)}", token.start, token.end, help_text)


def _check_call(call: Call) -> Call:
    min_count, max_count = FUNCTIONS[call.function]
    count = len(call.arguments)
    if count < min_count or (max_count is not None and count > max_count):
        count_text = f"one value, not {count}" if max_count == 1 else f"at least {min_count} values, not {count}"
        help_text = f"write {call.function}(x)" if max_count == 1 else f"write {call.function}(a, b)"
        raise ExpressionError(f"{call.function}() takes {count_text}", call.start, call.end, help_text)
    argument = call.arguments[0]
    if call.function in ("known", "age") and not isinstance(argument, Name):
        help_text = f"write {call.function}(NAME), without quotes or operators"
        raise ExpressionError(f"{call.function}() takes one name", argument.start, argument.end, help_text)
    return call


def _too_deep_error(start: int, end: int) -> ExpressionError:
    help_text = f"at most {MAX_DEPTH} levels are allowed: split the condition"
    return ExpressionError("the condition is nested too deeply", start, end, help_text)


def _depth(node: Node) -> int:
    max_depth = 0
    pending = [(node, 1)]
    while pending:
        current, depth = pending.pop()
        max_depth = max(max_depth, depth)
        pending.extend((part, depth + 1) for part in parts(current))
    return max_depth
