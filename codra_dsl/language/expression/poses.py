"""Functions of poses, and names with parts: `distance(a, b)`, `in_view(node, camera)`, `node.attribute`.

In the syntax tree of a pattern's condition, each of these is one name. In a condition over context, a complete
comparison with poses, such as `distance(a, b) < 0.9 m`, is one name, because poses change all the time, while the
result of the comparison seldom changes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from codra_dsl.language.expression.bare_paths import bare_path_problem
from codra_dsl.language.expression.parser import parse
from codra_dsl.language.expression.printer import to_text
from codra_dsl.language.expression.tokens import MAX_LENGTH, ExpressionError, SyntaxProblem, shown
from codra_dsl.language.expression.tree import Call, Compare, In, Name, Node, names_in, walk

NodeT = TypeVar("NodeT", bound=Node)

GEOMETRY = ("distance", "in_view")
"""Additional functions in conditions over context and in conditions of patterns. Their arguments are two nodes."""

_TEXT = r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'"""
_NAME = r"[A-Za-z][A-Za-z0-9_]*"
_POSE_FUNCTION_PATTERN = rf"""(?:{_TEXT})
    | (?P<asked>\b(?:{"|".join(GEOMETRY)})\ *\(\ *(?P<first>{_NAME})\ *,\ *(?P<second>{_NAME})\ *\))
    | (?P<half>\b(?:{"|".join(GEOMETRY)})\ *\()"""
_FLAGS = re.VERBOSE | re.DOTALL | re.ASCII
_POSE_FUNCTION = re.compile(rf"{_POSE_FUNCTION_PATTERN}|(?P<dotted>(?!))", _FLAGS)
_DOTTED_NAME_OR_POSE_FUNCTION = re.compile(
    rf"{_POSE_FUNCTION_PATTERN}|(?P<dotted>(?<![\w.]){_NAME}(?:\.{_NAME})+(?!\w))", _FLAGS
)
_PATH_HELP = "declare in 'context' a variable NAME with 'derived: {call}', and write '{condition}' here"
_ANY_NODE = re.compile(rf"\bsome +({_NAME})", re.ASCII)
_POSE_FUNCTION_START = re.compile(rf"\b(?:{'|'.join(GEOMETRY)})\ *\(", re.ASCII)


def parse_with_dotted_names(text: str) -> Node | SyntaxProblem:
    """Return the tree of a condition in which names may have parts, such as `a.b`. Its offsets refer to `text`.

    Raises:
        ExpressionError: if a name with parts is invalid.
    """
    return _parse_masked(text, _DOTTED_NAME_OR_POSE_FUNCTION)


def parse_over_context(text: str) -> Node | SyntaxProblem:
    """Return the tree of a condition over context, in which each comparison with poses is one name. Never raises."""
    tree = _parse_over_context(text)
    problem = bare_path_problem(text, _PATH_HELP) if isinstance(tree, SyntaxProblem) else None
    return tree if problem is None else problem


def _parse_over_context(text: str) -> Node | SyntaxProblem:
    if _POSE_FUNCTION_START.search(text) is None:
        return parse(text, reads_context=True)
    try:
        tree = _parse_masked(text, _POSE_FUNCTION)
        return tree if isinstance(tree, SyntaxProblem) else _replace_comparisons(tree)
    except ExpressionError as error:
        return error.problem


def spelt_out(tree: Node) -> Node:
    """Return a condition over context in which each name of a comparison with poses is replaced by the comparison.

    A count of the matches of a path reads no name. It stays one name.
    """
    if isinstance(tree, Name):
        comparison = tree.pose_comparison
        return tree if comparison is None or not names_in(comparison) else comparison
    if not any(part.pose_comparison is not None for part in names_in(tree)):
        return tree
    return map_parts(tree, spelt_out)


def written_text(node: Node) -> str:
    """Return a part of a condition for messages. Names of distances are without the step to which they are rounded."""
    return to_text(_without_resolution(node))


def _without_resolution(node: Node) -> Node:
    if isinstance(node, Name):
        return node.pose_comparison if isinstance(node.pose_comparison, Name) else node
    return map_parts(node, _without_resolution)


def reads_of(name: str) -> tuple[str, str, str]:
    """Return the parts of a name in a condition: a function and two names. Missing parts are empty.

    `a.b` gives ("", "a", "b"), `distance(a, b)` gives ("distance", "a", "b"), `c` gives ("", "", "c").
    """
    function, bracket, inner = name.partition("(")
    if bracket:
        first, _, second = inner.rstrip(")").partition(", ")
        return function, first, second
    node, dot, attribute = name.partition(".")
    return ("", node, attribute) if dot else ("", "", name)


def mask_pose_functions(text: str) -> tuple[str, dict[int, str]]:
    """Return the text with a plain name in place of each function of poses, and a mapping from offsets to their names.

    Raises:
        ExpressionError: if a function does not have the names of two nodes as arguments.
    """
    return _mask(text, _POSE_FUNCTION)


