"""Revisions that were made to stop codra: each is read with limits, or refused in one line."""

from __future__ import annotations

import hashlib
import os
import resource
import subprocess
import zlib
from pathlib import Path, PurePosixPath

import pytest

from codra_dsl.tooling import revisions
from codra_dsl.tooling.revisions import Repository, RevisionError
from tests.campaigns.hostile.git_objects import REF_DELTA, Objects, pack_record

FILE, FOLDER = b"100644", b"40000"
DOOR = b"codra: 1\nname: door\ninclude: [parts.txt]\n"


@pytest.fixture
def top(tmp_path: Path) -> Path:
    subprocess.run(["git", "init", "--quiet", tmp_path / "top"], check=True)
    return tmp_path / "top"


def store(top: Path, kind: bytes, data: bytes) -> bytes:
    """Write an object of git, even one that git would refuse to write; return its name."""
    full = kind + b" %d\0" % len(data) + data
    name = hashlib.sha1(full, usedforsecurity=False).hexdigest()
    file = top / ".git/objects" / name[:2] / name[2:]
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(zlib.compress(full, 1))
    return bytes.fromhex(name)


def tree(top: Path, *entries: tuple[bytes, bytes, bytes]) -> bytes:
    return store(top, b"tree", b"".join(mode + b" " + name + b"\0" + value for mode, name, value in entries))


def commit(top: Path, root: bytes) -> str:
    who = b"me <me@example.org> 0 +0000"
    return store(
        top, b"commit", b"tree %s\nauthor %s\ncommitter %s\n\nhostile\n" % (root.hex().encode(), who, who)
    ).hex()


def bomb(top: Path, leaf: bytes) -> str:
    """Ten folders, each of which has the next one under 20 names: 20 ** 10 paths."""
    for _ in range(10):
        leaf = tree(top, *((FOLDER, b"%02d" % number, leaf) for number in range(20)))
    return commit(top, leaf)


def extract(top: Path, commit_name: str, target: Path) -> list[str]:
    target.mkdir()
    Repository(top).extract(commit_name, PurePosixPath(), target)
    return sorted(path.relative_to(target).as_posix() for path in target.rglob("*") if path.is_file())


