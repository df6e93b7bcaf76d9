"""`python benchmarks/editor_memory.py [EDITS]`: memory of the language server over 10,000 edits of 2,000 lines.

Each edit changes a digit of one angle, as a keystroke does. After ten edits the findings are awaited, and a hover, a
completion and a search for references are requested. Every hundredth edit breaks the file, and the next one mends it.
After each tenth of the edits, the memory of the server's process is printed.
"""

from __future__ import annotations

import asyncio
import re
import sys
import tempfile
from functools import partial
from itertools import count
from pathlib import Path
from random import Random

from forests import flat_specs, write
from lsprotocol import types
from pygls.lsp.client import BaseLanguageClient

VARIABLES = 252
"""The number of variables of a spec with 2,024 lines."""

BROKEN_EVERY, AWAITED_EVERY = 100, 10
SAMPLES = 10

_ANGLE = re.compile(r"^(.*angle > 0\.)[0-9]", re.MULTILINE)
_SERVER = "from codra_dsl.tooling.language_server import methods, server; server.DEBOUNCE_S = 0.0; methods.serve()"


class Client(BaseLanguageClient):
    """A client that has one document open, and waits for the findings about each of its versions."""

    def __init__(self, uri: str) -> None:
        super().__init__("editor_memory", "1")
        self.document = types.TextDocumentIdentifier(uri)
        self._versions = count(1)
        self._found = asyncio.Event()
        self._version = 0
        self.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(partial(Client._on_findings, self))

    async def open(self, text: str) -> None:
        """Start a server, open the document, and wait for the findings about it."""
        await self.start_io(sys.executable, "-c", _SERVER)
        await self.initialize_async(types.InitializeParams(types.ClientCapabilities()))
        self.initialized(types.InitializedParams())
        self._expect_next_version()
        item = types.TextDocumentItem(self.document.uri, "yaml", self._version, text)
        self.text_document_did_open(types.DidOpenTextDocumentParams(item))
        await self.wait_for_findings()

    def edit(self, line: int, first: int, last: int, text: str) -> None:
        """Replace a range of a line."""
        self._expect_next_version()
        place = types.Range(types.Position(line, first), types.Position(line, last))
        document = types.VersionedTextDocumentIdentifier(version=self._version, uri=self.document.uri)
        change = types.TextDocumentContentChangePartial(place, text)
        self.text_document_did_change(types.DidChangeTextDocumentParams(document, [change]))

    async def wait_for_findings(self) -> None:
        """Wait for the findings about the newest text."""
        await self._found.wait()

    async def ask(self, line: int, character: int) -> None:
        """Send requests about a position."""
        where = self.document, types.Position(line, character)
        await self.text_document_hover_async(types.HoverParams(*where))
        await self.text_document_completion_async(types.CompletionParams(*where))
        await self.text_document_references_async(types.ReferenceParams(types.ReferenceContext(True), *where))

    def memory_bytes(self) -> int:
        """Return the memory of the server's process that is not swapped out."""
        assert self._server is not None
        (size,) = re.findall(r"^VmRSS:\s+(\d+) kB$", Path(f"/proc/{self._server.pid}/status").read_text(), re.MULTILINE)
        return int(size) * 1024

    def _expect_next_version(self) -> None:
        self._version = next(self._versions)
        self._found.clear()

    def _on_findings(self, params: types.PublishDiagnosticsParams) -> None:
        if params.version == self._version:
            self._found.set()


async def measure(client: Client, text: str, edit_count: int) -> None:
    """Edit a document, and print the memory of the server."""
    chance = Random(1)
    places = [(text.count("\n", 0, match.start()), len(match[1])) for match in _ANGLE.finditer(text)]
    await client.open(text)
    print(f"     0 edits: {client.memory_bytes() / 1e6:6.1f} MB")
    for number in range(1, edit_count + 1):
        line, character = chance.choice(places)
        if number % BROKEN_EVERY == 0:
            client.edit(line, 0, 0, "[")
            await client.wait_for_findings()
            client.edit(line, 0, 1, "")
        client.edit(line, character, character + 1, str(chance.randrange(1, 10)))
        if number % AWAITED_EVERY == 0:
            await client.wait_for_findings()
            await client.ask(line, character - len("angle > 0."))
        if number % (edit_count // SAMPLES) == 0:
            print(f"{number:6} edits: {client.memory_bytes() / 1e6:6.1f} MB", flush=True)
    await client.shutdown_async(None)
    client.exit(None)
    await client.stop()


def main(edit_count: int = 10_000) -> None:
    """Print the table."""
    ((file, text),) = flat_specs(VARIABLES, 1).items()
    with tempfile.TemporaryDirectory(prefix="editor-memory-") as folder:
        write({file: text}, Path(folder))
        asyncio.run(measure(Client((Path(folder) / file).as_uri()), text, edit_count))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
