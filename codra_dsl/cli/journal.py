"""`codra journal`: what can be done with the journal of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, existing, say, write_result

if TYPE_CHECKING:
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

journal_commands = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, context_settings={"help_option_names": ["-h", "--help"]}
)


@journal_commands.callback()
def _journal() -> None:
    """Mend the journal of a run that was killed."""


@journal_commands.command("recover")
def recover_command(file: JournalFile, *, output: Target = None) -> None:
    """Write a whole journal with all that a torn one holds, and say what is lost; the torn one stays as it is."""
    from codra_dsl.runtime.journal.reading import JournalError
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
