"""A YAML document as nodes: its data as plain Python values, and for each of them where it stands.

Positions are offsets into the file's text in code points; `Source.span` turns them into lines and columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum
from typing import NamedTuple

Data = bool | int | float | str | None
"""What a scalar stands for."""

Letters = tuple[tuple[int, int, int], ...]
"""Where the letters of a text stand, as `codra_dsl.model.Letters.runs`."""


class Style(Enum):
    """How a scalar is written."""

    PLAIN = ""
    SINGLE_QUOTED = "'"
    DOUBLE_QUOTED = '"'
    LITERAL = "|"
    FOLDED = ">"


class Filled(NamedTuple):
    """What is remembered of a scalar that parameters were put into.

    Attributes:
        written: the template's text.
        pieces: of the new text: each with where its letters stand, counted from its own beginning.
    """

    written: str
    pieces: tuple[tuple[str, Letters], ...]

    def letters(self) -> Letters:
        """Return where the letters of the new text stand."""
        found: list[tuple[int, int, int]] = []
        at = 0
        for text, letters in self.pieces:
            if text:
                found.extend((at + first, position, width) for first, position, width in letters)
            at += len(text)
        return tuple(found)


class ScalarNode:
    """A text, number, truth value or nothing.

    Attributes:
        text: what is written, without quotes; parameters put in.
        data: what it stands for in YAML 1.2's core schema.
        reported: whether a finding about it stands already, so that no other must follow.
        filled: of a scalar that parameters were put into; None where it stands in the file as it is.
    """

    __slots__ = ("data", "end", "filled", "reported", "start", "style", "text")

    def __init__(self, text: str, data: Data, start: int, end: int, style: Style) -> None:
        self.text = text
        self.data = data
        self.start = start
        self.end = end
        self.style = style
        self.reported = False
        self.filled: Filled | None = None

    @property
    def written(self) -> str:
        """Return the text as it stands in the file, before parameters were put in."""
        return self.text if self.filled is None else self.filled.written


class SequenceNode:
    """A list. `flow` says whether it is written in brackets."""

    __slots__ = ("data", "end", "flow", "items", "reported", "start")

    def __init__(self, start: int, end: int, *, flow: bool) -> None:
        self.items: list[YamlNode] = []
        self.data: list[object] = []
        self.start = start
        self.end = end
        self.flow = flow
        self.reported = False


class MappingNode:
    """A mapping. `entries` has key and value by the key's text; keys are texts, whatever they look like.

    `unread` says that it has an entry whose key nobody knows, which a finding is about.
    """

    __slots__ = ("data", "end", "entries", "flow", "reported", "start", "unread")

    def __init__(self, start: int, end: int, *, flow: bool) -> None:
        self.entries: dict[str, tuple[ScalarNode, YamlNode]] = {}
        self.data: dict[str, object] = {}
        self.start = start
        self.end = end
        self.flow = flow
        self.reported = False
        self.unread = False

    def value(self, key: str) -> YamlNode | None:
        """Return the value of a key, or None if the key is absent."""
        entry = self.entries.get(key)
        return None if entry is None else entry[1]

    def take(self, key: str) -> YamlNode | None:
        """Return the value of a key, or None if the key is absent, and let go of it."""
        self.data.pop(key, None)
        entry = self.entries.pop(key, None)
        return None if entry is None else entry[1]

    def put(self, key: ScalarNode, value: YamlNode) -> None:
        """Add an entry, which must not be there yet."""
        self.entries[key.text] = (key, value)
        self.data[key.text] = value.data


YamlNode = ScalarNode | SequenceNode | MappingNode


def scalars(node: YamlNode, wanted: Callable[[ScalarNode], bool]) -> Iterator[ScalarNode]:
    """Yield the scalars of a document for which `wanted` holds, keys included, in file order."""
    waiting: list[YamlNode] = [node]
    while waiting:
        current = waiting.pop()
        if isinstance(current, ScalarNode):
            if wanted(current):
                yield current
        elif isinstance(current, SequenceNode):
            waiting.extend(reversed(current.items))
        else:
            waiting.extend(part for entry in reversed(current.entries.values()) for part in reversed(entry))


def visible_range(key: ScalarNode, value: YamlNode) -> tuple[int, int]:
    """Return the range to underline for a value: its own where it is short, else that of its key."""
    if value.end > value.start and (isinstance(value, ScalarNode) or value.flow):
        return value.start, value.end
    return key.start, key.end
