"""Values as Python literals: the only way in which anything that a spec says reaches the code.

Literals are ASCII: the same bytes whichever Unicode a Python knows, and nothing that an editor would hide.
"""

from __future__ import annotations

import math

Value = bool | int | float | str


def literal(value: Value) -> str:
    """Return the literal of a value, as `ruff format` writes it; infinity needs `import math`."""
    if isinstance(value, str):
        return text_literal(value)
    if isinstance(value, float) and math.isinf(value):
        return "math.inf" if value > 0 else "-math.inf"
    return repr(value).replace("e+", "e")


def text_literal(text: str) -> str:
    """Return the literal of a string, in double quotes unless single ones spare escapes."""
    if text.isascii() and text.isprintable() and '"' not in text and "\\" not in text:  # as most texts are
        return f'"{text}"'
    # With both kinds of quote ahead of it, `ascii` takes single quotes and escapes those of the text alone.
    body = ascii("'\"" + text)[4:-1]
    if text.count('"') > text.count("'"):
        return f"'{body}'"
    return '"' + body.replace("\\'", "'").replace('"', '\\"') + '"'


def prose(text: str) -> str:
    """Return a text that can stand inside a docstring: on one line, without quotes or backslashes that would count."""
    return ascii(text)[1:-1].replace("\\", "/").replace('"', "'")
