from __future__ import annotations

import json
import resource
import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl import __version__
from codra_dsl.language.expression import is_identifier
from codra_dsl.tooling.installation import papers_origin_text, pip_install, requirement_from_origin
from codra_dsl.tooling.scaffold import (
    ImproperNameError,
    conflicts,
    name_from_folder,
    require_name,
    starter_texts,
    write_new_files,
)

COMMIT = "0123456789abcdef0123456789abcdef01234567"


# Names


@given(st.text(max_size=110))
def test_a_folder_gives_a_valid_name_or_a_help(folder: str) -> None:
    try:
        name = name_from_folder(folder)
    except ImproperNameError as error:
        name = str(error).rpartition(" --name ")[2]

    assert is_identifier(name)


@given(st.text(max_size=110) | st.sampled_from(["if", "true", "min", "x" * 101]))
def test_a_name_is_used_unchanged_or_refused_with_help(name: str) -> None:
    try:
        taken = require_name(name)
    except ImproperNameError as error:
        taken = str(error).split()[-1]
        assert taken != name

    assert is_identifier(taken)


@pytest.mark.parametrize(
    ("folder", "name"), [("my-robot", "my_robot"), ("Arm 2", "Arm_2"), ("arm.", "arm"), ("import", "import_robot")]
)
def test_the_name_of_a_folder_becomes_one_of_a_spec(folder: str, name: str) -> None:
    assert name_from_folder(folder) == name


# The origin of codra


def origin_text(**origin: object) -> str:
    return json.dumps(origin)


@pytest.mark.parametrize(
    ("origin", "requirement"),
    [
        (None, f"codra-dsl=={__version__}"),
        (origin_text(url="file:///home/me/codra", dir_info={"editable": True}), "codra-dsl @ file:///home/me/codra"),
        (origin_text(url="file:///tmp/codra.whl", archive_info={}), "codra-dsl @ file:///tmp/codra.whl"),
        (
            origin_text(url="https://example.org/codra.git", vcs_info={"vcs": "git", "commit_id": COMMIT}),
            f"codra-dsl @ git+https://example.org/codra.git@{COMMIT}",
        ),
        (
            origin_text(
                url="https://example.org/all", subdirectory="dsl", vcs_info={"vcs": "git", "commit_id": COMMIT}
            ),
            f"codra-dsl @ git+https://example.org/all@{COMMIT}#subdirectory=dsl",
        ),
        (
            origin_text(url="https://example.org/codra.whl", archive_info={}),
            "codra-dsl @ https://example.org/codra.whl",
        ),
    ],
)
def test_a_project_requires_codra_from_where_it_is_installed(origin: str | None, requirement: str) -> None:
    assert requirement_from_origin(origin) == requirement
    assert requirement_from_origin(origin, extras="viz") == requirement.replace("codra-dsl", "codra-dsl[viz]", 1)


@pytest.mark.parametrize("distribution", ["codra-dsl", "codra-papers"])
def test_a_hint_names_a_folder_or_an_address_from_which_pip_can_install(distribution: str) -> None:
    _, _, requirement = shlex.split(pip_install(distribution, "viz"))
    name, address = requirement.split(" @ ")

    assert name == f"{distribution}[viz]"
    folder = Path(address.removeprefix("file://"))
    assert f'name = "{distribution}"' in (folder / "pyproject.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("origin", "papers_origin"),
    [
        (None, None),
        (
            {"url": "file:///home/me/codra/", "dir_info": {"editable": True}},
            {"url": "file:///home/me/codra/codra_papers", "dir_info": {"editable": True}},
        ),
        (
            {"url": "https://example.org/codra.git", "vcs_info": {"vcs": "git", "commit_id": COMMIT}},
            {
                "url": "https://example.org/codra.git",
                "vcs_info": {"vcs": "git", "commit_id": COMMIT},
                "subdirectory": "codra_papers",
            },
        ),
        (
            {"url": "file:///codra_dsl/dist/codra_dsl-0.2.0-py3-none-any.whl", "archive_info": {"hash": "sha256=12"}},
            {"url": "file:///codra_dsl/dist/codra_papers-0.2.0-py3-none-any.whl", "archive_info": {}},
        ),
        (
            {"url": "https://example.org/v0.2.0/codra_dsl-0.2.0.tar.gz", "archive_info": {}},
            {"url": "https://example.org/v0.2.0/codra_papers-0.2.0.tar.gz", "archive_info": {}},
        ),
        ({"url": "https://example.org/codra/archive/main.zip", "archive_info": {}}, None),
    ],
)
def test_the_papers_come_from_the_same_clone_repository_or_release(
    origin: dict[str, object] | None, papers_origin: dict[str, object] | None
) -> None:
    text = papers_origin_text(origin and json.dumps(origin))

    assert (text and json.loads(text)) == papers_origin


def test_the_hooks_require_the_same_codra_as_the_requirements() -> None:
    texts = starter_texts("arm", "codra-dsl @ git+https://example.org/codra.git@1")

    assert "\ncodra-dsl @ git+https://example.org/codra.git@1\n" in texts["requirements.txt"]
    assert texts[".pre-commit-config.yaml"].count('["codra-dsl @ git+https://example.org/codra.git@1"]') == 2


# Written files


def test_no_placeholder_of_a_template_is_left() -> None:
    texts = starter_texts("arm", "codra-dsl")

    assert [path for path, text in texts.items() if "@NAME@" in path + text or "@CODRA@" in text] == []
    assert [path for path, text in texts.items() if not text.endswith("\n") or "\r" in text] == []


def test_the_readme_of_a_project_has_at_most_ten_lines() -> None:
    assert starter_texts("arm", "codra-dsl")["README.md"].count("\n") <= 10


def test_if_one_file_cannot_be_written_none_is_left(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    texts = {"a": "", "kept/b": "", "new/deep/c": "", f"new/{'x' * 300}": ""}

    with pytest.raises(OSError, match="name too long"):
        write_new_files(texts, tmp_path)

    assert [path.name for path in tmp_path.rglob("*")] == ["kept"]


def test_a_file_that_appears_in_the_meantime_is_not_overwritten(tmp_path: Path) -> None:
    texts = {"a": "ours", "b": "ours"}
    assert conflicts(texts, tmp_path) == ()
    (tmp_path / "b").write_text("mine")

    with pytest.raises(FileExistsError):
        write_new_files(texts, tmp_path)

    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"b": "mine"}


def test_the_file_that_a_full_disk_does_not_take_is_named(tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as error:
            write_new_files({"a": "", "b": "x" * 101}, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)

    assert error.value.filename == str(tmp_path / "b")
    assert list(tmp_path.iterdir()) == []
