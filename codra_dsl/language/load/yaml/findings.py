"""The findings of one run."""

from __future__ import annotations

from collections.abc import Iterable

from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, suggest
from codra_dsl.language.expression.tokens import shown, with_escapes
from codra_dsl.language.load.yaml.rules import RULES

MAX_SUGGESTIONS = 200
"""The maximum number of searches for similar names. Each search takes time, which a hostile file must not multiply."""

MAX_LISTED = 12
"""The maximum number of names in a message."""


class Findings:
    """An append-only list of findings, with a limit on the number of suggestions."""

    def __init__(self) -> None:
        self._diagnostics: list[Diagnostic] = []
        self._suggestions_left = MAX_SUGGESTIONS

    def __len__(self) -> int:
        """Return how many findings there are."""
        return len(self._diagnostics)

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
        """Report one finding of a rule of `RULES`.

        Characters of `help` that cannot be printed are escaped, because help repeats texts of the file.
        """
        self._diagnostics.append(
            Diagnostic(
                rule=RULES[rule],
                message=message,
                place=place,
                path=path,
                help=with_escapes(help),
                related=tuple(related),
                fix=fix,
            )
        )

    def extend(self, other: Findings) -> None:
        """Append the findings of another list."""
        self._diagnostics.extend(other.all())

    def all(self) -> tuple[Diagnostic, ...]:
        """Return the findings in the order in which they were added."""
        return tuple(self._diagnostics)

    def nearest(self, name: str, candidates: Iterable[str]) -> str | None:
        """Return the candidate that a name most likely means, or None. After MAX_SUGGESTIONS searches, return None."""
        if self._suggestions_left == 0:
            return None
        self._suggestions_left -= 1
        return suggest(name, candidates)


def list_names(names: Iterable[str]) -> str:
    """Return the first MAX_LISTED names for a message, and how many more there are."""
    all_names = list(names)
    more_text = f", and {len(all_names) - MAX_LISTED} more" if len(all_names) > MAX_LISTED else ""
    return ", ".join(map(shown, all_names[:MAX_LISTED])) + more_text
