"""Which of two names is misspelt: the one that is declared and used nowhere, or the one that is used and not declared.

One rule for all kinds of names. A name that several places agree on is right; of two that stand once each, it is the
one whose words the spec knows from elsewhere; where that tells nothing, the use is taken for the slip.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

_WORD = re.compile(r"[a-z]+|[0-9]+")


class Vocabulary:
    """The words of a spec's names and texts, by how many of them have each."""

    def __init__(self, texts: Iterable[str]) -> None:
        self._counts = Counter(word for text in set(texts) for word in _words(text))

    def knows_better(self, used: str, declared: str) -> bool:
        """Return whether the words that a used name has and a declared one has not are known better than the others."""
        left, right = _words(used), _words(declared)
        if left == right:
            return len(used) < len(declared)
        of_used = sum(self._counts[word] for word in left - right)
        of_declared = sum(max(0, self._counts[word] - 1) for word in right - left)  # the declaration tells nothing
        return of_used > of_declared


NO_WORDS = Vocabulary(())
"""Knows no word."""


def misspelt_declarations(
    uses: Mapping[str, int],
    unused: Iterable[str],
    declared: Iterable[str],
    vocabulary: Vocabulary,
    nearest: Callable[[str, Iterable[str]], str | None],
) -> dict[str, str]:
    """Return, for names that are used and not declared, the declaration that is misspelt: as it should be, as it is.

    Args:
        uses: how many uses each unknown name has.
        unused: what is declared and used nowhere.
        declared: all that is declared; where a name that is used is nearer, the use is misspelt.
        vocabulary: settles who is right where a name has one use only.
        nearest: returns the candidate that a name most likely means.
    """
    found: dict[str, str] = {}
    left = set(unused)
    known = set(declared)
    for name, count in uses.items():
        near = (nearest(name, left) or _shortened(name, left)) if left else None
        if near is None or nearest(name, known) not in (near, None):
            continue
        if count > 1 or vocabulary.knows_better(name, near):
            found[name] = near
            left.discard(near)
    return found


def _shortened(name: str, candidates: Iterable[str]) -> str | None:
    """Return the only candidate that is a name but for its first or last words, or the other way round."""
    alike = [
        other
        for other in candidates
        if any(
            long.startswith(f"{short}_") or long.endswith(f"_{short}") for long, short in ((name, other), (other, name))
        )
    ]
    return alike[0] if len(alike) == 1 else None


def _words(text: str) -> set[str]:
    return set(_WORD.findall(text.casefold()))
