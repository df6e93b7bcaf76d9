"""Paths of the knowledge graph in conditions, where only `exists` and `count` accept them."""

from __future__ import annotations

import re

from codra_dsl.language.expression.tokens import MAX_LENGTH, SyntaxProblem

_NAME = "[A-Za-z][A-Za-z0-9_]*"
_TERM = rf"(?:some\s+)?{_NAME}(?:\s+as\s+{_NAME})?"
_LINK = rf"(?:-{_NAME}->|<-{_NAME}-)"
_BARE_PATH = rf"\b{_TERM}(?:\s*{_LINK}\s*{_TERM})+"
_PATH = re.compile(rf"(?P<negation>\b(?:not|no)\s+)?(?P<path>{_BARE_PATH})", re.ASCII)
_COUNT = re.compile(
    rf"(?:\bnot\s+)?\b(?P<function>count|exists)\s*\(\s*{_BARE_PATH}\s*\)(?P<comparison>\s*(?:[=!]=|[<>]=?)\s*\d+\b)?",
    re.ASCII,
)


def bare_path_problem(text: str, help_template: str) -> SyntaxProblem | None:
    """Return the problem of a condition that contains a path where paths are not allowed; None if it contains no path.

    `help_template` has the field `call`, the count as written or the path as an argument of `exists`; and may have the
    field `condition`, a condition over a variable NAME with this value.
    """
    if len(text) > MAX_LENGTH:
        return None
    if count := _COUNT.search(text):
        message = f"{count['function']}() is allowed only in 'derived'"
        is_number = count["function"] == "count" and not count["comparison"]
        condition = "NAME" if is_number else "NAME == true"
        return SyntaxProblem(message, *count.span(), help_template.format(call=count[0], condition=condition))
    match = _PATH.search(text)
    if match is None:
        return None
    negation, path = (match["negation"] or "").strip(), match["path"]
    path = f"some {path}" if negation == "no" and not path.startswith("some ") else path
    call = f"{'not ' if negation else ''}exists({path})"
    help_text = help_template.format(call=call, condition="NAME == true")
    return SyntaxProblem("a path is not a condition by itself", *match.span(), help_text)
