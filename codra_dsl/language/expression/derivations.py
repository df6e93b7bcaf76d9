"""Expressions of derived variables: conditions and values over context, poses and paths of the knowledge graph.

A derived variable reads only context-variables. So a distance, `in_view`, a count of paths, and a comparison with poses
each become one name in the syntax tree, the name of an implicit context-variable.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from codra_dsl.language.expression.bare_paths import bare_path_problem
from codra_dsl.language.expression.parser import parse
from codra_dsl.language.expression.patterns import Count, parse_path
from codra_dsl.language.expression.poses import (
    comparison_name,
    map_parts,
    mask_pose_functions,
    reads_of,
    restore_names,
)
from codra_dsl.language.expression.tokens import MAX_LENGTH, ExpressionError, SyntaxProblem
from codra_dsl.language.expression.tree import Call, Compare, Fallback, In, Name, Node, names_in, walk

COUNTS = ("count", "exists")
"""Functions of derived variables. Their argument is a path of the knowledge graph."""

_TEXT = r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'"""
_COUNT = re.compile(
    rf"""(?:{_TEXT})
    | \b(?P<function>{"|".join(COUNTS)})\ *\((?P<path>[^()]*)(?P<end>\)?)""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
_WORD = re.compile(r"\w+", re.ASCII)


def parse_derivation(text: str) -> Node | SyntaxProblem:
    """Return the tree of a derived variable's expression, or the problem of an invalid text. Never raises."""
    if len(text) > MAX_LENGTH:
        return parse(text)  # it reports the length
    try:
        masked_text, counts = _mask_counts(text)
        masked_text, pose_names = mask_pose_functions(masked_text)
        tree = parse(masked_text, allows_fallback=True)
        if isinstance(tree, SyntaxProblem):
            problem = _with_written_names(tree, text, masked_text, (*counts, *pose_names))
            return bare_path_problem(masked_text, "write {call}") or problem
        return _with_implicit_names(restore_names(tree, pose_names), counts)
    except ExpressionError as error:
        return error.problem


def with_resolution(tree: Node, resolution_text: str) -> Node:
    """Return an expression in which the names of distances state the step to which the distances are rounded."""
    if isinstance(tree, Name):
        return replace(tree, name=f"{tree.name} to {resolution_text}") if is_distance(tree) else tree
    return map_parts(tree, lambda part: with_resolution(part, resolution_text))


def distances_in(tree: Node) -> Iterator[Name]:
    """Yield the distances whose numbers an expression reads. Distances in comparisons with poses are left out."""
    return (name for name in names_in(tree) if is_distance(name))


def is_distance(name: Name) -> bool:
    """Return whether a name is that of a distance as a number."""
    return isinstance(name.pose_comparison, Name) and reads_of(name.pose_comparison.name)[0] == "distance"


def _with_written_names(problem: SyntaxProblem, text: str, masked_text: str, offsets: Iterable[int]) -> SyntaxProblem:
    """Return a problem whose message and help show functions of the graph as they are written."""
    for mask in (_WORD.match(masked_text, offset) for offset in offsets):
        if mask is not None:
            written = text[mask.start() : mask.end()]
            message, help_text = (part.replace(mask[0], written) for part in (problem.message, problem.help))
            problem = replace(problem, message=message, help=help_text)
    return problem


def _mask_counts(text: str) -> tuple[str, dict[int, Count]]:
    """Return the text with a plain name in place of each count, and a mapping from offsets to the counts."""
    counts: dict[int, Count] = {}

    def mask(match: re.Match[str]) -> str:
        if match["function"] is None:
            return match[0]
        start, end = match.span()
        if not match["end"]:
            raise ExpressionError(f"{match['function']}( is never closed", start, end, "add ')' after the path")
        if not match["path"].strip():
            help_text = f"write {match['function']}(some TYPE -EDGE-> NODE)"
            raise ExpressionError(f"{match['function']}() takes a path of the knowledge graph", start, end, help_text)
        path = parse_path(f"{' ' * match.start('path')}{match['path']}")  # with offsets in the complete expression
        if path.negated:
            help_text = "remove 'not', and write 'not exists(PATH)' or 'count(PATH) == 0'"
            raise ExpressionError("'not' cannot be in a counted path", path.start, path.start + len("not"), help_text)
        counts[start] = Count(start=start, end=end, function=match["function"], path=path)
        return re.sub(r"\W", "_", match[0], flags=re.ASCII)

    return _COUNT.sub(mask, text), counts


def _with_implicit_names(part: Node, counts: dict[int, Count]) -> Node:
    """Return a part of an expression, with names of variables in place of everything that the graph determines.

    Raises:
        ExpressionError: if the part uses the age of something that the graph determines.
    """
    if isinstance(part, Call) and part.function == "age" and not _reads_context(part.arguments[0], counts):
        help_text = "remove age(): a value in the knowledge graph that is too old is unknown"
        raise ExpressionError("age() needs the name of a context-variable", part.start, part.end, help_text)
    if isinstance(part, Compare | In | Call) and _reads_only_poses(part, counts):
        return comparison_name(part)
    if not isinstance(part, Name):
        return map_parts(part, lambda inner_part: _with_implicit_names(inner_part, counts))
    count = counts.get(part.start)
    if count is not None:
        return replace(part, name=f"{count.function}({count.path})", pose_comparison=count)
    return part if _reads_context(part, counts) else replace(part, pose_comparison=part)


def _reads_context(part: Node, counts: dict[int, Count]) -> bool:
    """Return whether a part is the name of a context-variable or no name at all."""
    return not isinstance(part, Name) or (part.start not in counts and not reads_of(part.name)[0])


def _reads_only_poses(part: Compare | In | Call, counts: dict[int, Count]) -> bool:
    """Return whether a part is true or false, and follows from poses and literals alone."""
    is_truth = isinstance(part, Compare | In) or part.function == "known"
    names = names_in(part)
    has_fallback = any(isinstance(inner_part, Fallback) for inner_part in walk(part))
    reads_poses = all(name.start not in counts and reads_of(name.name)[0] for name in names)
    return is_truth and bool(names) and reads_poses and not has_fallback
