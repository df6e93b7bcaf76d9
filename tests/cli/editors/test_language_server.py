"""`codra language-server` as a command."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
WITHOUT_EXTRA = "import sys; sys.modules['lsprotocol'] = None; from codra_dsl.cli import main; main()"


def message(**content: object) -> bytes:
    data = json.dumps({"jsonrpc": "2.0", **content}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(data), data)


def test_without_the_extra_the_command_states_how_to_install_it() -> None:
    command = (sys.executable, "-c", WITHOUT_EXTRA, "language-server")
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)

    assert process.returncode == 1
    assert process.stderr.startswith("codra: 'codra language-server' needs lsprotocol: pip install ")
    assert "[editor]" in process.stderr


def test_a_session_that_is_shut_down_before_it_ends_succeeds() -> None:
    client = {"processId": None, "rootUri": None, "capabilities": {}}
    start = message(id=1, method="initialize", params=client)
    end = message(method="exit")
    command = (sys.executable, "-m", "codra_dsl", "language-server")
    for messages, expected in ((start + message(id=2, method="shutdown") + end, 0), (start + end, 1), (b"", 1)):
        process = subprocess.run(command, cwd=ROOT, input=messages, capture_output=True, check=False, timeout=60)

        assert (process.returncode, process.stderr) == (expected, b"")
