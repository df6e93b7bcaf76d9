"""`codra override`: override a context-variable of a running robot, as its operator."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, harmless_text, say

if TYPE_CHECKING:
    from codra_dsl.runtime.remote import RemoteContext

_TRUTH_VALUES = {"true": True, "false": False}
_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")


def override_command(
    variable: Annotated[str, typer.Argument(metavar="VARIABLE", help="The context-variable.", show_default=False)],
    value: Annotated[
        str | None,
        typer.Argument(metavar="[VALUE]", help="Its value: true, false, a number or a text.", show_default=False),
    ] = None,
    *,
    connect: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="The Unix socket or the port of the robot's server.", show_default=False),
    ],
    for_: Annotated[
        str, typer.Option("--for", metavar="DURATION", help="How long it lasts: '10 min'.", show_default=False)
    ] = "",
    reason: Annotated[
        str, typer.Option(metavar="TEXT", help="Why the variable is overridden.", show_default=False)
    ] = "",
    unknown: Annotated[bool, typer.Option("--unknown", help="Make the variable unknown.")] = False,
    clear: Annotated[bool, typer.Option("--clear", help="End the override of the variable.")] = False,
) -> None:
    """Give a context-variable of a running robot a value for some time, for example while its sensor is broken."""
    if (value is not None) + unknown + clear != 1:
        raise typer.BadParameter("give either a value, or --unknown, or --clear", param_hint="VALUE")
    if clear:
        _request(connect, lambda codra: codra.clear_override(variable))
        return
    for_s = _duration_s(for_)
    if not reason.strip():
        raise typer.BadParameter("state why: the reason is recorded", param_hint="--reason")
    _request(connect, lambda codra: _override(codra, variable, value, for_s, reason))


def _override(codra: RemoteContext, variable: str, value: str | None, for_s: float, reason: str) -> None:
    """Override a variable; a value that looks like a number or a truth value can also be a text."""
    from codra_dsl.runtime import NotOfTypeError

    read_value = None if value is None else _read_value(value)
    try:
        codra.override(variable, read_value, for_s=for_s, reason=reason)
    except NotOfTypeError:
        if isinstance(read_value, str) or value is None:
            raise
        try:
            codra.override(variable, value, for_s=for_s, reason=reason)
        except NotOfTypeError:
            codra.override(variable, read_value, for_s=for_s, reason=reason)  # for its message


def _request(address: str, send: Callable[[RemoteContext], None]) -> None:
    """Send a request to the context manager at an address, and report its errors."""
    from codra_dsl.runtime.remote import RemoteContext, TokenError

    try:
        with RemoteContext(int(address) if address.isdecimal() else address) as codra:
            send(codra)
    except (ConnectionError, TokenError, RuntimeError) as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except (ValueError, LookupError) as error:
        raise typer.BadParameter(harmless_text(str(error))) from error


def _duration_s(text: str) -> float:
    from codra_dsl.language.units import duration_help, parse_duration

    duration_s = parse_duration(text)
    if duration_s is None:
        message = duration_help(text) if text else "state how long the override lasts, such as '10 min'"
        raise typer.BadParameter(message, param_hint="--for")
    if not 0 < duration_s < math.inf:
        raise typer.BadParameter("an override lasts for more than 0 s, and not forever", param_hint="--for")
    return duration_s


def _read_value(text: str) -> bool | int | float | str:
    """Return the truth value or number that a text states; otherwise the text. NaN is no number."""
    if text in _TRUTH_VALUES:
        return _TRUTH_VALUES[text]
    try:
        number = float(text)
    except ValueError:
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    return text if math.isnan(number) else number
