"""The tables printed after a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

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


def score_table(scores: Sequence[Score]) -> str:
    """Return a table of the right, wrong and unknown seconds of each variable, as in P1's Table 2."""
    header = ("context-variable", "right s", "wrong s", "unknown s", "right/held", "identified", "first at s")
    return text_table(header, [_score_row(score) for score in scores])


def _score_row(score: Score) -> tuple[str, ...]:
    ratio = "-" if score.ratio is None else f"{score.ratio:.3f}"
    first = "never" if score.first_s is None else f"{score.first_s:.1f}"
    seconds = (f"{seconds_s:.1f}" for seconds_s in (score.right_s, score.wrong_s, score.unknown_s))
    return (score.name, *seconds, ratio, str(score.identified), first)


def values_text(values: Mapping[str, Any]) -> str:
    """Return the values that an algorithm returned, as text."""
    return ", ".join(
        f"{name} {value:.3f}" if isinstance(value, float) else f"{name} {str(value).lower()}"
        for name, value in values.items()
    )
