"""Fixes of names and members, where it is plain what is meant and the file says it letter by letter."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from codra_dsl.diagnostics import Applicability, Edit, Fix, Place, surely_means
from codra_dsl.model import Condition

_PLAIN_MEMBER = re.compile(r"[A-Za-z0-9_.-]+(?: [A-Za-z0-9_.-]+)*")


def renaming(
    name: str, meant: str, candidates: Iterable[str], places: Sequence[Place], mentioned: frozenset[str]
) -> Fix | None:
    """Return the fix of a misspelt name wherever it stands; None where a template or an escape makes it.

    It is safe for a name that stands once, can mean one thing only, and means one that is `mentioned` elsewhere as it
    is declared: else the declaration may be what is misspelt.
    """
    safe = len(places) == 1 and meant in mentioned and surely_means(name, meant, candidates)
    return _replacing(name, meant, places, safe=safe)


def truth(name: str, meant: str, places: Sequence[Place]) -> Fix | None:
    """Return the fix that writes `true` or `false` for a word that meant it in YAML 1.1."""
    return _replacing(name, meant, places, safe=True)


def quoting(name: str, place: Place, condition: Condition) -> Fix | None:
    """Return the fix that puts quotes around a member.

    There is none where the condition is quoted as a whole, and none at its beginning: YAML would take the quotes for
    its own.
    """
    start = condition.place.span
    first = condition.place_between(0, 1).span
    is_plain = (first.line, first.column) == (start.line, start.column)
    if not is_plain or (place.span.line, place.span.column) == (start.line, start.column):
        return None
    return _replacing(name, f'"{name}"', (place,), safe=True)


def member(written: str, meant: str, members: Iterable[str], place: Place, mentioned: frozenset[str]) -> Fix | None:
    """Return the fix of a misspelt member; `place` is that of its letters, without quotes; `mentioned` as above."""
    if _PLAIN_MEMBER.fullmatch(meant) is None:
        return None
    safe = meant in mentioned and surely_means(written, meant, members)
    return _replacing(written, meant, (place,), safe=safe)


def _replacing(written: str, meant: str, places: Iterable[Place], *, safe: bool) -> Fix | None:
    spans = [place.span for place in dict.fromkeys(places) if place.use is None]
    literal = [span for span in spans if span.line == span.end_line and span.end_column - span.column == len(written)]
    if len(literal) < len(set(places)):
        return None
    applicability = Applicability.SAFE if safe else Applicability.SUGGESTED
    edits = tuple(Edit(span, meant) for span in literal)
    return Fix(message=f"Replace '{written}' by '{meant}'", edits=edits, applicability=applicability)
