"""Sites: each states which values of a spec differ at one place where the robot works."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from functools import cached_property

from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model.elements import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Replacement:
    """A value that a site states instead of the spec.

    Attributes:
        section: the section of the element, or `use` for an argument of a use.
        name: the name of the element or of the use.
        key: the path from the element to the value, such as `valid_for` or `with.threshold`.
        place: the place of the value in the site's file; `extent` is the place of the key and the value.
        replaced: the place of the value in the spec; None if the spec does not state the value.
        element: the place of the name of the element or use in the spec.
    """

    section: str
    name: str
    key: str
    place: Place
    extent: Place
    replaced: Place | None
    element: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Handle:
    """How a site makes the handle of a resource.

    Attributes:
        call: `module:name` of a class or function.
        arguments: the arguments and their literals.
        argument_places: the places of the names of these arguments.
    """

    resource: str
    call: str
    arguments: tuple[tuple[str, Literal], ...]
    place: Place
    argument_places: tuple[Place, ...] = ()

    def __str__(self) -> str:
        return f"{self.call}({', '.join(f'{name}={value!r}' for name, value in self.arguments)})"


@dataclass(frozen=True, kw_only=True)
class Site:
    """The values that a site's file states for a spec.

    Attributes:
        file: the site's file, relative to the project root.
        place: the place of the spec's name under `overlays`.
        replacements: the values that the site replaces, in the order of the site's file.
    """

    file: str
    place: Place
    replacements: tuple[Replacement, ...]
    handles: tuple[Handle, ...] = ()

    def replacement_around(self, place: Place) -> Replacement | None:
        """Return the value of the site that contains a place; None if there is none."""
        if place.span.file != self.file:
            return None
        index = bisect_right(self.replacements, _start(place), key=lambda value: _start(value.extent))
        value = self.replacements[index - 1] if index else None
        return value if value is not None and value.extent.span.contains(place.span) else None

    @cached_property
    def replacements_of(self) -> Mapping[str | Span | None, Sequence[Replacement]]:
        """The values by the name of their element or use, and by the span of this name in the spec."""
        replacements: dict[str | Span | None, list[Replacement]] = {}
        for value in self.replacements:
            for key in (value.name, value.element.span):
                replacements.setdefault(key, []).append(value)
        return replacements


def _start(place: Place) -> tuple[int, int]:
    return place.span.line, place.span.column
