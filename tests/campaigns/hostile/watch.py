"""Compile hostile inputs in this process under an audit hook that records forbidden actions as breaches.

Breaches are recorded but not prevented, so that the watch sees the real behaviour of the compiler.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from tests.campaigns.hostile.inputs import Files, hostile

if TYPE_CHECKING:
    from codra_dsl.compiler import Compilation
    from codra_dsl.language.diagnostics import Diagnostic

PROJECT = "[tool.codra]\n"
SECRET_FOLDER = Path.home() / ".cache/codra"
"""The folder of the user's secret, with which commands check that results in a cache are their own."""

READABLE = tuple(
    {os.path.realpath(path) for path in (sys.prefix, sys.base_prefix, Path(__file__).parents[3], SECRET_FOLDER)}
)
CHANGES = {
    "os.remove",
    "os.rename",
    "os.mkdir",
    "os.rmdir",
    "os.link",
    "os.symlink",
    "os.chmod",
    "os.truncate",
    "os.utime",
}
FORBIDDEN = (
    "socket.",
    "subprocess.",
    "os.system",
    "os.fork",
    "os.exec",
    "os.posix_spawn",
    "os.spawn",
    "pty.",
    "ctypes.",
    "pickle.",
)
MAKERS_OF_CODE = ("<frozen importlib", "/networkx/", "/inspect.py", "/typing.py")
"""Imports, decorators of networkx, and annotations of commands, which typer reads: texts of specs never reach them."""
WARM_UP = 50
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


@dataclass
class Watch:
    """Records forbidden actions while it is armed.

    Attributes:
        root: the folder that may be read.
        out: the folder that may be changed.
        breaches: descriptions of forbidden actions.
    """

    root: str = ""
    out: str = ""
    armed: bool = False
    breaches: list[str] = field(default_factory=list)

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        """Check an audit event; Python calls this for every event."""
        if not self.armed:
            return
        self.armed = False  # the check itself opens files
        try:
            breach = self._breach_of(event, arguments)
        finally:
            self.armed = True
        if breach is not None:
            self.breaches.append(breach)

    def _breach_of(self, event: str, arguments: tuple[object, ...]) -> str | None:
        if event == "open":
            return self._opened(*arguments)
        if event in CHANGES or event.startswith("shutil."):
            return None if self._is_within(arguments[0], self.out) else f"{event} {arguments[0]!r}"
        if event == "import" and str(arguments[0]).split(".")[0] in (
            "antigravity",
            "turtle",
            "hostile_module",
            "this",
            "tests",
        ):
            return f"import {arguments[0]}"
        if event == "exec":
            return f"exec {arguments[0]!r}" if not _is_of_a_library(arguments[0]) else None
        return f"{event} {arguments!r:.200}" if event.startswith(FORBIDDEN) else None

    def _opened(self, path: object, mode: object, flags: object) -> str | None:
        if isinstance(path, int):
            return None
        writes = bool(flags & WRITING) if isinstance(flags, int) else any(letter in str(mode) for letter in "wax+")
        allowed = (self.out,) if writes else (self.root, *READABLE)
        return None if any(self._is_within(path, folder) for folder in allowed) else f"open {path!r} {mode} {flags}"

    @staticmethod
    def _is_within(path: object, folder: str) -> bool:
        real_path = os.path.realpath(os.fsdecode(path))  # type: ignore[arg-type]
        return real_path == folder or real_path.startswith(folder + os.sep)


def _is_of_a_library(code: object) -> bool:
    """Return whether code comes from a module, or from one of MAKERS_OF_CODE."""
    if str(getattr(code, "co_filename", "")).startswith((*READABLE, "<frozen")):
        return True
    frame: FrameType | None = sys._getframe()
    while frame is not None:
        if any(maker in frame.f_code.co_filename for maker in MAKERS_OF_CODE):
            return True
        frame = frame.f_back
    return False


@dataclass(frozen=True)
class Outcome:
    """The result of compiling an input."""

    number: int
    codes: tuple[str, ...]
    seconds: float  # of the processor
    crash: str

    @property
    def is_yaml(self) -> bool:
        """Return whether the input passed YAML and its limits."""
        return not self.crash and not any("CDR0" <= code <= "CDR1011" for code in self.codes)

    @property
    def has_the_right_shape(self) -> bool:
        """Return whether the input passed the schema as well."""
        return self.is_yaml and not any(code[3] == "2" for code in self.codes)


