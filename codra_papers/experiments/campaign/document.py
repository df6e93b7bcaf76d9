"""The content of a report: sections with paragraphs, tables and pictures, and the results as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Cell = str | int | float | bool | None
"""A value in a table. Numbers are shown without rounding, so round them first; None is shown as a dash."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """A paragraph in plain text."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table.

    Attributes:
        caption: a description in one or two sentences.
        header: the titles of the columns.
        rows: the rows, each with one cell per column.
        marked: the highlighted cells as pairs (row, column) with indices from 0, e.g. the cells of ratios below 0.9
            (P1, Table 2).
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    marked: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A vector drawing.

    Attributes:
        svg: a complete SVG document.
    """

    caption: str
    svg: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A stored frame.

    Attributes:
        path: the PNG file of the frame. The report shows it with the detected tags outlined.
    """

    caption: str
    path: Path


Part = Words | Table | Drawing | Photograph


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report with its own heading."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A report.

    Attributes:
        title: the title of the report.
        summary: the results in a few sentences.
        results: the results as data for `json.dumps`, with units in the keys.
    """

    title: str
    summary: Sequence[str]
    sections: Sequence[Section]
    results: Mapping[str, Any]
