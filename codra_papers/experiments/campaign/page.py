"""Render a report as one HTML file. It needs no network and no script, and can be shown in any browser and printed.

Drawings are embedded as images and not as SVG elements, so that names in different drawings cannot clash.
"""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import groupby

from jinja2 import Environment, PackageLoader, StrictUndefined

from codra_papers.experiments.campaign.document import Cell, Document, Drawing, Part, Photograph, Section, Table, Words
from codra_papers.experiments.campaign.experiment import AnyOutcome, Experiment
from codra_papers.experiments.campaign.photographs import NoPictureError, annotated_jpeg
from codra_papers.experiments.campaign.provenance import Provenance

_NOT_IN_ANCHORS = re.compile(r"[^a-z0-9]+")


class _Kind(StrEnum):
    """The kinds of blocks that the template distinguishes."""

    WORDS = "words"
    TABLE = "table"
    DRAWING = "drawing"
    PHOTOGRAPHS = "photographs"


@dataclass(frozen=True, slots=True, kw_only=True)
class _ShownCell:
    text: str
    is_number: bool
    is_marked: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _ShownTable:
    caption: str
    header: Sequence[_ShownCell]
    rows: Sequence[Sequence[_ShownCell]]
    has_marks: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Image:
    """A picture as a data URI, or the reason why it is missing."""

    caption: str
    uri: str = ""
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """A part of a section, or several photographs side by side."""

    kind: _Kind
    content: object


@dataclass(frozen=True, slots=True, kw_only=True)
class _ShownSection:
    anchor: str
    title: str
    blocks: Sequence[_Block]


def render_page(
    experiment: Experiment, document: Document, outcomes: Mapping[str, AnyOutcome], provenance: Provenance
) -> str:
    """Return a report as HTML.

    Args:
        experiment: the experiment, whose name and question are shown.
        document: the content of the report.
        outcomes: the outcomes of the trials. The key is the name of the trial.
        provenance: the inputs and the environment of the report.
    """
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            experiment=experiment,
            document=document,
            sections=_sections(document.sections),
            last_sections=_sections(
                [_provenance_section(provenance), _trials_section(outcomes)], first=len(document.sections)
            ),
        )
    )


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("codra_papers.experiments.campaign"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=True,
    )


def _sections(sections: Sequence[Section], first: int = 0) -> Sequence[_ShownSection]:
    return [
        _ShownSection(anchor=_anchor(number, section.title), title=section.title, blocks=_blocks(section.parts))
        for number, section in enumerate(sections, first + 1)
    ]


def _anchor(number: int, title: str) -> str:
    return f"{number}-{_NOT_IN_ANCHORS.sub('-', title.lower()).strip('-')}"


def _blocks(parts: Sequence[Part]) -> Sequence[_Block]:
    """Return parts as blocks. Consecutive photographs become one block, which shows them side by side."""
    blocks: list[_Block] = []
    for are_photographs, group in groupby(parts, lambda part: isinstance(part, Photograph)):
        if are_photographs:
            images = [_photograph(part) for part in group if isinstance(part, Photograph)]
            blocks.append(_Block(kind=_Kind.PHOTOGRAPHS, content=images))
        else:
            blocks += [_block(part) for part in group]
    return blocks


def _block(part: Part) -> _Block:
    match part:
        case Words():
            return _Block(kind=_Kind.WORDS, content=part.text)
        case Table():
            return _Block(kind=_Kind.TABLE, content=_table(part))
        case Drawing():
            image = _Image(caption=part.caption, uri=_uri("image/svg+xml", part.svg.encode()))
            return _Block(kind=_Kind.DRAWING, content=image)
        case Photograph():
            return _Block(kind=_Kind.PHOTOGRAPHS, content=[_photograph(part)])


def _photograph(part: Photograph) -> _Image:
    try:
        return _Image(caption=part.caption, uri=_uri("image/jpeg", annotated_jpeg(part.path)))
    except NoPictureError as error:
        return _Image(caption=part.caption, reason=str(error))


