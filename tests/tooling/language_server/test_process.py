"""The process of the language server: how it begins and ends, and what it does with clients that behave badly."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from lsprotocol import types
from pygls.lsp.client import BaseLanguageClient
from pygls.uris import from_fs_path

from tests.tooling.language_server.buffers import Buffer
from tests.tooling.language_server.editor import Editor

SPEC = """\
codra: 1
name: door
context:
  door_open: {label: "🤖 öffnet", type: bool, source: main_executon}
skills:
  open_door: {preview: [door_open]}
"""


@pytest.fixture
def uri(tmp_path: Path) -> str:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "door.yaml").write_text(SPEC, "utf-8")
    return str(from_fs_path(str(tmp_path / "door.yaml")))


@pytest.fixture
def editor() -> Iterator[Editor]:
    """An editor with a server of its own."""
    editor = Editor()
    yield editor
    if editor.process.returncode is None:
        editor.process.kill()
        editor.wait_for_end()


def finding(editor: Editor, uri: str) -> types.Diagnostic:
    (diagnostic,) = editor.published[uri].diagnostics
    return diagnostic


def test_positions_are_in_the_encoding_that_the_client_prefers(editor: Editor, uri: str) -> None:
    """The mistake is after a robot, which is four units of UTF-8 and two of UTF-16."""
    editor.start(encodings=[types.PositionEncodingKind.Utf8, types.PositionEncodingKind.Utf16])
    editor.open(uri, SPEC)

    place = finding(editor, uri).range
    assert editor.capabilities.position_encoding == types.PositionEncodingKind.Utf8
    assert (place.start.character, place.end.character) == (57, 70)
    assert editor.stop() == 0


def test_a_server_ends_with_an_error_if_its_client_goes_without_shutting_it_down(editor: Editor, uri: str) -> None:
    editor.start()
    editor.open(uri, SPEC)
    editor.client.exit(None)

    assert editor.wait_for_end() == 1
    assert "Traceback" not in editor.errors


def test_a_server_ends_if_its_client_is_killed(editor: Editor, uri: str) -> None:
    editor.start()
    editor.open(uri, SPEC)
    assert editor.process.stdin is not None
    editor.process.stdin.close()

    assert editor.wait_for_end() == 1
    assert "Traceback" not in editor.errors


def test_a_client_that_answers_nothing_sends_nonsense_and_cancels_requests_is_served_all_the_same(uri: str) -> None:
    client = BaseLanguageClient("silent", "1")
    client.feature(types.CLIENT_REGISTER_CAPABILITY)(_never_answer)
    editor = Editor(client=client)
    editor.start()
    assert editor.process.stdin is not None

    for body in (b"{", b"[]", b'{"jsonrpc": "2.0"}', b'{"jsonrpc": "2.0", "method": "textDocument/didOpen"}'):
        editor.process.stdin.write(b"Content-Length: %d\r\n\r\n%b" % (len(body), body))
    editor.open(uri, SPEC)
    params = types.HoverParams(types.TextDocumentIdentifier(uri), Buffer(SPEC).place_of("door_|open:").start)
    send = partial(client.protocol.send_request, types.TEXT_DOCUMENT_HOVER, params)
    hovers = [send(msg_id=str(number)) for number in range(20)]
    for number in range(21):
        client.cancel_request(types.CancelParams(str(number)))

    assert editor.wait(client.text_document_hover_async(params)) is not None
    assert [hover.done() for hover in hovers] == [True] * 20
    assert finding(editor, uri).code == "CDR3103"
    assert editor.stop() == 0


async def _never_answer(_: object) -> None:
    await asyncio.Event().wait()
