"""Read the value of a port: a text, or an entry in braces."""

from __future__ import annotations

import re
from dataclasses import dataclass

_KEY = re.compile(r"@?[A-Za-z_][A-Za-z0-9_.]*")
_SAME = ("{=}", "=")


@dataclass(frozen=True, slots=True)
class EntryKey:
    """`{key}`."""

    key: str


_NOT_IN_NAMES = re.compile(r"""[\s<>&"'/\\:*?|.\x00-\x1f\x7f]""")


def first_refused_letter(name: str) -> str | None:
    """Return the first letter that BehaviorTree.CPP refuses in the name of a tree, a node or a port, or None."""
    letter = _NOT_IN_NAMES.search(name)
    return None if letter is None else letter[0]


def is_key(text: str) -> bool:
    """Return whether a text can name an entry."""
    return _KEY.fullmatch(text) is not None


def parse_port_value(port: str, value: str) -> EntryKey | str | None:
    """Return the entry or text that a port gets, or None for invalid braces. `{=}` is the entry named as the port."""
    inside = value.strip(" ")
    if inside in _SAME:
        return EntryKey(port)
    if not inside.startswith("{") and not inside.endswith("}"):
        return value
    key = inside[1:-1]
    return EntryKey(key) if inside.startswith("{") and inside.endswith("}") and is_key(key) else None
