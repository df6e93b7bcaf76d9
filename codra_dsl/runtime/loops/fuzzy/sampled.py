"""The norms of the module `norms`, for numpy arrays of samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from codra_dsl.runtime.loops.fuzzy import norms

Samples = NDArray[np.float64]
Norm = Callable[[float, float], float]


def _algebraic_product(a: Samples | float, b: Samples) -> Samples:
    return a * b


def _algebraic_sum(a: Samples, b: Samples) -> Samples:
    return a + b - a * b


def _unbounded_sum(a: Samples, b: Samples) -> Samples:
    return a + b


def _bounded_difference(a: Samples | float, b: Samples) -> Samples:
    return np.maximum(0.0, a + b - 1.0)


def _drastic_product(a: Samples | float, b: Samples) -> Samples:
    return np.where(np.maximum(a, b) == 1.0, np.minimum(a, b), 0.0)


def _einstein_product(a: Samples | float, b: Samples) -> Samples:
    return (a * b) / (2.0 - (a + b - a * b))


def _hamacher_product(a: Samples | float, b: Samples) -> Samples:
    return np.where(a + b != 0.0, (a * b) / (a + b - a * b), 0.0)


def _nilpotent_minimum(a: Samples | float, b: Samples) -> Samples:
    return np.where(a + b > 1.0, np.minimum(a, b), 0.0)


def _bounded_sum(a: Samples, b: Samples) -> Samples:
    return np.minimum(1.0, a + b)


def _drastic_sum(a: Samples, b: Samples) -> Samples:
    return np.where(np.minimum(a, b) == 0.0, np.maximum(a, b), 1.0)


def _einstein_sum(a: Samples, b: Samples) -> Samples:
    return (a + b) / (1.0 + a * b)


def _hamacher_sum(a: Samples, b: Samples) -> Samples:
    product, missing_a, missing_b = a * b, 1.0 - a, 1.0 - b
    missing_product = missing_a * missing_b
    values_near_one = 1.0 - missing_product / (missing_a + missing_b - missing_product)
    usual_values = np.where(product != 1.0, (a + b - 2.0 * product) / (1.0 - product), 1.0)
    return np.where(((a > 0.5) | (b > 0.5)) & (product != 1.0), values_near_one, usual_values)


def _nilpotent_maximum(a: Samples, b: Samples) -> Samples:
    return np.where(a + b < 1.0, np.maximum(a, b), 1.0)


def _normalized_sum(a: Samples, b: Samples) -> Samples:
    return (a + b) / np.maximum(1.0, a + b)


NORMS_OF_SAMPLES: Mapping[Norm, Callable[..., Samples]] = MappingProxyType(
    {
        norms.algebraic_product: _algebraic_product,
        norms.bounded_difference: _bounded_difference,
        norms.drastic_product: _drastic_product,
        norms.einstein_product: _einstein_product,
        norms.hamacher_product: _hamacher_product,
        norms.minimum: np.minimum,
        norms.nilpotent_minimum: _nilpotent_minimum,
        norms.algebraic_sum: _algebraic_sum,
        norms.bounded_sum: _bounded_sum,
        norms.drastic_sum: _drastic_sum,
        norms.einstein_sum: _einstein_sum,
        norms.hamacher_sum: _hamacher_sum,
        norms.maximum: np.maximum,
        norms.nilpotent_maximum: _nilpotent_maximum,
        norms.normalized_sum: _normalized_sum,
        norms.unbounded_sum: _unbounded_sum,
    }
)
"""For each norm of two degrees, the same norm for samples."""
