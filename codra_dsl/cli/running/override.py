"""`codra override`: override a context-variable of a running robot, as its operator."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.running.addresses import CredentialsOption
from codra_dsl.cli.running.requests import ConnectOption, request

if TYPE_CHECKING:
    from codra_dsl.runtime.remote import RemoteContext
    from codra_dsl.runtime.values.model import ValueType

_TRUTH_VALUES = {"true": True, "false": False}
_INTEGER = re.compile(r"[+-]?[0-9]{1,100}")
_NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|inf)")


def override_command(
    variable: Annotated[str, typer.Argument(metavar="VARIABLE", help="The context-variable.", show_default=False)],
    value: Annotated[
        str | None,
        typer.Argument(metavar="[VALUE]", help="Its value: true, false, a number or a text.", show_default=False),
    ] = None,
    *,
    connect: ConnectOption,
    credentials: CredentialsOption = None,
    for_: Annotated[
        str,
        typer.Option(
            "--for", metavar="DURATION", help="How long it lasts, at most 24 h: '10 min'.", show_default=False
        ),
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
        request(connect, credentials, lambda codra: codra.clear_override(variable))
        return
    for_s = _duration_s(for_)
    if not reason.strip():
        raise typer.BadParameter("state why: the reason is recorded", param_hint="--reason")
    request(connect, credentials, lambda codra: _override(codra, variable, value, for_s, reason))


def _override(codra: RemoteContext, variable: str, value: str | None, for_s: float, reason: str) -> None:
    content = None if value is None else _read_value(value, variable, codra.describe(variable))
    codra.override(variable, content, for_s=for_s, reason=reason)


def _duration_s(text: str) -> float:
    from codra_dsl.language.units import duration_help, parse_duration
    from codra_dsl.runtime.context.overrides import checked_duration_s

    duration_s = parse_duration(text)
    if duration_s is None:
        message = duration_help(text) if text else "state how long the override lasts, such as '10 min'"
        raise typer.BadParameter(message, param_hint="--for")
    try:
        return checked_duration_s(duration_s)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--for") from error


def _read_value(text: str, variable: str, value_type: ValueType) -> bool | int | float | str:
    """Return the value of a variable that a text states. The manager checks its range and its members.

    Raises:
        ValueError: if the text is not a truth value or a number, although the variable has one.
    """
    if value_type.kind == "bool":
        if text.casefold() not in _TRUTH_VALUES:
            raise ValueError(f"'{text}' is not a value of '{variable}': write true or false")
        return _TRUTH_VALUES[text.casefold()]
    if value_type.kind in ("str", "enum"):
        return text
    number = _read_number(text, variable, value_type.unit)
    is_whole = value_type.kind == "int" and isinstance(number, float) and number.is_integer()
    return int(number) if is_whole else number


def _read_number(text: str, variable: str, unit_text: str | None) -> int | float:
    """Return a number in the unit of a variable."""
    from codra_dsl.language.units import convert, parse_quantity, parse_unit

    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text):
        if math.isinf(number := float(text)) and "inf" not in text:
            raise ValueError(f"{text[:60]} is too large")
        return number
    quantity, unit = parse_quantity(text.removeprefix("+")), parse_unit(unit_text or "")
    if quantity is None:
        raise ValueError(_not_a_number_text(text, variable, unit_text))
    if unit is None or quantity.unit.dimension != unit.dimension:
        unit_help = f"its unit is {unit_text}" if unit_text else f"it has no unit, so write {quantity.value}"
        raise ValueError(f"'{text}' is not a value of '{variable}': {unit_help}")
    return convert(quantity.value, quantity.unit, unit)


def _not_a_number_text(text: str, variable: str, unit_text: str | None) -> str:
    from codra_dsl.language.units import units_help

    if text.casefold() == "nan":
        return f"write --unknown in place of '{text}' to make '{variable}' unknown"
    match = re.fullmatch(rf"({_NUMBER.pattern})\s*(\S.*)", text)
    if match is not None and unit_text:
        return f"'{match[2]}' is not a unit: {units_help(match[2])}"
    return f"'{text}' is not a value of '{variable}': write a number{f' in {unit_text}' if unit_text else ''}"
