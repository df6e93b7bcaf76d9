"""Versions, releases and the lock file: what is built from a commit, and with what."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PROJECTS = ("", "codra_papers")
FILES = (
    ".git_archival.txt",
    ".gitattributes",
    ".gitignore",
    "LICENSE",
    "Makefile",
    "README.md",
    "pyproject.toml",
    "codra_papers/pyproject.toml",
    "codra_papers/hatch_build.py",
)


def git(folder: Path, *arguments: str) -> str:
    command = ["git", "-c", "user.name=N", "-c", "user.email=n@example.org", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A repository with the files that determine versions, and one commit without a tag."""
    folder = tmp_path / "repository"
    for file in FILES:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, folder / file)
    git(folder, "init", "--quiet")
    commit(folder)
    return folder


def commit(folder: Path) -> None:
    git(folder, "add", "--all")
    git(folder, "commit", "--quiet", "--allow-empty", "--message=A change")


def versions(folder: Path) -> list[str]:
    """Return the versions of both distributions."""
    command = [sys.executable, "-m", "hatchling", "version"]
    return [
        subprocess.run(command, cwd=folder / project, capture_output=True, text=True, check=True).stdout.strip()
        for project in PROJECTS
    ]


# Versions


def test_the_tag_of_a_commit_is_the_version_of_both_distributions(repository: Path) -> None:
    git(repository, "tag", "v1.4.0")
    git(repository, "tag", "not-a-version")

    assert versions(repository) == ["1.4.0", "1.4.0"]


def test_a_commit_after_a_tag_has_a_version_between_this_release_and_the_next(repository: Path) -> None:
    git(repository, "tag", "v1.4.0")
    commit(repository)

    assert [version.partition("+g")[0] for version in versions(repository)] == ["1.4.1.dev1", "1.4.1.dev1"]


def test_a_commit_without_a_tag_before_it_has_a_version_before_every_release(repository: Path) -> None:
    assert [version.partition("+g")[0] for version in versions(repository)] == ["0.0.0.dev1", "0.0.0.dev1"]


def test_sources_without_git_have_the_version_of_their_archive_or_none(repository: Path, tmp_path: Path) -> None:
    git(repository, "tag", "v1.4.0")
    git(repository, "archive", "--output", str(tmp_path / "sources.tar"), "HEAD")
    shutil.unpack_archive(tmp_path / "sources.tar", tmp_path / "sources")
    shutil.rmtree(repository / ".git")

    assert versions(tmp_path / "sources") == ["1.4.0", "1.4.0"]
    assert versions(repository) == ["0.0.0.dev0", "0.0.0.dev0"]


def required_by_the_papers(repository: Path) -> list[str]:
    command = [sys.executable, "-m", "hatchling", "metadata", "dependencies"]
    output = subprocess.run(command, cwd=repository / "codra_papers", capture_output=True, text=True, check=True).stdout
    dependencies: list[str] = json.loads(output)
    return dependencies


def test_the_papers_require_the_product_of_the_same_release(repository: Path) -> None:
    git(repository, "tag", "v1.4.0")

    assert "codra-dsl==1.4.0" in required_by_the_papers(repository)


def test_between_releases_the_papers_require_any_version_of_the_product(repository: Path) -> None:
    git(repository, "tag", "v1.4.0")
    (repository / "README.md").write_text("changed")

    assert "codra-dsl" in required_by_the_papers(repository)


# Releases


def refusal(folder: Path) -> str:
    """Return what `make release` says before it sets anything up."""
    outside_make = {name: value for name, value in os.environ.items() if name not in {"MAKELEVEL", "MAKEFLAGS"}}
    process = subprocess.run(
        ["make", "release"], cwd=folder, env=outside_make, capture_output=True, text=True, check=False
    )
    assert (process.returncode, process.stdout) == (2, "")
    return process.stderr.partition("\n")[0]


def test_a_release_without_a_tag_is_refused(repository: Path) -> None:
    git(repository, "tag", "not-a-version")

    assert refusal(repository) == "release: the commit has no tag of a version: git tag -a v0.2.0 -m v0.2.0"


@pytest.mark.parametrize("file", ["README.md", "new"])
def test_a_release_of_uncommitted_changes_is_refused(file: str, repository: Path) -> None:
    git(repository, "tag", "v1.4.0")
    (repository / file).write_text("changed")

    assert refusal(repository) == "release: there are uncommitted changes: commit them, and move the tag"


# The lock file

RELEASE = "release.lock"
LOCKS = ("requirements.lock", RELEASE)


def pins(lock: str) -> list[Requirement]:
    lines = (ROOT / lock).read_text("utf-8").splitlines()
    return [Requirement(line.removesuffix(" \\")) for line in lines if not line.startswith(" ")]


def requirements(lock: str) -> Iterator[Requirement]:
    """Yield what both distributions and their extras, or the tools of releases, require of others."""
    for project in PROJECTS:
        settings = tomllib.loads((ROOT / project / "pyproject.toml").read_text("utf-8"))
        hook = settings["tool"]["hatch"].get("metadata", {}).get("hooks", {}).get("custom", settings["project"])
        of_project = (hook["dependencies"], *settings["project"]["optional-dependencies"].values())
        for lines in settings.get("dependency-groups", {}).values() if lock == RELEASE else of_project:
            yield from (Requirement(line) for line in lines if not line.startswith("codra-"))


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_file_satisfies_every_requirement(lock: str) -> None:
    pinned_versions: dict[str, list[str]] = {}
    for pin in pins(lock):
        (specifier,) = pin.specifier
        pinned_versions.setdefault(canonicalize_name(pin.name), []).append(specifier.version)

    unsatisfied = [
        str(requirement)
        for requirement in requirements(lock)
        for version in pinned_versions.get(canonicalize_name(requirement.name), ["missing"])
        if version == "missing" or version not in requirement.specifier
    ]
    assert pinned_versions
    assert unsatisfied == [], "make lock"


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_file_has_a_hash_of_every_distribution_and_names_no_host(lock: str) -> None:
    text = (ROOT / lock).read_text("utf-8")
    entries = re.split(r"\n(?=\S)", text.rstrip())

    assert len(entries) == len(pins(lock))
    assert [entry for entry in entries if " \\\n    --hash=sha256:" not in entry] == []
    assert "//" not in text


def test_the_tests_run_without_the_grammars_of_rfc3987_syntax() -> None:
    assert "rfc3987-syntax" not in {pin.name for pin in pins("requirements.lock")}
