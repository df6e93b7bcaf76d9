"""The elements that decisions and loops reach, if this can be decided."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.spec_index import NEED_KEYS, SpecIndex
from codra_dsl.language.model import ObserverSetting

_NEEDS = {
    "skills": ("preview", "monitor"),
    "perception": (*NEED_KEYS, "identifies"),
    "observers": ("identifies",),
    "metrics": ("rules",),
    "actions": ("rules",),
    "adaptation": ("always", "value"),
    "agents": ("wakes",),
}
"""For each section, the keys that define which elements are needed."""


def can_judge_reach(scope: SpecIndex) -> bool:
    """Return whether unneeded elements are known: a skill is declared, and nothing that could need them is damaged."""
    lost = any(scope.lost(section, *keys) for section, keys in _NEEDS.items())
    return bool(scope.spec.skills) and scope.book.is_fully_parsed and not (lost or scope.undeclared_names)


def unreached_settings(scope: SpecIndex) -> Iterator[ObserverSetting]:
    """Yield the entries under `observers` without a reached variable."""
    for setting in scope.spec.observers if can_judge_reach(scope) else ():
        names = [reference.name for reference in setting.identifies]
        if names and all(name in scope.variables and name not in scope.reached for name in names):
            yield setting
