"""The tokens of a condition: text -> tokens, with help for common mistakes."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from enum import StrEnum

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.units import NUMBER_TEXT, UNIT_TEXT, parse_number, parse_unit, suggest_unit, units_help

MAX_LENGTH = 2000
"""The maximum length of a condition, in code points."""

WORDS = ("and", "or", "not", "in", "if", "else", "true", "false")
"""The keywords of the language, which cannot be names."""

FUNCTIONS: Mapping[str, tuple[int, int | None]] = {
    "abs": (1, 1),
    "min": (2, None),
    "max": (2, None),
    "known": (1, 1),
    "age": (1, 1),
}
"""The minimum and maximum number of arguments of each function."""

MAX_NAME = 100
"""The maximum length of a name that a spec declares. Names become parts of file names."""

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_RESERVED_WORDS = frozenset({*keyword.kwlist, *WORDS, *FUNCTIONS, "null"})


class TokenKind(StrEnum):
    """The kinds of token."""

    NUMBER = "number"
    TEXT = "text"
    NAME = "name"
    WORD = "word"
    SYMBOL = "symbol"
    END = "end"


@dataclass(frozen=True, slots=True)
class Token:
    """A token of a condition.

    Attributes:
        value: the value of a number; the text between quotes, with escapes resolved; empty for other tokens.
        unit: the unit of a number, as written.
    """

    kind: TokenKind
    text: str
    start: int
    end: int
    value: int | float | str = ""
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class SyntaxProblem:
    """A syntax error: message, range in code points, and help."""

    message: str
    start: int
    end: int
    help: str


class ExpressionError(Exception):
    """Carries a problem to `parse`, which returns the problem."""

    def __init__(self, message: str, start: int, end: int, help_text: str) -> None:
        super().__init__(message)
        self.problem = SyntaxProblem(message, start, end, help_text)


_UNIT_LIKE = UNIT_TEXT.replace("[A-Za-z]+", r"[^\W\d]\w*")
"""Matches valid and invalid units alike, so that messages can show an invalid unit in full."""

_NO_UNITS = "|".join((*WORDS, "is", "then", "for", "otherwise"))

# A unit has no blanks inside: `5 m/s` is a speed, but `5 m / s` divides 5 m by the variable `s`.
_TOKEN = re.compile(
    rf"""(?P<blank>[ \t\r\n]+)
    | (?P<word>[^\W\d]\w*)
    | (?P<number>{NUMBER_TEXT})(?![0-9_.])(?:[ \t\r\n]*(?P<unit>(?!(?i:{_NO_UNITS})\b){_UNIT_LIKE}))?
    | (?P<badnumber>\.?\d[\w.]*)
    | (?P<text>"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')
    | (?P<slip>&&|\|\||!==|===|=<|=>|<>|\*\*|//|:=|=(?!=)|!(?!=)|[^-\w\s()<>+*/,"'=!])
    | (?P<symbol><=|>=|==|!=|[-()<>+*/,])""",
    re.VERBOSE | re.DOTALL,
)

_DURATION = re.compile(r"[0-9][0-9.]* *(?:ms|s|min|h)\b")

_SYMBOL_HELP: Mapping[str, str] = {
    "&&": "write 'and'",
    "&": "write 'and'",
    "||": "write 'or'",
    "|": "write 'or'",
    "!": "write 'not'",
    "~": "write 'not'",
    "=": "write '==' to compare",
    ":=": "write '==' to compare",
    "===": "write '=='",
    "!==": "write '!='",
    "<>": "write '!='",
    "≠": "write '!='",
    "=<": "write '<='",
    "≤": "write '<='",
    "=>": "write '>='",
    "≥": "write '>='",
    "**": "write a product, such as x * x; the unit of an area is m*m",
    "^": "write a product, such as x * x; the unit of an area is m*m",
    "//": "write '/'",
    "\N{MULTIPLICATION SIGN}": "write '*'",
    "·": "write '*'",
    "÷": "write '/'",
    "\N{MINUS SIGN}": "write '-'",
    "?": "write A if CONDITION else B",
    ":": "write A if CONDITION else B",
    "[": "list the allowed values in parentheses, such as x in (1, 2)",
    "]": "list the allowed values in parentheses, such as x in (1, 2)",
    "{": "list the allowed values in parentheses, such as x in (1, 2)",
    "}": "list the allowed values in parentheses, such as x in (1, 2)",
    "$": "parameters are written $(name), and only inside a template",
    "%": "did you mean 'percent'?",
    "°": "did you mean 'deg'?",
    "`": "quote with \" or '",
    "“": "quote with \" or '",
    "”": "quote with \" or '",
    "„": "quote with \" or '",
    "\N{LEFT SINGLE QUOTATION MARK}": "quote with \" or '",
    "\N{RIGHT SINGLE QUOTATION MARK}": "quote with \" or '",
    "#": "remove it; put comments outside the condition",
    ";": "write each condition as an item of its own",
}

_ESCAPES: Mapping[str, str] = {"\\": "\\", '"': '"', "'": "'", "n": "\n", "t": "\t"}


def tokens(text: str) -> tuple[Token, ...]:
    """Return the tokens of a text, followed by a token of kind END.

    Raises:
        ExpressionError: if a part of the text is not a token.
    """
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"a condition of {len(text)} characters is too long",
            MAX_LENGTH,
            len(text),
            f"at most {MAX_LENGTH} are allowed: split it into several conditions",
        )
    token_list: list[Token] = []
    position = 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise _unexpected_character_error(text, position)
        if match.lastgroup != "blank":
            token_list.append(_read_token(match))
        position = match.end()
    token_list.append(Token(TokenKind.END, "", len(text), len(text)))
    return tuple(token_list)


def is_identifier(name: str) -> bool:
    """Return whether a spec may declare something with this name."""
    return len(name) <= MAX_NAME and is_name(name)


def is_name(text: str) -> bool:
    """Return whether a text can be the name of a context-variable or of a returned value."""
    return len(text) <= MAX_LENGTH and text not in _RESERVED_WORDS and _IDENTIFIER.fullmatch(text) is not None


def with_escapes(text: str) -> str:
    """Return a text with an escape in place of each character that cannot be printed."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else f"\\x{ord(letter):02x}" for letter in text)


def shown(text: str) -> str:
    """Return a text for a message: quoted, shortened, without control characters."""
    printable_text = with_escapes(text[:41])
    return f"'{printable_text[:40]}...'" if len(printable_text) > 40 else f"'{printable_text}'"


def _read_token(match: re.Match[str]) -> Token:
    kind, text, start, end = match.lastgroup, match[0], match.start(), match.end()
    if kind == "word":
        return _read_word(match.string, text, start, end)
    if kind == "symbol":
        return Token(TokenKind.SYMBOL, text, start, end)
    if kind in ("number", "unit"):
        return _read_number(match)
    if kind == "text":
        return Token(TokenKind.TEXT, text, start, end, value=_unescape(text, start))
    if kind == "badnumber":
        raise ExpressionError(f"{shown(text)} is not a number", start, end, _number_help(text))
    raise _unsupported_symbol_error(match.string, text, start, end)


def _read_word(condition_text: str, text: str, start: int, end: int) -> Token:
    if text in WORDS:
        return Token(TokenKind.WORD, text, start, end)
    if not _IDENTIFIER.fullmatch(text):
        help_text = "names hold only letters A to Z, digits and '_', and start with a letter"
        raise ExpressionError(f"{shown(text)} is not a name", start, end, help_text)
    if text == "is":
        raise ExpressionError(
            "'is' is not an operator", start, end, "write '==', '!=' or '<'; only fuzzy rules have 'is'"
        )
    if text == "for":
        raise _duration_error(condition_text[:start].strip(), condition_text[end:].strip(), start, end)
    if keyword.iskeyword(text) or text == "null":
        raise ExpressionError(f"'{text}' is not a name", start, end, _reserved_help(text))
    return Token(TokenKind.NAME, text, start, end)


def _duration_error(before: str, after: str, start: int, end: int) -> ExpressionError:
    """Return the error of `x for 5 s`."""
    duration = _DURATION.match(after)
    held, time = before if is_name(before) else "BOOL", duration[0] if duration is not None else "5 s"
    help_text = f"declare in 'context' a bool {{type: bool, held: {held}, for: {time}}}, and write its name here"
    if held != before:
        help_text += "; BOOL is a variable with this condition under 'derived'"
    return ExpressionError("a condition cannot state for how long it must hold", start, end, help_text)


def _reserved_help(text: str) -> str:
    if text in ("True", "False"):
        return f"write '{text.lower()}'"
    if text in ("None", "null"):
        return "use known(x) to test whether a context-variable is known"
    return "it is a reserved word and cannot be a name"


def _read_number(match: re.Match[str]) -> Token:
    unit = match["unit"]
    if unit is not None and parse_unit(unit) is None:
        raise ExpressionError(f"unknown unit '{unit}'", match.start("unit"), match.end("unit"), _unit_help(unit))
    value = parse_number(match["number"])
    if value is None:
        start, end = match.span("number")
        raise ExpressionError(
            f"the number {shown(match['number'])} is too large", start, end, "at most 1e100 is allowed"
        )
    return Token(TokenKind.NUMBER, match[0], match.start(), match.end(), value=value, unit=unit)


def _unit_help(unit: str) -> str:
    first_unit = re.split(r"[*/]", unit)[0]
    if first_unit != unit and parse_unit(first_unit) is not None and suggest_unit(unit) is None:
        operator = unit[len(first_unit)]
        return f"write blanks around '{operator}' for an operation; without blanks, '{operator}' is part of a unit"
    return units_help(unit)


def _number_help(text: str) -> str:
    if text.startswith("."):
        return f"write 0{text}" if _is_number(f"0{text}") else "write a number such as 0.5"
    if text.endswith(".") and _is_number(text[:-1]):
        return f"write {text[:-1]} or {text}0"
    if "_" in text and _is_number(text.replace("_", "")):
        return f"write {text.replace('_', '')}"
    if text.startswith("0") and _is_number(text.lstrip("0")):
        return f"write {text.lstrip('0')}"
    return "write a number such as 12, 0.5 or 1e-3"


def _is_number(text: str) -> bool:
    """Return whether a text is a number."""
    return re.fullmatch(NUMBER_TEXT, text) is not None


def _unescape(text: str, start: int) -> str:
    for escape in re.finditer(r"\\(.)", text, re.DOTALL):
        if escape[1] not in _ESCAPES:
            position = start + escape.start()
            help_text = "a backslash is allowed only before a quote, a backslash, n or t; write \\\\ for a backslash"
            raise ExpressionError(f"unknown escape {shown(escape[0])}", position, position + 2, help_text)
    return re.sub(r"\\(.)", lambda escape: _ESCAPES[escape[1]], text[1:-1])


def _unsupported_symbol_error(condition_text: str, text: str, start: int, end: int) -> ExpressionError:
    if text == "." and condition_text[:start][-1:].isidentifier():
        help_text = "write a name without '.'; a member is compared, as in door == \"open\""
        return ExpressionError("'.' is not an operator", start, end, help_text)
    if text == "%" and not condition_text[:start].rstrip()[-1:].isdigit():
        return ExpressionError("'%' is not an operator", start, end, "operators for numbers are '+', '-', '*' and '/'")
    if condition_text.startswith("??", start):
        return ExpressionError("'??' is not an operator", start, end + 1, "write x else y")
    noun = "a unit" if text in "%°" else "an operator" if text in _SYMBOL_HELP else "part of a condition"
    return ExpressionError(f"{shown(text)} is not {noun}", start, end, _SYMBOL_HELP.get(text, "remove it"))


def _unexpected_character_error(text: str, position: int) -> ExpressionError:
    character = text[position]
    if character in "\"'":
        return ExpressionError(
            f"the quote {character} is never closed", position, len(text), f"add {character} after the text"
        )
    help_text = "write an ordinary blank" if character.isspace() else "remove it"
    return ExpressionError(f"{shown(character)} is not part of a condition", position, position + 1, help_text)
