"""Inputs as files, and what a reader answers to them."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random

import click
import typer

from codra_dsl.cli import app as command_app


@dataclass(frozen=True)
class Link:
    """A symbolic link in an input."""

    target: str


Files = Mapping[str, bytes | Link]
"""An input: a mapping from paths, relative to the folder of the input, to contents."""

OUT = "out"
"""The folder in the folder of an input in which a reader may write."""

OWNED = "owned"
"""The file that code of an input creates if it is run."""


@dataclass(frozen=True)
class Answer:
    """What a reader says about an input.

    Attributes:
        is_accepted: whether the input is valid for the reader, perhaps with warnings.
        codes: the codes of findings, or the beginnings of messages.
    """

    is_accepted: bool
    codes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    Attributes:
        make: returns an input; equal random generators give equal inputs.
        read: reads an input in a folder, which is also the current folder. Any exception is a crash.
        changes: the folders, relative to the folder of the input, in which a reader may write in addition to OUT.
        prepare: computes once what all inputs share.
    """

    make: Callable[[Random], Files]
    read: Callable[[Path], Answer]
    changes: tuple[str, ...] = ()
    prepare: Callable[[], object] = tuple


class InternalError(AssertionError):
    """A command ended with the exit code for internal errors, or refused an input without a reason."""


def write(files: Files, folder: Path) -> None:
    """Write an input, as far as the system allows its paths."""
    (folder / OUT).mkdir(parents=True)
    for file, content in files.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Link):
            path.symlink_to(content.target)
        else:
            path.write_bytes(content)


def command(*arguments: str) -> Answer:
    """Run `codra` in this process.

    Raises:
        InternalError: if the exit code is neither 0, 1 nor 2, or if the command fails without a message.
    """
    _use_one_parser()
    sys.argv = ["codra", *arguments]
    with captured() as (out, error):
        code = command_app.command_line()
    text = out.getvalue().decode("utf-8", "replace") + error.getvalue().decode("utf-8", "replace")
    if code not in (0, 1, 2) or "Traceback" in text or (code and not text.strip()):
        raise InternalError(f"codra {' '.join(arguments)!r:.300}: exit {code}: {text[-600:]}")
    return Answer(code == 0, tuple(set(re.findall(r"CDR\d{4}", text))) or (message_code(text),) if code else ())


@contextmanager
def captured() -> Iterator[tuple[io.BytesIO, io.BytesIO]]:
    """Replace standard output and standard error by streams in memory, with their buffers as commands need them."""
    streams, buffers = (sys.stdout, sys.stderr), (io.BytesIO(), io.BytesIO())
    sys.stdout, sys.stderr = (io.TextIOWrapper(buffer, encoding="utf-8", write_through=True) for buffer in buffers)
    try:
        yield buffers
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.detach()
        sys.stdout, sys.stderr = streams


@cache
def _use_one_parser() -> None:
    """Build the parser of the command line once: this takes longer than most commands."""
    parser: click.Command = typer.main.get_command(command_app.app)
    command_app.app = parser  # type: ignore[assignment]


def message_code(message: str) -> str:
    """Return the part of a message that is the same for similar inputs."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"|\S*/\S*|[\d,]+", "", message.replace("│", " ").split("\n\n")[-1])
    return " ".join(re.findall(r"[a-z]{2,}", text)[:12])


def refused(error: Exception) -> Answer:
    """Return the answer of a reader that raises an exception for invalid inputs."""
    return Answer(False, (message_code(str(error)),))


def changed_files(files: Files, folder: Path, allowed: Iterable[str]) -> list[str]:
    """Return the files in the folder of an input that a reader has created, changed or removed."""
    allowed_parts = {OUT, *allowed}
    present: dict[str, bytes | Link] = {}
    for parent, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name not in allowed_parts]
        names += [name for name in folders if Path(parent, name).is_symlink()]
        for name in names:
            path = Path(parent, name)
            present[os.path.relpath(path, folder)] = (
                Link(str(path.readlink())) if path.is_symlink() else path.read_bytes()
            )
    before = {os.path.normpath(file): content for file, content in files.items()}
    paths = {*present, *before}
    return sorted(
        path for path in paths if present.get(path) != before.get(path) and not allowed_parts & {*Path(path).parts}
    )
