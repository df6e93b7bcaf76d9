"""Read the value of a port: a text, or an entry in braces."""

from __future__ import annotations

import re

from codra_dsl.language.frozen import dataclass

_KEY = re.compile(r"@?[A-Za-z_][A-Za-z0-9_.]*")
_SAME_NAME_VALUES = ("{=}", "=")


@dataclass(frozen=True, slots=True)
class EntryKey:
    """An entry as the value of a port: `{key}`."""

    key: str


def is_key(text: str) -> bool:
    """Return whether a text can name an entry."""
    return _KEY.fullmatch(text) is not None


def parse_port_value(port: str, value: str) -> EntryKey | str | None:
    """Return the entry or text that a port gets, or None for braces without the name of an entry between them.

    `{=}` is the entry with the same name. A text with only one brace at its ends, such as `json:{"x":1}`, is a text.
    """
    stripped_value = value.strip(" ")
    if stripped_value in _SAME_NAME_VALUES:
        return EntryKey(port)
    if not stripped_value.startswith("{") or not stripped_value.endswith("}"):
        return value
    key = stripped_value[1:-1]
    return EntryKey(key) if is_key(key) else None
