"""Paths of the knowledge graph in conditions, where they can stand only in `exists` and `count`."""

from __future__ import annotations

import re

from codra_dsl.language.expression.tokens import MAX_LENGTH, SyntaxProblem

_NAME = "[A-Za-z][A-Za-z0-9_]*"
_TERM = rf"(?:some\s+)?{_NAME}(?:\s+as\s+{_NAME})?"
_LINK = rf"(?:-{_NAME}->|<-{_NAME}-)"
_PATH = re.compile(rf"(?P<negation>\b(?:not|no)\s+)?(?P<path>\b{_TERM}(?:\s*{_LINK}\s*{_TERM})+)", re.ASCII)


def bare_path_problem(text: str, help_template: str) -> SyntaxProblem | None:
    """Return the problem of a condition that contains a path outside of functions; None if it contains no path.

    `help_template` has the field `call`, the path as an argument of `exists`.
    """
    match = _PATH.search(text) if len(text) <= MAX_LENGTH else None
    if match is None:
        return None
    negation, path = (match["negation"] or "").strip(), match["path"]
    path = f"some {path}" if negation == "no" and not path.startswith("some ") else path
    call = f"{'not ' if negation else ''}exists({path})"
    return SyntaxProblem("a path is not a condition by itself", *match.span(), help_template.format(call=call))
