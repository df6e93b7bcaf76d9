"""The address of a context manager on the command line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from codra_dsl.runtime.remote.json_lines import Address

_PORT = re.compile(r"[0-9]{1,5}")


def address_of(text: str) -> Address:
    """Return the address that a text states: a port, or the path of a Unix socket."""
    return int(text) if _PORT.fullmatch(text) else Path(text)
