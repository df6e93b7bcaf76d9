"""The condition language and the patterns of knowledge: tokens, parsers, syntax trees, printer.

This package only parses text; `check` decides the meaning of conditions and patterns.
"""

from codra_dsl.language.expression.derivations import (
    distances_in,
    is_distance,
    parse_derivation,
    with_resolution,
)
from codra_dsl.language.expression.parser import MAX_DEPTH, parse
from codra_dsl.language.expression.patterns import Count, EdgeTerm, NodeTerm, Path, parse_pattern
from codra_dsl.language.expression.poses import GEOMETRY, parse_over_context, reads_of, spelt_out, written_text
from codra_dsl.language.expression.printer import to_text
from codra_dsl.language.expression.tokens import (
    FUNCTIONS,
    MAX_LENGTH,
    MAX_NAME,
    WORDS,
    SyntaxProblem,
    is_identifier,
    is_name,
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
    names_in,
    parts,
    variables_in,
    walk,
)

__all__ = [
    "FUNCTIONS",
    "GEOMETRY",
    "MAX_DEPTH",
    "MAX_LENGTH",
    "MAX_NAME",
    "WORDS",
    "And",
    "Arithmetic",
    "Call",
    "Choice",
    "Compare",
    "Comparison",
    "Count",
    "EdgeTerm",
    "Fallback",
    "In",
    "Name",
    "Negative",
    "Node",
    "NodeTerm",
    "Not",
    "Number",
    "Or",
    "Path",
    "SyntaxProblem",
    "Text",
    "Truth",
    "distances_in",
    "is_distance",
    "is_identifier",
    "is_name",
    "names_in",
    "parse",
    "parse_derivation",
    "parse_over_context",
    "parse_pattern",
    "parts",
    "reads_of",
    "spelt_out",
    "to_text",
    "variables_in",
    "walk",
    "with_resolution",
    "written_text",
]
