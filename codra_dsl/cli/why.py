"""`codra why`: explain from the journal of a run why a variable had its value."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, existing, harmless_text, say, write_result
from codra_dsl.cli.journals import ResultFormat, instant_of, json_of, open_journal, report_damage
from codra_dsl.cli.running.addresses import CredentialsOption
from codra_dsl.cli.running.requests import request
from codra_dsl.isolation.error_text import described

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.events_in_file import EventsInFile
    from codra_dsl.runtime.journal.run_header import RunHeader
    from codra_dsl.runtime.why import Why


def complete_variable(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the context-variables that begin with a text, if a readable journal was given before.

    A journal may come from anybody, and shells evaluate completions. So only names that a spec can declare are
    returned.
    """
    from codra_dsl.language.expression import is_identifier
    from codra_dsl.runtime.journal.reader import JournalError, JournalReader

    try:
        with JournalReader(Path(str(ctx.params.get("journal")))) as reader:
            summary = reader.header().summary
            names = (*summary.variables, *summary.skills)
            return [name for name in names if name.startswith(incomplete) and is_identifier(name)]
    except (JournalError, OSError, ValueError):
        return []


Variable = Annotated[
    str,
    typer.Argument(
        metavar="VARIABLE",
        help="The context-variable, or the skill, to explain its preview; for knowledge, a node, 'node.attribute', "
        "'origin -edge-> target', or a task.",
        show_default=False,
        autocompletion=complete_variable,
    ),
]
JournalOption = Annotated[
    Path | None,
    typer.Option(
        "--journal",
        metavar="FILE",
        help="The journal of a run: finished, still running, or killed.",
        show_default=False,
    ),
]
AtOption = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="T",
        help="The instant: '31.5' or '31.5 s' on the run's clock, '+2 min' from its start, or, if the clock shows "
        "the time of day, '2030-01-31 03:12:05' in UTC.  "
        "[default: the end of the run, before observers stop]",
        show_default=False,
    ),
]


def why_command(
    variable: Variable,
    *,
    journal: JournalOption = None,
    connect: Annotated[
        str | None,
        typer.Option(
            "--connect", metavar="ADDRESS", help="Ask the manager of a running robot instead.", show_default=False
        ),
    ] = None,
    credentials: CredentialsOption = None,
    at: AtOption = None,
    format_: Annotated[
        ResultFormat, typer.Option("--format", help="The format of the explanation.")
    ] = ResultFormat.TEXT,
) -> None:
    """Explain why a variable had its value, back to its evidence, or why it was unknown: the missing conditions."""
    from codra_dsl.runtime.journal.events_in_file import EventsInFile
    from codra_dsl.runtime.why.values import instant_text

    if journal is None or connect is not None:
        if connect is None or journal is not None:
            raise typer.BadParameter("give either --journal or --connect", param_hint="--journal")
        if at is not None or format_ is not ResultFormat.TEXT:
            raise typer.BadParameter("a running robot explains the present, as text", param_hint="--connect")
        explanation_text = request(connect, credentials, lambda codra: codra.why(variable))
        write_result(harmless_text(f"{explanation_text}\n"))
        return
    existing([journal])
    with open_journal(journal) as reader:
        header = reader.header()
        at_s = None if at is None else instant_of(at, header, "--at")
        events = EventsInFile(reader, header.summary, ends_before_close=at_s is None)
        end_s = header.start_s if events.end_s is None else events.end_s
        try:
            if at_s is not None and not header.start_s <= at_s <= end_s:
                span_text = f"{instant_text(header.start_s)} to {instant_text(end_s)}"
                message = f"the journal holds {span_text}, not {instant_text(at_s)}"
                raise typer.BadParameter(message, param_hint="--at")
            explanation = _explain(header, events, variable, end_s if at_s is None else at_s, journal)
        finally:
            report_damage(reader, end_s)
    is_text = format_ is ResultFormat.TEXT
    write_result(harmless_text(f"{explanation}\n") if is_text else json_of(explanation))


def _explain(header: RunHeader, events: EventsInFile, variable: str, at_s: float, journal: Path) -> Why:
    from codra_dsl.runtime.errors import UnknownNameError
    from codra_dsl.runtime.why import explain

    try:
        return explain(header.summary, events.latest_events, variable, at_s)
    except UnknownNameError as error:
        _refuse_undeclared_variable(variable, header)
        raise typer.BadParameter(harmless_text(str(error)), param_hint="VARIABLE") from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        say(f"codra: '{journal}' cannot be explained: {described(error)}")
        raise typer.Exit(ExitCode.FAILED) from error


def _refuse_undeclared_variable(name: str, header: RunHeader) -> None:
    """Refuse the name of an undeclared variable, if the spec has no knowledge to which the name could belong."""
    if not header.summary.nodes and name not in header.summary.variables:
        similar_names = difflib.get_close_matches(name, (*header.summary.variables, *header.summary.skills), n=1)
        hint = f": did you mean '{similar_names[0]}'?" if similar_names else ""
        message = harmless_text(f"the spec has no context-variable '{name}'{hint}")
        raise typer.BadParameter(message, param_hint="VARIABLE")
