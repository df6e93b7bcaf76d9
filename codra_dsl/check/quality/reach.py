"""What decisions and loops reach, where it can be said."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.scope import NEED_KEYS, Scope
from codra_dsl.model import ObserverSetting

_NEEDS = {
    "skills": ("preview", "monitor"),
    "perception": (*NEED_KEYS, "identifies"),
    "observers": ("identifies",),
    "metrics": ("rules",),
    "actions": ("rules",),
    "adaptation": ("always", "value"),
    "agents": ("wakes",),
}
"""The keys that say what is needed, by section."""


def judges_reach(scope: Scope) -> bool:
    """Return whether it can be said what nothing needs: a skill is declared, and nothing that says more is damaged."""
    lost = any(scope.lost(section, *keys) for section, keys in _NEEDS.items())
    return bool(scope.spec.skills) and scope.book.is_whole and not (lost or scope.strangers)


def unreached_settings(scope: Scope) -> Iterator[ObserverSetting]:
    """Yield the entries under `observers` none of whose variables is reached."""
    for setting in scope.spec.observers if judges_reach(scope) else ():
        names = [each.name for each in setting.identifies]
        if names and all(name in scope.variables and name not in scope.reached for name in names):
            yield setting
