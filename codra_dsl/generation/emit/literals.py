"""Write values as Python literals: the only form in which contents of a spec reach the code.

Literals are ASCII, so that the bytes do not depend on the version of Unicode in Python, and so that no character is
invisible in an editor.
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
    """Return the literal of a string, in double quotes unless single quotes need fewer escapes."""
    if text.isascii() and text.isprintable() and '"' not in text and "\\" not in text:  # most texts are like this
        return f'"{text}"'
    # With both kinds of quotes before the text, `ascii` puts single quotes around it and escapes only single quotes.
    body = ascii("'\"" + text)[4:-1]
    if text.count('"') > text.count("'"):
        return f"'{body}'"
    return '"' + body.replace("\\'", "'").replace('"', '\\"') + '"'


def prose(text: str) -> str:
    """Return a text that is safe inside a docstring: on one line, without double quotes or backslashes."""
    return ascii(text)[1:-1].replace("\\", "/").replace('"', "'")
