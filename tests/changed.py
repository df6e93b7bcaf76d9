"""Print the test files that concern the changes of this branch: `make check` runs them.

A test file is printed if it changed, if it imports a module that changed, or if its folder mirrors the folder of a
changed module. Changes are those since the merge base with `main`, uncommitted ones included.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
TEST_ROOT_BY_PACKAGE = {"codra_dsl": "tests", "codra_papers": "tests/papers"}


def git(*arguments: str) -> list[str]:
    """Return the lines that a git command prints."""
    process = subprocess.run(("git", *arguments), cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return process.stdout.splitlines()


def changed_files() -> set[str]:
    """Return the changed files, relative to the root.

    A clone without a branch `main` is compared with its last commit.
    """
    has_main = git("branch", "--list", "main")
    merge_base = git("merge-base", "HEAD", "main")[0] if has_main else "HEAD"
    return {*git("diff", "--name-only", merge_base), *git("ls-files", "--others", "--exclude-standard")}


def module_of(file: str) -> str:
    """Return the dotted name of a module."""
    parts = PurePosixPath(file).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(text: str) -> set[str]:
    """Return the modules that a text imports; both readings of `from package import name` count."""
    module_names = set[str]()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            module_names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            module_names.add(node.module)
            module_names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return module_names


def mirrored_folder(file: str) -> str | None:
    """Return the folder of tests that mirrors the folder of a module; None for a module of no package."""
    package, *folders = PurePosixPath(file).parent.parts or ("",)
    test_root = TEST_ROOT_BY_PACKAGE.get(package)
    return None if test_root is None or not folders else "/".join((test_root, *folders))


def select(changed_paths: Iterable[str], texts: dict[str, str]) -> list[str]:
    """Return the test files that concern changed files, sorted.

    Args:
        changed_paths: files, relative to the root.
        texts: the text of each test file, by its name relative to the root.
    """
    python_files = {file for file in changed_paths if file.endswith(".py")}
    changed_modules = {module_of(file) for file in python_files}
    test_folders = {mirrored_folder(file) for file in python_files}
    return sorted(
        test_file
        for test_file, text in texts.items()
        if test_file in python_files
        or PurePosixPath(test_file).parent.as_posix() in test_folders
        or imported_modules(text) & changed_modules
    )


def main() -> None:
    """Print the tests, one on a line."""
    test_paths = sorted((ROOT / "tests").rglob("test_*.py"))
    texts = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in test_paths}
    other_folders = ("tests/integrations/rafcon/", "tests/integrations/ros2/")  # have environments of their own
    sys.stdout.writelines(
        f"{test_file}\n" for test_file in select(changed_files(), texts) if not test_file.startswith(other_folders)
    )


if __name__ == "__main__":
    main()
