"""Functions for all commands that read journals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from codra_dsl.cli.console import ExitCode, say

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.reader import JournalReader
    from codra_dsl.runtime.journal.run_header import RunHeader

JournalFile = Annotated[Path, typer.Argument(metavar="FILE", help="The journal of a run.", show_default=False)]
FromOption = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="T",
        help="The first instant, as for --at of codra why, e.g. '31.5' or '+2 min'.  [default: the start of the run]",
        show_default=False,
    ),
]
ToOption = Annotated[
    str | None,
    typer.Option(
        "--to", metavar="T", help="The last instant, in the same forms.  [default: the end]", show_default=False
    ),
]


class ResultFormat(StrEnum):
    """The formats in which commands show the content of a journal."""

    TEXT = "text"
    JSON = "json"


def json_of(result: Any) -> str:
    """Return a result, an object of a dataclass, as one line of JSON."""
    import dataclasses

    from codra_dsl.runtime.journal.encoding import json_text

    return f"{json_text(dataclasses.asdict(result))}\n"


@contextmanager
def open_journal(path: Path) -> Iterator[JournalReader]:
    """Open a journal. If the file is not a journal or cannot be read, print a message and exit."""
    from codra_dsl.runtime.journal.reader import JournalError, JournalReader

    try:
        with JournalReader(path) as reader:
            yield reader
    except JournalError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except BrokenPipeError:  # an error of standard output, not of the journal
        raise
    except OSError as error:
        say(f"codra: cannot read '{path}': {error.strerror or error}")
        raise typer.Exit(ExitCode.FAILED) from error


def report_damage(reader: JournalReader, end_s: float) -> None:
    """Report the damage of a journal that has been read up to an instant."""
    from codra_dsl.runtime.why.values import instant_text

    if reader.damage.is_torn:
        state = "is still being written" if reader.is_live else "lacks its end"
        say(f"codra: '{reader.path}' {state}: it holds what happened up to {instant_text(end_s)}")
    for part_text in reader.damage.part_texts():
        say(f"codra: '{reader.path}': {part_text}")


def range_of(from_: str | None, to: str | None, header: RunHeader) -> tuple[float, float]:
    """Return the first and the last instant of a range of time; an empty range is a usage error."""
    from_s = -math.inf if from_ is None else instant_of(from_, header, "--from")
    to_s = math.inf if to is None else instant_of(to, header, "--to")
    if to_s < max(from_s, header.start_s):
        start_text = "--from" if from_s >= header.start_s else "the start of the run"
        raise typer.BadParameter(f"'{to}' is before {start_text}", param_hint="--to")
    return from_s, to_s


def instant_of(text: str, header: RunHeader, option: str) -> float:
    """Return the instant that the value of an option such as `--at` names."""
    if text.startswith("+"):
        seconds = _parse_seconds(text[1:].strip())
        at_s = None if seconds is None else header.start_s + seconds
    else:
        seconds = _parse_seconds(text)
        at_s = _time_of_day_s(text) if seconds is None else seconds
    if at_s is None or not abs(at_s) < math.inf:
        examples = "'31.5', '+2 min', or '2030-01-31 03:12:05' in UTC"
        raise typer.BadParameter(f"'{text}' is not an instant such as {examples}", param_hint=option)
    return at_s


def _parse_seconds(text: str) -> float | None:
    from codra_dsl.language.units import parse_duration

    try:
        return float(text)
    except ValueError:
        duration_s = parse_duration(text)
        return duration_s if isinstance(duration_s, float) else None


def _time_of_day_s(text: str) -> float | None:
    """Return the seconds from 1970 to a date and time; None for another text. Without a time zone, UTC is meant."""
    from datetime import UTC, datetime

    try:
        date_time = datetime.fromisoformat(text.removesuffix("UTC").strip())
    except ValueError:
        return None
    return (date_time if date_time.tzinfo is not None else date_time.replace(tzinfo=UTC)).timestamp()
