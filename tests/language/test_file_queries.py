"""Queries about files: all are recorded, and a recorded query has another answer exactly if the files have changed."""

from __future__ import annotations

import os
import shutil
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import pytest

from codra_dsl.compiler import lint_paths
from codra_dsl.language.file_queries import (
    PresentAnswers,
    file_size,
    folder_names,
    is_file,
    is_folder,
    is_query,
    merged_answers,
    read_file,
    real_path,
    recorded_queries,
)
from tests.campaigns.edits.project import large_project

_opened_paths: list[str] = []
_recording_thread: list[int] = []


def _audit(event: str, arguments: tuple[object, ...]) -> None:
    if event in ("open", "os.scandir", "os.listdir") and _recording_thread == [threading.get_ident()]:
        _opened_paths.append(os.fsdecode(arguments[0]) if isinstance(arguments[0], str | bytes | os.PathLike) else "")


def test_all_files_that_a_result_depends_on_are_in_its_queries(tmp_path: Path) -> None:
    """Python itself reports which files and folders were opened; the files of codra and of Python do not count."""
    for path, text in large_project().items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    specs = [tmp_path / "specs/gate.yaml", tmp_path / "specs/loops-everything/spec.yaml"]
    sys.addaudithook(_audit)
    _recording_thread.append(threading.get_ident())
    try:
        linted = lint_paths(specs, tmp_path)
    finally:
        _recording_thread.clear()

    opened = {path for path in _opened_paths if path.startswith(str(tmp_path))} - {str(tmp_path / "pyproject.toml")}
    assert {str(tmp_path / "robot/gates.py"), str(tmp_path / "specs/parts/light.yaml")} <= opened
    assert opened <= {query[1] for query in linted.answers if query[0] in ("read_file", "folder_names")}


def _ask_all(folder: Path) -> None:
    for name in ("file", "folder", "link", "missing"):
        real_path(folder / name)
        is_file(folder / name)
        is_folder(folder / name)
        file_size(folder / name, "", {})
        for ask in (lambda path: read_file(path, 5, folder), lambda path: folder_names(path, 5, r"\w+")):
            with suppress(OSError):
                ask(folder / name)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "file").write_text("12345")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("file")
    return tmp_path


CHANGES: Mapping[str, Callable[[Path], object]] = {
    "another byte": lambda folder: (folder / "file").write_text("12346"),
    "too many bytes": lambda folder: (folder / "file").write_text("123456"),
    "no file": lambda folder: (folder / "file").unlink(),
    "a new name": lambda folder: (folder / "folder/new").touch(),
    "too many names": lambda folder: [(folder / f"folder/.{number}").touch() for number in range(5)],
    "no folder": lambda folder: shutil.rmtree(folder / "folder"),
    "another link": lambda folder: (folder / "link").replace(folder / "file"),
    "a file at last": lambda folder: (folder / "missing").touch(),
    "a folder at last": lambda folder: (folder / "missing").mkdir(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_of_a_queried_file_changes_an_answer(folder: Path, change: str) -> None:
    with recorded_queries() as answers:
        _ask_all(folder)
    assert PresentAnswers().agree_with(answers)
    os.utime(folder / "file", ns=(0, 0))
    (folder / "other").touch()
    (folder / "folder/.hidden").touch()
    assert PresentAnswers().agree_with(answers)

    CHANGES[change](folder)

    assert not PresentAnswers().agree_with(answers)


def test_answers_that_contradict_each_other_are_never_present(folder: Path) -> None:
    """A file changes between two queries: neither its old nor its new content belongs to the complete result."""
    texts, file = ("12345", "54321"), folder / "file"
    with recorded_queries() as both:
        for text in texts:
            file.write_text(text)
            read_file(file, 5, folder)
    with recorded_queries() as after:
        read_file(file, 5, folder)
    file.write_text(texts[0])
    with recorded_queries() as before:
        read_file(file, 5, folder)

    for text in texts:
        file.write_text(text)
        assert not PresentAnswers().agree_with(both)
        assert not PresentAnswers().agree_with(merged_answers([before, after]))
        assert not PresentAnswers().agree_with(merged_answers([before, after, before]))
        assert PresentAnswers().agree_with(merged_answers([before] * 2 if text == texts[0] else [after] * 2))


def test_a_text_in_memory_replaces_only_files_that_were_read_under_its_name(folder: Path) -> None:
    with recorded_queries() as named:
        assert read_file(folder / "file", 5, folder, "file", {}) == b"12345"
    with recorded_queries() as unnamed:
        read_file(folder / "file", 5, folder)

    assert PresentAnswers({"file": b"12345"}).agree_with(named)
    assert not PresentAnswers({"file": b"1"}).agree_with(named)
    assert PresentAnswers({"file": b"1"}).agree_with(unnamed)


def test_a_size_is_that_of_the_text_in_memory(folder: Path) -> None:
    with recorded_queries() as answers:
        assert file_size(folder / "file", "file", {}) == 5
        assert file_size(folder / "folder", "folder", {}) == 0

    assert PresentAnswers({"file": b"54321"}).agree_with(answers)
    assert not PresentAnswers({"file": b"1"}).agree_with(answers)
    (folder / "file").write_text("123456")
    assert not PresentAnswers().agree_with(answers)


def test_an_enclosing_recording_goes_on_after_an_inner_one(folder: Path) -> None:
    with recorded_queries() as outer:
        is_file(folder / "file")
        with recorded_queries() as inner:
            is_file(folder / "folder")
        is_file(folder / "link")

    assert [Path(str(query[1])).name for query in outer] == ["file", "link"]
    assert [Path(str(query[1])).name for query in inner] == ["folder"]


def test_only_names_of_functions_with_fitting_arguments_are_queries() -> None:
    assert is_query(("is_file", "a"))
    assert is_query(("read_file", "a", 1, "b", ""))
    assert not any(map(is_query, [("is_file",), ("is_file", 1), ("system", "a"), ("folder_names", "a", True, "")]))
