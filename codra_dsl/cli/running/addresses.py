"""The address of a context manager on the command line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from codra_dsl.runtime.remote.json_lines import Address
    from codra_dsl.runtime.remote.zenoh_session import NetworkAddress

_PORT = re.compile(r"[0-9]{1,5}")
_ENDPOINT = re.compile(r"(tcp|tls|quic|udp|ws)/.+")


def address_of(text: str) -> Address | NetworkAddress:
    """Return the address that a text states: a port, an endpoint of Zenoh, or the path of a Unix socket."""
    from codra_dsl.runtime.remote.zenoh_session import NetworkAddress

    if _ENDPOINT.fullmatch(text):
        return NetworkAddress(text)
    return int(text) if _PORT.fullmatch(text) else Path(text)
