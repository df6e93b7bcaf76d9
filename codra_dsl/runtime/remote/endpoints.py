"""The addresses at which managers listen: local sockets, and networks."""

from __future__ import annotations

from typing import Any

from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.remote.json_lines import Address
from codra_dsl.runtime.remote.links import Link, SocketLink
from codra_dsl.runtime.remote.server import Server
from codra_dsl.runtime.remote.zenoh_link import ZenohLink
from codra_dsl.runtime.remote.zenoh_server import ZenohServer
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress


def connect(address: Address | NetworkAddress, token: str | None = None) -> Link:
    """Return a link to the manager at an address.

    Args:
        address: the path of a Unix socket, a port of 127.0.0.1, or an address of a network.
        token: the token of a manager at a port; by default it is read from the manager's token file.

    Raises:
        ConnectionError: if no manager can be reached there.
        MissingZenohError: if the address is one of a network, and Zenoh is not installed.
    """
    return ZenohLink(address) if isinstance(address, NetworkAddress) else SocketLink(address, token)


def serve(codra: ContextManager[Any, Any], address: Address | NetworkAddress = 0) -> Server | ZenohServer:
    """Let other programs use a context manager; the result is open until it is closed.

    Args:
        codra: the context manager.
        address: the path of a Unix socket, a port of 127.0.0.1 (0 for a free one), or an address of a network.

    Raises:
        OSError: if the address is taken or cannot be used, or if other machines could connect without TLS and users.
        MissingZenohError: if the address is one of a network, and Zenoh is not installed.
    """
    return ZenohServer(codra, address) if isinstance(address, NetworkAddress) else Server(codra, address)
