"""The token of a manager that listens at a port: a file that only the user of the manager can read.

Every user of a machine can connect to its ports, so a program proves with this token that it belongs to the user.
"""

from __future__ import annotations

import hmac
import os
import secrets
from collections.abc import Mapping
from pathlib import Path

from codra_dsl.runtime.remote.json_lines import OWNER_ONLY
from codra_dsl.runtime.remote.protocol import TokenError


def token_file(port: int) -> Path:
    """Return the file with the token of the manager at a port: `$XDG_STATE_HOME/codra/PORT.token`.

    If the environment does not set `XDG_STATE_HOME`, the folder is `~/.local/state/codra`.
    """
    state_folder = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(state_folder) / "codra" / f"{port}.token"


def create_token(path: Path) -> str:
    """Write a new token to a file that only its owner can read and write, and return the token.

    Raises:
        OSError: if the file cannot be written.
    """
    token = secrets.token_urlsafe(32)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.unlink(missing_ok=True)  # of a manager that was killed
        path.touch(OWNER_ONLY, exist_ok=False)
        path.write_text(f"{token}\n", encoding="ascii")
    except OSError as error:
        raise OSError(error.errno, f"cannot write the token of the manager to {path}: {error.strerror}") from None
    return token


def read_token(port: int) -> str:
    """Return the token of the manager at a port.

    Raises:
        ConnectionError: if the token cannot be read.
    """
    path = token_file(port)
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConnectionError(f"cannot read the token of the manager at {port} from {path}: {reason}") from None


def check_token(message: object, token: str, path: Path) -> None:
    """Check that the first message of a connection is `hello` with a token.

    Raises:
        TokenError: if it is not.
    """
    is_hello = isinstance(message, Mapping) and message.get("ask") == "hello"
    received_token = message.get("token") if is_hello else None  # type: ignore[attr-defined]
    received_bytes = received_token.encode("utf-8", "replace") if isinstance(received_token, str) else b""
    if not hmac.compare_digest(received_bytes, token.encode()):
        raise TokenError(f"the first request at a port must be `hello` with the `token` in {path}")
