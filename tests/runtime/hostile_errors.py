"""Exceptions whose methods do everything that a text of an exception should not depend on."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NoReturn


def _raising(error: type[BaseException]) -> type[Exception]:
    def method(_: object) -> NoReturn:
        raise error("from a method of an exception")

    return type(f"Raises{error.__name__}", (Exception,), {"__str__": method, "__repr__": method})


Wordless = type("Wordless", (Exception,), dict.fromkeys(("__str__", "__repr__"), lambda _: None))


class Text(str):
    """A text that ends the program when it is used."""

    def _exit(self, *_: object) -> NoReturn:
        raise SystemExit

    __len__ = __getitem__ = __format__ = __str__ = __iter__ = encode = _exit  # type: ignore[assignment]


class Spoken(Exception):  # noqa: N818
    def __str__(self) -> str:
        return Text("spoken")

    __repr__ = __str__


class Masked(Exception):  # noqa: N818
    @property
    def __class__(self) -> Any:
        raise SystemExit

    @property
    def __notes__(self) -> Any:
        raise SystemExit


class _Nameless(type):
    @property
    def __name__(cls) -> NoReturn:
        raise SystemExit


class Unnamed(Exception, metaclass=_Nameless):  # noqa: N818
    pass


UNSPEAKABLE = "its message cannot be shown"
_KINDS: dict[str, tuple[Callable[[], BaseException], str]] = {
    **{
        f"raises {error.__name__}": (_raising(error), f"Raises{error.__name__}: {UNSPEAKABLE}")
        for error in (SystemExit, KeyboardInterrupt, GeneratorExit, RecursionError, MemoryError)
    },
    "no text": (Wordless, f"Wordless: {UNSPEAKABLE}"),
    "hostile text": (Spoken, "Spoken: spoken"),
    "hostile properties": (partial(Masked, "mask"), "Masked: mask"),
    "hostile metaclass": (partial(Unnamed, "no name"), "Unnamed: no name"),
    "long message": (lambda: ValueError("\ud800" + "x" * 10**7), f"ValueError: ?{'x' * 199}..."),
    "long name": (partial(type("N" * 10**6, (Exception,), {}), "long"), f"{'N' * 200}: long"),
}

HOSTILE_ERRORS = {kind: text for kind, (_, text) in _KINDS.items()}
"""The kinds of hostile exceptions, and the texts that describe them."""


def hostile_error(kind: str) -> BaseException:
    """Return a new exception of a kind. Do not keep it: other tests look at all objects of the program."""
    return _KINDS[kind][0]()
