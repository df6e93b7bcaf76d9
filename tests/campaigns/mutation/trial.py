"""Run tests on a changed copy of the repository."""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

_CPU_LIMIT_S, _WALL_LIMIT_S, _MEMORY_LIMIT_BYTES = 60, 600, 8_000_000_000
_LIBRARIES = ("hypothesis", "networkx", "numpy", "jsonschema_rs", "yaml", "py_trees", "rich", "typer", "mcap.writer")
_OUTPUT = ".mutation-output"
_FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+?\.py(?:::.*?)?)(?: - .*)?$", re.MULTILINE)
_OPTIONS = ["-x", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", "-p", "no:xdist", "--examples-factor=0.2"]
_OPTIONS += ["-W", "ignore:Module already imported:pytest.PytestAssertRewriteWarning"]  # by `copies`


def copies(root: Path, folder: Path, count: int) -> list[Copies]:
    """Return copies of the files that git would commit; import, once, the libraries that all runs need."""
    for library in _LIBRARIES:
        importlib.import_module(library)
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    names = subprocess.run(command, cwd=root, stdout=subprocess.PIPE, text=True, check=True).stdout
    unchanged = folder / "unchanged"
    for name in filter(None, names.split("\0")):
        if (root / name).is_file():
            (unchanged / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, unchanged / name, follow_symlinks=False)
    subprocess.run(["git", "init", "--quiet"], cwd=unchanged, check=True)
    subprocess.run([sys.executable, "-m", "compileall", "-q", "codra_dsl"], cwd=unchanged, check=True)
    changed_folders = [folder / f"changed-{number}" for number in range(count)]
    return [Copies(shutil.copytree(unchanged, changed, symlinks=True), unchanged) for changed in changed_folders]


@dataclass
class Copies:
    """A copy of the repository in which one change at a time is made and tested, and another one without a change."""

    changed: Path
    unchanged: Path
    passes_unchanged: dict[tuple[str, ...], bool] = field(default_factory=dict)

    def failure(self, file: str, changed_source: bytes, stages: Iterable[Sequence[str]]) -> str | None:
        """Return the first test that fails with a changed file, or the tests that exceed a limit; None if all pass."""
        path = self.changed / file
        source, times = path.read_bytes(), path.stat()
        path.write_bytes(changed_source)
        os.utime(path, (0, zlib.crc32(changed_source)))  # so that bytecode of another change is not used
        try:
            return next(filter(None, map(self.failure_of, stages)), None)
        finally:
            path.write_bytes(source)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))

    def failure_of(self, tests: Sequence[str]) -> str | None:
        """Return the first of the tests that fails, if it passes without the change."""
        failing_anyway = [test for known, passes in self.passes_unchanged.items() if not passes for test in known]
        while tests and (failed := _failed(self.changed, tests, failing_anyway)):
            if failed not in self.passes_unchanged:
                self.passes_unchanged[failed] = not _failed(self.unchanged, failed, [])
            if self.passes_unchanged[failed]:
                return " ".join(failed)
            failing_anyway += failed
        return None


def _failed(root: Path, tests: Sequence[str], deselected: Sequence[str]) -> tuple[str, ...]:
    """Return the first test that fails; all tests if their process ends early or exceeds a limit."""
    arguments = [*_OPTIONS, *(f"--deselect={test}" for test in deselected), *tests]
    process = multiprocessing.get_context("fork").Process(target=_run_pytest, args=(root, arguments))
    process.start()
    process.join(_WALL_LIMIT_S)
    code = process.exitcode
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid or 0, signal.SIGKILL)
    process.join()
    match = _FAILED.search((root / _OUTPUT).read_text("utf-8", errors="replace"))
    if code in {pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED}:
        return ()
    return tuple(tests) if match is None else (match[1],)


def _run_pytest(root: Path, arguments: list[str]) -> None:
    """Run pytest in a new process, as if it were started in the root; the process ends without cleaning up."""
    os.setsid()
    output = os.open(root / _OUTPUT, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    resource.setrlimit(resource.RLIMIT_CPU, (_CPU_LIMIT_S, _CPU_LIMIT_S))
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_LIMIT_BYTES, _MEMORY_LIMIT_BYTES))
    os.chdir(root)
    os.environ |= {"PYTHONPATH": str(root), "HOME": str(root / ".mutation-home")}
    sys.path[:] = [str(root), *(path for path in sys.path if not (Path(path) / "codra_dsl").is_dir())]
    for name in [name for name in sys.modules if name.partition(".")[0] in {"tests", "codra_dsl"}]:
        del sys.modules[name]
    code = 1
    try:
        code = int(pytest.main(arguments))
    finally:
        sys.stdout.flush()
        os._exit(code)