def _parse_masked(text: str, pattern: re.Pattern[str]) -> Node | SyntaxProblem:
    if len(text) > MAX_LENGTH:
        return parse(text)  # it reports the length
    masked_text, names = _mask(text, pattern)
    tree = parse(masked_text, reads_context=True)
    if isinstance(tree, SyntaxProblem):
        message, help_text = tree.message, tree.help
        for start, name in names.items():
            match = pattern.match(text, start)
            mask = masked_text[start : start if match is None else match.end()]
            message, help_text = message.replace(mask, name), help_text.replace(mask, name)
        return SyntaxProblem(message, tree.start, tree.end, help_text)
    return restore_names(tree, names) if names else tree


def _mask(text: str, pattern: re.Pattern[str]) -> tuple[str, dict[int, str]]:
    """Return the text in which each name with parts is replaced by a plain name of the same length.

    Also return a mapping from offsets to the replaced names.
    """
    names: dict[int, str] = {}
    masked_text = text
    for match in pattern.finditer(text):
        start, end = match.span()
        if match["half"]:
            function = match["half"].rstrip("( ")
            help_text = _arguments_help(function, text[end:].partition(")")[0])
            raise ExpressionError(f"{function}() takes the names of two nodes", start, end, help_text)
        if match["dotted"] and match["dotted"].count(".") > 1:
            raise ExpressionError(f"{shown(match[0])} has too many parts", start, end, "write node.attribute")
        if match["asked"]:
            function = match["asked"].partition("(")[0].strip()
            names[start] = f"{function}({match['first']}, {match['second']})"
        elif match["dotted"]:
            names[start] = match["dotted"]
        else:
            continue
        masked_text = masked_text[:start] + re.sub(r"\W", "_", match[0], flags=re.ASCII) + masked_text[end:]
    return masked_text, names


def _arguments_help(function: str, arguments: str) -> str:
    """Return the help for arguments that are not the names of two nodes."""
    any_node, one_node = _ANY_NODE.search(arguments), re.fullmatch(_NAME, arguments.strip(), re.ASCII)
    if any_node is not None:
        other = next((argument.strip() for argument in arguments.split(",") if any_node[0] not in argument), "robot")
        return (
            f"write the name of a node in place of '{any_node[0]}'; for any {any_node[1]}, let an agent write edges, "
            f"and write 'exists({any_node[0]} -EDGE-> {other})' in 'derived'"
        )
    if one_node is not None:
        return f"write {function}({one_node[0]}, NODE)"
    return "write distance(a, b)" if function == "distance" else "write in_view(node, camera)"


def restore_names(value: Node, names: Mapping[int, str]) -> Node:
    """Return a part of a tree with masked names restored."""
    if isinstance(value, Name):
        return replace(value, name=names.get(value.start, value.name))
    return map_parts(value, lambda part: restore_names(part, names))


def _replace_comparisons(value: Node) -> Node:
    """Return a part of a tree in which each comparison with poses is one name.

    Raises:
        ExpressionError: if a part with poses cannot be one name, for example because it is not a comparison.
    """
    if isinstance(value, Compare | In | Call | Name) and any(reads_of(name.name)[0] for name in names_in(value)):
        return comparison_name(value)
    return map_parts(value, _replace_comparisons)


def comparison_name(part: Compare | In | Call | Name) -> Name:
    """Return the name of the variable for a comparison with poses.

    Raises:
        ExpressionError: if the part is not a comparison, or reads something other than poses.
    """
    first = next(name for name in names_in(part) if reads_of(name.name)[0])
    text = first.name
    function = reads_of(text)[0]
    age_call = next((node for node in walk(part) if isinstance(node, Call) and node.function == "age"), None)
    if age_call is not None:
        help_text = "remove age(): poses that are older than the 'valid_for' of their edge are unknown"
        raise ExpressionError(f"age() and {text} cannot be in one comparison", age_call.start, age_call.end, help_text)
    is_truth = isinstance(part, Compare | In) or (isinstance(part, Call) and part.function == "known")
    if not is_truth and (isinstance(part, Call) or function == "distance"):
        help_text = f"compare it, e.g. {text} < 0.9 m" if function == "distance" else "remove the function around it"
        raise ExpressionError(f"{text} is not part of a comparison", first.start, first.end, help_text)
    other_name = next((name for name in names_in(part) if not reads_of(name.name)[0]), None)
    if other_name is not None:
        help_text = "compare poses only with numbers; write a separate comparison for the variable"
        raise ExpressionError(
            f"{shown(other_name.name)} cannot be in one comparison with {text}",
            other_name.start,
            other_name.end,
            help_text,
        )
    return Name(start=part.start, end=part.end, name=to_text(part), pose_comparison=part)


def map_parts(node: NodeT, function: Callable[[Node], Node]) -> NodeT:
    """Return a node with a function applied to all its parts, including those in tuples."""

    def apply(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(apply, value))
        return function(value) if isinstance(value, Node) else value

    names = (field.name for field in fields(node) if field.name not in ("start", "end"))
    return replace(node, **{name: apply(getattr(node, name)) for name in names})
