"""Decide which of two similar names is misspelt: one is declared but never used, the other used but not declared.

The same rule applies to all kinds of names. A name with several uses is right. If each of the two names occurs once,
the name whose words occur more often elsewhere in the spec is right. If this decides nothing, the used name is
considered misspelt.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

_WORD = re.compile(r"[a-z]+|[0-9]+")


class Vocabulary:
    """The words of a spec's names and texts, with the number of texts that contain each word."""

    def __init__(self, texts: Iterable[str]) -> None:
        self._counts = Counter(word for text in set(texts) for word in _words(text))

    def knows_better(self, used_name: str, declared_name: str) -> bool:
        """Return whether the words only in the used name are more frequent than the words only in the declared name.

        If both names have the same words, return whether the used name is shorter.
        """
        used_words, declared_words = _words(used_name), _words(declared_name)
        if used_words == declared_words:
            return len(used_name) < len(declared_name)
        used_count = sum(self._counts[word] for word in used_words - declared_words)
        declared_count = sum(
            max(0, self._counts[word] - 1) for word in declared_words - used_words
        )  # without the declaration itself
        return used_count > declared_count


NO_WORDS = Vocabulary(())
"""An empty vocabulary."""


def misspelt_declarations(
    uses: Mapping[str, int],
    unused: Iterable[str],
    declared: Iterable[str],
    vocabulary: Vocabulary,
    nearest: Callable[[str, Iterable[str]], str | None],
) -> dict[str, str]:
    """Return the misspelt declarations, as a mapping from the used name to the declared name.

    Args:
        uses: the number of uses of each unknown name.
        unused: the names that are declared and never used.
        declared: all declared names. If another of these is nearer to the unknown name than the unused name, the use is
            misspelt.
        vocabulary: decides about names with only one use.
        nearest: returns the candidate that a name most likely means.
    """
    misspelt_names: dict[str, str] = {}
    remaining_names = set(unused)
    declared_names = set(declared)
    for name, count in uses.items():
        similar_name = (
            (nearest(name, remaining_names) or _find_shortened_name(name, remaining_names)) if remaining_names else None
        )
        if similar_name is None or nearest(name, declared_names) not in (similar_name, None):
            continue
        if count > 1 or vocabulary.knows_better(name, similar_name):
            misspelt_names[name] = similar_name
            remaining_names.discard(similar_name)
    return misspelt_names


def _find_shortened_name(name: str, candidates: Iterable[str]) -> str | None:
    """Return the only candidate that equals the name without its first or last words, or vice versa."""
    matches = [
        other
        for other in candidates
        if any(
            long.startswith(f"{short}_") or long.endswith(f"_{short}") for long, short in ((name, other), (other, name))
        )
    ]
    return matches[0] if len(matches) == 1 else None


def _words(text: str) -> set[str]:
    return set(_WORD.findall(text.casefold()))
