"""The traps of YAML for conditions: what a person reads in one way and YAML in another, each with its cure."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.expression.tokens import shown


@dataclass(frozen=True, slots=True)
class Trap:
    """What YAML made of a condition, and the cure.

    Attributes:
        cure: what to write in its place; empty where that depends on what is meant.
        condition: the condition that YAML reads then.
    """

    rule: str
    message: str
    help: str
    cure: str = ""
    condition: str = ""


def quoted(text: str) -> str:
    """Return a text as a YAML scalar in single quotes."""
    return "'" + _on_one_line(text).replace("'", "''") + "'"


def _on_one_line(text: str) -> str:
    """Return a text with single blanks in place of tabs and ends of lines."""
    return " ".join(text.split())


def _quoting(rule: str, message: str, written: str, what: str = "it") -> Trap:
    """Return a trap whose cure is quotes around all that is written."""
    way_out = f"put quotes around {what}: {quoted(written)}"
    return Trap(rule, message, way_out, quoted(written), _on_one_line(written))


def read_as_tag(tag: str, rest: str) -> Trap:
    """Return the trap of a condition that begins with `!`."""
    message = f"YAML reads {shown(tag)} as a tag, not as a negation"
    if not tag[1:]:
        return Trap("read-as-tag", message, "write 'not' instead of '!'")
    cure = f"not {tag[1:]}"
    return Trap("read-as-tag", message, f"write '{cure}{rest}'", cure, f"{cure}{rest}")


def read_as_block(text: str) -> Trap:
    """Return the trap of a condition that begins with `>` or `|`."""
    message = f"YAML reads the '{text[0]}' of {shown(text)} as the head of a text block, not as a comparison"
    way_out = (
        f"name what is compared: x {_on_one_line(text)}" if text[0] == ">" else f"put quotes around it: {quoted(text)}"
    )
    return Trap("read-as-block", message, way_out)


def read_as_quoted(first: str, rest: str, whole: str) -> Trap:
    """Return the trap of a condition that begins with a quoted text and goes on after it."""
    message = f"YAML takes {shown(first)} for the whole value and cannot read {shown(rest)} after it"
    return _quoting("read-as-quoted", message, whole, "all of it")


def read_as_literal(written: str, what: str) -> Trap:
    """Return the trap of a condition that is a YAML literal."""
    message = f"YAML reads {shown(written)} as {what}, not as a condition"
    way_out = f"write a condition, such as x == {written}; a list without items always holds"
    return Trap("read-as-literal", message, way_out)


def read_as_list(written: str) -> Trap:
    """Return the trap of a condition that is a list for YAML: it begins with `- ` or stands in brackets."""
    message = f"YAML reads {shown(written)} as a list, not as a condition"
    return Trap("read-as-list", message, f"put quotes around it: {quoted(written)}")


def torn_at_comma(written: str) -> Trap:
    """Return the trap of a condition with a comma inside brackets or braces."""
    message = f"YAML tears {shown(written)} apart at its comma"
    return _quoting("torn-at-comma", message, written)


def torn_at_colon(written: str) -> Trap:
    """Return the trap of a condition with `: ` in it."""
    message = f"YAML reads {shown(written)} as a key and its value, not as one text"
    return _quoting("torn-at-colon", message, written)


def cut_off_by_comment(written: str) -> Trap:
    """Return the trap of a condition with ` #` in it."""
    message = f"YAML reads all after the ' #' in {shown(written)} as a comment"
    return _quoting("cut-off-by-comment", message, written)


class Openings:
    """The quotes and parentheses that a text opens and does not close.

    Attributes:
        quote: the quote that is open, or an empty text.
    """

    def __init__(self, text: str) -> None:
        self.quote = ""
        self._depth = 0
        self._escaped = False
        self.read(text)

    @property
    def are_left(self) -> bool:
        """Whether anything is open."""
        return self._depth > 0 or self.quote != ""

    def read(self, text: str) -> None:
        """Go on with more text."""
        for letter in text:
            if self._escaped:
                self._escaped = False
            elif self.quote:
                self._escaped = letter == "\\"
                self.quote = "" if letter == self.quote else self.quote
            elif letter in "\"'":
                self.quote = letter
            elif letter in "()":
                self._depth += 1 if letter == "(" else -1
