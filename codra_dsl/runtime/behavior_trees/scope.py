"""The blackboard of one tree: entries with a type, of its own or remapped to those of the tree around it.

It is not py_trees' Blackboard, which is one for the whole process and lets any value take any other's place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.behavior_trees.result import TreeError

GLOBAL = "@"
"""An entry whose name begins so is that of the outermost tree."""

_EQUAL = 2.0**-23
"""Numbers that differ by less are equal in scripts."""

PRIVATE = "_"
"""An entry whose name begins so is never remapped by `_autoremap`."""


@dataclass(slots=True)
class _Entry:
    """A value, and how often it was written."""

    value: object
    writes: int = 1


class Scope:
    """The entries that the nodes of one tree see."""

    def __init__(
        self, around: Scope | None = None, *, remapped: Mapping[str, str] | None = None, remaps_all: bool = False
    ) -> None:
        """Begin without entries.

        Args:
            around: the scope of the tree that has this one as a subtree.
            remapped: names in here, and what the same entries are called around.
            remaps_all: whether names that are not remapped are those around, unless they are private (`_autoremap`).
        """
        self._around = around
        self._remapped = dict(remapped or {})
        self._remaps_all = remaps_all
        self._constants: set[str] = set()
        self._declared: set[str] = set()
        self._entries: dict[str, _Entry] = {}

    def within(self, remapped: Mapping[str, str], constants: Mapping[str, str], *, remaps_all: bool) -> Scope:
        """Return the scope of a subtree; constants are entries of its own from the start."""
        inner = Scope(self, remapped=remapped, remaps_all=remaps_all)
        inner._constants.update(constants)
        for name, value in constants.items():
            inner.create(name, value)
        return inner

    def get(self, name: str) -> Any:
        """Return the value of an entry.

        Raises:
            TreeError: if there is none.
        """
        entry = self._find(name)
        if entry is None:
            raise TreeError(f"there is no entry {name!r} yet: entries are {', '.join(sorted(self.names())) or 'none'}")
        return entry.value

    def has(self, name: str) -> bool:
        """Return whether there is such an entry."""
        return self._find(name) is not None

    def names(self) -> Iterator[str]:
        """Yield the names by which entries can be read here, those that `_autoremap` brings left out."""
        yield from self._entries
        yield from (name for name in self._remapped if self.has(name))

    def writes(self, name: str) -> int:
        """Return how often an entry was written: 0 if there is none."""
        entry = self._find(name)
        return 0 if entry is None else entry.writes

    def declare(self, name: str) -> None:
        """Say that a port names an entry: it can be assigned to from then on, though it has no value yet."""
        owner, own_name = self._owner(name)
        owner._declared.add(own_name)

    def create(self, name: str, value: object) -> None:
        """Write an entry, which need not be there (`:=`).

        Raises:
            TreeError: if the entry has a value of another type: its first value decides.
        """
        owner, own_name = self._owner(name)
        owner._write(own_name, value)

    def assign(self, name: str, value: object) -> None:
        """Write an entry that is there, or that a port names (`=`).

        Raises:
            TreeError: if it is neither, or has another type.
        """
        owner, own_name = self._owner(name)
        if own_name not in owner._declared:
            self.get(name)
        self.create(name, value)

    def unset(self, name: str) -> None:
        """Remove an entry, if it is there."""
        owner, own_name = self._owner(name)
        owner._entries.pop(own_name, None)
        owner._declared.discard(own_name)

    def __getitem__(self, name: str) -> Any:
        """Return the value of an entry as scripts compute with it."""
        return Operand(self.get(name))

    def _find(self, name: str) -> _Entry | None:
        owner, own_name = self._owner(name)
        return owner._entries.get(own_name)

    def _owner(self, name: str) -> tuple[Scope, str]:
        """Return the scope that holds an entry, and what it is called there."""
        scope, own = self, name
        while scope._around is not None:
            outer = scope._outer_name(own)
            if outer is None:
                break
            scope, own = scope._around, outer
        return scope, own.removeprefix(GLOBAL)

    def _outer_name(self, name: str) -> str | None:
        if name.startswith(GLOBAL):
            return name
        if name in self._constants:
            return None
        if name in self._remapped:
            return self._remapped[name]
        return name if self._remaps_all and not name.startswith(PRIVATE) else None

    def _write(self, name: str, value: object) -> None:
        entry = self._entries.get(name)
        if value is None:
            raise TreeError(f"the entry {name!r} cannot be written with None: unset it")
        if entry is None:
            self._entries[name] = _Entry(value)
            return
        entry.value = _fitting(name, entry.value, value)
        entry.writes += 1


def _fitting(name: str, present: object, value: object) -> object:
    """Return a value for an entry that has one; a text that says a number is one where a number stands."""
    if _family(present) == _family(value):
        return value
    number = number_in(value) if _family(present) == NUMBER and isinstance(value, str) else None
    if number is None:
        raise TreeError(f"the entry {name!r} holds a {_family(present)}, and {value!r} is a {_family(value)}")
    return number


NUMBER, TEXT = "number", "text"


def _family(value: object) -> str:
    if isinstance(value, bool | int | float):
        return NUMBER
    return TEXT if isinstance(value, str) else type(value).__name__


def number_in(value: object) -> int | float | None:
    """Return the number that a value is or that a text says, or None."""
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


def plain(value: object) -> Any:
    """Return a value as entries hold it, whether or not scripts computed with it."""
    return value.value if isinstance(value, Operand) else value


def equal(left: object, right: object) -> bool:
    """Return whether two values are equal; numbers are if they differ by less than a `float` of C++ can tell from 1."""
    if isinstance(left, int | float) and isinstance(right, int | float):
        return left == right or abs(left - right) <= _EQUAL
    return left == right


def is_true(value: object) -> bool:
    """Return what a value means as a condition: a number other than 0 is true.

    Raises:
        TreeError: if it is neither a number nor a truth.
    """
    number = number_in(plain(value))
    if number is None:
        raise TreeError(f"{plain(value)!r} is neither true nor false")
    return bool(number)


class Operand:
    """A value that scripts compute with: numbers are one kind, a text that says a number compares as one."""

    __slots__ = ("value",)
    __hash__ = None  # type: ignore[assignment]  # it compares with what hashes otherwise

    def __init__(self, value: object) -> None:
        self.value = value

    def __repr__(self) -> str:
        return repr(self.value)

    def __bool__(self) -> bool:
        return is_true(self.value)

    def __eq__(self, other: object) -> bool:
        return self._compared(other, "==", equal)

    def __lt__(self, other: object) -> bool:
        return self._compared(other, "<", lambda left, right: left < right)

    def __le__(self, other: object) -> bool:
        return self._compared(other, "<=", lambda left, right: left <= right)

    def __gt__(self, other: object) -> bool:
        return self._compared(other, ">", lambda left, right: left > right)

    def __ge__(self, other: object) -> bool:
        return self._compared(other, ">=", lambda left, right: left >= right)

    def __add__(self, other: object) -> Operand:
        return _sum(self.value, plain(other))

    def __radd__(self, other: object) -> Operand:
        return _sum(other, self.value)

    def __sub__(self, other: object) -> Operand:
        left, right = _numbers("-", self.value, other)
        return Operand(left - right)

    def __rsub__(self, other: object) -> Operand:
        return Operand(other) - self

    def __mul__(self, other: object) -> Operand:
        left, right = _numbers("*", self.value, other)
        return Operand(left * right)

    def __rmul__(self, other: object) -> Operand:
        return Operand(other) * self

    def __truediv__(self, other: object) -> Operand:
        left, right = _numbers("/", self.value, other)
        return Operand(left / right if right else _by_zero(left, right))

    def __rtruediv__(self, other: object) -> Operand:
        return Operand(other) / self

    def __neg__(self) -> Operand:
        return 0 - self

    def _pair(self, other: object) -> tuple[Any, Any]:
        """Return both values, as numbers where one is a number and the other says one."""
        left, right = self.value, plain(other)
        if _family(left) == _family(right):
            return left, right
        numbers = number_in(left), number_in(right)
        return (left, right) if None in numbers else numbers

    def _compared(self, other: object, sign: str, compare: Callable[[Any, Any], bool]) -> bool:
        left, right = self._pair(other)
        comparable = (NUMBER, TEXT) if compare is not equal else (NUMBER, TEXT, _family(left))
        if _family(left) != _family(right) or _family(left) not in comparable:
            raise TreeError(f"{left!r} {sign} {right!r} compares a {_family(left)} with a {_family(right)}")
        return compare(left, right)


def _numbers(sign: str, left: object, right: object) -> tuple[int | float, int | float]:
    values = plain(left), plain(right)
    if _family(values[0]) != NUMBER or _family(values[1]) != NUMBER:
        raise TreeError(f"{values[0]!r} {sign} {values[1]!r}: only numbers can be computed with")
    return values


def _sum(left: object, right: object) -> Operand:
    if isinstance(left, str) and isinstance(right, str):
        return Operand(left + right)
    first, second = _numbers("+", left, right)
    return Operand(first + second)


def _by_zero(left: float, right: float) -> float:
    """Return what a division by zero comes to for a `double` of C++."""
    if left == 0 or math.isnan(left):
        return math.nan
    return math.copysign(math.inf, left) * math.copysign(1.0, right)
