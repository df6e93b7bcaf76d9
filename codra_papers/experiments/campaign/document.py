"""What an experiment reports, before it is a page: sections of words, tables and pictures, and results as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Cell = str | int | float | bool | None
"""A number is shown as it is rounded by who puts it in; None as a dash."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """A paragraph in plain text."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table.

    Attributes:
        caption: what it shows, in a sentence or two.
        header: of its columns.
        rows: each with a cell for each column.
        marked: the cells, by row and column from 0, that deserve a second look, e.g. ratios below 0.9 (P1, Table 2).
    """

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    marked: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A picture that was drawn.

    Attributes:
        svg: a whole SVG document.
    """

    caption: str
    svg: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """A frame that was kept.

    Attributes:
        path: of a PNG file; tags found in it are outlined when it is shown.
    """

    caption: str
    path: Path


Part = Words | Table | Drawing | Photograph


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of a report under a heading."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """A report.

    Attributes:
        title: of the experiment.
        summary: what was found, in a few sentences.
        results: the same as data: what `json.dumps` takes, with units in its keys.
    """

    title: str
    summary: Sequence[str]
    sections: Sequence[Section]
    results: Mapping[str, Any]
