"""`codra get` and `codra watch`: the context-variables of a running robot."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, Annotated, Any

import typer

from codra_dsl.cli.console import harmless_text, write_result
from codra_dsl.cli.running.addresses import CredentialsOption
from codra_dsl.cli.running.requests import ConnectOption, request

if TYPE_CHECKING:
    from codra_dsl.runtime.remote import RemoteContext
    from codra_dsl.runtime.values.cell import Reading

Variables = Annotated[
    list[str], typer.Argument(metavar="VARIABLE...", help="The context-variables.", show_default=False)
]


def get_command(variables: Variables, *, connect: ConnectOption, credentials: CredentialsOption = None) -> None:
    """Print the present values of context-variables of a running robot, or why they are unknown."""

    def read(codra: RemoteContext) -> str:
        return "".join(_line(codra.get(name), codra.describe(name).unit) for name in variables)

    write_result(request(connect, credentials, read))


def watch_command(variables: Variables, *, connect: ConnectOption, credentials: CredentialsOption = None) -> None:
    """Print context-variables of a running robot, now and whenever they change, until Ctrl-C."""

    def follow(codra: RemoteContext) -> None:
        units = {name: codra.describe(name).unit for name in variables}
        lost_event = threading.Event()
        codra.subscribe(variables, lambda reading: write_result(_line(reading, units[reading.name])))
        while not lost_event.wait(1.0):
            codra.get(variables[0])  # raises ConnectionError once the manager is gone

    request(connect, credentials, follow)


def _line(reading: Reading[Any], unit: str | None) -> str:
    from codra_dsl.runtime.why.values import instant_text, value_text

    if reading.known:
        unit_text = f" {unit}" if unit else ""
        source_text = f"  ({reading.source}, evidence of {instant_text(reading.evidence_s)})" if reading.source else ""
        return harmless_text(f"{reading.name} = {value_text(reading.value)}{unit_text}{source_text}\n")
    since_text = f" since {instant_text(reading.evidence_s)}" if math.isfinite(reading.evidence_s) else ""
    detail_text = f": {reading.detail}" if reading.detail else ""
    return harmless_text(f"{reading.name} is unknown ({reading.reason}{since_text}){detail_text}\n")
