"""What all commands share: where text goes, colours, exit codes, and the specs' root."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import typer

if TYPE_CHECKING:
    from codra_dsl.diagnostics import Diagnostic


class ExitCode(IntEnum):
    """How a command ends."""

    CLEAN = 0
    FAILED = 1
    USAGE = 2
    INTERNAL = 70
    INTERRUPTED = 130


class Format(StrEnum):
    """How findings are shown."""

    FULL = "full"
    CONCISE = "concise"
    JSON = "json"


class Colour(StrEnum):
    """When text is coloured; `auto` means on a terminal, unless `NO_COLOR` is set."""

    AUTO = "auto"
    ALWAYS = "always"
    NEVER = "never"


class FailOn(StrEnum):
    """The least severity of a finding that fails the command."""

    ERROR = "error"
    WARNING = "warning"


STANDARD_INPUT = "-"
_PIECE = 1 << 15


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """How findings are shown, and where the lines come from that they are about.

    Attributes:
        root: the folder that their files are relative to.
        text: of the spec that came by standard input.
    """

    root: Path
    format: Format
    colour: Colour
    text: str | None = None

    def rendered(self, diagnostics: Sequence[Diagnostic], stream: TextIO) -> str:
        """Return findings in the form that was asked for, for a stream."""
        from codra_dsl.report import findings

        if self.format is Format.JSON:
            return findings.render_json(diagnostics)
        palette = findings.COLOURED if is_coloured(self.colour, stream) else findings.PLAIN
        if self.format is Format.CONCISE:
            return findings.render_concise(diagnostics, palette)
        return findings.render_full(diagnostics, self._source, palette)

    def _source(self, file: str) -> str | None:
        if file == STANDARD_INPUT:
            return self.text
        try:
            return (self.root / file).read_text("utf-8", errors="replace")
        except OSError:
            return None


def is_coloured(colour: Colour, stream: TextIO) -> bool:
    """Return whether a stream gets colours."""
    if colour is not Colour.AUTO:
        return colour is Colour.ALWAYS
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def fails(diagnostics: Sequence[Diagnostic], fail_on: FailOn) -> bool:
    """Return whether findings make a command fail."""
    from codra_dsl.diagnostics import has_errors

    return has_errors(diagnostics) or (fail_on is FailOn.WARNING and bool(diagnostics))


def counted(diagnostics: Sequence[Diagnostic]) -> str:
    """Return how many findings there are."""
    from codra_dsl.diagnostics import has_errors

    errors = sum(has_errors([found]) for found in diagnostics)
    numbers = ((errors, "error"), (len(diagnostics) - errors, "warning"))
    told = [f"{number} {noun}{'' if number == 1 else 's'}" for number, noun in numbers if number]
    return ", ".join(told) or "no findings"


def say(text: str) -> None:
    """Write about progress to standard error, after what was written as a result."""
    sys.stdout.flush()
    print(text, file=sys.stderr)


def write_result(text: str, output: Path | None = None) -> None:
    """Write a result to standard output, or to the file that was asked for."""
    if output is None:
        # In pieces: with PYTHONUNBUFFERED a single write to a reader that has gone would be cut off without an error.
        try:
            for start in range(0, len(text), _PIECE):
                sys.stdout.write(text[start : start + _PIECE])
            sys.stdout.flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for what Python flushes as it ends
            print(f"codra: cannot write to standard output: {error.strerror}", file=sys.stderr)
            raise typer.Exit(ExitCode.FAILED) from error
        return
    try:
        output.write_text(text, "utf-8", errors="backslashreplace")
    except OSError as error:
        raise typer.BadParameter(f"cannot write '{output}': {error.strerror}", param_hint="--output") from error


def existing(paths: Iterable[Path]) -> None:
    """Refuse paths that do not exist, as a mistake of usage."""
    for path in paths:
        if not path.exists():
            raise typer.BadParameter(f"'{path}' does not exist", param_hint="PATH")


def common_root(paths: Sequence[Path]) -> Path:
    """Return the folder that all paths in output are relative to; specs of several projects are a mistake of usage."""
    from codra_dsl.project import root_of

    roots = sorted({root_of(path) for path in paths})
    if len(roots) > 1:
        named = ", ".join(map(str, roots))
        message = f"the specs belong to several projects ({named}): take one at a time"
        raise typer.BadParameter(message, param_hint="PATH")
    return roots[0]