@dataclass
class Session:
    """A run over inputs."""

    outcomes: list[Outcome] = field(default_factory=list)
    breaches: list[str] = field(default_factory=list)

    @property
    def peak_bytes(self) -> int:
        """Return the peak memory of this process; `ru_maxrss` would include that of its parent."""
        status_text = Path("/proc/self/status").read_text(encoding="utf-8")
        return int(status_text.split("VmHWM:")[1].split()[0]) * 1024

    def report(self) -> str:
        """Return the figures of the run."""
        count = len(self.outcomes)
        slowest = max(self.outcomes, key=lambda outcome: outcome.seconds)
        codes = Counter(code for outcome in self.outcomes for code in set(outcome.codes))
        rows = [
            f"{count} inputs",
            f"{sum(outcome.is_yaml for outcome in self.outcomes) / count:.1%} pass YAML",
            f"{sum(outcome.has_the_right_shape for outcome in self.outcomes) / count:.1%} pass the schema",
            f"{sum(not outcome.codes and not outcome.crash for outcome in self.outcomes)} compile",
            f"{len(codes)} codes",
            f"slowest: {slowest.seconds:.2f} s (number {slowest.number})",
            f"peak memory: {self.peak_bytes / 1e6:.0f} MB",
            f"{sum(bool(outcome.crash) for outcome in self.outcomes)} crashes, {len(self.breaches)} breaches",
        ]
        rows += [f"crash {outcome.number}: {outcome.crash}" for outcome in self.outcomes if outcome.crash][:20]
        return "\n".join(rows + self.breaches[:20])


def run(seed: int, first: int, count: int) -> Session:
    """Compile inputs one after the other and render their findings in every format."""
    watch, session = Watch(), Session()
    sys.addaudithook(watch)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        for number in range(-WARM_UP, 0):  # performs the lazy imports
            _attempt(watch, folder / str(number), hostile(seed, number), number)
        for number in range(first, first + count):
            session.outcomes.append(_attempt(watch, folder / str(number), hostile(seed, number), number))
            if sys.stderr.isatty():
                print(f"\r{number - first + 1} of {count}", end="", file=sys.stderr)
    session.breaches = watch.breaches
    return session


def _attempt(watch: Watch, root: Path, files: Files, number: int) -> Outcome:
    for file, data in {"pyproject.toml": PROJECT.encode(), **files}.items():
        path = root / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    out = root / "out"
    out.mkdir()
    watch.root, watch.out, watch.armed = str(root), str(out), number >= 0
    started, crash = time.process_time(), ""
    codes: tuple[str, ...] = ()
    try:
        codes = _compiled(root, out)
    except Exception as error:  # noqa: BLE001 - any exception is a crash
        crash = f"{type(error).__name__}: {error!s:.200}"
    finally:
        watch.armed = False
    return Outcome(number, codes, time.process_time() - started, crash)


def _compiled(root: Path, out: Path) -> tuple[str, ...]:
    from codra_dsl.compiler import compile_paths
    from codra_dsl.generation.output import freshness, write

    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        compilation = compile_paths([root / "spec.yaml"], root)
        diagnostics = compilation.planned.diagnostics
        _render_findings(diagnostics, lambda file: (root / file).read_text("utf-8", errors="replace"))
        if compilation.files:
            write(compilation.files, out, compilation.covered)
            freshness(compilation.files, out, compilation.covered)
            _draw(compilation)
    return tuple(diagnostic.code for diagnostic in diagnostics)


def _render_findings(diagnostics: Sequence[Diagnostic], sources: Callable[[str], str | None]) -> None:
    from codra_dsl.tooling.report.findings import render_concise, render_full, render_json
    from codra_dsl.tooling.report.github import render_github, render_summary
    from codra_dsl.tooling.report.junit import render_junit
    from codra_dsl.tooling.report.sarif import render_sarif

    render_full(diagnostics, sources)
    for render in (render_concise, render_json, render_github, render_sarif):
        render(diagnostics)
    render_summary(diagnostics, "findings")
    render_junit(diagnostics, ["spec.yaml"], sources, is_failure=lambda _: True, suite_name="codra")


def _draw(compilation: Compilation) -> None:
    from codra_dsl.tooling.report.dot import render_dot
    from codra_dsl.tooling.report.graphs import graph_of, render_json
    from codra_dsl.tooling.report.mermaid import flowchart

    for render in (render_json, render_dot, flowchart):
        render(graph_of(compilation.planned.plans))
