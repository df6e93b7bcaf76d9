"""Requests to the context manager of a running robot."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from codra_dsl.cli.console import ExitCode, harmless_text, say
from codra_dsl.cli.running.addresses import address_of

if TYPE_CHECKING:
    from codra_dsl.runtime.remote import RemoteContext

ConnectOption = Annotated[
    str,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        help="The address of the robot's manager: a Unix socket, a port, or an endpoint such as tcp/10.0.0.5:7447.",
        show_default=False,
    ),
]

Answer = TypeVar("Answer")


def request(address: str, credentials: Path | None, send: Callable[[RemoteContext], Answer]) -> Answer:
    """Send requests to the context manager at an address, and report its errors."""
    from codra_dsl.runtime.remote import RemoteContext

    try:
        with RemoteContext(address_of(address, credentials)) as codra:
            return send(codra)
    except (OSError, RuntimeError, ImportError) as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except (ValueError, LookupError) as error:
        raise typer.BadParameter(harmless_text(str(error))) from error
