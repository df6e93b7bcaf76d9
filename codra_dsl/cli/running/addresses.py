"""The address of a context manager on the command line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import existing

if TYPE_CHECKING:
    from codra_dsl.runtime.remote.json_lines import Address
    from codra_dsl.runtime.remote.zenoh_session import NetworkAddress

CredentialsOption = Annotated[
    Path | None,
    typer.Option(
        "--credentials",
        metavar="FILE",
        help="The file with the user, the password and the certificate, for a network with users.",
        show_default=False,
    ),
]

_PORT = re.compile(r"[0-9]{1,5}")
_ENDPOINT = re.compile(r"(tcp|tls|quic|udp|ws)/.+")


def address_of(text: str, credentials: Path | None = None) -> Address | NetworkAddress:
    """Return the address that a text states: a port, an endpoint of Zenoh, or the path of a Unix socket.

    Args:
        text: the text.
        credentials: the file with the user, the password and TLS, for an endpoint of Zenoh.
    """
    from codra_dsl.runtime.remote.zenoh_session import NetworkAddress

    if _ENDPOINT.fullmatch(text):
        return NetworkAddress(text, None if credentials is None else existing([credentials])[0])
    if credentials is not None:
        raise typer.BadParameter("only a network has users, such as tls/192.168.1.5:7447", param_hint="--credentials")
    return int(text) if _PORT.fullmatch(text) else Path(text)
