"""Fixes of wrong names and members.

There is a fix only if the intended word is clear, and the file contains the wrong word literally.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from codra_dsl.language.diagnostics import Applicability, Edit, Fix, Place, surely_means
from codra_dsl.language.model import Condition

_PLAIN_MEMBER = re.compile(r"[A-Za-z0-9_.-]+(?: [A-Za-z0-9_.-]+)*")


def renaming(
    name: str, intended: str, candidates: Iterable[str], places: Sequence[Place], mentioned: frozenset[str]
) -> Fix | None:
    """Return the fix of a misspelt name at all its places.

    Return None if, at one of these places, the name comes from a template or is written with an escape sequence.

    The fix is safe under three conditions: the name occurs once; it can mean only one candidate; and `mentioned`, the
    names that other elements refer to, contains this candidate. Otherwise the declaration may be misspelt instead.
    """
    safe = len(places) == 1 and intended in mentioned and surely_means(name, intended, candidates)
    return _replacing(name, intended, places, safe=safe)


def truth(name: str, intended: str, places: Sequence[Place]) -> Fix | None:
    """Return the fix that writes `true` or `false` instead of a word that means the same in YAML 1.1."""
    return _replacing(name, intended, places, safe=True)


def quoting(name: str, place: Place, condition: Condition) -> Fix | None:
    """Return the fix that puts quotes around a member.

    Return None if the whole condition is quoted, or if the member is at the beginning of the condition: YAML would read
    the new quotes as quotes around the whole text.
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
