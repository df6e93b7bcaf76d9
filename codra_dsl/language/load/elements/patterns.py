"""Parse patterns of the knowledge graph, with the position of every letter."""

from __future__ import annotations

from functools import lru_cache

from codra_dsl.language.expression import SyntaxProblem, parse_pattern
from codra_dsl.language.load.elements.conditions import build_condition, condition_text, untorn_items
from codra_dsl.language.load.yaml.nodes import ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.model import Condition

_parse = lru_cache(maxsize=1024)(parse_pattern)


def read_patterns(reader: Reader, key: str) -> tuple[Condition, ...]:
    """Return the patterns in a list, or the single pattern that is written instead of a list."""
    node = reader.node.value(key)
    if isinstance(node, SequenceNode):
        return tuple(_pattern(reader, item, key, str(index)) for index, item in untorn_items(reader, key))
    return (_pattern(reader, node, key),) if isinstance(node, ScalarNode) else ()


def _pattern(reader: Reader, node: YamlNode, *steps: str) -> Condition:
    """Return one pattern; on a syntax error, report it and set the tree to None."""
    text, letters = condition_text(reader, node)
    pattern = build_condition(reader, node, text, letters, steps, grammar=_parse)
    problem = _parse(pattern.text) if pattern.tree is None and not node.reported else None
    if isinstance(problem, SyntaxProblem):
        place = pattern.place_between(problem.start, problem.end)
        reader.findings.add("pattern-syntax", problem.message, place, help=problem.help, path=reader.part(*steps))
    return pattern
