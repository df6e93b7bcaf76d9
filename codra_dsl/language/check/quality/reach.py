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


def can_judge_reach(spec_index: SpecIndex) -> bool:
    """Return whether unneeded elements are known: a skill is declared, and nothing that could need them is damaged."""
    lost = any(spec_index.lost(section, *keys) for section, keys in _NEEDS.items())
    return (
        bool(spec_index.spec.skills)
        and spec_index.parsed_rules.is_fully_parsed
        and not (lost or spec_index.undeclared_names)
    )


def unreached_settings(spec_index: SpecIndex) -> Iterator[ObserverSetting]:
    """Yield the entries under `observers` without a reached variable."""
    for setting in spec_index.spec.observers if can_judge_reach(spec_index) else ():
        names = [reference.name for reference in setting.identifies]
        if names and all(name in spec_index.variables and name not in spec_index.reached for name in names):
            yield setting
