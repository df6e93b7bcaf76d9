"""The revision of the working tree in a report."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from codra_papers.experiments.campaign.provenance import Revision, revision_of


def git(folder: Path, *arguments: str) -> str:
    named = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false")
    return subprocess.run(["git", *named, *arguments], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    folder = tmp_path / "tree"
    (folder / "specs").mkdir(parents=True)
    (folder / "specs/a.yaml").write_text("codra: 1\n")
    (folder / ".gitignore").write_text("*.log\n")
    git(folder, "init", "--quiet")
    git(folder, "add", "-A")
    git(folder, "commit", "--quiet", "-m", "first")
    return folder


def edit(tree: Path) -> None:
    (tree / "specs/a.yaml").write_text("codra: 2\n")


def stage(tree: Path) -> None:
    edit(tree)
    git(tree, "add", "-A")


def remove(tree: Path) -> None:
    (tree / "specs/a.yaml").unlink()


def add(tree: Path) -> None:
    (tree / "specs/own.py").write_text("")


def ignore(tree: Path) -> None:
    (tree / "a.log").write_text("")


def write_results(tree: Path) -> None:
    (tree / "runs/a/trials").mkdir(parents=True)
    (tree / "runs/a/trials/x.json").write_text("")


def change_nothing(tree: Path) -> None:
    del tree


@pytest.mark.parametrize(
    ("change", "is_clean"),
    [
        (change_nothing, True),
        (ignore, True),
        (write_results, True),
        (edit, False),
        (stage, False),
        (remove, False),
        (add, False),
    ],
)
def test_a_tree_is_clean_when_only_results_differ_from_its_commit(
    tree: Path, change: Callable[[Path], None], is_clean: bool
) -> None:
    change(tree)
    commit = git(tree, "rev-parse", "HEAD").strip()

    assert revision_of(tree / "specs", tree / "runs/a") == Revision(commit=commit, is_clean=is_clean)


def test_no_filter_of_the_repository_is_run(tree: Path) -> None:
    (tree / ".gitattributes").write_text("*.yaml filter=trap\n")
    git(tree, "add", "-A")
    git(tree, "commit", "--quiet", "-m", "second")
    trap = f"touch {tree}/sprung.log; cat"
    for key, value in (("clean", trap), ("process", trap), ("required", "true")):
        git(tree, "config", f"filter.trap.{key}", value)
    (tree / "specs/a.yaml").write_text("codra: 9\n")

    assert revision_of(tree, tree / "runs") == Revision(commit=git(tree, "rev-parse", "HEAD").strip(), is_clean=False)
    assert not (tree / "sprung.log").exists()


def test_where_there_is_no_repository_or_no_commit_there_is_no_revision(tmp_path: Path) -> None:
    assert revision_of(tmp_path, tmp_path / "runs") is None
    git(tmp_path, "init", "--quiet")
    assert revision_of(tmp_path, tmp_path / "runs") is None
