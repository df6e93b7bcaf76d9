"""Write fixed texts to their files: atomically, with owner and mode preserved, and never outside of the project."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from codra_dsl.generation.output import output_finding
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load.yaml.source import MAX_BYTES
from codra_dsl.regular_files import read_regular_file, real_path, replace_file

_LINES = re.compile(r"[^\n]*\n|[^\n]+")


def read_rewritable_files(files: Iterable[str], root: Path) -> dict[str, bytes]:
    """Return the contents of all files that may be rewritten: files that exist in the project and are not too large."""
    files_and_contents = ((file, _rewritable_bytes(file, root)) for file in files)
    return {file: data for file, data in files_and_contents if data is not None}


def _rewritable_bytes(file: str, root: Path) -> bytes | None:
    try:
        return read_regular_file(root / file, MAX_BYTES, within=root)
    except OSError:
        return None


def rewrite(file: str, root: Path, before: bytes, after: bytes) -> Diagnostic | None:
    """Replace a file's bytes if they are still `before`. If this fails, return a finding, otherwise None."""
    try:
        path = _project_path(file, root)
        if read_regular_file(path, MAX_BYTES) != before:
            return _write_failure(file, "it has changed in the meantime")
        if not os.access(path, os.W_OK):
            return _write_failure(file, "it is write-protected")
        replace_file(path, after)
    except OSError as error:
        return _write_failure(file, error.strerror or "it cannot be replaced")
    except (ValueError, RuntimeError):
        return _write_failure(file, "it is a link that leads out of the project")
    return None


def unified_diff(before: bytes, after: bytes, file: str) -> str:
    """Return the difference between two texts of a file in unified form; line ends are preserved."""
    old_lines, new_lines = (_LINES.findall(data.decode("utf-8", "replace")) for data in (before, after))
    name = _quote_name(file)
    lines = difflib.unified_diff(old_lines, new_lines, name, name)
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)


def _quote_name(file: str) -> str:
    """Return a file's name as git and patch write it: in quotes and with escapes, if a character could end it."""
    if file.isprintable() and not set('"\\') & set(file):
        return f"{file}\t" if " " in file else file
    plain_bytes = frozenset(range(0x20, 0x7F)) - frozenset(b'"\\')
    escaped_characters = (chr(byte) if byte in plain_bytes else f"\\{byte:03o}" for byte in os.fsencode(file))
    return f'"{"".join(escaped_characters)}"'


def _write_failure(file: str, reason: str) -> Diagnostic:
    help = "check the permissions of the file, and run the fix again"
    return output_finding("cannot-write", file, f"cannot write '{file}': {reason}", help=help)


def _project_path(file: str, root: Path) -> Path:
    """Return a file's real path.

    Raises:
        ValueError: if the path is outside of the project.
    """
    path = (root / file).resolve(strict=True)
    path.relative_to(real_path(root))
    return path
