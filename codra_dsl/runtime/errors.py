"""Errors that several parts of the runtime raise, with suggestions for names that the spec does not declare."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UnknownNameError(LookupError):
    """The spec does not declare a name."""


class NotASourceError(PermissionError):
    """An agent wrote a variable that does not name it as `source`."""


class AgentTakenError(PermissionError):
    """An agent with an open handle was requested."""


def unknown(kind: str, name: object, names: Iterable[str]) -> UnknownNameError:
    """Return the error for a name of some kind that the spec does not declare."""
    return UnknownNameError(f"the spec has no {kind} {name!r}{nearest(str(name), names)}")


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a suggestion of a similar name; empty if there is no similar name."""
    similar = difflib.get_close_matches(name, list(names), n=1)
    return f": did you mean {similar[0]!r}?" if similar else ""
