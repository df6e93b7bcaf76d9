"""Names that a spec does not declare, and what was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UnknownNameError(LookupError):
    """A name that the spec does not declare."""


def unknown(kind: str, name: object, names: Iterable[str]) -> UnknownNameError:
    """Return the error that tells that the spec has nothing of a kind with this name."""
    return UnknownNameError(f"the spec has no {kind} {name!r}{nearest(str(name), names)}")


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the question whether a similar name was meant; empty if there is none."""
    similar = difflib.get_close_matches(name, list(names), n=1)
    return f": did you mean {similar[0]!r}?" if similar else ""
