"""What conditions ask of poses, and names with parts: `distance(a, b)`, `in_view(node, camera)`, `node.attribute`.

Each is one name in the tree of a pattern's condition. In a condition over context a whole comparison with poses is one
name, `distance(a, b) < 0.9 m`: poses change all the time, and what it comes to changes seldom.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from codra_dsl.expression.parser import parse
from codra_dsl.expression.printer import to_text
from codra_dsl.expression.tokens import SlipError, SyntaxProblem, shown
from codra_dsl.expression.tree import Call, Compare, In, Name, Node, names_in, walk

NodeT = TypeVar("NodeT", bound=Node)

GEOMETRY = ("distance", "in_view")
"""The functions of two nodes that conditions over context and of patterns know besides those of all conditions."""

_TEXT = r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'"""
_NAME = r"[A-Za-z][A-Za-z0-9_]*"
_OF_POSES = rf"""(?:{_TEXT})
    | (?P<asked>\b(?:{"|".join(GEOMETRY)})\ *\(\ *(?P<first>{_NAME})\ *,\ *(?P<second>{_NAME})\ *\))
    | (?P<half>\b(?:{"|".join(GEOMETRY)})\ *\()"""
_FLAGS = re.VERBOSE | re.DOTALL | re.ASCII
_ASKED = re.compile(rf"{_OF_POSES}|(?P<dotted>(?!))", _FLAGS)
_READ = re.compile(rf"{_OF_POSES}|(?P<dotted>(?<![\w.]){_NAME}(?:\.{_NAME})+(?!\w))", _FLAGS)
_MAY_ASK = re.compile(rf"\b(?:{'|'.join(GEOMETRY)})\ *\(", re.ASCII)


def parse_named(text: str) -> Node | SyntaxProblem:
    """Return the tree of a condition whose names may have parts, with the same places as in the text.

    Raises:
        SlipError: if such a name is none.
    """
    return _parsed(text, _READ)


def parse_over_context(text: str) -> Node | SyntaxProblem:
    """Return the tree of a condition over context, in which comparisons with poses are names. Never raises."""
    if _MAY_ASK.search(text) is None:
        return parse(text)
    try:
        tree = _parsed(text, _ASKED)
        return tree if isinstance(tree, SyntaxProblem) else _posed(tree)
    except SlipError as slip:
        return slip.problem


def spelt_out(tree: Node) -> Node:
    """Return a condition over context with what its names ask of poses in their places."""
    if isinstance(tree, Name):
        return tree if tree.asks is None else tree.asks
    if not any(name.asks is not None for name in names_in(tree)):
        return tree
    return _each_part(tree, spelt_out)


def reads_of(name: str) -> tuple[str, str, str]:
    """Return what a name in a condition reads: a function or nothing, and two names or one.

    `a.b` gives ("", "a", "b"), `distance(a, b)` gives ("distance", "a", "b"), `c` gives ("", "", "c").
    """
    function, bracket, inner = name.partition("(")
    if bracket:
        first, _, second = inner.rstrip(")").partition(", ")
        return function, first, second
    node, dot, attribute = name.partition(".")
    return ("", node, attribute) if dot else ("", "", name)


def _parsed(text: str, read: re.Pattern[str]) -> Node | SyntaxProblem:
    masked, names = _masked(text, read)
    tree = parse(masked)
    if isinstance(tree, SyntaxProblem):
        message, way_out = tree.message, tree.help
        for start, name in names.items():
            mask = masked[start : start + len(_written(text, read, start))]
            message, way_out = message.replace(mask, name), way_out.replace(mask, name)
        return SyntaxProblem(message, tree.start, tree.end, way_out)
    return _named(tree, names) if names else tree


def _masked(text: str, read: re.Pattern[str]) -> tuple[str, dict[int, str]]:
    """Return a text in which each name with parts is a plain one of the same length, and those names by place."""
    names: dict[int, str] = {}
    masked = text
    for match in read.finditer(text):
        start, end = match.span()
        if match["half"]:
            function = match["half"].rstrip("( ")
            takes = "write distance(a, b)" if function == "distance" else "write in_view(node, camera)"
            raise SlipError(f"{function}() takes the names of two nodes", start, end, takes)
        if match["dotted"] and match["dotted"].count(".") > 1:
            raise SlipError(f"{shown(match[0])} has too many parts", start, end, "write node.attribute")
        if match["asked"]:
            function = match["asked"].partition("(")[0].strip()
            names[start] = f"{function}({match['first']}, {match['second']})"
        elif match["dotted"]:
            names[start] = match["dotted"]
        else:
            continue
        masked = masked[:start] + re.sub(r"\W", "_", match[0], flags=re.ASCII) + masked[end:]
    return masked, names


def _written(text: str, read: re.Pattern[str], start: int) -> str:
    match = read.match(text, start)
    return "" if match is None else match[0]


def _named(value: Node, names: Mapping[int, str]) -> Node:
    """Return a part of a tree in which names that were masked are as they were written."""
    if isinstance(value, Name):
        return replace(value, name=names.get(value.start, value.name))
    return _each_part(value, lambda part: _named(part, names))


def _posed(value: Node) -> Node:
    """Return a part of a tree in which each comparison with poses is one name.

    Raises:
        SlipError: if poses are asked for what cannot be kept as true, false or unknown.
    """
    if isinstance(value, Compare | In | Call | Name):
        asked = [name for name in names_in(value) if reads_of(name.name)[0]]
        if asked:
            return _one_name(value, asked)
    return _each_part(value, _posed)


def _one_name(part: Compare | In | Call | Name, asked: list[Name]) -> Name:
    first, text = asked[0], asked[0].name
    function = reads_of(text)[0]
    aged = next((each for each in walk(part) if isinstance(each, Call) and each.function == "age"), None)
    if aged is not None:
        way_out = "poses that are older than the 'valid_for' of their edge are unknown"
        raise SlipError(f"age() and {text} stand in one comparison", aged.start, aged.end, way_out)
    is_truth = isinstance(part, Compare | In) or (isinstance(part, Call) and part.function == "known")
    if not is_truth and (isinstance(part, Call) or function == "distance"):
        way_out = f"compare it, e.g. {text} < 0.9 m" if function == "distance" else "leave the function away"
        raise SlipError(f"{text} stands in no comparison", first.start, first.end, way_out)
    other = next((name for name in names_in(part) if not reads_of(name.name)[0]), None)
    if other is not None:
        way_out = "compare what poses tell with numbers, and variables in a comparison of their own"
        raise SlipError(f"{shown(other.name)} stands in one comparison with {text}", other.start, other.end, way_out)
    return Name(start=part.start, end=part.end, name=to_text(part), asks=part)


def _each_part(node: NodeT, made: Callable[[Node], Node]) -> NodeT:
    """Return a node with something made of each of its parts, those in tuples too."""

    def of(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(of, value))
        return made(value) if isinstance(value, Node) else value

    own = (each for each in fields(node) if each.name not in ("start", "end"))
    return replace(node, **{each.name: of(getattr(node, each.name)) for each in own})
