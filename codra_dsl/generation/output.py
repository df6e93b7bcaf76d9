"""The output folder: which files are ours, whether they are up to date, and how they are renewed.

The folder contains an `__init__.py` and one package per spec. A package is ours if it contains a manifest that codra
wrote. In the folder itself and in the packages that a run generates, each file that the run does not generate is an
orphan. Files in `__pycache__` and names that begin with a dot are left alone. If a run does not generate a package of
ours, but covers the spec file from which the package was made, all files of this package are orphans.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from enum import StrEnum
from pathlib import Path

from codra_dsl.collector import paused_collector
from codra_dsl.language.diagnostics import Diagnostic, Place, Severity, Span, rules
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import MANIFEST, MANIFEST_FORMAT, covers
from codra_dsl.regular_files import read_beginning, read_regular_file

_CACHE = "__pycache__"
_ENTRY = "__init__.py"
_STAGING_PREFIX = ".codra-"

_BYTECODE_FLAGS = slice(4, 8)
_UNCHECKED_HASH = 0b01

_MAX_BYTES = 64 * 1024 * 1024
"""The maximum size of a file that is read to show it or to compare its digest."""

_MAX_COMPARED_LINES = 20_000
"""The maximum number of lines of a difference. The time to compare texts can grow with the square of their lines."""

RULES = rules(
    ("CDR6001", "same-spec-name", Severity.ERROR),
    ("CDR6002", "foreign-folder", Severity.ERROR),
    ("CDR6003", "stale-output", Severity.ERROR),
    ("CDR6004", "cannot-write", Severity.ERROR),
)


def output_finding(rule: str, path: str, message: str, *, help: str) -> Diagnostic:
    """Return a finding about a file or folder of the output."""
    return Diagnostic(rule=RULES[rule], message=message, place=Place(Span(path, 1, 1, 1, 1)), path=path, help=help)


class Change(StrEnum):
    """How a file in the output folder differs from the file that the specs define."""

    MODIFIED = "modified"
    MISSING = "missing"
    ORPHAN = "orphan"


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """A file that differs from the text that the specs define.

    Attributes:
        path: the path of the file, which begins with the name of the output folder and uses `/`.
        diff: the difference from the current text to the text that the specs define, in unified form.
    """

    path: str
    change: Change
    diff: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Freshness:
    """How an output folder differs from its expected contents. If there is a finding, the folder was not compared."""

    drifts: tuple[Drift, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteResult:
    """The changes made to an output folder, as paths relative to the folder. No further change followed a finding."""

    changed: tuple[str, ...] = ()
    removed: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


def drift_finding(drift: Drift) -> Diagnostic:
    """Return the finding that reports a drift to tools."""
    message = f"'{drift.path}' does not match the specs: {drift.change.value}"
    return output_finding("stale-output", drift.path, message, help="renew it with 'codra compile'")


@paused_collector()
def freshness(
    files: Mapping[str, str], out: Path, covered: Iterable[str] = (), intact: Iterable[str] = ()
) -> Freshness:
    """Return how an output folder differs from its expected contents; nothing is written.

    Args:
        files: the expected files, by path relative to the folder.
        out: the output folder, as an absolute path.
        covered: the files and folders of specs that this run covers, relative to the project root.
        intact: the paths of further expected files, which the folder is known to have.
    """
    try:
        if not _is_ours_or_new(out):
            return Freshness(diagnostics=(_foreign_folder_finding(out, out),))
        file_drifts = (_drift_of_file(path, text, out) for path, text in files.items())
        orphans = (_drift(path, Change.ORPHAN, out, "") for path in _orphans({*files, *intact}, out, covered))
        drifts = [*(drift for drift in file_drifts if drift is not None), *orphans]
        return Freshness(drifts=tuple(sorted(drifts, key=lambda drift: drift.path)))
    except OSError as error:
        return Freshness(diagnostics=(_inaccessible_finding(error, out, "read"),))


def is_as_made(outputs: Mapping[str, str], out: Path, covered: Iterable[str] = ()) -> bool:
    """Return whether an output folder holds exactly the files that an earlier run generated.

    Args:
        outputs: the digest of each file, as `digests` returns it, by path relative to the folder.
        out: the output folder, as an absolute path.
        covered: the files and folders of specs that the run covers, relative to the project root.
    """
    try:
        if any(_foreign_folder_findings(outputs, out)) or _orphans(outputs, out, covered):
            return False
        return holds(outputs, out)
    except OSError:
        return False


def holds(outputs: Mapping[str, str], out: Path) -> bool:
    """Return whether an output folder has files with the given digests, as `digests` returns them."""
    return all(_digest(_read_bytes(out / path)) == digest for path, digest in outputs.items())


def digests(files: Mapping[str, str]) -> Mapping[str, str]:
    """Return a mapping from the path of each output to its digest."""
    return {path: _digest(text.encode()) for path, text in files.items()}


def _digest(data: bytes | None) -> str:
    return "" if data is None else hashlib.sha256(data).hexdigest()


@paused_collector()
def write(files: Mapping[str, str], out: Path, covered: Iterable[str] = (), intact: Iterable[str] = ()) -> WriteResult:
    """Bring an output folder up to date: write changed files and remove orphans; nothing else is touched.

    Each file is replaced atomically. A folder that is not ours is left unchanged, and a finding reports it.

    Args:
        files: the expected files, by path relative to the folder.
        out: the output folder, as an absolute path.
        covered: the files and folders of specs that this run covers, relative to the project root.
        intact: the paths of further expected files, which the folder is known to have.
    """
    try:
        expected_paths = {*files, *intact}
        refusals = tuple(_foreign_folder_findings(expected_paths, out))
        if refusals:
            return WriteResult(diagnostics=refusals)
        orphans = _orphans(expected_paths, out, covered)
        changed_files = {path: text for path, text in sorted(files.items()) if not _holds(out / path, text)}
        _replace(changed_files, out)
        _remove(orphans, out)
    except OSError as error:
        return WriteResult(diagnostics=(_inaccessible_finding(error, out, "write"),))
    return WriteResult(changed=tuple(changed_files), removed=tuple(orphans))


# ---------------------------------------------------------------------------------------------------- ownership


def _foreign_folder_findings(files: Collection[str], out: Path) -> Iterator[Diagnostic]:
    """Yield a finding for each folder that is not ours, but to which the run would write."""
    if not _is_ours_or_new(out):
        yield _foreign_folder_finding(out, out)
        return
    for package in sorted({path.split("/")[0] for path in files if "/" in path}):
        folder = out / package
        if folder.is_symlink() or (_folder_entries(folder) != [] and not _is_our_package(folder)):
            yield _foreign_folder_finding(folder, out)


def _foreign_folder_finding(folder: Path, out: Path) -> Diagnostic:
    shown_path = folder.relative_to(out.parent).as_posix() if folder != out else out.name
    reason = "is not a folder" if folder.exists() and not folder.is_dir() else "holds files that codra did not make"
    reason = "is a link" if folder.is_symlink() else reason
    help = "choose another folder with --out, or move its contents away"
    return output_finding(
        "foreign-folder", shown_path, f"'{shown_path}' {reason}, so nothing is written there", help=help
    )


def _is_ours_or_new(out: Path) -> bool:
    """Return whether an output folder is missing, is empty, or contains our `__init__.py` or a package of ours.

    A link is never ours: it can be part of a repository, and lead to a folder whose files would be removed.
    """
    if out.is_symlink():
        return False
    if not out.exists():
        return True
    if not out.is_dir():
        return False
    entries = _folder_entries(out)
    if not entries or any(map(_is_our_package, entries)):
        return True
    from codra_dsl.generation.emit import package_text  # noqa: PLC0415

    return _read_text(out / _ENTRY) == package_text()


def _is_our_package(folder: Path) -> bool:
    """Return whether a folder contains a manifest of ours, even one that was edited or has merge conflicts."""
    return not folder.is_symlink() and f'"{MANIFEST_FORMAT}"' in _read_text(folder / MANIFEST)


def sites_in(out: Path) -> frozenset[str]:
    """Return the files of the sites for which the packages in an output folder were made, relative to the project."""
    return frozenset(filter(None, (_manifest_entry(folder, "site") for folder in _folder_entries(out))))


def _folder_entries(folder: Path) -> list[Path]:
    """Return the entries of a folder that can be output, sorted; an empty list if the folder does not exist."""
    if not folder.is_dir():
        return []
    return sorted(entry for entry in folder.iterdir() if entry.name != _CACHE and not entry.name.startswith("."))


# ---------------------------------------------------------------------------------------------------- comparison


def _drift_of_file(path: str, text: str, out: Path) -> Drift | None:
    if _holds(out / path, text):
        return None
    return _drift(path, Change.MODIFIED if os.path.lexists(out / path) else Change.MISSING, out, text)


def _drift(path: str, change: Change, out: Path, expected_text: str) -> Drift:
    shown_path = f"{out.name}/{path}"
    is_text = not path.endswith(".pyc")
    diff = _difference(_read_text(out / path), expected_text, shown_path) if is_text else ""
    return Drift(path=shown_path, change=change, diff=diff)


def _difference(current_text: str, expected_text: str, shown_path: str) -> str:
    """Return the difference between two texts in unified form, or one line if the texts are too long to compare."""
    names = f"{shown_path} (as it is)", f"{shown_path} (as specified)"
    if max(current_text.count("\n"), expected_text.count("\n")) > _MAX_COMPARED_LINES:
        return f"--- {names[0]}\n+++ {names[1]}\n(more than {_MAX_COMPARED_LINES} lines: not shown)\n"
    lines = difflib.unified_diff(
        current_text.splitlines(keepends=True), expected_text.splitlines(keepends=True), *names
    )
    return "".join(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n" for line in lines)


def _orphans(files: Collection[str], out: Path, covered: Iterable[str]) -> list[str]:
    """Return the orphans: files in the folder and in packages of ours that this run does not generate, sorted."""
    packages = {path.split("/")[0] for path in files if "/" in path}
    prefixes = tuple(covered)
    existing_files = list(_unchecked_bytecode(out, out))
    for entry in _folder_entries(out):
        if not entry.is_dir() or entry.is_symlink():
            existing_files += [entry.name]
        elif entry.name in packages or (_is_our_package(entry) and _is_covered(entry, prefixes)):
            existing_files += _files_below(entry, out)
    return sorted(path for path in existing_files if path not in files)


def _files_below(folder: Path, out: Path) -> Iterator[str]:
    pending_folders = [folder]  # not a recursion: there may be more folders in folders than Python can call
    while pending_folders:
        parent = pending_folders.pop()
        yield from _unchecked_bytecode(parent, out)
        for entry in _folder_entries(parent):
            if entry.is_dir() and not entry.is_symlink():
                pending_folders.append(entry)
            else:
                yield entry.relative_to(out).as_posix()


def _unchecked_bytecode(folder: Path, out: Path) -> Iterator[str]:
    """Yield the bytecode of a folder that Python runs without comparing it with the source (PEP 552).

    Such a file can be part of a repository, and Python would run it instead of the output. Bytecode that Python itself
    writes is always compared. A `__pycache__` that is a link is yielded as well.
    """
    cache = folder / _CACHE
    if cache.is_symlink():
        yield cache.relative_to(out).as_posix()
        return
    for file in sorted(cache.glob("*.pyc")):
        with suppress(OSError):  # Python cannot read the file either
            flags = read_beginning(file, _BYTECODE_FLAGS.stop)[_BYTECODE_FLAGS]
            if int.from_bytes(flags, "little") == _UNCHECKED_HASH:
                yield file.relative_to(out).as_posix()


def _is_covered(package: Path, covered: tuple[str, ...]) -> bool:
    """Return whether this run covers the spec of a package."""
    spec = _manifest_entry(package, "spec")
    return bool(spec) and covers(covered, spec)


def _manifest_entry(package: Path, key: str) -> str:
    """Return a text of a package's manifest; empty if there is none."""
    try:
        return str(json.loads(_read_text(package / MANIFEST))[key])
    except (ValueError, TypeError, LookupError, RecursionError):
        return ""


