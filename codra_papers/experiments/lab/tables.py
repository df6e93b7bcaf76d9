"""The tables printed after a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from codra_papers.experiments.campaign.statistics import ratio_of_sums
from codra_papers.experiments.lab.metrics import SecondsByTruth
from codra_papers.experiments.lab.scoring import Score


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as plain text. The first column is aligned to the left, all others to the right."""
    widths = [max(len(row[column]) for row in (header, *rows)) for column in range(len(header))]
    lines = [_line(header, widths), "  ".join("-" * width for width in widths)]
    lines.extend(_line(row, widths) for row in rows)
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    padded_cells = [cell.rjust(width) for cell, width in zip(cells, widths, strict=True)]
    return "  ".join([cells[0].ljust(widths[0]), *padded_cells[1:]])


def score_table(scores: Sequence[Score], by_truth: Mapping[str, SecondsByTruth]) -> str:
    """Return a table of the right, wrong and unknown seconds of each variable, as in P1's Table 2.

    Args:
        scores: the scores of the variables.
        by_truth: the seconds of each variable, divided by the true value.
    """
    header = (
        "context-variable",
        "right s",
        "wrong s",
        "unknown s",
        "right/held",
        "balanced",
        "constant",
        "identified",
        "first at s",
    )
    return text_table(header, [_score_row(score, by_truth[score.name]) for score in scores])


def _score_row(score: Score, by_truth: SecondsByTruth) -> tuple[str, ...]:
    ratios = (score.ratio, by_truth.balanced_ratio, ratio_of_sums([by_truth.constant_share]))
    first = "never" if score.first_s is None else f"{score.first_s:.1f}"
    seconds = (f"{seconds_s:.1f}" for seconds_s in (score.right_s, score.wrong_s, score.unknown_s))
    return (
        score.name,
        *seconds,
        *("-" if ratio is None else f"{ratio:.3f}" for ratio in ratios),
        str(score.identified),
        first,
    )


def values_text(values: Mapping[str, Any]) -> str:
    """Return the values that an algorithm returned, as text."""
    return ", ".join(
        f"{name} {value:.3f}" if isinstance(value, float) else f"{name} {str(value).lower()}"
        for name, value in values.items()
    )
