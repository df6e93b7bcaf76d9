"""Unique names for the generated module of an engine."""

from __future__ import annotations

import builtins
import keyword

_MODULE_NAMES = frozenset(
    {
        "activations",
        "bounded_activations",
        "bounded_formulas",
        "bounded_outputs",
        "bounds",
        "defuzzifiers",
        "formulas",
        "hedges",
        "norms",
        "outputs",
        "terms",
    }
)
_NAMES_OF_FUNCTIONS_AND_CLASSES = frozenset(
    {"infer", "infer_bounds", "previous", "x", "y", "Bounds", "BoundedInference", "Inference"}
)
_RESERVED_NAMES = (
    _MODULE_NAMES | _NAMES_OF_FUNCTIONS_AND_CLASSES | {"INPUTS", "OUTPUTS", "RANGES", "RULES", "annotations", "math"}
)


class Names:
    """Assigns unique Python names, as close to the names in the engine as possible."""

    def __init__(self, taken_names: frozenset[str] = frozenset()) -> None:
        self._taken_names = set(_RESERVED_NAMES | taken_names | set(keyword.kwlist) | set(dir(builtins)))

    def claim(self, wanted_name: str) -> str:
        """Return an unused name. A character that an ASCII identifier cannot contain becomes `u` and its code point."""
        name = "".join(
            letter if f"_{letter}".isidentifier() and letter.isascii() else f"u{ord(letter):x}"
            for letter in wanted_name
        )
        while name in self._taken_names:
            name += "_"
        self._taken_names.add(name)
        return name

    @property
    def taken_names(self) -> frozenset[str]:
        """All names in use."""
        return frozenset(self._taken_names)
