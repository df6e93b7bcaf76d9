"""How numbers are written in the tables and sentences of a report."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from codra_papers.experiments.campaign.document import Cell, Table
from codra_papers.experiments.campaign.statistics import Estimate, Share, ratio_of_sums


def rounded(value: float | None, digits: int) -> float | None:
    """Return a number as it is shown; None stays None."""
    return None if value is None else round(value, digits)


def ratio(share: Share) -> float | None:
    """Return a ratio as P1 writes it, with three digits."""
    return rounded(ratio_of_sums([share]), 3)


def interval(found: Estimate, digits: int = 3) -> str:
    """Return an estimate in words: the value and the ends of its interval."""
    if found.value is None:
        return "none"
    if found.low is None or found.high is None:
        return f"{found.value:+.{digits}f}, no interval"
    return f"{found.value:+.{digits}f} [{found.low:+.{digits}f}, {found.high:+.{digits}f}]"


def percent(found: Estimate) -> str:
    """Return an estimate of a share as percentages."""
    return with_ends(found, lambda share: f"{100 * share:.1f}", "none")


def with_ends(found: Estimate, shown: Callable[[float], str], nothing: str) -> str:
    """Return an estimate, each number as `shown` writes it, with the ends of its interval where it has one."""
    if found.value is None:
        return nothing
    ends = "" if found.low is None or found.high is None else f" [{shown(found.low)}, {shown(found.high)}]"
    return f"{shown(found.value)}{ends}"


def plain_table(caption: str, header: Iterable[str], rows: Iterable[Iterable[Cell]]) -> Table:
    """Return a table without marks."""
    return Table(caption=caption, header=tuple(header), rows=tuple(tuple(row) for row in rows))


def marked_below(table: Table, limit: float, rows: Iterable[int]) -> Table:
    """Return a table with the numbers of some rows marked that lie below a limit."""
    low = frozenset(
        (row, column)
        for row in rows
        for column, cell in enumerate(table.rows[row])
        if isinstance(cell, float) and cell < limit
    )
    return Table(caption=table.caption, header=table.header, rows=table.rows, marked=table.marked | low)
