"""Parse conditions, keep the position of every letter, and find traps of YAML that appear only as syntax errors."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

from codra_dsl.language.expression import Node, SyntaxProblem, names_in, parse, parse_derivation, parse_over_context
from codra_dsl.language.load.yaml.fixes import trap_fix
from codra_dsl.language.load.yaml.nodes import LetterRuns, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.reader import Reader, Suspect
from codra_dsl.language.load.yaml.source_offsets import cut, letter_runs
from codra_dsl.language.load.yaml.traps import Openings, cut_off_by_comment_trap, torn_at_comma_trap
from codra_dsl.language.model import Condition, Letters

MAX_PIECES = 50
"""The maximum number of pieces of a split condition that are joined again."""

MAX_CACHED_LENGTH = 200
"""The maximum length, in code points, of a condition whose tree is cached."""

_OPENING_MARK = re.compile(r"[(\"']")
_LEADING_OPERATOR = re.compile(r"^(?:and|or)\s")
_COMMENT = re.compile(r"[ \t]+#([^\r\n]*)")


Grammar = Callable[[str], Node | SyntaxProblem]
"""Parses a condition."""


def read_conditions(reader: Reader, key: str, *, grammar: Grammar = parse) -> tuple[Condition, ...]:
    """Return the conditions in a list."""
    items = untorn_items(reader, key)
    return tuple(read_condition(reader, item, key, str(index), grammar=grammar) for index, item in items)


def untorn_items(reader: Reader, key: str) -> Iterator[tuple[int, YamlNode]]:
    """Yield the index and the node of each item in a list. Conditions that commas have split are reported instead."""
    node = reader.node.value(key)
    skip_until = 0
    for index, item in enumerate(node.items if isinstance(node, SequenceNode) else ()):
        if index < skip_until or not isinstance(node, SequenceNode):
            continue
        torn_end = _end_of_split_item(node, index)
        if torn_end is None:
            yield index, item
            continue
        skip_until = torn_end
        end = node.items[torn_end - 1].end
        trap = torn_at_comma_trap(reader.origin.source.text[item.start : end])
        place = reader.origin.place(item.start, end)
        reader.fail(trap.rule, trap.message, place, trap.help, key, str(index), fix=trap_fix(trap, place))


def read_condition(reader: Reader, node: YamlNode, *steps: str, grammar: Grammar = parse) -> Condition:
    """Return one condition; on a syntax error, report it and set the tree to None."""
    condition = build_condition(reader, node, *condition_text(reader, node), steps, grammar=_CACHED_GRAMMARS[grammar])
    if condition.tree is not None:
        _record_suspect_comment(reader, node, condition, steps)
    elif not node.reported:
        report_syntax(reader, node, condition, steps, grammar=grammar)
    return condition


def condition_text(reader: Reader, node: YamlNode) -> tuple[str, LetterRuns]:
    """Return the text of a scalar on one line without surrounding blanks, and the positions of its letters."""
    if not isinstance(node, ScalarNode):
        return "", ()
    letters = letter_runs(node, reader.origin.source.text)
    text = node.text
    if node.style is Style.PLAIN and node.filled_text is None:
        return text, letters
    stripped_text = text.strip()
    before = len(text) - len(text.lstrip())
    return stripped_text.replace("\n", " "), cut(letters, before, before + len(stripped_text), 0) if before else letters


def build_condition(
    reader: Reader,
    node: YamlNode,
    text: str,
    letters: LetterRuns,
    steps: tuple[str, ...],
    *,
    grammar: Grammar | None = None,
) -> Condition:
    """Return a condition; its tree is None on a syntax error, or if the node has already been reported.

    `grammar` parses the text; by default, the text is parsed as a plain condition.
    """
    place = reader.origin.of(node)
    tree = None if node.reported else (grammar or _cached_tree)(text)
    if not isinstance(tree, Node):
        reader.damage(*steps)
    placed_letters = Letters(reader.place_of, letters) if letters else None
    return Condition(text=text, tree=tree if isinstance(tree, Node) else None, place=place, letters=placed_letters)


def _cached_tree(text: str) -> Node | SyntaxProblem:
    """Return the tree of a condition. Trees of short conditions are cached, because many conditions are equal."""
    return _parse_cached(text) if len(text) <= MAX_CACHED_LENGTH else parse(text)


_parse_cached = lru_cache(maxsize=4096)(parse)
_parse_over_context_cached = lru_cache(maxsize=4096)(parse_over_context)


def _cached_tree_over_context(text: str) -> Node | SyntaxProblem:
    return _parse_over_context_cached(text) if len(text) <= MAX_CACHED_LENGTH else parse_over_context(text)


_CACHED_GRAMMARS: Mapping[Grammar, Grammar] = {
    parse: _cached_tree,
    parse_over_context: _cached_tree_over_context,
    parse_derivation: parse_derivation,
}


def _end_of_split_item(sequence: SequenceNode, index: int) -> int | None:
    """Return the index after the pieces into which commas split an item, or None if the item is complete."""
    first = sequence.items[index]
    if not sequence.flow or not isinstance(first, ScalarNode) or first.style is not Style.PLAIN:
        return None
    if not _OPENING_MARK.search(first.text):
        return None
    openings = Openings(first.text)
    if not openings.is_any_open:
        return None
    for end_index, piece in enumerate(sequence.items[index + 1 : index + MAX_PIECES], start=index + 2):
        if not isinstance(piece, ScalarNode):
            return None
        openings.read(f", {piece.text}")
        if not openings.is_any_open:
            return end_index
    return None


def report_syntax(
    reader: Reader, node: YamlNode, condition: Condition, steps: tuple[str, ...], *, grammar: Grammar = parse
) -> None:
    """Report the syntax error of a condition."""
    problem, path = grammar(condition.text), reader.part(*steps)
    comment = _comment_after(reader, node)
    if comment is not None:
        trap = cut_off_by_comment_trap(f"{condition.text} #{comment.rstrip()}")
        place_with_comment = reader.origin.place(node.start, reader.origin.source.line_end(node.end))
        fix = trap_fix(trap, place_with_comment)
        reader.findings.add(trap.rule, trap.message, condition.place, help=trap.help, path=path, fix=fix)
    elif isinstance(problem, SyntaxProblem):
        place = condition.place_between(problem.start, problem.end)
        reader.findings.add("condition-syntax", problem.message, place, help=problem.help, path=path)


def _record_suspect_comment(reader: Reader, node: YamlNode, condition: Condition, steps: tuple[str, ...]) -> None:
    comment = _comment_after(reader, node)
    tree = parse(_LEADING_OPERATOR.sub("", comment.strip())) if comment is not None else None
    names = frozenset(name.name for name in names_in(tree)) if isinstance(tree, Node) else frozenset()
    if comment is not None and names:
        text_with_comment = f"{condition.text} #{comment.rstrip()}"
        reader.suspects.append(Suspect(condition.place, text_with_comment, names, reader.part(*steps)))


def _comment_after(reader: Reader, node: YamlNode) -> str | None:
    """Return the comment that follows a plain scalar on its line."""
    text = reader.origin.source.text
    if text[node.end : node.end + 1] not in (" ", "\t"):
        return None
    if not isinstance(node, ScalarNode) or node.style is not Style.PLAIN:
        return None
    comment = _COMMENT.match(text, node.end)
    return None if comment is None else comment[1]
