"""A YAML document as nodes: its data as plain Python values, each value with its position.

Positions are offsets into the file's text in code points; `Source.span` converts them to lines and columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum
from typing import NamedTuple

Data = bool | int | float | str | None
"""The value of a scalar."""

LetterRuns = tuple[tuple[int, int, int], ...]
"""The positions of the letters of a text, in the form of `codra_dsl.language.model.Letters.runs`."""


class Style(Enum):
    """The YAML style of a scalar."""

    PLAIN = ""
    SINGLE_QUOTED = "'"
    DOUBLE_QUOTED = '"'
    LITERAL = "|"
    FOLDED = ">"


class FilledText(NamedTuple):
    """The origin of a scalar with substituted parameters.

    Attributes:
        written: the template's text.
        pieces: the pieces of the new text. Each piece has the positions of its letters, with offsets from the beginning
            of the piece.
    """

    written: str
    pieces: tuple[tuple[str, LetterRuns], ...]

    def letters(self) -> LetterRuns:
        """Return the positions of the letters of the new text."""
        runs: list[tuple[int, int, int]] = []
        offset = 0
        for text, letters in self.pieces:
            if text:
                runs.extend((offset + first, position, width) for first, position, width in letters)
            offset += len(text)
        return tuple(runs)


class ScalarNode:
    """A text, number, truth value or empty value.

    Attributes:
        text: the text as written, without quotes, with parameters substituted.
        data: the value in YAML 1.2's core schema.
        reported: whether there is already a finding about the scalar, so that no other finding may follow.
        filled_text: the origin of the text if parameters were substituted; None if the file contains the text itself.
    """

    __slots__ = ("data", "end", "filled_text", "reported", "start", "style", "text")

    def __init__(self, text: str, data: Data, start: int, end: int, style: Style) -> None:
        self.text = text
        self.data = data
        self.start = start
        self.end = end
        self.style = style
        self.reported = False
        self.filled_text: FilledText | None = None

    @property
    def written(self) -> str:
        """Return the text as written in the file, before the substitution of parameters."""
        return self.text if self.filled_text is None else self.filled_text.written


class SequenceNode:
    """A list; `flow` is true if it is written in brackets."""

    __slots__ = ("data", "end", "flow", "items", "reported", "start")

    def __init__(self, start: int, end: int, *, flow: bool) -> None:
        self.items: list[YamlNode] = []
        self.data: list[object] = []
        self.start = start
        self.end = end
        self.flow = flow
        self.reported = False


class MappingNode:
    """A mapping. `entries` maps the text of each key to (key, value); keys are always texts.

    `unread` is true if the mapping has an entry with an unreadable key; this entry has been reported.
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
        """Remove a key and return its value, or None if the key is absent."""
        self.data.pop(key, None)
        entry = self.entries.pop(key, None)
        return None if entry is None else entry[1]

    def put(self, key: ScalarNode, value: YamlNode) -> None:
        """Add an entry; its key must be new."""
        self.entries[key.text] = (key, value)
        self.data[key.text] = value.data


YamlNode = ScalarNode | SequenceNode | MappingNode


def scalars(node: YamlNode, is_wanted: Callable[[ScalarNode], bool]) -> Iterator[ScalarNode]:
    """Yield the scalars of a document for which `is_wanted` holds, keys included, in file order."""
    pending: list[YamlNode] = [node]
    while pending:
        current = pending.pop()
        if isinstance(current, ScalarNode):
            if is_wanted(current):
                yield current
        elif isinstance(current, SequenceNode):
            pending.extend(reversed(current.items))
        else:
            pending.extend(part for entry in reversed(current.entries.values()) for part in reversed(entry))


def visible_range(key: ScalarNode, value: YamlNode) -> tuple[int, int]:
    """Return the range to underline: that of the value if it is a scalar or in brackets, otherwise that of its key."""
    if value.end > value.start and (isinstance(value, ScalarNode) or value.flow):
        return value.start, value.end
    return key.start, key.end
