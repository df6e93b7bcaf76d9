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
PACKAGES = {"codra_dsl": "tests", "codra_papers": "tests/papers"}


def git(*arguments: str) -> list[str]:
    """Return the lines that a git command prints; none if it fails."""
    done = subprocess.run(("git", *arguments), cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.splitlines() if done.returncode == 0 else []


def changed_files() -> set[str]:
    """Return the changed files, relative to the root."""
    base = next(iter(git("merge-base", "HEAD", "main")), "HEAD")
    return {*git("diff", "--name-only", base), *git("ls-files", "--others", "--exclude-standard")}


def module_of(file: str) -> str:
    """Return the dotted name of a module."""
    parts = PurePosixPath(file).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(text: str) -> set[str]:
    """Return the modules that a text imports; both readings of `from package import name` count."""
    names = set[str]()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def mirrored_folder(file: str) -> str | None:
    """Return the folder of tests that mirrors the folder of a module; None for a module of no package."""
    package, *folders = PurePosixPath(file).parent.parts or ("",)
    tests = PACKAGES.get(package)
    return None if tests is None or not folders else "/".join((tests, *folders))


def select(changed: Iterable[str], texts: dict[str, str]) -> list[str]:
    """Return the test files that concern changed files, sorted.

    Args:
        changed: files, relative to the root.
        texts: the text of each test file, by its name relative to the root.
    """
    files = {file for file in changed if file.endswith(".py")}
    modules = {module_of(file) for file in files}
    folders = {mirrored_folder(file) for file in files}
    return sorted(
        test
        for test, text in texts.items()
        if test in files or PurePosixPath(test).parent.as_posix() in folders or imported_modules(text) & modules
    )


def main() -> None:
    """Print the tests, one on a line."""
    paths = sorted((ROOT / "tests").rglob("test_*.py"))
    texts = {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in paths}
    rafcon = "tests/integrations/rafcon/"  # has an environment of its own
    sys.stdout.writelines(f"{test}\n" for test in select(changed_files(), texts) if not test.startswith(rafcon))


if __name__ == "__main__":
    main()