def _holds(path: Path, text: str) -> bool:
    data = text.encode()
    try:
        return read_regular_file(path, len(data)) == data
    except OSError:
        return False


def _read_bytes(path: Path) -> bytes | None:
    """Return the content of a file; None if it is missing, is not a regular file, or is too large."""
    try:
        return read_regular_file(path, _MAX_BYTES)
    except OSError:
        return None


def _read_text(path: Path) -> str:
    return (_read_bytes(path) or b"").decode(errors="replace")


# ---------------------------------------------------------------------------------------------------- writing


def _replace(files: Mapping[str, str], out: Path) -> None:
    """Write all files to a temporary folder inside the output folder, then move each file to its place.

    Manifests are moved first, so that a folder is recognised as ours even if writing is interrupted.
    """
    if not files:
        return
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=_STAGING_PREFIX, dir=out) as staging:
        staged_files = {path: Path(staging) / str(number) for number, path in enumerate(files)}
        for path, temporary_file in staged_files.items():
            temporary_file.write_bytes(files[path].encode())
        for path in sorted(files, key=lambda path: (not path.endswith(MANIFEST), path)):
            (out / path).parent.mkdir(exist_ok=True)
            staged_files[path].replace(out / path)


def _remove(paths: Iterable[str], out: Path) -> None:
    """Remove orphans, and folders that become empty. Another run may remove the same files meanwhile."""
    for path in paths:
        with suppress(FileNotFoundError):
            (out / path).unlink()
        folder = (out / path).parent
        with suppress(FileNotFoundError):
            while folder != out and not _folder_entries(folder):
                shutil.rmtree(folder / _CACHE, ignore_errors=True)
                if any(folder.iterdir()):
                    break
                folder.rmdir()
                folder = folder.parent


def _inaccessible_finding(error: OSError, out: Path, verb: str) -> Diagnostic:
    """Return the finding about an inaccessible path; for temporary files, the path is the output folder."""
    failed_path = Path(error.filename2 or error.filename or out)
    if any(part.startswith(_STAGING_PREFIX) for part in failed_path.parts):
        failed_path = out
    path = (failed_path.relative_to(Path.cwd()) if failed_path.is_relative_to(Path.cwd()) else failed_path).as_posix()
    message = f"cannot {verb} '{path}': {error.strerror}"
    return output_finding(
        "cannot-write", path, message, help="check the permissions, or choose another folder with --out"
    )
