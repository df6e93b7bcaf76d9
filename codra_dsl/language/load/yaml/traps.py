"""The traps of YAML for conditions: texts that YAML reads differently from people, and the fixes of these texts."""

from __future__ import annotations

import re
from dataclasses import dataclass

from codra_dsl.language.expression import Negative, Node, parse
from codra_dsl.language.expression.tokens import shown

_KEY_AND_VALUE = re.compile(r"(?P<key>[A-Za-z]\w*):\s+(?P<value>\S+)")


_CHOICE = re.compile(r"(?P<condition>[^?:]+?)\s*\?\s*(?P<then>[^?:]+?)\s*:\s*(?P<otherwise>[^?:]+)")


@dataclass(frozen=True, slots=True)
class Trap:
    """A condition that YAML misreads, and its fix.

    Attributes:
        replacement: the text to write instead; empty if that depends on the author's intention.
        condition: the condition that YAML reads from `replacement`.
    """

    rule: str
    message: str
    help: str
    replacement: str = ""
    condition: str = ""


def quote_text(text: str) -> str:
    """Return a text as a YAML scalar in single quotes, or in double quotes if that is easier to read."""
    line = _on_one_line(text)
    if "'" in line and not {'"', "\\"} & set(line):
        return f'"{line}"'
    return "'" + line.replace("'", "''") + "'"


def is_condition(text: str) -> bool:
    """Return whether a text can be read as a condition."""
    return isinstance(parse(_on_one_line(text)), Node)


def _on_one_line(text: str) -> str:
    """Return a text with single blanks in place of tabs and line breaks."""
    return " ".join(text.split())


def _quoting_trap(rule: str, message: str, written: str, pronoun: str = "it") -> Trap:
    """Return a trap whose fix is to quote the complete text."""
    help_text = f"put quotes around {pronoun}: {quote_text(written)}"
    return Trap(rule, message, help_text, quote_text(written), _on_one_line(written))


def read_as_tag(tag: str, rest: str) -> Trap:
    """Return the trap of a condition that begins with `!`."""
    message = f"YAML reads {shown(tag)} as a tag, not as a negation"
    if not tag[1:]:
        return Trap("read-as-tag", message, "write 'not' instead of '!'")
    replacement = f"not {tag[1:]}"
    return Trap("read-as-tag", message, f"write '{replacement}{rest}'", replacement, f"{replacement}{rest}")


def read_as_block(text: str) -> Trap:
    """Return the trap of a condition that begins with `>` or `|`."""
    message = f"YAML reads the '{text[0]}' of {shown(text)} as the head of a text block, not as a comparison"
    help_text = (
        f"write the compared name before it: x {_on_one_line(text)}"
        if text[0] == ">"
        else f"put quotes around it: {quote_text(text)}"
    )
    return Trap("read-as-block", message, help_text)


def read_as_quoted(first: str, rest: str, complete_text: str) -> Trap:
    """Return the trap of a condition that begins with a quoted text and continues after it."""
    message = f"YAML reads {shown(first)} as the complete value and cannot read {shown(rest)} after it"
    inner = complete_text[1:-1]
    if complete_text[:1] == complete_text[-1:] and not is_condition(complete_text):
        requoted_text = quote_text(inner)
        return Trap(
            "read-as-quoted",
            message,
            f"use other quotes around it: {requoted_text}",
            requoted_text,
            _on_one_line(inner),
        )
    return _quoting_trap("read-as-quoted", message, complete_text, "all of it")


def read_as_literal(written: str, noun: str, key: str) -> Trap:
    """Return the trap of a condition that is a YAML literal, under a key of an element."""
    message = f"YAML reads {shown(written)} as {noun}, not as a condition"
    if key == "value":
        return Trap("read-as-literal", message, f"quote it: '{written}'")
    is_listed = key not in ("identifies", "always")
    rest = "a list without items always holds" if is_listed else f"if it is constant, quote it: '{written}'"
    return Trap("read-as-literal", message, f"write a condition, such as x == {written}; {rest}")


def read_as_list(written: str) -> Trap:
    """Return the trap of a condition that is a list for YAML: it begins with `- ` or is in brackets."""
    message = f"YAML reads {shown(written)} as a list, not as a condition"
    if isinstance(parse(_on_one_line(written)), Negative):  # a number, which is not a condition
        return Trap("read-as-list", message, "write '- ' once")
    return Trap("read-as-list", message, f"put quotes around it: {quote_text(written)}")


def torn_at_comma(written: str) -> Trap:
    """Return the trap of a condition with a comma inside brackets or braces."""
    message = f"YAML splits {shown(written)} at its comma"
    if written[:1] + written[-1:] == "()" and not is_condition(written):
        return Trap("torn-at-comma", message, f"write [{written[1:-1]}]")
    return _quoting_trap("torn-at-comma", message, written)


def torn_number(written: str) -> Trap:
    """Return the trap of a number with a decimal comma inside brackets or braces."""
    number_text = re.sub(r"(?<=[0-9]),(?=[0-9])", ".", written)
    return Trap("torn-at-comma", f"YAML splits {shown(written)} at its comma", f"write {number_text}")


def torn_at_colon(written: str) -> Trap:
    """Return the trap of a text with `: ` in it."""
    message = f"YAML reads {shown(written)} as a key and its value, not as one text"
    return _quoting_trap("torn-at-colon", message, written)


def torn_call(written: str) -> Trap:
    """Return the trap of `package.module: function`."""
    message = f"YAML reads {shown(written)} as a key and its value, not as a function"
    return Trap("torn-at-colon", message, f"write {''.join(written.split())}, without a blank")


def torn_expectation(written: str) -> Trap:
    """Return the trap of `door: open` under `monitor`."""
    message = f"YAML reads {shown(written)} as a key and its value, not as an expectation"
    return Trap("torn-at-colon", message, "write NAME, NAME becomes VALUE within D, or NAME stays VALUE")


def torn_mapping(written: str) -> Trap:
    """Return the trap of a mapping on one line without braces."""
    message = f"YAML reads {shown(written)} as a key and its value, not as a mapping"
    return Trap("torn-at-colon", message, f"put braces around it: {{{written}}}")


def torn_condition(written: str) -> Trap:
    """Return the trap of a condition with `: ` in it: `x: true` for `x == true`, `c ? a : b` for `a if c else b`."""
    pair, choice = _KEY_AND_VALUE.fullmatch(written), _CHOICE.fullmatch(written)
    replacement = "" if pair is None else f"{pair['key']} == {pair['value']}"
    if choice is not None:
        replacement = f"{choice['then']} if {choice['condition']} else {choice['otherwise']}"
    if not is_condition(replacement):
        return torn_at_colon(written)
    message = f"YAML reads {shown(written)} as a key and its value, not as a condition"
    return Trap("torn-at-colon", message, f"write {replacement}", replacement, replacement)


def cut_off_by_comment(written: str) -> Trap:
    """Return the trap of a condition with ` #` in it."""
    message = f"YAML reads everything after ' #' in {shown(written)} as a comment"
    if not is_condition(written):
        is_condition_before = is_condition(written.partition(" #")[0])
        help_text = (
            "put the comment on a line of its own" if is_condition_before else "complete the condition before the '#'"
        )
        return Trap("cut-off-by-comment", message, f"{help_text}, or quote all of it")
    return _quoting_trap("cut-off-by-comment", message, written)


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
        """Continue with more text."""
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
