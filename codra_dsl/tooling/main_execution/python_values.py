"""What is known about the values in a Python file without running it: texts, sequences, and calls that decide."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass

_MAX_TEXT = 200
_MAX_ITEMS = 100
_MAX_DEPTH = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """A call of a function that the file does not define, or of one that perceives.

    Attributes:
        function: the name of the function; with its module, `module:function`, if the file imports it.
        arguments: the texts of the arguments. The calls from which the arguments derive are not kept.
        is_context: whether the call asks a context manager for a variable by its name.
    """

    function: str
    arguments: tuple[Value, ...]
    place: Place
    is_context: bool

    @property
    def is_complete(self) -> bool:
        """Whether no argument depends on a caller that is not in the file."""
        return not any(argument.is_hole for argument in self.arguments)

    @property
    def key(self) -> tuple[str, ...]:
        """Return what distinguishes the result from the results of other calls."""
        if self.is_context:
            return ("context", self.arguments[0].text)
        return (self.function, *(argument.text for argument in self.arguments))

    @property
    def words(self) -> tuple[str, ...]:
        """Return the words of the variable's name."""
        if self.is_context:
            return (self.arguments[0].text,)
        function = self.function.rpartition(":")[2].removeprefix("self.")
        return (function, *(argument.text for argument in self.arguments if argument.text != UNKNOWN_TEXT))

    @property
    def texts(self) -> tuple[str, ...]:
        """Return the literal texts among the arguments."""
        return tuple(argument.text for argument in self.arguments if argument.is_text)


UNKNOWN_TEXT = "..."


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """What is known about a value.

    Attributes:
        text: the text of a string, or else how the file writes the value.
        is_text: whether the value is a string that is known completely.
        is_hole: whether the value depends on a caller that is not known.
        calls: the calls from whose results the value derives.
        items: the items of a sequence; None if they are not known.
        table: the entries of a dictionary, with the texts of their keys.
        module: the module from which the name is imported; empty for other values.
        is_library: whether the name is imported from Python's standard library or another library without perception.
    """

    text: str = UNKNOWN_TEXT
    is_text: bool = False
    is_hole: bool = False
    calls: tuple[Call, ...] = ()
    items: tuple[Value, ...] | None = None
    table: tuple[tuple[str, Value], ...] = ()
    module: str = ""
    is_library: bool = False
    depth: int = 0


def sequence(values: Sequence[Value]) -> Value:
    """Return a sequence of values. The items of long and of deeply nested sequences are forgotten."""
    depth = 1 + max((value.depth for value in values), default=0)
    is_known = depth <= _MAX_DEPTH and len(values) <= _MAX_ITEMS
    return Value(calls=merged_calls(values), items=tuple(values) if is_known else None, depth=depth if is_known else 0)


def table(entries: Sequence[tuple[str, Value]]) -> Value:
    """Return a dictionary. The entries of large and of deeply nested ones are forgotten."""
    depth = 1 + max((value.depth for _, value in entries), default=0)
    is_known = depth <= _MAX_DEPTH and len(entries) <= _MAX_ITEMS
    calls = merged_calls(value for _, value in entries)
    return Value(calls=calls, table=tuple(entries) if is_known else (), depth=depth if is_known else 0)


def merged_calls(values: Iterable[Value]) -> tuple[Call, ...]:
    """Return the calls of several values, each once."""
    return tuple(dict.fromkeys(call for value in values for call in value.calls))[:_MAX_ITEMS]


def alternatives(values: Sequence[Value], text: str = UNKNOWN_TEXT) -> Value:
    """Return what is known about a value that is one of several; `text` is how the file writes it."""
    values = list(dict.fromkeys(values))
    if len(values) == 1:
        return values[0]
    return Value(
        text=text,
        is_hole=any(value.is_hole for value in values),
        calls=merged_calls(values),
        module=next((value.module for value in values if value.module), ""),
        is_library=any(value.is_library for value in values),
    )


def formatted(parts: Iterable[Value]) -> Value:
    """Return the value of an f-string. A part that is not known is written as `{part}`."""
    values = list(parts)
    text = "".join(value.text if value.is_text else f"{{{value.text}}}" for value in values)
    return Value(
        text=text[:_MAX_TEXT],
        is_text=all(value.is_text for value in values) and len(text) <= _MAX_TEXT,
        is_hole=any(value.is_hole for value in values),
        calls=merged_calls(values),
    )


class Scope:
    """The names of a function, of a module or of a branch, with what is known about their values."""

    def __init__(self, values: dict[str, Value], outer: Scope | None = None) -> None:
        self._values = values
        self._outer = outer

    def bind(self, name: str, value: Value) -> None:
        """Bind a name; it replaces an earlier value."""
        self._values[name] = value

    def join(self, branches: Sequence[Scope]) -> None:
        """Bind the names that branches bind, of which one was taken. This scope is the outer one of the branches."""
        for name in dict.fromkeys(name for branch in branches for name in branch._values):
            values = [value for branch in branches if (value := branch.get(name)) is not None]
            self.bind(name, alternatives(values, name))

    def get(self, name: str) -> Value | None:
        """Return what is known about a name, or None."""
        if name in self._values or self._outer is None:
            return self._values.get(name)
        return self._outer.get(name)
