"""A file's text as the parser gets it: unreadable ranges are masked, and missing text is inserted.

Offsets in this text are mapped to offsets in the file.
"""

from __future__ import annotations

from bisect import insort

from codra_dsl.language.diagnostics import Applicability, Edit, Fix, Place
from codra_dsl.language.load.yaml.fixes import trap_fix
from codra_dsl.language.load.yaml.nodes import MappingNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.parser_error import Problem
from codra_dsl.language.load.yaml.repair import NO_KEY
from codra_dsl.language.load.yaml.source import Source

_NEARBY = 2
"""An insertion counts as the cause of a new problem if the problem is at most this number of lines away."""


class RepairedText:
    """The text of one file, with the repairs that make it readable.

    Attributes:
        text: the repaired text that the parser reads. Its offsets equal the file's if nothing was inserted.
        placeholders: the offsets in `text` of masked ranges and inserted placeholders, which have been reported.
    """

    def __init__(self, source: Source) -> None:
        self.text = source.text
        self.placeholders: set[int] = set()
        self._source = source
        self._masked: dict[int, int] = {}
        self._missing: list[tuple[int, str]] = []
        self._repaired_lines: list[int] = []

    def place(self, start: int, end: int) -> Place:
        """Return the place in the file of a range of the repaired text."""
        return self._source.place(self._offset_in_file(start), self._offset_in_file(end))

    def line_end(self, offset: int) -> int:
        """Return the offset of the line break after an offset, or of the text's end."""
        at = self._offset_in_file(offset)
        return offset + self._source.line_end(at) - at

    def fix(self, problem: Problem) -> Fix | None:
        """Return the fix of a problem, if there is one."""
        place = self.place(problem.start, problem.end)
        if problem.trap is not None:
            return trap_fix(problem.trap, place)
        if problem.insertion is None or problem.insertion[1] == NO_KEY:
            return None
        at = self._offset_in_file(problem.insertion[0])
        edit = Edit(self._source.span(at, at), problem.insertion[1])
        return Fix(message=f"Insert '{edit.text}'", edits=(edit,), applicability=Applicability.SUGGESTED)

    def has_caused(self, problem: Problem) -> bool:
        """Return whether an insertion caused a problem: the problem cannot be repaired, and the insertion is nearby."""
        helpless = problem.insertion is None and problem.mask is None
        return helpless and any(abs(self._line(problem.start) - line) <= _NEARBY for line in self._repaired_lines)

    def repair(self, problem: Problem) -> bool:
        """Mask an unreadable range, or insert missing text; return whether either is possible."""
        if problem.insertion is not None:
            at, missing = problem.insertion
            insort(self._missing, (self._offset_in_file(at), missing))
            self._repaired_lines.append(self._line(problem.insertion[0]))
        elif problem.mask is not None:
            start, end = map(self._offset_in_file, problem.mask)
            self._masked[start] = end
        else:
            return False
        self._write()
        return True

    def restore_offsets(self, root: YamlNode | None) -> None:
        """Convert the offsets of nodes from the repaired text to the file."""
        waiting = [root] if root is not None and self._missing else []
        while waiting:
            node = waiting.pop()
            node.start, node.end = self._offset_in_file(node.start), self._offset_in_file(node.end)
            if isinstance(node, SequenceNode):
                waiting.extend(node.items)
            elif isinstance(node, MappingNode):
                waiting.extend(part for entry in node.entries.values() for part in entry)

    def _line(self, offset: int) -> int:
        """Return the line number in the file of an offset of the repaired text."""
        return self.place(offset, offset).span.line

    def _write(self) -> None:
        text = self._source.text
        for start, end in self._masked.items():
            text = text[:start] + "x" * (end - start) + text[end:]
        pieces, at = [], 0
        for offset, missing in self._missing:
            pieces += [text[at:offset], missing]
            at = offset
        self.text = "".join((*pieces, text[at:]))
        self.placeholders = {self._offset_in_text(start) for start in self._masked}
        self.placeholders |= {
            self._offset_in_text(at) - len(letter) for at, letter in self._missing if letter == NO_KEY
        }

    def _offset_in_file(self, offset: int) -> int:
        """Return the offset in the file of an offset in the repaired text."""
        before = 0
        for at, missing in self._missing:
            if offset <= at + before:
                break
            before += min(len(missing), offset - at - before)
        return offset - before

    def _offset_in_text(self, offset: int) -> int:
        """Return the offset in the repaired text of an offset in the file; it is after any text inserted there."""
        return offset + sum(len(missing) for at, missing in self._missing if at <= offset)
