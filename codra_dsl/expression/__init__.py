"""The condition language: tokens, parser, syntax tree, printer. What a condition means is judged by `check`."""

from codra_dsl.expression.parser import MAX_DEPTH, parse
from codra_dsl.expression.printer import to_text
from codra_dsl.expression.tokens import FUNCTIONS, MAX_LENGTH, WORDS, SyntaxProblem, is_name
from codra_dsl.expression.tree import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Comparison,
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
    walk,
)

__all__ = [
    "FUNCTIONS",
    "MAX_DEPTH",
    "MAX_LENGTH",
    "WORDS",
    "And",
    "Arithmetic",
    "Call",
    "Choice",
    "Compare",
    "Comparison",
    "In",
    "Name",
    "Negative",
    "Node",
    "Not",
    "Number",
    "Or",
    "SyntaxProblem",
    "Text",
    "Truth",
    "is_name",
    "names_in",
    "parse",
    "parts",
    "to_text",
    "walk",
]
