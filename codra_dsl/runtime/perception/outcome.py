"""What a job brought: a result as the spec's `returns` says, or a failure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.isolation.messages import MAX_SHOWN
from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reason
from codra_dsl.runtime.model import Algorithm, NotOfTypeError


@dataclass(frozen=True, slots=True)
class Result:
    """What a perception function returned, checked; None stands for what it did not measure."""

    values: Mapping[str, Value | None]

    def value(self, name: str) -> Value | None:
        """Return a returned value, or None."""
        return self.values.get(name)

    def age_s(self, name: str) -> float | None:  # noqa: ARG002 - it is the same for all
        """Return None: a returned value has no age."""
        return None


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a job brought no result."""

    reason: Reason
    message: str


def checked(algorithm: Algorithm, returned: object) -> Result | Failure:
    """Return what a perception function returned, if it is what the spec's `returns` says."""
    if not isinstance(returned, Mapping):
        return Failure(Reason.FAILED, f"returned a {type(returned).__name__}, not a mapping")
    surplus = next((name for name in returned if name not in algorithm.returns), None)
    if surplus is not None:
        shown = repr(surplus[:MAX_SHOWN]) if isinstance(surplus, str) else f"a {type(surplus).__name__}"
        return Failure(Reason.FAILED, f"returned {shown}, which `returns` does not name")
    values: dict[str, Value | None] = {}
    for name, expected in algorithm.returns.items():
        given = returned.get(name)
        if given is None and not expected.optional:
            return Failure(Reason.FAILED, f"returned no {name!r}")
        try:
            values[name] = None if given is None else expected.convert(given)
        except NotOfTypeError as error:
            return Failure(Reason.FAILED, f"returned {name!r}: {error}")
    return Result(values)
