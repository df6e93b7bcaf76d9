"""C_E(t) of P1, Equation 4: the variables that the main execution declares at this time, with their holders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

MAIN = "main_execution"
"""The holder of the declarations that the main execution makes itself.

If there are several main executions, the holders of the others are this name and a number.
"""

OBSERVER = "observer"
"""The source of a variable that an observer identifies."""

OPERATOR = "operator"
"""The source of an override; no agent can have this name."""

POSES = "the knowledge graph"
"""The source of a variable that follows from poses; no agent can have this name."""

DERIVED = "other context-variables"
"""The source of derived variables; no agent can have this name."""

_EXPECTATION_PREFIX = "expected"
_SKILL_PREFIX = "skill "


def expectation_holder(main_execution: str) -> str:
    """Return the holder that declares the previews of the skills that a main execution expects."""
    return _EXPECTATION_PREFIX if main_execution == MAIN else f"{_EXPECTATION_PREFIX} by {main_execution}"


def skill_holder(skill: str, number: int) -> str:
    """Return the holder that declares the previews and the monitored variables of a running skill."""
    return f"{_SKILL_PREFIX}{skill} {number}"


class Declarations:
    """The declared variables and their holders: the main execution, running skills and expected skills."""

    def __init__(self, enter: Callable[[str, str], None], leave: Callable[[str, str], None]) -> None:
        """Start without declarations; `version` counts the changes.

        Args:
            enter: called with a variable that enters C_E(t), and its holder.
            leave: called with a variable that leaves C_E(t), and its last holder.
        """
        self.version = 0
        self._holders: dict[str, dict[str, None]] = {}
        self._holder_counts: Counter[str] = Counter()
        self._enter = enter
        self._leave = leave

    def __contains__(self, name: object) -> bool:
        return name in self._holder_counts

    def names(self) -> frozenset[str]:
        """Return C_E(t)."""
        return frozenset(self._holder_counts)

    def names_of(self, holder: str) -> tuple[str, ...]:
        """Return the variables that a holder declares, in order."""
        return tuple(self._holders.get(holder, ()))

    def holders(self) -> tuple[str, ...]:
        """Return the holders that declare a variable."""
        return tuple(self._holders)

    def names_of_expected_skills(self) -> tuple[str, ...]:
        """Return the variables that are declared for expected skills."""
        return self._names_by_prefix(_EXPECTATION_PREFIX)

    def names_of_active_skills(self) -> tuple[str, ...]:
        """Return the variables that are declared for running skills."""
        return self._names_by_prefix(_SKILL_PREFIX)

    def _names_by_prefix(self, prefix: str) -> tuple[str, ...]:
        return tuple(name for holder in self._holders if holder.startswith(prefix) for name in self.names_of(holder))

    def add(self, holder: str, name: str) -> None:
        """Declare a variable for a holder. If the holder already declares it, this has no effect."""
        declared_names = self._holders.setdefault(holder, {})
        if name not in declared_names:
            self.version += 1
            declared_names[name] = None
            self._holder_counts[name] += 1
            if self._holder_counts[name] == 1:
                self._enter(name, holder)

    def remove(self, holder: str, name: str) -> None:
        """Remove a variable from a holder's declarations. If the holder does not declare it, this has no effect."""
        declared_names = self._holders.get(holder, {})
        if name in declared_names:
            self.version += 1
            del declared_names[name]
            if not declared_names:
                del self._holders[holder]
            self._holder_counts[name] -= 1
            if not self._holder_counts[name]:
                del self._holder_counts[name]
                self._leave(name, holder)

    def declare_exactly(self, holder: str, names: Iterable[str]) -> None:
        """Let a holder declare exactly these variables. A variable that it already declares stays in C_E(t)."""
        before, after = self.names_of(holder), dict.fromkeys(names)
        for name in after:
            self.add(holder, name)
        for name in before:
            if name not in after:
                self.remove(holder, name)
