"""The traps of YAML for conditions: texts that YAML reads differently from people, and the fixes of these texts."""

from __future__ import annotations

import re

from codra_dsl.language.expression import Negative, Node, is_name, parse, parse_derivation
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass

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
    line = _join_lines(text)
    if "'" in line and not {'"', "\\"} & set(line):
        return f'"{line}"'
    return "'" + line.replace("'", "''") + "'"


def is_condition(text: str) -> bool:
    """Return whether a text can be read as a condition."""
    return isinstance(parse(_join_lines(text)), Node)


def is_derivation(text: str) -> bool:
    """Return whether a text can be read as the expression of a derived variable."""
    return isinstance(parse_derivation(_join_lines(text)), Node)


def _join_lines(text: str) -> str:
    """Return a text with single blanks in place of tabs and line breaks."""
    return " ".join(text.split())


def _quoting_trap(rule: str, message: str, scalar_text: str, pronoun: str = "it") -> Trap:
    """Return a trap whose fix is to quote the complete text."""
    help_text = f"put quotes around {pronoun}: {quote_text(scalar_text)}"
    return Trap(rule, message, help_text, quote_text(scalar_text), _join_lines(scalar_text))


def read_as_tag_trap(tag: str, rest: str) -> Trap:
    """Return the trap of a condition that begins with `!`."""
    message = f"YAML reads {shown(tag)} as a tag, not as a negation"
    if not tag[1:]:
        return Trap("read-as-tag", message, "write 'not' instead of '!'")
    replacement = f"not {tag[1:]}"
    return Trap("read-as-tag", message, f"write '{replacement}{rest}'", replacement, f"{replacement}{rest}")


def read_as_block_trap(text: str) -> Trap:
    """Return the trap of a condition that begins with `>` or `|`."""
    message = f"YAML reads the '{text[0]}' of {shown(text)} as the head of a text block, not as a comparison"
    help_text = (
        f"write the compared name before it: x {_join_lines(text)}"
        if text[0] == ">"
        else f"put quotes around it: {quote_text(text)}"
    )
    return Trap("read-as-block", message, help_text)


def read_as_quoted_trap(first: str, rest: str, complete_text: str) -> Trap:
    """Return the trap of a condition that begins with a quoted text and continues after it."""
    message = f"YAML reads {shown(first)} as the complete value and cannot read {shown(rest)} after it"
    unquoted_text = complete_text[1:-1]
    if complete_text[:1] == complete_text[-1:] and not is_condition(complete_text):
        requoted_text = quote_text(unquoted_text)
        return Trap(
            "read-as-quoted",
            message,
            f"use other quotes around it: {requoted_text}",
            requoted_text,
            _join_lines(unquoted_text),
        )
    return _quoting_trap("read-as-quoted", message, complete_text, "all of it")


def read_as_literal_trap(scalar_text: str, noun: str, key: str) -> Trap:
    """Return the trap of a condition that is a YAML literal; `key` is the element's key that contains it."""
    message = f"YAML reads {shown(scalar_text)} as {noun}, not as a condition"
    if key == "value":
        return Trap("read-as-literal", message, f"quote it: '{scalar_text}'")
    is_listed = key not in ("identifies", "always")
    rest = "a list without items always holds" if is_listed else f"if it is constant, quote it: '{scalar_text}'"
    return Trap("read-as-literal", message, f"write a condition, such as x == {scalar_text}; {rest}")


def read_as_list_trap(scalar_text: str) -> Trap:
    """Return the trap of a condition that is a list for YAML: it begins with `- ` or is in brackets."""
    message = f"YAML reads {shown(scalar_text)} as a list, not as a condition"
    if isinstance(parse(_join_lines(scalar_text)), Negative):  # a number, which is not a condition
        return Trap("read-as-list", message, "write '- ' once")
    return Trap("read-as-list", message, f"put quotes around it: {quote_text(scalar_text)}")


