"""Functions for all commands that read journals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from codra_dsl.cli.console import ExitCode, say

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.reader import JournalReader


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
