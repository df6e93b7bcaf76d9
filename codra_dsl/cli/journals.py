"""What commands share that read the journal of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from codra_dsl.cli.console import ExitCode, say

if TYPE_CHECKING:
    from codra_dsl.runtime.journal import Event
    from codra_dsl.runtime.journal.head import Head


def read_journal(path: Path) -> tuple[Head, tuple[Event, ...]]:
    """Return what ran and all events of a journal; say if it is torn, and fail if it is none."""
    from codra_dsl.runtime.journal.reading import JournalError, JournalReader

    try:
        with JournalReader(path) as reader:
            head, events, damage = reader.head(), tuple(reader.events()), reader.damage
    except JournalError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except OSError as error:
        say(f"codra: cannot read '{path}': {error.strerror or error}")
        raise typer.Exit(ExitCode.FAILED) from error
    if damage.is_torn:
        say(f"codra: '{path}' lacks its end: it holds what happened up to {_end_s(events, head):.3f} s")
    for part in damage.unread:
        say(f"codra: '{path}': cannot be read: {part}")
    return head, events


def _end_s(events: tuple[Event, ...], head: Head) -> float:
    return events[-1].instant_s if events else head.start_s
