"""The scripting language of BehaviorTree.CPP v4, evaluated over a blackboard.

Numbers are doubles and booleans are 1 and 0. `&&` and `||` have the same precedence, are left-associative, and both
sides are evaluated.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Protocol

Value = float | str
TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*|\.\d+)|'([^']*)'|([A-Za-z_@]\w*)|(:=|\+=|-=|\*=|/=|==|!=|<=|>=|&&|\|\||[-+*/<>=!?:;()]))"
)
EPSILON = 2.0**-23


class ScriptError(Exception):
    """Raised for a script that cannot be read or evaluated, where BehaviorTree.CPP throws."""


class Entries(Protocol):
    """The part of a blackboard that a script uses."""

    def read(self, key: str) -> Value | None: ...

    def knows(self, key: str) -> bool: ...

    def write(self, key: str, value: Value) -> None: ...


def tokens(text: str) -> list[tuple[str, str]]:
    token_list, position = [], 0
    while text[position:].strip():
        match = TOKEN.match(text, position)
        if match is None:
            raise ScriptError(f"{text!r} at {position}")
        kind = ("number", "string", "name", "operator")[(match.lastindex or 0) - 1]
        token_list.append((kind, match.group(match.lastindex or 0)))
        position = match.end()
    return [*token_list, ("end", "")]


def run(text: str, entries: Entries) -> Value:
    """Return the value of the last statement."""
    return Reading(tokens(text), entries).statements()


def holds(text: str, entries: Entries) -> bool:
    value = run(text, entries)
    if isinstance(value, str):
        raise ScriptError(f"{text!r} is text")
    return value != 0.0


class Reading:
    """Evaluates a script in one pass over its tokens; `is_live` is false in the branch of `?:` that is not taken."""

    def __init__(self, all_tokens: list[tuple[str, str]], entries: Entries) -> None:
        self.tokens, self.entries, self.position, self.is_live = all_tokens, entries, 0, True

    def statements(self) -> Value:
        value: Value = 0.0
        while self.tokens[self.position][0] != "end":
            value = self.assignment()
            if not self.accept(";"):
                break
        if self.tokens[self.position][0] != "end":
            raise ScriptError(f"unexpected {self.tokens[self.position][1]!r}")
        return value

    def accept(self, *operators: str) -> str:
        kind, text = self.tokens[self.position]
        if kind != "operator" or text not in operators:
            return ""
        self.position += 1
        return text

    def assignment(self) -> Value:
        kind, name = self.tokens[self.position]
        next_token = self.tokens[self.position + 1] if kind == "name" else ("end", "")
        if kind != "name" or next_token[0] != "operator" or next_token[1] not in {":=", "=", "+=", "-=", "*=", "/="}:
            return self.conditional()
        self.position += 2
        old_value = self.entries.read(name)
        if next_token[1] != ":=" and not self.entries.knows(name):
            raise ScriptError(f"no entry {name}")
        value = self.conditional()
        if next_token[1] not in {":=", "="}:
            if old_value is None:
                raise ScriptError(f"{name} has no value")
            value = arithmetic(next_token[1][0], old_value, value)
        self.entries.write(name, value)
        return value

    def conditional(self) -> Value:
        condition = self.logical()
        if not self.accept("?"):
            return condition
        was_live, is_true = self.is_live, condition not in (0.0, "")
        self.is_live = was_live and is_true
        then_value = self.conditional()
        if not self.accept(":"):
            raise ScriptError("no ':' after '?'")
        self.is_live = was_live and not is_true
        otherwise_value = self.conditional()
        self.is_live = was_live
        return then_value if is_true else otherwise_value

    def logical(self) -> Value:
        left = self.comparison()
        while operator := self.accept("&&", "||"):
            right = self.comparison()
            both = (left != 0.0, right != 0.0)
            left = float(all(both) if operator == "&&" else any(both))
        return left

    def comparison(self) -> Value:
        left, result = self.sum(), None
        while operator := self.accept("==", "!=", "<=", ">=", "<", ">"):
            right = self.sum()
            result = float(compare(operator, left, right) and result != 0.0)
            left = right
        return left if result is None else result

    def sum(self) -> Value:
        return self.chain(("+", "-"), lambda: self.chain(("*", "/"), self.prefix))

    def chain(self, operators: tuple[str, ...], operand: Callable[[], Value]) -> Value:
        left = operand()
        while operator := self.accept(*operators):
            right = operand()
            left = arithmetic(operator, left, right) if self.is_live else left
        return left

    def prefix(self) -> Value:
        if operator := self.accept("-", "!"):
            value = self.atom()
            if isinstance(value, str):
                raise ScriptError(f"{operator} before text")
            return -value if operator == "-" else float(value == 0.0)
        return self.atom()

    def atom(self) -> Value:
        if self.accept("("):
            value = self.conditional()
            if not self.accept(")"):
                raise ScriptError("no ')'")
            return value
        kind, text = self.tokens[self.position]
        self.position += 1
        if kind == "number":
            return float(text)
        if kind == "string":
            return text
        if kind != "name":
            raise ScriptError(f"unexpected {text!r}")
        if text in {"true", "false"}:
            return float(text == "true")
        stored_value = self.entries.read(text)
        if stored_value is None and self.is_live:
            raise ScriptError(f"no entry {text}")
        return 0.0 if stored_value is None else stored_value


def arithmetic(operator: str, left: Value, right: Value) -> Value:
    if isinstance(left, str) and isinstance(right, str) and operator == "+":
        return left + right
    if isinstance(left, str) or isinstance(right, str):
        raise ScriptError(f"{left!r} {operator} {right!r}")
    if operator == "/" and right == 0.0:
        raise ScriptError("division by zero")
    return {"+": left + right, "-": left - right, "*": left * right}.get(operator, left / right if right else 0.0)


def number(value: Value) -> float:
    """Return the number of a text that is used with another number."""
    try:
        return {"true": 1.0, "false": 0.0}[value] if value in ("true", "false") else float(value)
    except ValueError:
        raise ScriptError(f"{value!r} is not a number") from None


def compare(operator: str, left: Value, right: Value) -> bool:
    if isinstance(left, str) != isinstance(right, str):
        left, right = number(left), number(right)
    if isinstance(left, str) or isinstance(right, str):
        equal, less = left == right, str(left) < str(right)
    else:
        equal, less = abs(left - right) <= EPSILON, left < right
    exactly = left == right
    return {
        "==": equal,
        "!=": not equal,
        "<": less,
        ">": not less and not exactly,
        "<=": less or exactly,
        ">=": not less,
    }[operator]