@pytest.mark.parametrize("name", [b"note", b"door.yaml", None], ids=["other files", "specs", "empty folders"])
def test_a_few_objects_that_describe_too_many_paths_are_refused(
    top: Path, tmp_path: Path, name: bytes | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(revisions, "MAX_ENTRIES", 50_000)
    entries = [] if name is None else [(FILE, name, store(top, b"blob", DOOR))]

    with pytest.raises(RevisionError, match=r"too many files|too much YAML"):
        extract(top, bomb(top, tree(top, *entries)), tmp_path / "target")


def test_a_long_list_of_names_is_refused_by_its_bytes(
    top: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(revisions, "MAX_LISTED_BYTES", 1_000_000)
    blob = store(top, b"blob", DOOR)
    names = [b"%04d" % number + b"a" * 1000 for number in range(2000)]

    with pytest.raises(RevisionError, match="too long paths"):
        extract(top, commit(top, tree(top, *((FILE, name, blob) for name in names))), tmp_path / "target")


def test_a_name_without_an_end_is_refused(top: Path, tmp_path: Path) -> None:
    root = tree(top, (FILE, b"a" * 1_000_000, store(top, b"blob", DOOR)))

    with pytest.raises(RevisionError, match="too long paths"):
        extract(top, commit(top, root), tmp_path / "target")


@pytest.mark.parametrize(
    ("folders", "name", "reason"),
    [
        ([], b"a" * 300 + b".yaml", "File name too long"),
        ([b"d" * 250] * 20, b"a.yaml", "File name too long"),
        ([b"d"] * 3000, b"a.yaml", "in more than 100 folders|nested too deeply"),
        ([b"d"] * 101, b"a.yaml", "in more than 100 folders"),
    ],
    ids=["name", "path", "depth 3000", "depth 101"],
)
def test_a_path_that_the_system_cannot_have_is_refused_in_one_line(
    top: Path, tmp_path: Path, folders: list[bytes], name: bytes, reason: str
) -> None:
    root = tree(top, (FILE, name, store(top, b"blob", DOOR)))
    for folder in folders:
        root = tree(top, (FOLDER, folder, root))

    with pytest.raises(RevisionError, match=reason) as raised:
        extract(top, commit(top, root), tmp_path / "target")
    assert len(str(raised.value)) < 400
    assert "\n" not in str(raised.value)


def test_a_few_objects_that_describe_thousands_of_equal_specs_are_refused(top: Path, tmp_path: Path) -> None:
    folder = tree(top, (FILE, b"door.yaml", store(top, b"blob", DOOR)))
    for _ in range(3):
        folder = tree(top, *((FOLDER, b"f%d" % number, folder) for number in range(10)))
    assert len(extract(top, commit(top, folder), tmp_path / "target")) == 1000

    more = tree(top, (FOLDER, b"more", folder), (FILE, b"one.yaml", store(top, b"blob", DOOR)))
    with pytest.raises(RevisionError, match="too much YAML"):
        extract(top, commit(top, more), tmp_path / "another target")


def test_a_file_and_a_folder_of_one_name_are_refused(top: Path, tmp_path: Path) -> None:
    blob = store(top, b"blob", DOOR)
    inner = tree(top, (FILE, b"b.yaml", blob))

    with pytest.raises(RevisionError, match=r"cannot be read: (Not a directory|File exists|Is a directory)"):
        extract(top, commit(top, tree(top, (FILE, b"a.yaml", blob), (FOLDER, b"a.yaml", inner))), tmp_path / "target")


def test_specs_parts_and_settings_are_extracted_and_nothing_else(top: Path, tmp_path: Path) -> None:
    blob, note = store(top, b"blob", DOOR), store(top, b"blob", b"[tool.codra]\n")
    specs = tree(top, (FILE, b"door.yaml", blob), (FILE, b"note.md", note), (FILE, b"parts.txt", note))
    project = tree(top, (FILE, b"pyproject.toml", note), (FOLDER, b"specs", specs))
    root = commit(
        top, tree(top, (FILE, b"other.yaml", blob), (FOLDER, b"robot", project), (FOLDER, b"robots", project))
    )
    target = tmp_path / "target"
    target.mkdir()

    Repository(top).extract(root, PurePosixPath("robot/specs"), target)

    files = sorted(os.fspath(path.relative_to(target)) for path in target.rglob("*") if path.is_file())
    assert files == ["robot/pyproject.toml", "robot/specs/door.yaml", "robot/specs/parts.txt"]
    assert extract(top, root, tmp_path / "everything")[:2] == ["other.yaml", "robot/pyproject.toml"]


def test_too_many_words_of_including_files_are_refused(
    top: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(revisions, "_MAX_WORDS", 1000)
    words = b" ".join(b"w%d" % number for number in range(2000))

    with pytest.raises(RevisionError, match="too much YAML"):
        extract(top, commit(top, tree(top, (FILE, b"a.yaml", store(top, b"blob", DOOR + words)))), tmp_path / "target")


def test_an_object_that_is_described_by_itself_takes_little_memory(top: Path, tmp_path: Path) -> None:
    """Two deltas in a pack, each the base of the other: git would unpack them until memory ends."""
    objects = Objects()
    spec, other = objects.blob(DOOR), objects.blob(b"other")
    revision = objects.commit(objects.tree([(FILE, b"door.yaml", spec)])).hex()
    del objects.contents[spec], objects.contents[other]
    delta = b"\x05\x05\x90\x05"
    circle = [(spec, pack_record(REF_DELTA, delta, base=other)), (other, pack_record(REF_DELTA, delta, base=spec))]
    for file, data in objects.pack_files(circle).items():
        (top / ".git" / file).write_bytes(data)
    earlier_peak_kb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    soft_limit, hard_limit = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (3 << 30, hard_limit))  # so that a failure of this test is bounded
    try:
        with pytest.raises(RevisionError, match="some files of the revision are missing here"):
            extract(top, revision, tmp_path / "target")
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft_limit, hard_limit))

    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss <= max(earlier_peak_kb, 400_000)


def test_only_some_of_very_many_branches_are_suggestions(top: Path) -> None:
    name = commit(top, tree(top))
    lines = [f"{name} refs/heads/feature_{number:06d}\n" for number in range(10_000)]
    lines.append(f"{name} refs/heads/zebra\n")
    (top / ".git/packed-refs").write_text("# pack-refs with: peeled fully-peeled sorted\n" + "".join(lines))

    with pytest.raises(RevisionError, match="did you mean 'feature_000012'"):
        Repository(top).commit("feature_00012")
    with pytest.raises(RevisionError, match="name a file, a folder, a branch"):
        Repository(top).commit("zebrra")
