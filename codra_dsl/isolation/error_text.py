"""Texts of exceptions and objects of user code, whose methods can raise anything, and can return anything.

These functions never raise, and their texts have a limited length and can always be encoded. All code that shows an
exception of user code calls them, because an exception that is raised while another one is handled would end a thread,
or the program.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

MAX_SHOWN_CHARACTERS = 200
"""The maximum number of characters of a foreign text that a message shows."""

MAX_TRACEBACK_CHARACTERS = 20_000
"""The maximum number of characters of a traceback and its messages in a log."""


def described(error: BaseException) -> str:
    """Return the type and the message of any exception."""
    return f"{type_name(error)}: {message_of(error, MAX_SHOWN_CHARACTERS)}"


def message_of(error: BaseException, max_characters: int) -> str:
    """Return the message of any exception, or its beginning."""
    return _call_safely(str, error, "its message cannot be shown", max_characters)


def type_name(value: object) -> str:
    """Return the name of the type of any object, or its beginning."""
    name: str = vars(type)["__name__"].__get__(type(value))  # a metaclass can replace `type(value).__name__`
    return _encodable(name[:MAX_SHOWN_CHARACTERS])


def loggable(error: BaseException) -> BaseException:
    """Return an exception that a logger can show with its traceback.

    This is the exception itself or, if it cannot be shown, an exception with the text of `described`.
    """
    try:
        texts = [str(error), repr(error), *traceback.format_exception(error)]
        if all(type(text) is str for text in texts) and sum(map(len, texts)) <= MAX_TRACEBACK_CHARACTERS:
            return error
    except BaseException:  # noqa: BLE001 - notes and causes of an exception can be properties, which raise anything
        pass
    place = vars(BaseException)["__traceback__"].__get__(error)  # a class can replace `error.__traceback__`
    return RuntimeError(described(error)).with_traceback(place)


def shown(value: object) -> str:
    """Return the `repr` of any object."""
    return _call_safely(repr, value, "an object that cannot be shown", MAX_SHOWN_CHARACTERS)


def _call_safely(make_text: Callable[[Any], str], value: object, default_text: str, max_characters: int) -> str:
    """Return the beginning of a text of an object; `default_text` if the object does not provide a text."""
    try:
        text = make_text(value)
    except BaseException:  # noqa: BLE001 - also SystemExit and KeyboardInterrupt, which would end the program
        return default_text
    # A subclass of `str` can override all methods, so the methods of `str` are called.
    beginning = str.__getitem__(text, slice(max_characters))
    return _encodable(f"{beginning}..." if str.__len__(text) > max_characters else beginning)


def _encodable(text: str) -> str:
    return text.encode(errors="replace").decode()
