"""The outcome of a job: a result that matches the spec's `returns`, or a failure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.isolation.messages import MAX_SHOWN
from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm, NotOfTypeError


@dataclass(frozen=True, slots=True)
class Result:
    """The checked return value of a perception function; None means that a quantity was not measured."""

    values: Mapping[str, Value | None]

    def value(self, name: str) -> Value | None:
        """Return a returned value, or None."""
        return self.values.get(name)

    def age_s(self, name: str) -> float | None:  # noqa: ARG002 - it is the same for all
        """Return None: a returned value has no age."""
        return None


@dataclass(frozen=True, slots=True)
class Failure:
    """The reason why a job has no result."""

    reason: Reason
    message: str


def checked(algorithm: Algorithm, returned: object) -> Result | Failure:
    """Return the result of a perception function if it matches the spec's `returns`, else a failure."""
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
