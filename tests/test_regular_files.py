"""Reading regular files: nothing else is opened, and no more bytes are read than allowed."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from codra_dsl.regular_files import (
    OutsideError,
    TooLargeError,
    UnsuitableFileError,
    leads_into,
    read_beginning,
    read_regular_file,
    replace_file,
)


def test_a_file_of_the_maximum_size_is_read_and_a_larger_one_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")

    assert read_regular_file(tmp_path / "file", 3) == b"abc"
    with pytest.raises(TooLargeError) as raised:
        read_regular_file(tmp_path / "file", 2)
    assert raised.value.filename == str(tmp_path / "file")


def test_of_a_larger_file_the_beginning_can_be_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")

    assert [read_beginning(tmp_path / "file", count) for count in (0, 2, 4)] == [b"", b"ab", b"abc"]


def test_a_file_that_has_more_bytes_than_its_size_states_is_refused() -> None:
    assert Path("/proc/self/status").stat().st_size == 0

    with pytest.raises(TooLargeError):
        read_regular_file("/proc/self/status", 10)


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("/dev/zero", "it is not a regular file"),
        ("folder", "it is a folder"),
        ("pipe", "it is not a regular file"),
        ("circle", "Too many levels of symbolic links"),
        ("a" * 5000, "File name too long"),
        ("nul\0", "the path is not valid"),
        ("\ud800", "the path is not valid"),
        ("missing", "No such file or directory"),
    ],
)
def test_whatever_cannot_be_read_is_an_error_that_names_the_file(
    tmp_path: Path, path: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    os.mkfifo("pipe")
    Path("circle").symlink_to("circle")

    with pytest.raises(OSError) as raised:  # noqa: PT011 - the reason is compared
        read_regular_file(path, 10)

    assert (raised.value.strerror, raised.value.filename) == (reason, path)


def test_a_device_is_not_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    """To open a watchdog starts it."""
    monkeypatch.setattr(os, "open", None)

    with pytest.raises(UnsuitableFileError):
        read_regular_file("/dev/null", 10)


def test_a_link_is_followed_only_within_the_folder(tmp_path: Path) -> None:
    project = tmp_path / "project"
    (project / "specs").mkdir(parents=True)
    (project / "real").write_text("inside")
    (tmp_path / "secret").write_text("outside")
    (project / "specs/inward").symlink_to("../real")
    (project / "specs/outward").symlink_to("../../secret")
    (tmp_path / "entrance").symlink_to("project")

    assert read_regular_file(tmp_path / "entrance/specs/inward", 10, within=project) == b"inside"
    with pytest.raises(OutsideError):
        read_regular_file(project / "specs/outward", 10, within=tmp_path / "entrance")
    assert not leads_into(project / "specs/outward", project)


def test_a_new_file_has_the_permissions_of_every_new_file_of_the_process(tmp_path: Path) -> None:
    (tmp_path / "usual").touch()

    replace_file(tmp_path / "file", b"new")

    assert (tmp_path / "file").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_replaced_file_keeps_its_permissions_and_nothing_else_is_left(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    (tmp_path / "file").chmod(0o640)

    replace_file(tmp_path / "file", b"new")

    assert (tmp_path / "file").read_bytes() == b"new"
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o640
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


@pytest.mark.parametrize("name", ["folder", "missing/file"])
def test_a_file_that_cannot_be_replaced_is_an_error_that_names_it_and_leaves_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()

    with pytest.raises(OSError) as raised:  # noqa: PT011 - the file name is compared
        replace_file(tmp_path / name, b"new")

    assert (raised.value.filename, raised.value.filename2) == (str(tmp_path / name), None)
    assert list(tmp_path.iterdir()) == [tmp_path / "folder"]
