"""The findings of one run, as they are collected."""

from __future__ import annotations

from collections.abc import Iterable

from codra_dsl.diagnostics import Diagnostic, Fix, Place, Related, suggest
from codra_dsl.expression.tokens import shown
from codra_dsl.load.rules import RULES

MAX_SUGGESTIONS = 200
"""Looking for similar names costs time, which a hostile file must not multiply."""

MAX_LISTED = 12
"""How many names a message lists."""


class Findings:
    """A list of findings that only grows, and the suggestions that are left to make."""

    def __init__(self) -> None:
        self._found: list[Diagnostic] = []
        self._suggestions_left = MAX_SUGGESTIONS

    def __len__(self) -> int:
        """Return how many findings there are."""
        return len(self._found)

    def add(
        self,
        rule: str,
        message: str,
        place: Place,
        *,
        help: str = "",
        path: str = "",
        related: Iterable[Related] = (),
        fix: Fix | None = None,
    ) -> None:
        """Report one finding of a rule of `RULES`."""
        self._found.append(
            Diagnostic(
                rule=RULES[rule], message=message, place=place, path=path, help=help, related=tuple(related), fix=fix
            )
        )

    def extend(self, other: Findings) -> None:
        """Take over the findings of another list."""
        self._found.extend(other.all())

    def all(self) -> tuple[Diagnostic, ...]:
        """Return the findings in the order in which they were made."""
        return tuple(self._found)

    def nearest(self, name: str, candidates: Iterable[str]) -> str | None:
        """Return the candidate that a name most likely means, as long as suggestions are left."""
        if self._suggestions_left == 0:
            return None
        self._suggestions_left -= 1
        return suggest(name, candidates)


def listed(names: Iterable[str]) -> str:
    """Return names for a message, the first MAX_LISTED of them."""
    several = list(names)
    more = f", and {len(several) - MAX_LISTED} more" if len(several) > MAX_LISTED else ""
    return ", ".join(map(shown, several[:MAX_LISTED])) + more
