"""`codra why`: why a variable was what it was, from the journal of a run."""

from __future__ import annotations

import difflib
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, existing, say, write_result

if TYPE_CHECKING:
    from codra_dsl.runtime.journal import Event
    from codra_dsl.runtime.journal.head import Head
    from codra_dsl.runtime.why import Why


class WhyFormat(StrEnum):
    """How an explanation is shown."""

    TEXT = "text"
    JSON = "json"


Variable = Annotated[str, typer.Argument(metavar="VARIABLE", help="The context-variable.", show_default=False)]
JournalOption = Annotated[
    Path, typer.Option("--journal", metavar="FILE", help="The journal of a run, whole or torn.", show_default=False)
]
At = Annotated[
    str | None,
    typer.Option(
        "--at",
        metavar="T",
        help="The instant: '31.5' or '31.5 s' on the run's clock, '+2 min' from its start.  "
        "[default: the end, before observers stop]",
        show_default=False,
    ),
]


def why_command(
    variable: Variable,
    *,
    journal: JournalOption,
    at: At = None,
    format_: Annotated[WhyFormat, typer.Option("--format", help="How it is shown.")] = WhyFormat.TEXT,
) -> None:
    """Say why a variable was what it was. From its value to the evidence, or from unknown to what was missing."""
    from codra_dsl.cli.journals import read_journal
    from codra_dsl.runtime.journal.ledger import Ledger
    from codra_dsl.runtime.why import explain

    existing([journal])
    head, events = read_journal(journal)
    if variable not in head.outline.variables:
        near = difflib.get_close_matches(variable, head.outline.variables, n=1)
        hint = f": did you mean '{near[0]}'?" if near else ""
        raise typer.BadParameter(f"the spec has no context-variable '{variable}'{hint}", param_hint="VARIABLE")
    at_s = _instant_s(at, head, events)
    events = _before_close(events) if at is None else events
    try:
        found = explain(head.outline, lambda until_s: Ledger.of(events, until_s), variable, at_s)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        say(f"codra: '{journal}' cannot be explained: {type(error).__name__}: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    write_result(f"{found}\n" if format_ is WhyFormat.TEXT else _json(found))


def _json(found: Why) -> str:
    import dataclasses

    from codra_dsl.runtime.journal.encoding import json_text

    return f"{json_text(dataclasses.asdict(found))}\n"


def _before_close(events: tuple[Event, ...]) -> tuple[Event, ...]:
    """Leave out that all observers stopped because the run ended."""
    from codra_dsl.runtime.journal import Kind

    ends = (number for number, event in enumerate(events) if event.kind is Kind.INPUT and event.what == "close")
    return events[: next(ends, len(events))]


def _instant_s(text: str | None, head: Head, events: tuple[Event, ...]) -> float:
    """Return the instant that is asked about; without one, that of the last event."""
    from codra_dsl.units import parse_duration

    end_s = events[-1].instant_s if events else head.start_s
    if text is None:
        return end_s
    from_s, number = (head.start_s, text[1:].strip()) if text.startswith("+") else (0.0, text)
    try:
        found_s: object = float(number)
    except ValueError:
        found_s = parse_duration(number)
    if not isinstance(found_s, float) or not abs(found_s) < float("inf"):
        raise typer.BadParameter(f"'{text}' is no instant such as '31.5' or '+2 min'", param_hint="--at")
    if not head.start_s <= from_s + found_s <= end_s:
        message = f"the journal holds {head.start_s:g} s to {end_s:.3f} s, not {from_s + found_s:g} s"
        raise typer.BadParameter(message, param_hint="--at")
    return from_s + found_s
