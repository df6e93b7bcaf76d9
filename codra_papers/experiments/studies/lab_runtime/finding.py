"""One part of a report: a section, sentences for the summary, and data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean, stdev
from typing import Any

from codra_papers.experiments.campaign.document import Section
from codra_papers.experiments.campaign.statistics import CONFIDENCE_LEVEL, Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One part of a report.

    Attributes:
        results: the data of this part. Each key is unique in the report, and includes the unit of its value.
    """

    section: Section
    summary: Sequence[str]
    results: Mapping[str, Any]


def mean(values: Sequence[float]) -> float | None:
    """Return the mean, or None if there are no values."""
    return fmean(values) if values else None


def deviation(values: Sequence[float]) -> float | None:
    """Return the standard deviation of a sample, or None if the sample has fewer than two values."""
    return stdev(values) if len(values) > 1 else None


def rounded(value: float | None, digits: int = 2) -> float | None:
    """Return a number rounded for display. Return None for None."""
    return None if value is None else round(value, digits) + 0.0  # turns -0.0 into 0.0


def percent(share: float | None) -> float | None:
    """Return a share in percent, rounded for display. Return None for None."""
    return None if share is None else round(100.0 * share, 1)


def spread_text(values: Sequence[float]) -> str:
    """Return mean and standard deviation as text."""
    mean_value, spread = rounded(mean(values)), rounded(deviation(values))
    return "none" if mean_value is None else f"{mean_value}" if spread is None else f"{mean_value} ± {spread}"


def interval_text(estimate: Estimate, *, scale: float = 1.0, digits: int = 2) -> str:
    """Return an estimate with its interval as text."""
    if estimate.value is None:
        return "none"
    value_text = f"{scale * estimate.value:.{digits}f}"
    if estimate.low is None or estimate.high is None:
        return value_text
    return f"{value_text} [{scale * estimate.low:.{digits}f}, {scale * estimate.high:.{digits}f}]"


def estimate_as_data(estimate: Estimate) -> Mapping[str, float | None]:
    """Return an estimate as plain data."""
    return {**asdict(estimate), "level": CONFIDENCE_LEVEL}
