"""C_E(t) of P1, Equation 4: what the main execution declares now, and on whose behalf."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

MAIN = "main_execution"
"""Who holds what the main execution declares by itself; of several, each has a number behind its name."""

OBSERVER = "observer"
"""What a variable names as its source that is identified by an observer."""

POSES = "the knowledge graph"
"""What a variable names as its source that follows from poses; no agent can be called so."""

_EXPECTED = "expected"
_UNDER_WAY = "skill "


def expected_by(party: str) -> str:
    """Return who holds what the skills preview that a main execution expects."""
    return _EXPECTED if party == MAIN else f"{_EXPECTED} by {party}"


def under_way(skill: str, number: int) -> str:
    """Return who holds what a skill under way previews and monitors."""
    return f"{_UNDER_WAY}{skill} {number}"


class Declarations:
    """What several holders declare: the main execution itself, skills under way, skills that are expected."""

    def __init__(self, enter: Callable[[str, str], None], leave: Callable[[str, str], None]) -> None:
        """Start with nothing declared; `version` counts what changes.

        Args:
            enter: called with a variable that enters C_E(t), and its holder.
            leave: called with a variable that leaves C_E(t), and who held it last.
        """
        self.version = 0
        self._holders: dict[str, dict[str, None]] = {}
        self._counts: Counter[str] = Counter()
        self._enter = enter
        self._leave = leave

    def __contains__(self, name: object) -> bool:
        return name in self._counts

    def names(self) -> frozenset[str]:
        """Return C_E(t)."""
        return frozenset(self._counts)

    def of(self, holder: str) -> tuple[str, ...]:
        """Return what a holder declares, in order."""
        return tuple(self._holders.get(holder, ()))

    def holders(self) -> tuple[str, ...]:
        """Return who declares something."""
        return tuple(self._holders)

    def of_expected(self) -> tuple[str, ...]:
        """Return what is declared for skills that are expected."""
        return self._of_those_with(_EXPECTED)

    def of_skills(self) -> tuple[str, ...]:
        """Return what is declared for skills under way."""
        return self._of_those_with(_UNDER_WAY)

    def _of_those_with(self, start: str) -> tuple[str, ...]:
        return tuple(name for holder in self._holders if holder.startswith(start) for name in self.of(holder))

    def add(self, holder: str, name: str) -> None:
        """Let a holder declare one variable more; harmless when it does so already."""
        held = self._holders.setdefault(holder, {})
        if name not in held:
            self.version += 1
            held[name] = None
            self._counts[name] += 1
            if self._counts[name] == 1:
                self._enter(name, holder)

    def remove(self, holder: str, name: str) -> None:
        """Let a holder declare one variable less; harmless when it does not declare it."""
        held = self._holders.get(holder, {})
        if name in held:
            self.version += 1
            del held[name]
            if not held:
                del self._holders[holder]
            self._counts[name] -= 1
            if not self._counts[name]:
                del self._counts[name]
                self._leave(name, holder)

    def hold(self, holder: str, names: Iterable[str]) -> None:
        """Let a holder declare exactly these variables; what it keeps is not touched."""
        before, after = self.of(holder), dict.fromkeys(names)
        for name in after:
            self.add(holder, name)
        for name in before:
            if name not in after:
                self.remove(holder, name)
