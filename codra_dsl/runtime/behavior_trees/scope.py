"""The blackboard of one tree: typed entries, which are its own or remapped to entries of the outer tree.

The Blackboard of py_trees is not used, because it is global in the process and has no types.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.behavior_trees.result import TreeError

GLOBAL_PREFIX = "@"
"""The prefix for entries of the outermost tree."""

_EQUALITY_TOLERANCE = 2.0**-23
"""Scripts treat two numbers as equal if their difference is not larger than this value."""

PRIVATE_PREFIX = "_"
"""The prefix of entries that `_autoremap` never remaps."""


@dataclass(slots=True)
class _Entry:
    """A value, with the number of its writes."""

    value: object
    write_count: int = 1


class Scope:
    """The entries of one tree, under the names that the tree's nodes use."""

    def __init__(
        self, outer_scope: Scope | None = None, *, remapped: Mapping[str, str] | None = None, remaps_all: bool = False
    ) -> None:
        """Begin without entries.

        Args:
            outer_scope: the scope of the tree that contains this tree as a subtree.
            remapped: the names of entries in the outer scope. The keys are the names of these entries in this scope.
            remaps_all: whether every other entry, unless private, is the entry of the same name in the outer scope
                (`_autoremap`).
        """
        self._outer_scope = outer_scope
        self._remapped = dict(remapped or {})
        self._remaps_all = remaps_all
        self._constant_names: set[str] = set()
        self._declared_names: set[str] = set()
        self._entries: dict[str, _Entry] = {}

    def within(self, remapped: Mapping[str, str], constants: Mapping[str, str], *, remaps_all: bool) -> Scope:
        """Return the scope of a subtree; `constants` are initial values of the subtree's own entries."""
        inner_scope = Scope(self, remapped=remapped, remaps_all=remaps_all)
        inner_scope._constant_names.update(constants)
        for name, value in constants.items():
            inner_scope.create(name, value)
        return inner_scope

    def get(self, name: str) -> Any:
        """Return the value of an entry.

        Raises:
            TreeError: if the entry does not exist.
        """
        entry = self._find(name)
        if entry is None:
            raise TreeError(
                f"the entry {name!r} does not exist yet; existing entries: {', '.join(sorted(self.names())) or 'none'}"
            )
        return entry.value

    def has(self, name: str) -> bool:
        """Return whether the entry exists."""
        return self._find(name) is not None

    def is_empty(self, name: str) -> bool:
        """Return whether a port declares the entry, and it has no value yet."""
        owner, own_name = self._owner(name)
        return own_name in owner._declared_names and own_name not in owner._entries

    def names(self) -> Iterator[str]:
        """Yield the names of entries that can be read, except entries that only `_autoremap` makes readable."""
        yield from self._entries
        yield from (name for name in self._remapped if self.has(name))

    def write_count(self, name: str) -> int:
        """Return how often an entry was written: 0 if it does not exist."""
        entry = self._find(name)
        return 0 if entry is None else entry.write_count

    def declare(self, name: str) -> None:
        """Declare an entry of a port: from then on the entry can be assigned, even if it has no value yet."""
        owner, own_name = self._owner(name)
        owner._declared_names.add(own_name)

    def create(self, name: str, value: object) -> None:
        """Write an entry, and create it if it does not exist (`:=`).

        Raises:
            TreeError: if the value does not have the type of the entry, which is the type of the entry's first value.
        """
        owner, own_name = self._owner(name)
        owner._write(own_name, value)

    def assign(self, name: str, value: object) -> None:
        """Write an entry that exists or is declared by a port (`=`).

        Raises:
            TreeError: if the entry neither exists nor is declared, or has another type.
        """
        owner, own_name = self._owner(name)
        if own_name not in owner._declared_names:
            self.get(name)
        self.create(name, value)

    def unset(self, name: str) -> None:
        """Remove an entry, if it exists."""
        owner, own_name = self._owner(name)
        owner._entries.pop(own_name, None)
        owner._declared_names.discard(own_name)

    def __getitem__(self, name: str) -> Any:
        """Return the value of an entry for computations in scripts."""
        return Operand(self.get(name))

    def _find(self, name: str) -> _Entry | None:
        owner, own_name = self._owner(name)
        return owner._entries.get(own_name)

    def _owner(self, name: str) -> tuple[Scope, str]:
        """Return the scope that holds an entry, and the entry's name there."""
        scope, own_name = self, name
        while scope._outer_scope is not None:
            outer_name = scope._outer_name(own_name)
            if outer_name is None:
                break
            scope, own_name = scope._outer_scope, outer_name
        return scope, own_name.removeprefix(GLOBAL_PREFIX)

    def _outer_name(self, name: str) -> str | None:
        if name.startswith(GLOBAL_PREFIX):
            return name
        if name in self._constant_names:
            return None
        if name in self._remapped:
            return self._remapped[name]
        return name if self._remaps_all and not name.startswith(PRIVATE_PREFIX) else None

    def _write(self, name: str, value: object) -> None:
        entry = self._entries.get(name)
        if value is None:
            raise TreeError(f"the entry {name!r} cannot have the value None: unset the entry instead")
        if entry is None:
            self._entries[name] = _Entry(value)
            return
        entry.value = _convert_value(name, entry.value, value)
        entry.write_count += 1