def torn_at_comma_trap(scalar_text: str) -> Trap:
    """Return the trap of a condition with a comma inside brackets or braces."""
    message = f"YAML splits {shown(scalar_text)} at its comma"
    if scalar_text[:1] + scalar_text[-1:] == "()" and not is_condition(scalar_text):
        return Trap("torn-at-comma", message, f"write [{scalar_text[1:-1]}]")
    return _quoting_trap("torn-at-comma", message, scalar_text)


def torn_number_trap(scalar_text: str) -> Trap:
    """Return the trap of a number with a decimal comma inside brackets or braces."""
    number_text = re.sub(r"(?<=[0-9]),(?=[0-9])", ".", scalar_text)
    return Trap("torn-at-comma", f"YAML splits {shown(scalar_text)} at its comma", f"write {number_text}")


def torn_at_colon_trap(scalar_text: str) -> Trap:
    """Return the trap of a text with `: ` in it."""
    message = f"YAML reads {shown(scalar_text)} as a key and its value, not as one text"
    return _quoting_trap("torn-at-colon", message, scalar_text)


def torn_call_trap(scalar_text: str) -> Trap:
    """Return the trap of `package.module: function`."""
    message = f"YAML reads {shown(scalar_text)} as a key and its value, not as a function"
    return Trap("torn-at-colon", message, f"write {''.join(scalar_text.split())}, without a blank")


def torn_expectation_trap(scalar_text: str) -> Trap:
    """Return the trap of `door: open` under `monitor`."""
    message = f"YAML reads {shown(scalar_text)} as a key and its value, not as an expectation"
    return Trap("torn-at-colon", message, "write NAME, NAME becomes VALUE within D, or NAME stays VALUE")


def torn_mapping_trap(scalar_text: str) -> Trap:
    """Return the trap of a mapping on one line without braces."""
    message = f"YAML reads {shown(scalar_text)} as a key and its value, not as a mapping"
    return Trap("torn-at-colon", message, f"put braces around it: {{{scalar_text}}}")


def torn_condition_trap(scalar_text: str) -> Trap:
    """Return the trap of a condition with `: ` in it: `x: true` for `x == true`, `c ? a : b` for `a if c else b`."""
    pair_match, choice_match = _KEY_AND_VALUE.fullmatch(scalar_text), _CHOICE.fullmatch(scalar_text)
    value = "" if pair_match is None else pair_match["value"]
    value = f'"{value}"' if is_name(value) else value
    replacement = "" if pair_match is None else f"{pair_match['key']} == {value}"
    if choice_match is not None:
        replacement = f"{choice_match['then']} if {choice_match['condition']} else {choice_match['otherwise']}"
    if not is_condition(replacement):
        return torn_at_colon_trap(scalar_text)
    message = f"YAML reads {shown(scalar_text)} as a key and its value, not as a condition"
    return Trap("torn-at-colon", message, f"write {replacement}", replacement, replacement)


def cut_off_by_comment_trap(scalar_text: str) -> Trap:
    """Return the trap of a condition with ` #` in it."""
    message = f"YAML reads everything after ' #' in {shown(scalar_text)} as a comment"
    if not is_condition(scalar_text):
        is_condition_before = is_condition(scalar_text.partition(" #")[0])
        help_text = (
            "put the comment on a line of its own" if is_condition_before else "complete the condition before the '#'"
        )
        return Trap("cut-off-by-comment", message, f"{help_text}, or quote all of it")
    return _quoting_trap("cut-off-by-comment", message, scalar_text)


class Openings:
    """The quotes and parentheses that a text opens and does not close.

    Attributes:
        quote: the quote that is open, or an empty text.
    """

    def __init__(self, text: str) -> None:
        self.quote = ""
        self._depth = 0
        self._is_escaped = False
        self.read(text)

    @property
    def is_any_open(self) -> bool:
        """Whether a quote or a parenthesis is open."""
        return self._depth > 0 or self.quote != ""

    def read(self, text: str) -> None:
        """Continue with more text."""
        for letter in text:
            if self._is_escaped:
                self._is_escaped = False
            elif self.quote:
                self._is_escaped = letter == "\\"
                self.quote = "" if letter == self.quote else self.quote
            elif letter in "\"'":
                self.quote = letter
            elif letter in "()":
                self._depth += 1 if letter == "(" else -1
