"""Fixed texts are written to their files completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.workspace.suppression import read_rewritable_files, rewrite, unified_diff


def test_a_file_that_has_changed_since_it_was_read_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_bytes(b"newer")

    finding = rewrite("a.yaml", tmp_path, b"old", b"fixed")

    assert finding is not None
    assert finding.message == "cannot write 'a.yaml': it has changed in the meantime"
    assert (tmp_path / "a.yaml").read_bytes() == b"newer"


def test_a_write_protected_file_is_left_alone_or_keeps_its_mode(tmp_path: Path) -> None:
    """For the superuser no file is write-protected."""
    path = tmp_path / "a.yaml"
    path.write_bytes(b"old")
    path.chmod(0o444)

    finding = rewrite("a.yaml", tmp_path, b"old", b"fixed")

    assert path.read_bytes() == (b"fixed" if finding is None else b"old")
    assert path.stat().st_mode & 0o777 == 0o444
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.yaml"]


def test_fixing_a_file_does_not_change_its_owner(tmp_path: Path) -> None:
    """This matters in a container that runs as the superuser on the files of a user; others cannot give files away."""
    path = tmp_path / "a.yaml"
    path.write_bytes(b"old")
    owner = 65534 if os.geteuid() == 0 else os.geteuid()
    os.chown(path, owner, -1)

    assert rewrite("a.yaml", tmp_path, b"old", b"fixed") is None

    assert (path.read_bytes(), path.stat().st_uid) == (b"fixed", owner)


def test_files_outside_of_the_project_are_neither_read_nor_written(tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    (tmp_path / "outside.yaml").write_bytes(b"old")
    (tmp_path / "project/link.yaml").symlink_to("../outside.yaml")

    for file in ("../outside.yaml", "link.yaml"):
        assert read_rewritable_files([file], tmp_path / "project") == {}
        assert rewrite(file, tmp_path / "project", b"old", b"fixed") is not None
    assert (tmp_path / "outside.yaml").read_bytes() == b"old"


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    assert read_rewritable_files(["a.yaml"], tmp_path) == {}
    assert rewrite("a.yaml", tmp_path, b"", b"fixed") is not None
    assert list(tmp_path.iterdir()) == []


LINES = st.lists(st.sampled_from(["a\n", "b\r\n", "c\rd\n", "\n", "e"]), max_size=6).map("".join)


@given(LINES, LINES)
def test_a_difference_has_every_line_of_both_texts_unchanged(before: str, after: str) -> None:
    diff = unified_diff(before.encode(), after.encode(), "f")

    body = diff.split("\n", 2)[-1]
    removed = [line[1:] for line in body.split("\n") if line.startswith("-")]
    added = [line[1:] for line in body.split("\n") if line.startswith("+")]
    assert (diff == "") == (before == after)
    assert set(removed) <= set(before.split("\n"))
    assert set(added) <= set(after.split("\n"))
