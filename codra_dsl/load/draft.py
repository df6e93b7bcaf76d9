"""A file's text as the parser gets it: what spoils it blotted out, what is missing put in, each letter in its place."""

from __future__ import annotations

from bisect import insort

from codra_dsl.diagnostics import Applicability, Edit, Fix, Place
from codra_dsl.load.complaint import Problem
from codra_dsl.load.fixes import trap_fix
from codra_dsl.load.mending import NO_KEY
from codra_dsl.load.nodes import MappingNode, SequenceNode, YamlNode
from codra_dsl.load.source import Source

_NEARBY = 2
"""How many lines after something was put in it still counts as what makes the rest unreadable."""


class Draft:
    """The text of one file, and what was done to it so that it can be read.

    Attributes:
        text: what the parser reads; offsets in it are the draft's, unless something was put in the same as the file's.
        blots: where in `text` something stands that was not written there, and that a finding is about.
    """

    def __init__(self, source: Source) -> None:
        self.text = source.text
        self.blots: set[int] = set()
        self._source = source
        self._blotted: dict[int, int] = {}
        self._missing: list[tuple[int, str]] = []
        self._mended: list[int] = []

    def place(self, start: int, end: int) -> Place:
        """Return the place of a range of the draft in the file."""
        return self._source.place(self._of_file(start), self._of_file(end))

    def line_end(self, offset: int) -> int:
        """Return the offset of the line break after an offset, or of the text's end."""
        at = self._of_file(offset)
        return offset + self._source.line_end(at) - at

    def fix(self, problem: Problem) -> Fix | None:
        """Return how a problem is put right, where that is known."""
        place = self.place(problem.start, problem.end)
        if problem.trap is not None:
            return trap_fix(problem.trap, place)
        if problem.mend is None or problem.mend[1] == NO_KEY:
            return None
        at = self._of_file(problem.mend[0])
        edit = Edit(self._source.span(at, at), problem.mend[1])
        return Fix(message=f"Insert '{edit.text}'", edits=(edit,), applicability=Applicability.SUGGESTED)

    def is_lost_at(self, problem: Problem) -> bool:
        """Return whether a problem comes of what was put in: nothing is known that helps, and the place is the same."""
        helpless = problem.mend is None and problem.blot is None
        return helpless and any(abs(self._line(problem.start) - line) <= _NEARBY for line in self._mended)

    def mend(self, problem: Problem) -> bool:
        """Blot out what spoils the text, or put in what is missing; return whether either is known."""
        if problem.mend is not None:
            at, missing = problem.mend
            insort(self._missing, (self._of_file(at), missing))
            self._mended.append(self._line(problem.mend[0]))
        elif problem.blot is not None:
            start, end = map(self._of_file, problem.blot)
            self._blotted[start] = end
        else:
            return False
        self._write()
        return True

    def put_back(self, root: YamlNode | None) -> None:
        """Let nodes of the draft stand where the file has them."""
        waiting = [root] if root is not None and self._missing else []
        while waiting:
            node = waiting.pop()
            node.start, node.end = self._of_file(node.start), self._of_file(node.end)
            if isinstance(node, SequenceNode):
                waiting.extend(node.items)
            elif isinstance(node, MappingNode):
                waiting.extend(part for entry in node.entries.values() for part in entry)

    def _line(self, offset: int) -> int:
        """Return the number of the file's line that an offset of the draft stands in."""
        return self.place(offset, offset).span.line

    def _write(self) -> None:
        text = self._source.text
        for start, end in self._blotted.items():
            text = text[:start] + "x" * (end - start) + text[end:]
        pieces, at = [], 0
        for offset, missing in self._missing:
            pieces += [text[at:offset], missing]
            at = offset
        self.text = "".join((*pieces, text[at:]))
        self.blots = {self._of_draft(start) for start in self._blotted}
        self.blots |= {self._of_draft(at) - len(letter) for at, letter in self._missing if letter == NO_KEY}

    def _of_file(self, offset: int) -> int:
        """Return the offset in the file of an offset in the draft."""
        before = 0
        for at, missing in self._missing:
            if offset <= at + before:
                break
            before += min(len(missing), offset - at - before)
        return offset - before

    def _of_draft(self, offset: int) -> int:
        """Return the offset in the draft of an offset in the file, after what is missing there."""
        return offset + sum(len(missing) for at, missing in self._missing if at <= offset)
