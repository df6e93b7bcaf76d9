"""Errors that several parts of the runtime raise, with suggestions for names that the spec does not declare."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UnknownNameError(LookupError):
    """A name that the spec does not declare."""


class NotASourceError(PermissionError):
    """An agent wrote a variable that does not name it as `source`."""


class AgentTakenError(PermissionError):
    """An agent was to be taken of which a handle is open."""


def unknown(kind: str, name: object, names: Iterable[str]) -> UnknownNameError:
    """Return the error that tells that the spec has nothing of a kind with this name."""
    return UnknownNameError(f"the spec has no {kind} {name!r}{nearest(str(name), names)}")


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the question whether a similar name was meant; empty if there is none."""
    similar = difflib.get_close_matches(name, list(names), n=1)
    return f": did you mean {similar[0]!r}?" if similar else ""
