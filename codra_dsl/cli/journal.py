"""`codra journal`: commands for the journal of a run."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.arguments import QuickCommand
from codra_dsl.cli.console import ExitCode, existing, harmless_text, say, text_for_log, write_result
from codra_dsl.cli.journals import (
    FromOption,
    JournalFile,
    ResultFormat,
    ToOption,
    open_journal,
    range_of,
    report_damage,
)
from codra_dsl.regular_files import real_path

if TYPE_CHECKING:
    from codra_dsl.runtime.journal import Event
    from codra_dsl.runtime.journal.recovery import Recovery

OutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output",
        metavar="FILE",
        help="The file to write.  [default: beside the journal, with .recovered in the file name]",
        show_default=False,
    ),
]

KindOption = Annotated[
    list[str] | None,
    typer.Option(
        "--kind",
        metavar="KIND",
        help="Show only events of this kind, e.g. decision. The option may be repeated.  [default: all but input]",
        show_default=False,
    ),
]
AboutOption = Annotated[
    list[str] | None,
    typer.Option(
        "--about",
        metavar="NAME",
        help="Show only events about this variable, observer or algorithm. The option may be repeated.",
        show_default=False,
    ),
]

WhatOption = Annotated[
    list[str] | None,
    typer.Option(
        "--what",
        metavar="WHAT",
        help="Show only events in which this happened, e.g. fell_back. The option may be repeated.",
        show_default=False,
    ),
]

_LINES_PER_WRITE = 1000


journal_commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@journal_commands.callback()
def _journal() -> None:
    """Show the journal of a run, or repair the journal of a run that was killed."""


@journal_commands.command("recover", cls=QuickCommand)
def recover_command(file: JournalFile, *, output: OutputOption = None) -> None:
    """Write a complete journal with everything that a damaged journal holds, and report losses. FILE is kept."""
    from codra_dsl.runtime.journal.reader import JournalError
    from codra_dsl.runtime.journal.recovery import recover

    existing([file])
    target = file.with_name(f"{file.stem}.recovered{file.suffix}") if output is None else output
    if real_path(target) == real_path(file):
        raise typer.BadParameter(f"'{target}' is the journal itself", param_hint="--output")
    try:
        recovery = recover(file, target)
    except JournalError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except OSError as error:
        say(f"codra: cannot read '{file}' or write '{target}': {error.strerror or error}")
        raise typer.Exit(ExitCode.FAILED) from error
    write_result(harmless_text(f"{target}: {_recovery_text(recovery)}\n"))


@journal_commands.command("show", cls=QuickCommand)
def show_command(
    file: JournalFile,
    *,
    kind: KindOption = None,
    about: AboutOption = None,
    what: WhatOption = None,
    from_: FromOption = None,
    to: ToOption = None,
    format_: Annotated[
        ResultFormat, typer.Option("--format", help="The format of the events; json is one JSON object per line.")
    ] = ResultFormat.TEXT,
) -> None:
    """Print the events of a journal, one per line: instant, kind, name, what happened, and details."""
    from codra_dsl.cli.worlds import Progress
    from codra_dsl.runtime.journal import Kind

    existing([file])
    kind_names = [str(event_kind) for event_kind in Kind]
    unknown_kind = next((name for name in kind or () if name not in kind_names), None)
    if unknown_kind is not None:
        raise typer.BadParameter(
            f"'{unknown_kind}' is not a kind; choose from {', '.join(kind_names)}", param_hint="--kind"
        )
    wanted_kinds = frozenset(kind or (name for name in kind_names if name != Kind.INPUT))
    is_text = format_ is ResultFormat.TEXT
    text_of, for_output = (_event_text, text_for_log) if is_text else (_event_json, str)
    with open_journal(file) as reader:
        header = reader.header()
        from_s, to_s = range_of(from_, to, header)
        end_s, lines, progress = header.start_s, list[str](), Progress(is_shown=not sys.stdout.isatty())
        for event in reader.events():
            if event.instant_s > to_s:
                break
            end_s = event.instant_s
            progress(end_s - header.start_s)
            if (
                event.instant_s >= from_s
                and event.kind in wanted_kinds
                and event.name in (about or (event.name,))
                and event.what in (what or (event.what,))
            ):
                lines.append(text_of(event))
            if len(lines) == _LINES_PER_WRITE:
                write_result(for_output("".join(lines)))
                lines.clear()
        progress.clear()
        write_result(for_output("".join(lines)))
        if to is None:
            report_damage(reader, end_s)


def _event_text(event: Event) -> str:
    from codra_dsl.runtime.journal.encoding import json_text
    from codra_dsl.runtime.why.values import instant_text
    from codra_dsl.tooling.report.findings import visible_text

    details = {key: detail for key, detail in event.details.items() if detail != ""}
    text = f"{instant_text(event.instant_s)}  {event.kind} {event.name} {event.what}  {json_text(details)}"
    return f"{visible_text(text)}\n"


def _event_json(event: Event) -> str:
    """Return an event as the JSON of its message in the journal, with its kind."""
    from codra_dsl.runtime.journal.encoding import message_of

    return f'{{"kind":"{event.kind}",{message_of(event).decode()[1:]}\n'


def _recovery_text(recovery: Recovery) -> str:
    from codra_dsl.runtime.why.values import instant_text

    damage = recovery.damage
    lines = [
        f"{recovery.message_count} messages from {instant_text(recovery.start_s)} to {instant_text(recovery.end_s)}"
    ]
    if not damage.is_torn and not damage.unreadable_parts:
        lines.append("the journal was complete: nothing was lost")
    if damage.regained_message_count:
        lines.append(f"{damage.regained_message_count} of these messages were not yet in a chunk")
    lines.extend(damage.part_texts())
    if damage.unreadable_parts and damage.lost_message_count:
        lines.append(f"lost: {damage.lost_message_count} messages between readable ones")
    if recovery.is_live:
        lines.append("the program is still writing this journal: this is its content so far")
    elif damage.is_torn:
        lines.append("lost at the end: at most the message that was being written")
    return "\n  ".join(lines)
