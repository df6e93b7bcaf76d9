"""The manager's interface as messages: plain data with a version, for a main execution in another process."""

from __future__ import annotations

from codra_dsl.runtime.messages.client import RemoteContext
from codra_dsl.runtime.messages.protocol import VERSION, LeaseError, MessageError
from codra_dsl.runtime.messages.server import Server
from codra_dsl.runtime.messages.session import Send, Session

__all__ = ["VERSION", "LeaseError", "MessageError", "RemoteContext", "Send", "Server", "Session"]
