"""The elements that decisions and loops do not need, if this can be decided."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.spec_index import NEED_KEYS, SpecIndex
from codra_dsl.language.model import ObserverSetting

_KEYS_OF_NEEDS = {
    "context": ("rate_of", "share_of", "held"),
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
    """Return whether it can be decided which elements are not needed.

    This is possible if a skill is declared, and nothing that could need an element is damaged.
    """
    is_damaged = any(spec_index.has_damage(section, *keys) for section, keys in _KEYS_OF_NEEDS.items()) or any(
        variable.derived is not None and variable.derived.tree is None for variable in spec_index.spec.context
    )
    return (
        bool(spec_index.spec.skills)
        and spec_index.parsed_rules.is_fully_parsed
        and not (is_damaged or spec_index.undeclared_names)
    )


def unreached_settings(spec_index: SpecIndex) -> Iterator[ObserverSetting]:
    """Yield the entries under `observers` that contain no needed variable."""
    for setting in spec_index.spec.observers if can_judge_reach(spec_index) else ():
        names = [reference.name for reference in setting.identifies]
        if names and all(name in spec_index.variables and name not in spec_index.variables_in_force for name in names):
            yield setting
