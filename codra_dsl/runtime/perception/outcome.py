"""The outcome of a job: a result that matches `returns` of the spec, or a failure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.isolation.error_text import MAX_SHOWN_CHARACTERS, type_name
from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm, NotOfTypeError


@dataclass(frozen=True, slots=True)
class Result:
    """The checked return value of a perception function; None means that a quantity was not measured."""

    values: Mapping[str, Value | None]

    def value(self, name: str) -> Value | None:
        """Return a value of the result, or None if it was not measured."""
        return self.values.get(name)

    def age_s(self, name: str) -> float | None:  # noqa: ARG002 - the result is the same for all names
        """Return None: a returned value has no age."""
        return None


@dataclass(frozen=True, slots=True)
class Failure:
    """The reason why a job has no result."""

    reason: Reason
    message: str


def checked(algorithm: Algorithm, returned_value: object) -> Result | Failure:
    """Return the result of a perception function if it matches `returns` of the spec, otherwise a failure."""
    if not isinstance(returned_value, Mapping):
        return Failure(Reason.FAILED, f"returned a {type_name(returned_value)}, not a mapping")
    unknown_key = next((name for name in returned_value if name not in algorithm.returns), None)
    if unknown_key is not None:
        key_text = (
            repr(str.__str__(unknown_key)[:MAX_SHOWN_CHARACTERS])
            if issubclass(type(unknown_key), str)
            else f"a {type_name(unknown_key)}"
        )
        return Failure(Reason.FAILED, f"returned {key_text}, which `returns` does not name")
    values: dict[str, Value | None] = {}
    for name, value_type in algorithm.returns.items():
        value = returned_value.get(name)
        if value is None and not value_type.optional:
            return Failure(Reason.FAILED, f"returned no {name!r}")
        try:
            values[name] = None if value is None else value_type.convert(value)
        except NotOfTypeError as error:
            return Failure(Reason.FAILED, f"returned {name!r}: {error}")
    return Result(values)
