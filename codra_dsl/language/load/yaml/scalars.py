"""The values of plain scalars in YAML 1.2's core schema. PyYAML itself reads `on`, `no`, `010`, `1:30` differently."""

from __future__ import annotations

import re
from functools import lru_cache

from codra_dsl.language.load.yaml.nodes import Data
from codra_dsl.language.units import MAX_MAGNITUDE

_FIRST_LETTERS = frozenset("~nNtTfF")
SPECIAL_FIRST = frozenset("+-.0123456789") | _FIRST_LETTERS | {""}
"""Every plain scalar that is not a text begins with one of these characters, or is empty."""

_WORDS: dict[str, Data] = {
    "": None,
    "~": None,
    **dict.fromkeys(("null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INTEGER = re.compile(r"[-+]?[0-9]+")
_OTHER_BASE = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_MAX_DIGITS = 110


@lru_cache(maxsize=4096)
def resolve(text: str) -> Data:
    """Return the value of a plain scalar.

    Raises:
        OverflowError: if the scalar is a number that is not finite or beyond MAX_MAGNITUDE.
    """
    if text[:1] in _FIRST_LETTERS or not text:
        return _WORDS.get(text, text)
    if _INTEGER.fullmatch(text):
        return _limited(int(text)) if len(text) <= _MAX_DIGITS else _too_large()
    if _OTHER_BASE.fullmatch(text):
        return _limited(int(text, 0)) if len(text) <= _MAX_DIGITS else _too_large()
    if _FLOAT.fullmatch(text):
        return _limited(float(text))
    return _too_large() if _NOT_FINITE.fullmatch(text) else text


def _limited(number: float) -> Data:
    return number if abs(number) <= MAX_MAGNITUDE else _too_large()


def _too_large() -> Data:
    raise OverflowError
