"""C_E(t) of P1, Equation 4: what the main execution declares now, and on whose behalf."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

MAIN = "main_execution"
"""Who holds what is declared by itself."""

EXPECTED = "expected"
"""Who holds what expected skills preview; any other holder is a skill under way."""


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
        return self.of(EXPECTED)

    def of_skills(self) -> tuple[str, ...]:
        """Return what is declared for skills under way."""
        return tuple(name for holder in self._holders if holder not in (MAIN, EXPECTED) for name in self.of(holder))

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
