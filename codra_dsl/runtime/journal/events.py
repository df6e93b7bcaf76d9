"""What an event is."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class Kind(StrEnum):
    """What an event is about.

    An `INPUT` is what reached the context manager from outside and follows from nothing else: a call of a program, or
    that a job's function has come to its end. From inputs and evidence all else follows; only journals hold them.
    """

    VARIABLE = "variable"
    OBSERVER = "observer"
    JOB = "job"
    DECISION = "decision"
    DECLARATION = "declaration"
    EXPECTATION = "expectation"
    KNOWLEDGE = "knowledge"
    ADAPTATION = "adaptation"
    INPUT = "input"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened.

    Attributes:
        instant_s: when.
        name: of the variable, observer or algorithm; of knowledge, a node, `node.attribute`, an edge, or a task; of
            adaptation, a loop, course, parameter or tree; of an input, who it came from.
        what: what happened to it, e.g. `started`, `identified`, `fell_back`.
        details: plain values, by a name that is no other attribute's.
    """

    instant_s: float
    kind: Kind
    name: str
    what: str
    details: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> str:
        """Return the event as one line; numbers that are not finite become null."""
        plain = {"instant_s": self.instant_s, "kind": self.kind, "name": self.name, "what": self.what}
        return json.dumps(plain | _finite(self.details), ensure_ascii=False, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