def _convert_value(name: str, present_value: object, value: object) -> object:
    """Return a new value for an entry; for an entry that holds a number, the text of a number becomes a number."""
    if _family(present_value) == _family(value):
        return value
    number = number_in(value) if _family(present_value) == NUMBER and isinstance(value, str) else None
    if number is None:
        raise TreeError(f"the entry {name!r} holds a {_family(present_value)}, and {value!r} is a {_family(value)}")
    return number


NUMBER, TEXT = "number", "text"


def _family(value: object) -> str:
    if isinstance(value, bool | int | float):
        return NUMBER
    return TEXT if isinstance(value, str) else type(value).__name__


def number_in(value: object) -> int | float | None:
    """Return a value as a number; None if it is not a number, a boolean, or the text of one of them."""
    if isinstance(value, bool | int | float):
        return value
    if not isinstance(value, str):
        return None
    for read in (int, float):
        try:
            return read(value)
        except ValueError:
            continue
    return {"true": 1, "false": 0}.get(value)


def plain_value(value: object) -> Any:
    """Return a value in the form in which entries hold it, which is not an `Operand`."""
    return value.value if isinstance(value, Operand) else value


def equal(left: object, right: object) -> bool:
    """Return whether two values are equal; numbers may differ by the precision of a `float` in C++ (2**-23)."""
    if isinstance(left, int | float) and isinstance(right, int | float):
        return left == right or abs(left - right) <= _EQUALITY_TOLERANCE
    return left == right


def is_true(value: object) -> bool:
    """Return a value as a condition: a number other than 0 is true.

    Raises:
        TreeError: if the value is neither a number nor a boolean.
    """
    number = number_in(plain_value(value))
    if number is None:
        raise TreeError(f"{plain_value(value)!r} is neither true nor false")
    return bool(number)


class Operand:
    """A value in the computations of scripts.

    All numbers have one type. In a comparison of a number with the text of a number, the text becomes a number. Scripts
    use Python's operators on operands, which behave as in BehaviorTree.CPP: `'42' == 42` is true, and `1 / 0` is
    infinite as in C++.
    """

    __slots__ = ("value",)
    __hash__ = None  # type: ignore[assignment]  # operands can be equal to values with other hashes

    def __init__(self, value: object) -> None:
        self.value = value

    def __repr__(self) -> str:
        return repr(self.value)

    def __bool__(self) -> bool:
        return is_true(self.value)

    def __eq__(self, other: object) -> bool:
        return self._compare(other, "==", equal)

    def __lt__(self, other: object) -> bool:
        return self._compare(other, "<", lambda left, right: left < right)

    def __le__(self, other: object) -> bool:
        return self._compare(other, "<=", lambda left, right: left <= right)

    def __gt__(self, other: object) -> bool:
        return self._compare(other, ">", lambda left, right: left > right)

    def __ge__(self, other: object) -> bool:
        return self._compare(other, ">=", lambda left, right: left >= right)

    def __add__(self, other: object) -> Operand:
        return _sum(self.value, plain_value(other))

    def __radd__(self, other: object) -> Operand:
        return _sum(other, self.value)

    def __sub__(self, other: object) -> Operand:
        left, right = _require_numbers("-", self.value, other)
        return Operand(left - right)

    def __rsub__(self, other: object) -> Operand:
        return Operand(other) - self

    def __mul__(self, other: object) -> Operand:
        left, right = _require_numbers("*", self.value, other)
        return Operand(left * right)

    def __rmul__(self, other: object) -> Operand:
        return Operand(other) * self

    def __truediv__(self, other: object) -> Operand:
        left, right = _require_numbers("/", self.value, other)
        return Operand(left / right if right else _quotient_by_zero(left, right))

    def __rtruediv__(self, other: object) -> Operand:
        return Operand(other) / self

    def __neg__(self) -> Operand:
        return 0 - self

    def _comparable_pair(self, other: object) -> tuple[Any, Any]:
        """Return both values; if one is a number and the other the text of a number, return both as numbers."""
        left, right = self.value, plain_value(other)
        if _family(left) == _family(right):
            return left, right
        numbers = number_in(left), number_in(right)
        return (left, right) if None in numbers else numbers

    def _compare(self, other: object, sign: str, compare: Callable[[Any, Any], bool]) -> bool:
        left, right = self._comparable_pair(other)
        comparable_families = (NUMBER, TEXT) if compare is not equal else (NUMBER, TEXT, _family(left))
        if _family(left) != _family(right) or _family(left) not in comparable_families:
            raise TreeError(f"{left!r} {sign} {right!r} compares a {_family(left)} with a {_family(right)}")
        return compare(left, right)


def _require_numbers(sign: str, left: object, right: object) -> tuple[int | float, int | float]:
    values = plain_value(left), plain_value(right)
    if _family(values[0]) != NUMBER or _family(values[1]) != NUMBER:
        raise TreeError(f"{values[0]!r} {sign} {values[1]!r}: this operator needs two numbers")
    return values


def _sum(left: object, right: object) -> Operand:
    if isinstance(left, str) and isinstance(right, str):
        return Operand(left + right)
    first, second = _require_numbers("+", left, right)
    return Operand(first + second)


def _quotient_by_zero(left: float, right: float) -> float:
    """Return the result of a division by zero for a `double` in C++."""
    if left == 0 or math.isnan(left):
        return math.nan
    return math.copysign(math.inf, left) * math.copysign(1.0, right)
