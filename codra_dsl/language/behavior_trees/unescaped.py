"""Escape `&` and `<` in the values of attributes, which BehaviorTree.CPP accepts and other readers of XML refuse."""

from __future__ import annotations

import re
from bisect import bisect_right
from itertools import accumulate

from codra_dsl.language.frozen import dataclass

_PART = re.compile(r"""<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|=\s*(?:"([^"]*)"|'([^']*)')""", re.DOTALL)
_UNESCAPED = re.compile(r"<|&(?!(?:#[0-9]+|#x[0-9a-fA-F]+|[A-Za-z_][\w.-]*);)")
_REFERENCES = {"<": "&lt;", "&": "&amp;"}


@dataclass(frozen=True, slots=True)
class EscapedText:
    """A text in which the values of attributes are escaped.

    Attributes:
        offsets: the offsets of the escaped characters in the original text.
    """

    text: str
    offsets: tuple[int, ...]
    _ends: tuple[int, ...]
    _added: tuple[int, ...]

    def original_offset(self, offset: int) -> int:
        """Return the offset in the original text, for an offset in the escaped text that is outside of references."""
        index = bisect_right(self._ends, offset)
        return offset - (self._added[index - 1] if index else 0)


def escape_values(text: str) -> EscapedText:
    """Return a text in which each `<` and each `&` that begins no reference is escaped, if it is in a value."""
    offsets = tuple(
        match.start(group) + character.start()
        for match in _PART.finditer(text)
        if (group := match.lastindex) is not None
        for character in _UNESCAPED.finditer(match[group])
    )
    begins, ends = (0, *(offset + 1 for offset in offsets)), (*offsets, len(text))
    parts = [text[begin:end] for begin, end in zip(begins, ends, strict=True)]
    references = [_REFERENCES[text[offset]] for offset in offsets]
    added = tuple(accumulate(len(reference) - 1 for reference in references))
    return EscapedText(
        text="".join(piece for pair in zip(parts, (*references, ""), strict=True) for piece in pair),
        offsets=offsets,
        _ends=tuple(offset + 1 + total for offset, total in zip(offsets, added, strict=True)),
        _added=added,
    )
