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
        text: the repaired text that the parser reads. Its offsets equal those in the file if nothing was inserted.
        reported_offsets: the offsets in `text` of masked ranges and inserted placeholders, which have been reported.
    """

    def __init__(self, source: Source) -> None:
        self.text = source.text
        self.reported_offsets: set[int] = set()
        self._source = source
        self._masked_ranges: dict[int, int] = {}
        self._insertions: list[tuple[int, str]] = []
        self._repaired_lines: list[int] = []

    def place(self, start: int, end: int) -> Place:
        """Return the place in the file of a range of the repaired text."""
        return self._source.place(self._offset_in_file(start), self._offset_in_file(end))

    def line_end(self, offset: int) -> int:
        """Return the offset of the line break after an offset, or of the text's end."""
        offset_in_file = self._offset_in_file(offset)
        return offset + self._source.line_end(offset_in_file) - offset_in_file

    def fix(self, problem: Problem) -> Fix | None:
        """Return the fix of a problem, if there is one."""
        place = self.place(problem.start, problem.end)
        if problem.trap is not None:
            return trap_fix(problem.trap, place)
        if problem.insertion is None or problem.insertion[1] == NO_KEY:
            return None
        offset_in_file = self._offset_in_file(problem.insertion[0])
        edit = Edit(self._source.span(offset_in_file, offset_in_file), problem.insertion[1])
        return Fix(message=f"Insert '{edit.text}'", edits=(edit,), applicability=Applicability.SUGGESTED)

    def has_caused(self, problem: Problem) -> bool:
        """Return whether an insertion caused a problem: the problem cannot be repaired, and the insertion is nearby."""
        is_unrepairable = problem.insertion is None and problem.mask is None
        return is_unrepairable and any(
            abs(self._line_number(problem.start) - line) <= _NEARBY for line in self._repaired_lines
        )

    def repair(self, problem: Problem) -> bool:
        """Mask an unreadable range, or insert missing text; return whether either is possible."""
        if problem.insertion is not None:
            offset, missing_text = problem.insertion
            insort(self._insertions, (self._offset_in_file(offset), missing_text))
            self._repaired_lines.append(self._line_number(problem.insertion[0]))
        elif problem.mask is not None:
            start, end = map(self._offset_in_file, problem.mask)
            self._masked_ranges[start] = end
        else:
            return False
        self._rebuild_text()
        return True

    def restore_offsets(self, root: YamlNode | None) -> None:
        """Convert the offsets of nodes from the repaired text to the file."""
        pending = [root] if root is not None and self._insertions else []
        while pending:
            node = pending.pop()
            node.start, node.end = self._offset_in_file(node.start), self._offset_in_file(node.end)
            if isinstance(node, SequenceNode):
                pending.extend(node.items)
            elif isinstance(node, MappingNode):
                pending.extend(part for entry in node.entries.values() for part in entry)

    def _line_number(self, offset: int) -> int:
        """Return the number of the line in the file that contains an offset in the repaired text."""
        return self.place(offset, offset).span.line

    def _rebuild_text(self) -> None:
        text = self._source.text
        for start, end in self._masked_ranges.items():
            text = text[:start] + "x" * (end - start) + text[end:]
        pieces, position = [], 0
        for offset, missing_text in self._insertions:
            pieces += [text[position:offset], missing_text]
            position = offset
        self.text = "".join((*pieces, text[position:]))
        self.reported_offsets = {self._offset_in_repaired_text(start) for start in self._masked_ranges}
        self.reported_offsets |= {
            self._offset_in_repaired_text(position) - len(missing_text)
            for position, missing_text in self._insertions
            if missing_text == NO_KEY
        }

    def _offset_in_file(self, offset: int) -> int:
        """Convert an offset in the repaired text to an offset in the file."""
        inserted_length = 0
        for insertion_offset, missing_text in self._insertions:
            if offset <= insertion_offset + inserted_length:
                break
            inserted_length += min(len(missing_text), offset - insertion_offset - inserted_length)
        return offset - inserted_length

    def _offset_in_repaired_text(self, offset: int) -> int:
        """Convert an offset in the file to an offset in the repaired text, after any text inserted at this offset."""
        return offset + sum(
            len(missing_text) for insertion_offset, missing_text in self._insertions if insertion_offset <= offset
        )
