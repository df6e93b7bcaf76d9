"""The process of the language server: how it begins and ends, and what it does with clients that behave badly."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
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
  door_open: {label: "🚪 Tür", type: bool, source: main_execution}
skills:
  open_door: {label: "🤖 öffnet", preview: [door_opn, door_open]}
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


@pytest.mark.parametrize(
    ("encoding", "columns"), [(types.PositionEncodingKind.Utf8, (45, 53)), (types.PositionEncodingKind.Utf32, (41, 49))]
)
def test_positions_are_in_the_encoding_that_the_client_prefers(
    encoding: types.PositionEncodingKind, columns: tuple[int, int], editor: Editor, uri: str
) -> None:
    """The mistake is after a robot, which is four units of UTF-8, two of UTF-16, and one of UTF-32."""
    editor.start(encodings=[encoding, types.PositionEncodingKind.Utf16])
    editor.open(uri, SPEC)

    place = finding(editor, uri).range
    assert editor.capabilities.position_encoding == encoding
    assert (place.start.character, place.end.character) == columns
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


def test_a_client_that_answers_nothing_and_sends_nonsense_is_served_all_the_same(uri: str) -> None:
    client = BaseLanguageClient("silent", "1")
    for method in (types.CLIENT_REGISTER_CAPABILITY, types.WORKSPACE_CONFIGURATION):
        client.feature(method)(_never_answer)
    editor = Editor(client)
    editor.start()
    assert editor.process.stdin is not None

    for body in (
        b"{",
        b"[]",
        b'{"jsonrpc": "2.0"}',
        b'{"jsonrpc": "2.0", "method": "textDocument/hover", "params": 7}',
    ):
        editor.process.stdin.write(b"Content-Length: %d\r\n\r\n%b" % (len(body), body))
    client.cancel_request(types.CancelParams("a request that there is not"))
    editor.open(uri, SPEC)

    assert finding(editor, uri).code == "CDR3101"
    assert editor.stop() == 0


async def _never_answer(_: object) -> None:
    await asyncio.Event().wait()


def test_cancelled_requests_are_answered_and_the_next_one_too(editor: Editor, uri: str) -> None:
    editor.start()
    editor.open(uri, SPEC)
    position = Buffer(SPEC).place_of("door_|open:").start
    params = types.HoverParams(types.TextDocumentIdentifier(uri), position)
    futures = [
        editor.client.protocol.send_request(types.TEXT_DOCUMENT_HOVER, params, msg_id=f"hover {number}")
        for number in range(20)
    ]
    for number in range(20):
        editor.client.cancel_request(types.CancelParams(f"hover {number}"))

    assert editor.wait(editor.client.text_document_hover_async(params)) is not None
    assert [future.done() for future in futures] == [True] * 20
    assert editor.stop() == 0
