"""Events of a run and their kinds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from codra_dsl.runtime.journal.schemas import Kind

__all__ = ["Event", "Kind"]


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened during a run.

    Attributes:
        instant_s: the instant at which it happened.
        name: the subject of the event: a variable, observer or algorithm. For an event of kind knowledge, it is a node,
            `node.attribute`, an edge or a task; of kind adaptation, a loop, course, parameter or tree; of kind input,
            the sender of the input.
        what: what happened, e.g. `started`, `identified`, `fell_back`.
        details: plain values by name. No detail has the name of another attribute of this class.
    """

    instant_s: float
    kind: Kind
    name: str
    what: str
    details: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> str:
        """Return the event as one line of JSON; numbers that are not finite become null."""
        plain_fields = {"instant_s": self.instant_s, "kind": self.kind, "name": self.name, "what": self.what}
        return json.dumps(plain_fields | _replace_nonfinite(self.details), ensure_ascii=False, allow_nan=False)


def _replace_nonfinite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _replace_nonfinite(element) for key, element in value.items()}
    if isinstance(value, (list, tuple)):
        return [_replace_nonfinite(element) for element in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
