"""`codra shadow`: report from a run's journal how often context agreed with the robot's own perception."""

from __future__ import annotations

from typing import Annotated

import typer

from codra_dsl.cli.console import ExitCode, existing, harmless_text, say, write_result
from codra_dsl.cli.journals import JournalFile, ResultFormat, json_of, open_journal, report_damage
from codra_dsl.isolation.error_text import described


def shadow_command(
    file: JournalFile,
    *,
    format_: Annotated[ResultFormat, typer.Option("--format", help="The format of the report.")] = ResultFormat.TEXT,
) -> None:
    """Report how often context agreed with the robot's own perception, in decisions with `shadow=True`."""
    from codra_dsl.runtime.context.shadow import shadow_report

    existing([file])
    with open_journal(file) as reader:
        events = tuple(reader.events())
        report_damage(reader, events[-1].instant_s if events else reader.header().start_s)
    try:
        report = shadow_report(events)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        say(f"codra: the decisions in '{file}' cannot be read: {described(error)}")
        raise typer.Exit(ExitCode.FAILED) from error
    write_result(harmless_text(f"{report}\n") if format_ is ResultFormat.TEXT else json_of(report))
