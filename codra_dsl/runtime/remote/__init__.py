"""The context manager's interface as versioned messages of plain data, for a main execution in another process."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.runtime.remote.client import RemoteContext
from codra_dsl.runtime.remote.endpoints import serve
from codra_dsl.runtime.remote.protocol import VERSION, LeaseError, MessageError, NotPermittedError, TokenError
from codra_dsl.runtime.remote.server import Server
from codra_dsl.runtime.remote.session import Send, Session, open_session
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress

SCHEMA_FILE = Path(__file__).with_name("messages.schema.json")
"""The JSON Schema of all messages."""

INCLUDE_FOLDER = Path(__file__).with_name("include")
"""The folder with `codra.hpp`, the client for programs in C++."""

__all__ = [
    "INCLUDE_FOLDER",
    "SCHEMA_FILE",
    "VERSION",
    "LeaseError",
    "MessageError",
    "NetworkAddress",
    "NotPermittedError",
    "RemoteContext",
    "Send",
    "Server",
    "Session",
    "TokenError",
    "open_session",
    "serve",
]
