"""The changes that are made to one expression of a module: operators, constants, conditions, results, arguments."""

from __future__ import annotations

import ast
import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

_OPERATORS = "< <= >=;<= < >;> >= <=;>= > <;== !=;!= ==;is is_not;is_not is;in not_in;not_in in;and or;or and"
_OPERATORS += ";+ -;- +;* /;/ *;// /;% *;& |;| &"
_REPLACEMENTS = {old: new for old, *new in map(str.split, _OPERATORS.split(";"))}
_OPERATOR = re.compile(r"(?:is\s+not|not\s+in)\b|[^\s()#\\]+")


@dataclass(frozen=True)
class Change:
    """The replacement of the bytes from `start` to `end` in the source of a module."""

    start: int
    end: int
    replacement: str
    source: bytes

    @property
    def result(self) -> bytes:
        """Return the changed source."""
        return self.source[: self.start] + self.replacement.encode() + self.source[self.end :]

    @property
    def is_valid(self) -> bool:
        """Return whether the result can be parsed; for example, a walrus may need the parentheses of a call."""
        try:
            return bool(ast.parse(self.result))
        except SyntaxError:
            return False

    def __str__(self) -> str:
        line = self.source[self.source.rfind(b"\n", 0, self.start) + 1 :].split(b"\n", 1)[0].strip()
        return f"{line.decode()} ({self.source[self.start : self.end].decode()} -> {self.replacement})"

    def diff(self, file: str) -> str:
        """Return the change as a unified diff without context."""
        before, after = (text.decode().splitlines() for text in (self.source, self.result))
        return "\n".join(difflib.unified_diff(before, after, file, file, lineterm="", n=0))


def changes(source: bytes) -> Iterator[Change]:
    """Yield all changes of a module in the order of its syntax tree.

    Annotations, decorators, assertions, texts and code for type checkers stay as they are, and the parts of f-strings,
    whose positions are unknown before Python 3.12.
    """
    line_starts = [0, *(match.end() for match in re.finditer(b"\n", source))]

    def span(node: ast.AST) -> tuple[int, int]:
        places = (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)
        start, end = (line_starts[line - 1] + column for line, column in places)
        return start, end

    def text(start: int, end: int) -> str:
        return source[start:end].decode()

    def in_tree(node: ast.AST) -> Iterator[Change]:
        for start, end, replacement in of_node(node):
            yield Change(start, end, replacement, source)
        for child in _changed_children(node):
            yield from in_tree(child)

    def of_node(node: ast.AST) -> Iterator[tuple[int, int, str]]:
        for before, after in pairwise(map(span, _operands(node))):
            if match := _OPERATOR.search(text(before[1], after[0])):
                for new in _REPLACEMENTS.get("_".join(match[0].split()), ()):
                    yield before[1] + match.start(), before[1] + match.end(), new.replace("_", " ")
        match node:
            case ast.Constant(value=bool() as value):
                yield *span(node), str(not value)
            case ast.Constant(value=int() | float() as value):
                yield *span(node), repr(value + 1)
            case ast.Return(value=ast.expr() as result):
                yield *span(result), "None"
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                yield *span(node), f"({text(*span(operand))})"
            case ast.Call(args=arguments) if not any(isinstance(argument, ast.Starred) for argument in arguments):
                for before, after in pairwise(map(span, arguments)):
                    yield before[0], after[1], text(*after) + text(before[1], after[0]) + text(*before)
        for test in _conditions(node):
            yield *span(test), f"(not ({text(*span(test))}))"

    return in_tree(ast.parse(source))


def _operands(node: ast.AST) -> list[ast.expr]:
    match node:
        case ast.Compare(left=left, comparators=others):
            return [left, *others]
        case ast.BoolOp(values=values):
            return values
        case ast.BinOp(left=left, right=right):
            return [left, right]
    return []


def _conditions(node: ast.AST) -> list[ast.expr]:
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        return [node.test]
    return node.ifs if isinstance(node, ast.comprehension) else []


def _changed_children(node: ast.AST) -> Iterator[ast.AST]:
    for field, value in ast.iter_fields(node):
        if field not in {"annotation", "returns", "decorator_list"}:
            for child in value if isinstance(value, list) else [value]:
                is_for_types = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
                if (
                    isinstance(child, ast.AST)
                    and not isinstance(child, ast.JoinedStr | ast.Assert)
                    and not is_for_types
                ):
                    yield child
