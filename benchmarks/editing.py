"""The row about editing: from a keystroke in a spec of 2,000 lines to its findings in the editor.

A language server runs in a process of its own and gets changes of one line; the pause in which it waits for more
keystrokes is left out. The first peer is `codra lint` of the same file, a new process without a cache. The second peer
is stricter: a full lint of the same text within a process that has imported everything.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from forests import flat_specs, write
from processes import Cost, in_turns, run
from rows import Row

from codra_dsl.compiler import lint_paths

RUNS = 15
VARIABLES = 252
"""The number of variables of a spec with 2,024 lines."""

_ANGLE = re.compile(r"angle > 0\.[0-9]+ rad")
_SERVER = """
from codra_dsl.tooling.language_server import methods, server
server.DEBOUNCE_S = 0.0
methods.serve()
"""


def rows(scratch: Path) -> Iterator[Row]:
    """Yield the rows, measured in a scratch folder."""
    ((file, text),) = flat_specs(VARIABLES, 1).items()
    write({file: text}, scratch)
    editor = _Editor(scratch / file, text)
    try:
        command = (sys.executable, "-m", "codra_dsl", "lint", file, "--no-cache")
        edited, process, in_process = in_turns(
            RUNS, editor.edit, lambda: run(command, scratch), lambda: _lint(scratch / file)
        )
    finally:
        editor.stop()
    yield Row(name="edit_feedback", ours=edited.wall_s, peer=process.wall_s, target=0.5)
    yield Row(name="edit_feedback_in_process", ours=edited.wall_s, peer=in_process.wall_s, target=1.5)


def _lint(path: Path) -> Cost:
    start_s = time.perf_counter()
    lint_paths([path], path.parent)
    return Cost(wall_s=time.perf_counter() - start_s, cpu_s=0.0, peak_bytes=0)


class _Editor:
    """A client of a language server that has one document open."""

    def __init__(self, path: Path, text: str) -> None:
        command = (sys.executable, "-c", _SERVER)
        self._process = subprocess.Popen(command, cwd=path.parent, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._uri, self._version = path.as_uri(), 1
        match = _ANGLE.search(text)
        assert match is not None
        line = text.count("\n", 0, match.start())
        column = match.start() - text.rindex("\n", 0, match.start()) - 1
        digit = column + len("angle > 0.")
        self._range = {"start": {"line": line, "character": digit}, "end": {"line": line, "character": digit + 1}}
        self._send(
            {"id": 1, "method": "initialize", "params": {"capabilities": {}, "processId": None, "rootUri": None}}
        )
        document = {"uri": self._uri, "languageId": "yaml", "version": 1, "text": text}
        self._send({"method": "textDocument/didOpen", "params": {"textDocument": document}})
        self._wait_for_findings()

    def edit(self) -> Cost:
        """Change one digit and wait for the findings about the new text."""
        self._version += 1
        change = {"range": self._range, "text": str(self._version % 9 + 1)}
        document = {"uri": self._uri, "version": self._version}
        start_s = time.perf_counter()
        self._send(
            {"method": "textDocument/didChange", "params": {"textDocument": document, "contentChanges": [change]}}
        )
        self._wait_for_findings()
        return Cost(wall_s=time.perf_counter() - start_s, cpu_s=0.0, peak_bytes=0)

    def stop(self) -> None:
        """End the server."""
        self._process.kill()
        self._process.communicate()

    def _send(self, message: dict[str, Any]) -> None:
        data = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self._process.stdin is not None
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(data), data))
        self._process.stdin.flush()

    def _wait_for_findings(self) -> None:
        """Read messages until the findings about the newest version arrive."""
        stream = self._process.stdout
        assert stream is not None
        while True:
            length = 0
            while (header := stream.readline()) not in (b"\r\n", b""):
                if header.lower().startswith(b"content-length:"):
                    length = int(header.split(b":")[1])
            if not length:
                raise RuntimeError("the language server has ended")
            message = json.loads(stream.read(length))
            if message.get("params", {}).get("version") == self._version:
                return
