"""The arithmetic of fuzzy inference, which the compiled modules of engines import.

Values equal those of the FuzzyLite libraries (J. Rada-Vilela, fuzzylite.com), which P2 uses for its two stages of
inference (section 5.2). This includes missing inputs (NaN), infinities and degenerate parameters.

Rules compute with Python numbers, which are fast for a few values. Fuzzy sets are numpy arrays, which are fast for a
hundred values.
"""

from __future__ import annotations

from codra_dsl.runtime.loops.fuzzy import terms
from codra_dsl.runtime.loops.fuzzy.bounds import BoundedInference, Bounds, End, point, refined
from codra_dsl.runtime.loops.fuzzy.outputs import Inference

__all__ = ["BoundedInference", "Bounds", "End", "Inference", "point", "refined", "terms"]
