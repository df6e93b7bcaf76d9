"""Formats of numbers in the tables and sentences of a report."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from codra_papers.experiments.campaign.document import Cell, Table
from codra_papers.experiments.campaign.statistics import Estimate, Share, ratio_of_sums


def rounded(value: float | None, digits: int) -> float | None:
    """Return a number rounded for display. Return None for None."""
    return None if value is None else round(value, digits)


def ratio(share: Share) -> float | None:
    """Return the ratio of a share, rounded to three digits as in P1. Return None for 0 / 0."""
    return rounded(ratio_of_sums([share]), 3)


def interval(estimate: Estimate, digits: int = 3) -> str:
    """Return an estimate as text with signs: the value, and the ends of the interval if there is an interval."""
    if estimate.value is None:
        return "none"
    if estimate.low is None or estimate.high is None:
        return f"{estimate.value:+.{digits}f}, no interval"
    return f"{estimate.value:+.{digits}f} [{estimate.low:+.{digits}f}, {estimate.high:+.{digits}f}]"


def percent(estimate: Estimate) -> str:
    """Return an estimate of a share as text, in percent."""
    return estimate_text(estimate, lambda share: f"{100 * share:.1f}", "none")


def estimate_text(estimate: Estimate, format_number: Callable[[float], str], absent_text: str) -> str:
    """Return an estimate as text: the value, and the ends of the interval if there is an interval.

    Args:
        estimate: the estimate to format.
        format_number: a function that returns one number as text.
        absent_text: the text for an estimate without a value.
    """
    if estimate.value is None:
        return absent_text
    interval_text = (
        ""
        if estimate.low is None or estimate.high is None
        else f" [{format_number(estimate.low)}, {format_number(estimate.high)}]"
    )
    return f"{format_number(estimate.value)}{interval_text}"


def plain_table(caption: str, header: Iterable[str], rows: Iterable[Iterable[Cell]]) -> Table:
    """Return a table without marked cells."""
    return Table(caption=caption, header=tuple(header), rows=tuple(tuple(row) for row in rows))


def mark_below(table: Table, limit: float, rows: Iterable[int]) -> Table:
    """Return a table with further marked cells: in the given rows, the decimal numbers below a limit."""
    low_cells = frozenset(
        (row, column)
        for row in rows
        for column, cell in enumerate(table.rows[row])
        if isinstance(cell, float) and cell < limit
    )
    return Table(caption=table.caption, header=table.header, rows=table.rows, marked=table.marked | low_cells)
