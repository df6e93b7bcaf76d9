"""`codra journal`: what can be done with the journal of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, existing, say, write_result

if TYPE_CHECKING:
    from codra_dsl.runtime.journal import Event
    from codra_dsl.runtime.journal.recovery import Recovery

JournalFile = Annotated[Path, typer.Argument(metavar="FILE", help="The journal of a run.", show_default=False)]
Target = Annotated[
    Path | None,
    typer.Option(
        "--output",
        metavar="FILE",
        help="The file to write.  [default: beside the journal, with .recovered in its name]",
        show_default=False,
    ),
]

Kinds = Annotated[
    list[str] | None,
    typer.Option(
        "--kind",
        metavar="KIND",
        help="Only events of this kind, e.g. decision; may be repeated.  [default: all but input]",
        show_default=False,
    ),
]
About = Annotated[
    list[str] | None,
    typer.Option(
        "--about",
        metavar="NAME",
        help="Only events about this variable, observer or algorithm; may be repeated.",
        show_default=False,
    ),
]

Whats = Annotated[
    list[str] | None,
    typer.Option(
        "--what",
        metavar="WHAT",
        help="Only what happened like this, e.g. fell_back; may be repeated.",
        show_default=False,
    ),
]

_LINES_AT_ONCE = 1000

journal_commands = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, context_settings={"help_option_names": ["-h", "--help"]}
)


@journal_commands.callback()
def _journal() -> None:
    """Show the journal of a run, or mend that of one that was killed."""


@journal_commands.command("recover")
def recover_command(file: JournalFile, *, output: Target = None) -> None:
    """Write a whole journal with all that a torn one holds, and say what is lost; the torn one stays as it is."""
    from codra_dsl.runtime.journal.reader import JournalError
    from codra_dsl.runtime.journal.recovery import recover

    existing([file])
    target = file.with_name(f"{file.stem}.recovered{file.suffix}") if output is None else output
    if target.resolve() == file.resolve():
        raise typer.BadParameter(f"'{target}' is the journal itself", param_hint="--output")
    try:
        found = recover(file, target)
    except JournalError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except OSError as error:
        say(f"codra: cannot read '{file}' or write '{target}': {error.strerror or error}")
        raise typer.Exit(ExitCode.FAILED) from error
    write_result(f"{target}: {_told(found)}\n")


@journal_commands.command("show")
def show_command(file: JournalFile, *, kind: Kinds = None, about: About = None, what: Whats = None) -> None:
    """Print the events of a journal, one a line: the instant, what it is about, what happened, and the details."""
    from codra_dsl.cli.journals import opened_journal, say_what_lacks
    from codra_dsl.runtime.journal import Kind

    existing([file])
    names = [str(each) for each in Kind]
    unknown = next((each for each in kind or () if each not in names), None)
    if unknown is not None:
        raise typer.BadParameter(f"'{unknown}' is none of {', '.join(names)}", param_hint="--kind")
    wanted = frozenset(kind or (each for each in names if each != Kind.INPUT))
    with opened_journal(file) as reader:
        end_s, lines = reader.header().start_s, list[str]()
        for event in reader.events():
            end_s = event.instant_s
            if (
                event.kind in wanted
                and event.name in (about or (event.name,))
                and event.what in (what or (event.what,))
            ):
                lines.append(_line(event))
            if len(lines) == _LINES_AT_ONCE:
                write_result("".join(lines))
                lines.clear()
        write_result("".join(lines))
        say_what_lacks(reader, end_s)


def _line(event: Event) -> str:
    from codra_dsl.runtime.journal.encoding import json_text
    from codra_dsl.runtime.why.values import instant

    details = {key: detail for key, detail in event.details.items() if detail != ""}
    return f"{instant(event.instant_s)}  {event.kind} {event.name} {event.what}  {json_text(details)}\n"


def _told(found: Recovery) -> str:
    from codra_dsl.runtime.why.values import instant

    damage = found.damage
    lines = [f"{found.messages} messages from {instant(found.from_s)} to {instant(found.to_s)}"]
    if not damage.is_torn and not damage.unread:
        lines.append("the journal was whole: nothing was lost")
    if damage.regained:
        lines.append(f"{damage.regained} of them stood in no chunk yet")
    lines.extend(f"cannot be read: {part}" for part in damage.unread)
    if damage.unread and damage.lost:
        lines.append(f"lost: {damage.lost} messages between others")
    if found.is_live:
        lines.append("its program still writes it: this is what it held so far")
    elif damage.is_torn:
        lines.append("lost at the end: at most the message that was being written")
    return "\n  ".join(lines)
