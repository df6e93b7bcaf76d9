"""The names that an engine's module uses."""

from __future__ import annotations

import builtins
import keyword

_OF_MODULES = frozenset(
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
_OF_OURS = frozenset({"infer", "infer_bounds", "previous", "x", "y", "Bounds", "BoundedInference", "Inference"})
_TAKEN = _OF_MODULES | _OF_OURS | {"INPUTS", "OUTPUTS", "RANGES", "RULES", "annotations", "math"}


class Names:
    """Gives each thing a name of its own, as close to what it is called as Python allows."""

    def __init__(self, taken: frozenset[str] = frozenset()) -> None:
        self._taken = set(_TAKEN | taken | set(keyword.kwlist) | set(dir(builtins)))

    def claim(self, wanted: str) -> str:
        """Return a name that nobody has; what no name of ASCII has is spelt out."""
        name = "".join(
            letter if f"_{letter}".isidentifier() and letter.isascii() else f"u{ord(letter):x}" for letter in wanted
        )
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    @property
    def taken(self) -> frozenset[str]:
        """All names that are somebody's."""
        return frozenset(self._taken)
