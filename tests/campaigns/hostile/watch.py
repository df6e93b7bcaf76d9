"""An audit hook that records forbidden actions as breaches.

Breaches are recorded but not prevented, so that the watch sees the real behaviour of the readers.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

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
CHANGES_OF_TARGETS = ("os.chmod", "os.truncate", "os.utime")
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
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


@dataclass
class Watch:
    """Records forbidden actions while it is armed.

    Attributes:
        root: the folder that may be read.
        out: the folder that may be changed.
        breaches: descriptions of forbidden actions.
        further_outs: files and folders that may be changed in addition.
        is_recording: whether breaches are kept.
    """

    root: str = ""
    out: str = ""
    armed: bool = False
    breaches: list[str] = field(default_factory=list)
    further_outs: tuple[str, ...] = ()
    is_recording: bool = True

    def arm(self, root: Path, out: Path, further_outs: Sequence[Path], *, is_recording: bool) -> None:
        """Begin to watch the reading of an input."""
        self.root, self.out, self.further_outs = str(root), str(out), tuple(map(str, further_outs))
        self.is_recording, self.armed = is_recording, True

    def disarm(self) -> None:
        """Stop watching."""
        self.armed = False

    def take_breaches(self) -> list[str]:
        """Return the breaches, and forget them."""
        breaches = list(dict.fromkeys(self.breaches)) if self.is_recording else []
        self.breaches.clear()
        return breaches

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
            path = _changed_path(event, arguments)
            return None if _is_below(path, (self.out, *self.further_outs)) else f"{event} {arguments[0]!r:.200}"
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
        if event == "subprocess.Popen" and arguments[0] == "git":
            return None  # the files that git changes are found by comparison
        return f"{event} {arguments!r:.200}" if event.startswith(FORBIDDEN) else None

    def _opened(self, path: object, mode: object, flags: object) -> str | None:
        if isinstance(path, int) or path == os.devnull:
            return None
        writes = bool(flags & WRITING) if isinstance(flags, int) else any(letter in str(mode) for letter in "wax+")
        is_allowed = self._may_change(path) if writes else _is_within(path, (self.root, *READABLE))
        return None if is_allowed else f"open {path!r:.200} {mode} {flags}"

    def _may_change(self, path: object) -> bool:
        return _is_within(path, (self.out, *self.further_outs))


def _changed_path(event: str, arguments: tuple[object, ...]) -> str:
    """Return the real path that an event changes; its last argument may be the descriptor of the folder of this path.

    If the path is a link, the system changes the link itself, except for the events in CHANGES_OF_TARGETS.
    """
    folder, path = arguments[-1], Path(os.fsdecode(arguments[0]))  # type: ignore[arg-type]
    if isinstance(folder, int) and folder >= 0 and len(arguments) > 1:
        path = Path(f"/proc/self/fd/{folder}").readlink() / path
    if event in CHANGES_OF_TARGETS:
        return os.path.realpath(path)
    return str(Path(os.path.realpath(path.parent), path.name))


def _is_within(path: object, folders: Sequence[str]) -> bool:
    try:
        real_path = os.path.realpath(os.fsdecode(path))  # type: ignore[arg-type]
    except ValueError:
        return True  # a path with a null character: the system refuses it
    return _is_below(real_path, folders)


def _is_below(real_path: str, folders: Sequence[str]) -> bool:
    return any(real_path == folder or real_path.startswith(folder + os.sep) for folder in folders)


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