def _uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _table(table: Table) -> _ShownTable:
    """Return a table with the numeric columns aligned to the right. A table without rows gets the row "none"."""
    shown_rows = table.rows or [("none", *[""] * (len(table.header) - 1))]
    cells_by_column = [
        [row[column] for row in shown_rows if row[column] not in _ABSENT_CELLS] for column in range(len(table.header))
    ]
    is_numeric_by_column = [bool(cells) and all(map(_is_number, cells)) for cells in cells_by_column]
    decimals_by_column = [max(map(_decimals, cells), default=0) for cells in cells_by_column]
    rows = [
        [
            _ShownCell(
                text=_cell_text(cell, decimals_by_column[column]),
                is_number=is_numeric_by_column[column],
                is_marked=(row_index, column) in table.marked,
            )
            for column, cell in enumerate(row)
        ]
        for row_index, row in enumerate(shown_rows)
    ]
    header = [
        _ShownCell(text=text, is_number=is_number, is_marked=False)
        for text, is_number in zip(table.header, is_numeric_by_column, strict=True)
    ]
    return _ShownTable(caption=table.caption, header=header, rows=rows, has_marks=bool(table.marked))


_ABSENT_CELLS = (None, "", "-", "\u2013")
_BETWEEN_DIGITS = r"([-+\u2212\u2013\u00b1\d\s.,%()\[\]/]|\bto\b|(?<=\d)e(?=[-+]?\d))*"
_FIGURE = re.compile(rf"{_BETWEEN_DIGITS}\d{_BETWEEN_DIGITS}")
"""Text that shows a rounded number, a share or an interval."""


def _is_number(cell: Cell) -> bool:
    """Return whether a cell is a number, or text that shows a rounded number."""
    if isinstance(cell, str):
        return _FIGURE.fullmatch(cell) is not None
    return cell is not None and not isinstance(cell, bool)


def _decimals(cell: Cell) -> int:
    """Return the number of decimals of a number."""
    return len(str(cell).partition(".")[2]) if isinstance(cell, float) and math.isfinite(cell) else 0


def _cell_text(cell: Cell, decimals: int) -> str:
    """Return the text of a cell. All decimal numbers of a column have the same number of decimals."""
    match cell:
        case None:
            return "\u2013"
        case bool():
            return "yes" if cell else "no"
        case float():
            return f"{cell:.{decimals}f}"
        case _:
            return str(cell)


# Sections at the end of every report


def _provenance_section(provenance: Provenance) -> Section:
    reused_text = f"; {provenance.reused_trial_count} had been run before" if provenance.reused_trial_count else ""
    revision = "in no git repository"
    if provenance.revision is not None:
        state = "no uncommitted changes" if provenance.revision.is_clean else "with uncommitted changes"
        revision = f"{provenance.revision.commit}, {state}"
    rows = [
        ("Command", provenance.command),
        ("Specification", provenance.spec),
        ("Working tree", revision),
        *((name, version) for name, version in provenance.versions.items()),
        ("Code of codra", f"SHA-256 {provenance.code}"),
        ("Seeds", ", ".join(map(str, provenance.seeds))),
        (
            ("Cores", f"{provenance.cores}; {provenance.processes} processes at once")
            if provenance.cluster is None
            else ("Cluster", provenance.cluster)
        ),
        ("Time", f"{provenance.elapsed_s:.0f} s for the trials that this call ran{reused_text}"),
    ]
    caption = "The inputs of this report. The same command, code and versions give the same results."
    return Section(title="Made with", parts=[Table(caption=caption, header=("Input", "Value"), rows=rows)])


def _trials_section(outcomes: Mapping[str, AnyOutcome]) -> Section:
    rows = [
        (
            name,
            str(outcome.seed),
            f"{outcome.duration_s:.1f}",
            str(outcome.loops),
            str(outcome.frames),
            outcome.error,
        )
        for name, outcome in outcomes.items()
    ]
    header = ("Trial", "Seed", "Simulated s", "Loops", "Frames", "Ended by an error")
    marked = frozenset((number, 5) for number, outcome in enumerate(outcomes.values()) if outcome.error)
    caption = (
        "All trials. Loops are those that the main execution completed; in the store, they are missions."
        " Frames are those rendered for perception."
    )
    return Section(title="Trials", parts=[Table(caption=caption, header=header, rows=rows, marked=marked)])
