"""Errors that several parts of the runtime raise, and suggestions for names that the spec does not declare."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UnknownNameError(LookupError):
    """A program used a name that the spec does not declare."""


class NotASourceError(PermissionError):
    """An agent or program tried to write a variable or an element of the knowledge graph without permission."""


class AgentTakenError(PermissionError):
    """The handle of an agent was requested, but another handle of this agent is open."""


def unknown_name_error(kind: str, name: object, names: Iterable[str]) -> UnknownNameError:
    """Return the error for an undeclared name. `kind` is the kind of element, `names` are its declared names."""
    return UnknownNameError(f"the spec has no {kind} {name!r}{suggestion_text(str(name), names)}")


def suggestion_text(name: str, names: Iterable[str]) -> str:
    """Return a question that suggests a similar name; empty if there is no similar name."""
    similar_names = difflib.get_close_matches(name, list(names), n=1)
    return f": did you mean {similar_names[0]!r}?" if similar_names else ""
