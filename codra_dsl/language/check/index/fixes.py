"""Fixes of wrong names and members.

There is a fix only if the intended word is clear, and the file contains the wrong word literally.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from codra_dsl.language.diagnostics import Applicability, Edit, Fix, Place, surely_means
from codra_dsl.language.model import Condition

_PLAIN_MEMBER_PATTERN = re.compile(r"[A-Za-z0-9_.-]+(?: [A-Za-z0-9_.-]+)*")


def renaming_fix(
    name: str, intended_name: str, candidates: Iterable[str], places: Sequence[Place], mentioned_names: frozenset[str]
) -> Fix | None:
    """Return the fix of a misspelt name at all its places.

    Return None if, at one of these places, the name comes from a template or is written with an escape sequence.

    The fix is safe under three conditions: the name occurs once; the name can mean only one candidate; and other
    elements refer to this candidate, so that `mentioned_names` contains the candidate. If one of these conditions is
    not fulfilled, the declaration may be misspelt instead of the name.
    """
    is_safe = len(places) == 1 and intended_name in mentioned_names and surely_means(name, intended_name, candidates)
    return _replacement_fix(name, intended_name, places, is_safe=is_safe)


def truth_fix(name: str, truth_text: str, places: Sequence[Place]) -> Fix | None:
    """Return the fix that writes `true` or `false` instead of a word that means the same in YAML 1.1."""
    return _replacement_fix(name, truth_text, places, is_safe=True)


def quoting_fix(name: str, place: Place, condition: Condition) -> Fix | None:
    """Return the fix that puts quotes around a member.

    Return None if the whole condition is quoted, or if the member is at the beginning of the condition: YAML would read
    the new quotes as quotes around the whole text.
    """
    condition_span = condition.place.span
    first_span = condition.place_between(0, 1).span
    is_unquoted = (first_span.line, first_span.column) == (condition_span.line, condition_span.column)
    if not is_unquoted or (place.span.line, place.span.column) == (condition_span.line, condition_span.column):
        return None
    return _replacement_fix(name, f'"{name}"', (place,), is_safe=True)


def member_fix(
    written_member: str, intended_member: str, members: Iterable[str], place: Place, mentioned_names: frozenset[str]
) -> Fix | None:
    """Return the fix of a misspelt member. `place` excludes the quotes. `renaming_fix` explains `mentioned_names`."""
    if _PLAIN_MEMBER_PATTERN.fullmatch(intended_member) is None:
        return None
    is_safe = intended_member in mentioned_names and surely_means(written_member, intended_member, members)
    return _replacement_fix(written_member, intended_member, (place,), is_safe=is_safe)


def _replacement_fix(old_text: str, new_text: str, places: Iterable[Place], *, is_safe: bool) -> Fix | None:
    spans = [place.span for place in dict.fromkeys(places) if place.use is None]
    literal_spans = [
        span for span in spans if span.line == span.end_line and span.end_column - span.column == len(old_text)
    ]
    if len(literal_spans) < len(set(places)):
        return None
    applicability = Applicability.SAFE if is_safe else Applicability.SUGGESTED
    edits = tuple(Edit(span, new_text) for span in literal_spans)
    return Fix(message=f"Replace '{old_text}' by '{new_text}'", edits=edits, applicability=applicability)
