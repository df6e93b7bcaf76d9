"""The server: when it lints, what it publishes, and how it answers and refuses."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from pygls.exceptions import JsonRpcInvalidParams

from codra_dsl.tooling.language_server import server as server_module
from codra_dsl.tooling.language_server.methods import make_server
from codra_dsl.tooling.language_server.server import CodraServer
from tests.tooling.language_server.workspace import FILES, Workspace


class Client:
    """A client in the same process: it passes messages to a server and keeps the messages of the server."""

    def __init__(self, server: CodraServer, folder: Path) -> None:
        self._server, self._folder = server, folder
        self.received: list[dict[str, Any]] = []
        self._versions: dict[str, int] = {}
        server.protocol.set_writer(self, include_headers=False)

    def write(self, data: bytes) -> None:
        self.received.append(json.loads(data))

    def close(self) -> None:
        pass

    def uri(self, file: str) -> str:
        return (self._folder / file).as_uri()

    def notify(self, method: str, params: Any) -> None:
        message = {"jsonrpc": "2.0", "method": method, "params": params}
        self._server.protocol.handle_message(self._server.protocol.structure_message(message))

    async def request(self, method: str, params: Any) -> dict[str, Any]:
        """Return the response to a request."""
        message = {"jsonrpc": "2.0", "id": method, "method": method, "params": params}
        self._server.protocol.handle_message(self._server.protocol.structure_message(message))
        return await self._wait(lambda received: received.get("id") == method and "method" not in received)

    async def _wait(self, is_wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        while True:
            for index, received in enumerate(self.received):
                if is_wanted(received):
                    return self.received.pop(index)
            await asyncio.sleep(0.002)

    def open(self, file: str, text: str | None = None) -> None:
        self._versions[file] = 1
        text = FILES[file] if text is None else text
        document = {"uri": self.uri(file), "languageId": "yaml", "version": 1, "text": text}
        self.notify("textDocument/didOpen", {"textDocument": document})

    def change(self, file: str, text: str) -> None:
        self._versions[file] += 1
        document = {"uri": self.uri(file), "version": self._versions[file]}
        self.notify("textDocument/didChange", {"textDocument": document, "contentChanges": [{"text": text}]})

    async def findings(self, file: str, version: int | None) -> list[dict[str, Any]]:
        """Wait for the findings about a version of a file."""
        notification = await self._wait(
            lambda received: (
                received.get("method") == "textDocument/publishDiagnostics"
                and (received["params"]["uri"], received["params"].get("version")) == (self.uri(file), version)
            )
        )
        diagnostics: list[dict[str, Any]] = notification["params"]["diagnostics"]
        return diagnostics


def session(folder: Path, play: Callable[[Client], Awaitable[None]], capabilities: Any = None) -> Client:
    """Play a session with a server, about the files of a project in a folder."""
    Workspace(folder)

    async def run() -> Client:
        client = Client(make_server(), folder)
        await client.request("initialize", {"processId": None, "rootUri": None, "capabilities": capabilities or {}})
        client.notify("initialized", {})
        await asyncio.wait_for(play(client), 30)
        return client

    return asyncio.run(run())


@pytest.fixture(autouse=True)
def _short_pause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "DEBOUNCE_S", 0.02)


def test_findings_have_place_code_help_and_related_places(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml", FILES["hall.yaml"].replace("changes: [near]", "changes: [nearr]"))
        (finding,) = await client.findings("hall.yaml", 1)
        assert finding["range"] == {"start": {"line": 40, "character": 14}, "end": {"line": 40, "character": 19}}
        assert (finding["code"], finding["severity"], finding["source"]) == ("CDR3101", 1, "codra")
        assert finding["message"].splitlines()[1] == "did you mean 'near'?"

    session(tmp_path, play)


def test_of_quick_edits_only_the_last_is_published(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml")
        for number in range(20):
            client.change("hall.yaml", f"{FILES['hall.yaml']}# {number}\n")
        await client.findings("hall.yaml", 21)

    client = session(tmp_path, play)
    versions = [received["params"].get("version") for received in client.received if "params" in received]
    assert not [version for version in versions if version is not None and 1 < version < 21]


def test_findings_about_another_file_are_published_and_taken_back(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("parts/lights.yaml", FILES["parts/lights.yaml"].replace("lamp", "sun"))
        assert await client.findings("hall.yaml", None) != []
        client.change("parts/lights.yaml", FILES["parts/lights.yaml"])
        assert await client.findings("hall.yaml", None) == []

    session(tmp_path, play)


def test_a_project_within_another_has_the_findings_about_its_open_documents(tmp_path: Path) -> None:
    inner = "codra: 1\nname: inner\ncontext: {x: {type: bool, source: main_execution, valid_for: 1 s}}\n"
    Workspace(tmp_path / "inner", {"pyproject.toml": "[tool.codra]\n", "inner.yaml": "codra: 1\nname: hall\n"})

    async def play(client: Client) -> None:
        client.open("inner/inner.yaml", f"{inner}skills: {{go: {{preview: [x]}}}}\n")
        assert await client.findings("inner/inner.yaml", 1) == []
        client.open("hall.yaml")
        await client.findings("hall.yaml", 1)

    client = session(tmp_path, play)
    uris = [received["params"].get("uri") for received in client.received if "params" in received]
    assert client.uri("inner/inner.yaml") not in uris


def test_a_closed_document_has_the_findings_of_its_file(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml", "codra: 1\nname: hall\nskills: {go: {preview: [x]}}\n")
        assert len(await client.findings("hall.yaml", 1)) == 1
        client.notify("textDocument/didClose", {"textDocument": {"uri": client.uri("hall.yaml")}})
        assert await client.findings("hall.yaml", None) == []

    session(tmp_path, play)


def test_a_change_on_disk_is_noticed_when_the_client_reports_it(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml")
        assert await client.findings("hall.yaml", 1) == []
        (tmp_path / "parts/lights.yaml").write_text("codra: 1\ncontext: {}\n", "utf-8")
        client.notify("workspace/didChangeWatchedFiles", {"changes": []})
        assert await client.findings("hall.yaml", 1) != []

    session(tmp_path, play)


def test_a_document_belongs_to_a_project_that_is_made_while_the_document_is_open(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        (tmp_path / "pyproject.toml").unlink()
        client.open("parts/lights.yaml")
        assert [finding["code"] for finding in await client.findings("parts/lights.yaml", 1)] == ["CDR0008"]
        (tmp_path / "pyproject.toml").write_text("[tool.codra]\n", "utf-8")
        client.notify("workspace/didChangeWatchedFiles", {"changes": []})
        assert await client.findings("parts/lights.yaml", 1) == []
        document, position = {"uri": client.uri("parts/lights.yaml")}, {"line": 2, "character": 3}
        params = {"textDocument": document, "position": position, "context": {"includeDeclaration": False}}
        assert len((await client.request("textDocument/references", params))["result"]) > 1

    session(tmp_path, play)


def test_the_findings_of_a_project_end_with_the_project(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        (tmp_path / "other.yaml").write_text("codra: 1\nname: other\nskills: {go: {preview: [x]}}\n", "utf-8")
        client.open("hall.yaml")
        assert [finding["code"] for finding in await client.findings("other.yaml", None)] == ["CDR3101"]
        (tmp_path / "pyproject.toml").unlink()
        client.notify("workspace/didChangeWatchedFiles", {"changes": []})
        assert await client.findings("other.yaml", None) == []

    session(tmp_path, play)


def test_a_document_has_symbols_and_tokens_as_soon_as_it_is_open(tmp_path: Path) -> None:
    """Editors ask once, directly after they have opened it."""

    async def play(client: Client) -> None:
        client.open("hall.yaml")
        params = {"textDocument": {"uri": client.uri("hall.yaml")}}
        assert (await client.request("textDocument/documentSymbol", params))["result"]
        assert (await client.request("textDocument/semanticTokens/full", params))["result"]["data"]

    session(tmp_path, play)


def test_clients_ask_for_tokens_again_after_each_result_if_they_can(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml")
        await client.findings("hall.yaml", 1)

    refreshing = {"workspace": {"semanticTokens": {"refreshSupport": True}}}
    requests = [received.get("method") for received in session(tmp_path, play, refreshing).received]
    assert requests.count("workspace/semanticTokens/refresh") == 1
    requests = [received.get("method") for received in session(tmp_path, play).received]
    assert "workspace/semanticTokens/refresh" not in requests


def test_changes_of_a_document_that_is_not_open_are_ignored(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        document = {"uri": client.uri("hall.yaml"), "version": 7}
        change = {"textDocument": document, "contentChanges": [{"text": ""}]}
        client.notify("textDocument/didChange", change)
        client.notify("textDocument/didClose", {"textDocument": document})
        client.open("hall.yaml")
        assert await client.findings("hall.yaml", 1) == []

    assert [received.get("method") for received in session(tmp_path, play).received if "method" in received] == []


def test_files_of_the_project_are_watched_if_the_client_can(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml")
        await client.findings("hall.yaml", 1)

    watching = {"workspace": {"didChangeWatchedFiles": {"dynamicRegistration": True}}}
    requests = [received.get("method") for received in session(tmp_path, play, watching).received]
    assert "client/registerCapability" in requests
    requests = [received.get("method") for received in session(tmp_path, play).received]
    assert "client/registerCapability" not in requests


def test_a_fix_is_offered_for_the_text_in_which_the_finding_was_found(tmp_path: Path) -> None:
    text = FILES["hall.yaml"].replace("changes: [near]", "changes: [nearr]").replace("\n", "\r\n")
    place = {"start": {"line": 40, "character": 15}, "end": {"line": 40, "character": 15}}

    async def play(client: Client) -> None:
        params = {"textDocument": {"uri": client.uri("hall.yaml")}, "range": place, "context": {"diagnostics": []}}
        client.open("hall.yaml", text)
        await client.findings("hall.yaml", 1)
        (action,) = (await client.request("textDocument/codeAction", params))["result"]
        (edit,) = action["edit"]["documentChanges"]
        assert (action["kind"], edit["textDocument"]["version"]) == ("quickfix", 1)
        assert [change["newText"] for change in edit["edits"]] == ["near"]

        client.change("hall.yaml", f"\n{text}")
        assert (await client.request("textDocument/codeAction", params))["result"] == []

    session(tmp_path, play, {"workspace": {"workspaceEdit": {"documentChanges": True}}})


def test_a_rename_waits_for_the_newest_text(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("parts/lights.yaml")
        client.change("parts/lights.yaml", FILES["parts/lights.yaml"].replace("context:", "context:\n"))
        uri, position = client.uri("parts/lights.yaml"), {"line": 3, "character": 3}
        params = {"textDocument": {"uri": uri}, "position": position, "newName": "sun"}
        changes = (await client.request("textDocument/rename", params))["result"]["changes"]
        assert [edit["range"]["start"]["line"] for edit in changes[uri]] == [3]
        assert len(changes[client.uri("hall.yaml")]) == 3

    session(tmp_path, play)


def test_a_rename_reads_files_that_have_changed_on_disk(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml")
        await client.findings("hall.yaml", 1)
        (tmp_path / "parts/lights.yaml").write_text(f"# New.\n{FILES['parts/lights.yaml']}", "utf-8")
        document, position = {"uri": client.uri("hall.yaml")}, {"line": 6, "character": 40}
        params = {"textDocument": document, "position": position, "newName": "sun"}
        changes = (await client.request("textDocument/rename", params))["result"]["changes"]
        assert [edit["range"]["start"]["line"] for edit in changes[client.uri("parts/lights.yaml")]] == [3]

    session(tmp_path, play)


def test_a_refused_rename_states_the_reason(tmp_path: Path) -> None:
    async def play(client: Client) -> None:
        client.open("parts/lights.yaml")
        await client.findings("parts/lights.yaml", 1)
        document = {"uri": client.uri("parts/lights.yaml")}
        params = {"textDocument": document, "position": {"line": 2, "character": 3}, "newName": "near"}
        assert (await client.request("textDocument/rename", params))["error"] == {
            "code": -32803,
            "message": "'near' is taken: see hall.yaml:5",
        }
        params["position"] = {"line": 0, "character": 0}
        error = (await client.request("textDocument/prepareRename", params))["error"]
        assert error["message"] == "there is no name here, or the text around it cannot be read at the moment"

    session(tmp_path, play)


@pytest.mark.parametrize("method", ["hover", "completion", "definition", "documentSymbol", "semanticTokens/full"])
def test_every_request_has_an_answer_on_broken_text_and_in_foreign_files(tmp_path: Path, method: str) -> None:
    async def play(client: Client) -> None:
        client.open("hall.yaml", "codra: 1\nname: [\n\t{\ud800")
        for file in ("hall.yaml", "robot.py", "missing.yaml"):
            params = {"textDocument": {"uri": client.uri(file)}, "position": {"line": 2, "character": 2}}
            assert "error" not in await client.request(f"textDocument/{method}", params)

    session(tmp_path, play)


def test_after_a_request_to_shut_down_nothing_is_linted(tmp_path: Path) -> None:
    server = make_server()

    async def play() -> None:
        client = Client(server, tmp_path)
        await client.request("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        client.open("hall.yaml")
        await client.request("shutdown", None)
        for linter in server._linters.values():
            await linter.settle()
        assert client.received == []

    asyncio.run(play())


@pytest.mark.parametrize("params", [None, {}, [1], {"textDocument": {"uri": "a.yaml"}, "position": {"line": -1}}])
def test_a_request_with_invalid_parameters_is_answered_with_an_error(tmp_path: Path, params: Any) -> None:
    async def play(client: Client) -> None:
        with pytest.raises(JsonRpcInvalidParams):  # pygls reports it in the log of the client
            await client.request("textDocument/hover", params)

    client = session(tmp_path, play)
    (answer,) = [received for received in client.received if received.get("id") == "textDocument/hover"]
    assert answer["error"]["code"] == JsonRpcInvalidParams.CODE


def test_a_bug_is_reported_and_the_next_text_is_linted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def play(client: Client) -> None:
        with monkeypatch.context() as patch:
            patch.setattr("codra_dsl.tooling.language_server.projects.lint_paths", lambda *_, **__: 1 / 0)
            client.open("hall.yaml")
            while not any(received.get("method") == "window/logMessage" for received in client.received):
                await asyncio.sleep(0.002)
        client.change("hall.yaml", FILES["hall.yaml"])
        assert await client.findings("hall.yaml", 2) == []

    session(tmp_path, play)


def test_a_handled_notification_leaves_nothing_behind(tmp_path: Path) -> None:
    server = make_server()

    async def play() -> None:
        client = Client(server, tmp_path)
        await client.request("initialize", {"processId": None, "rootUri": None, "capabilities": {}})
        client.notify("initialized", {})
        client.open("hall.yaml", "")
        for number in range(20):
            client.change("hall.yaml", f"# {number}\n")
        await client.findings("hall.yaml", 21)

    asyncio.run(play())
    assert server.protocol._request_futures == {}
