"""Fixes of names and members, where the intended one is clear and the file contains the wrong one literally."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from codra_dsl.language.diagnostics import Applicability, Edit, Fix, Place, surely_means
from codra_dsl.language.model import Condition

_PLAIN_MEMBER = re.compile(r"[A-Za-z0-9_.-]+(?: [A-Za-z0-9_.-]+)*")


def renaming(
    name: str, intended: str, candidates: Iterable[str], places: Sequence[Place], mentioned: frozenset[str]
) -> Fix | None:
    """Return the fix of a misspelt name at all its places; None if a template or an escape produces it.

    The fix is safe if the name occurs once, can mean only one candidate, and that candidate is `mentioned` elsewhere as
    it is declared. Otherwise the declaration may be the misspelt one.
    """
    safe = len(places) == 1 and intended in mentioned and surely_means(name, intended, candidates)
    return _replacing(name, intended, places, safe=safe)


def truth(name: str, intended: str, places: Sequence[Place]) -> Fix | None:
    """Return the fix that writes `true` or `false` instead of a word with that meaning in YAML 1.1."""
    return _replacing(name, intended, places, safe=True)


def quoting(name: str, place: Place, condition: Condition) -> Fix | None:
    """Return the fix that puts quotes around a member.

    Return None if the whole condition is quoted, and at its beginning: YAML would read the quotes as its own.
    """
    start = condition.place.span
    first = condition.place_between(0, 1).span
    is_plain = (first.line, first.column) == (start.line, start.column)
    if not is_plain or (place.span.line, place.span.column) == (start.line, start.column):
        return None
    return _replacing(name, f'"{name}"', (place,), safe=True)


def member(written: str, intended: str, members: Iterable[str], place: Place, mentioned: frozenset[str]) -> Fix | None:
    """Return the fix of a misspelt member. `place` excludes the quotes; `mentioned` is as in `renaming`."""
    if _PLAIN_MEMBER.fullmatch(intended) is None:
        return None
    safe = intended in mentioned and surely_means(written, intended, members)
    return _replacing(written, intended, (place,), safe=safe)


def _replacing(written: str, intended: str, places: Iterable[Place], *, safe: bool) -> Fix | None:
    spans = [place.span for place in dict.fromkeys(places) if place.use is None]
    literal_spans = [
        span for span in spans if span.line == span.end_line and span.end_column - span.column == len(written)
    ]
    if len(literal_spans) < len(set(places)):
        return None
    applicability = Applicability.SAFE if safe else Applicability.SUGGESTED
    edits = tuple(Edit(span, intended) for span in literal_spans)
    return Fix(message=f"Replace '{written}' by '{intended}'", edits=edits, applicability=applicability)
