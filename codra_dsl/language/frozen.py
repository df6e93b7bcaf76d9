"""Dataclasses of the compiler: frozen for the type checker, and cheap to define and to create.

A specification becomes hundreds of thousands of values, and every command defines more than two hundred classes of
values when it starts. Python's frozen dataclasses set each field of a value by a call of `object.__setattr__`, which
takes twice as long as assignments, and compile six methods for each class. Here only `__init__` is compiled, and mypy
refuses assignments to fields; at run time nothing does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

__all__ = ["dataclass"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:
    import dataclasses
    from collections.abc import Callable
    from operator import attrgetter

    def dataclass(
        *, frozen: bool = False, eq: bool = True, order: bool = False, **options: bool
    ) -> Callable[[type], type]:
        """Return a decorator with the options of `dataclasses.dataclass`; values of frozen classes are hashable."""
        if not frozen or order:
            return dataclasses.dataclass(eq=eq, order=order, unsafe_hash=frozen and eq, **options)

        def decorate(plain_class: type) -> type:
            has_own_repr = "__repr__" in plain_class.__dict__
            value_class = dataclasses.dataclass(eq=False, repr=False, **options)(plain_class)
            if not has_own_repr:
                value_class.__repr__ = _repr
            if eq:
                _compare_by_fields(value_class)
            return value_class

        return decorate

    def _repr(value: object) -> str:
        fields = [field.name for field in dataclasses.fields(value) if field.repr]
        return f"{type(value).__qualname__}({', '.join(f'{name}={getattr(value, name)!r}' for name in fields)})"

    def _compare_by_fields(value_class: type) -> None:
        names = [field.name for field in dataclasses.fields(value_class) if field.compare]
        values_of = (
            attrgetter(*names) if len(names) > 1 else lambda value: tuple(getattr(value, name) for name in names)
        )

        def equals(value: object, other: object) -> bool:
            return values_of(value) == values_of(other) if other.__class__ is value.__class__ else NotImplemented

        def hash_of(value: object) -> int:
            return hash(values_of(value))

        value_class.__eq__, value_class.__hash__ = equals, hash_of
