"""Sessions of an editor with the server: `sessions/*.txt` have what a person does, and the complete answers.

Renew the answers with `pytest tests/tooling/language_server --renew-cases`, and read the diff.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.tooling.language_server.editor import SERVER_WITHOUT_PAUSE, Editor
from tests.tooling.language_server.session import Script, Session

SESSIONS = sorted(Path(__file__).with_name("sessions").glob("*.txt"))
assert SESSIONS


@pytest.fixture(scope="module")
def editor() -> Iterator[Editor]:
    """An editor whose server serves all sessions."""
    editor = Editor(SERVER_WITHOUT_PAUSE)
    editor.start()
    yield editor
    assert editor.stop() == 0
    assert "Traceback" not in editor.errors


@pytest.mark.parametrize("path", SESSIONS, ids=lambda path: path.stem)
def test_a_session_has_exactly_the_expected_answers(
    path: Path, editor: Editor, tmp_path: Path, renew_cases: bool
) -> None:
    played = Session(editor, tmp_path / "workspace").play(Script.read(path.read_text("utf-8")))
    if renew_cases:
        path.write_text(played, "utf-8")

    assert played == path.read_text("utf-8")
