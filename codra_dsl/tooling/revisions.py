"""The spec files of a project in a revision, read from git's objects into a folder of their own.

Nothing is checked out. No program that the repository configures is run: no hook, filter, monitor, pager or transport.
Symbolic links and submodules are not followed.
"""

from __future__ import annotations

import errno
import os
import re
import resource
import shlex
import subprocess
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path, PurePath, PurePosixPath
from typing import IO

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import SETTINGS
from codra_dsl.regular_files import read_beginning

__all__ = [
    "Repository",
    "RevisionError",
]

MAX_FILES = 20_000
MAX_COPIES = 1000
"""The maximum number of paths with one content. A few small objects can describe a folder of equal specs that would
take minutes to check."""

MAX_FILE_BYTES = 32 * 1024 * 1024
MAX_TOTAL_BYTES = 128 * 1024 * 1024
MAX_ENTRIES = 500_000
"""The maximum number of files and folders that git lists. A few small objects can describe any number of them."""

MAX_LISTED_BYTES = 64 * 1024 * 1024
MAX_DEPTH = 100
_MAX_WORDS = 1_000_000
_MAX_LINE_BYTES = 1 << 16

_MAX_GIT_CPU_S = 10
_MAX_GIT_DATA_BYTES = 256 * 1024 * 1024
"""The maximum heap of a git process. A pack of 2 KB can describe an object that git would unpack for ever."""

_GIT = (
    *("git", "--no-pager", "--no-replace-objects", "--literal-pathspecs"),
    *("-c", "core.fsmonitor=false", "-c", f"core.hooksPath={os.devnull}"),
)
# Inherited variables could point git at another repository, or make git start a program.
_SAFE_ENVIRONMENT = {
    "GIT_ALLOW_PROTOCOL": "none",
    "GIT_NO_LAZY_FETCH": "1",
    "GIT_OPTIONAL_LOCKS": "0",
    "GIT_TERMINAL_PROMPT": "0",
    "LC_ALL": "C",
}
_FILE_MODES = ("100644", "100755")
_SUBMODULE_MODE = "160000"
_KIND_OF_UNREAD_MODE = {"120000": "a symbolic link", _SUBMODULE_MODE: "a submodule"}
_INCOMPLETE_MESSAGE = "some files of the revision are missing here: fetch them (git fetch --refetch --no-filter)"
_SMALLER_MESSAGE = "compare a project in a smaller folder"
_TOO_MUCH_MESSAGE = "too much YAML to compare: give the specs that matter as PATH"
_ANCESTOR_STEPS = re.compile(r"[~^].*")
_MAX_SHOWN_NAME = 200
_MAX_SUGGESTED_REFS = 10_000
"""The maximum number of branches and tags that are compared with a misspelt name."""

_WORDS = re.compile(rb"[^\s\[\],\"'/:{}#]+")


class RevisionError(Exception):
    """Raised if a revision cannot be read. The message states the cause and how to fix it."""


@dataclass(frozen=True, slots=True)
class _Entry:
    """A file in a tree of git."""

    mode: str
    object_name: str
    path: PurePosixPath


@dataclass(frozen=True, slots=True)
class Repository:
    """A git repository.

    Attributes:
        top: the working folder of the repository; for a bare repository, the folder of the repository itself.
    """

    top: Path

    @staticmethod
    def around(path: Path) -> Repository:
        """Return the repository that contains a path; the path itself need not exist.

        Raises:
            RevisionError: if the path is not in a repository.
        """
        folder = next(parent for parent in (path, *path.parents) if parent.is_dir())
        is_bare = _run_git(("rev-parse", "--is-bare-repository"), folder).stdout == b"true\n"
        git_result = _run_git(("rev-parse", "--absolute-git-dir" if is_bare else "--show-toplevel"), folder)
        if git_result.returncode != 0:
            reason = os.fsdecode(git_result.stderr).strip().removeprefix("fatal: ").split("\n")[0]
            trust_hint = f"; if you trust it: git config --global --add safe.directory {shlex.quote(str(folder))}"
            reason += trust_hint if "dubious ownership" in reason else ""
            raise RevisionError(f"no git repository can be read at '{folder}': {reason}")
        return Repository(Path(os.fsdecode(git_result.stdout).rstrip("\n")))

    def commit(self, name: str) -> str:
        """Return the object name of a revision's commit.

        Raises:
            RevisionError: if the revision does not exist.
        """
        if name.startswith("-"):
            raise RevisionError(f"'{name}' is not a revision: names of revisions do not begin with '-'")
        if ".." in name:
            raise RevisionError(f"'{name}' is a range: give both ends, '{re.sub('[.]{2,3}', ' ', name)}'")
        if ":" in name:
            raise RevisionError(f"'{name}' is not a revision: give the path after both versions")
        commit = self._resolve_commit(name)
        if commit is None:
            hint = self._revision_hint(name)
            raise RevisionError(f"'{name}' is neither a path here nor a revision of '{self.top.name}' ({hint})")
        return commit

    def _resolve_commit(self, name: str) -> str | None:
        git_result = _run_git(("rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}"), self.top)
        return git_result.stdout.decode().strip() if name and git_result.returncode == 0 else None

    def holds(self, commit: str, path: PurePath) -> bool:
        """Return whether a commit has a file or folder."""
        return _run_git(("cat-file", "-e", f"{commit}:{path.as_posix()}"), self.top).returncode == 0

    def changed(self, excluded_folder: Path) -> Sequence[PurePosixPath]:
        """Return the files of the working folder that differ from the commit, or are new and not ignored.

        Args:
            excluded_folder: a folder whose files are left out.

        Raises:
            RevisionError: if git reports an error.
        """
        options = ("--porcelain", "-z", "--no-renames", "--untracked-files=all", "--ignore-submodules=dirty")
        git_result = _run_git((*self._filter_disabling_options(), "status", *options), self.top)
        if git_result.returncode != 0:
            raise RevisionError(f"git cannot list the changed files of '{self.top}'")
        paths = (PurePosixPath(os.fsdecode(line[3:])) for line in git_result.stdout.split(b"\0") if line)
        return [path for path in paths if not (self.top / path).is_relative_to(excluded_folder)]

    def _filter_disabling_options(self) -> Iterator[str]:
        """Yield settings that disable the filters that the repository configures."""
        git_result = _run_git(("config", "--null", "--name-only", "--get-regexp", r"^filter\."), self.top)
        for name in dict.fromkeys(os.fsdecode(git_result.stdout).split("\0")):
            if name.endswith((".clean", ".process")):
                yield from ("-c", f"{name}=")
            elif name.endswith(".required"):
                yield from ("-c", f"{name}=false")

    def extract(self, commit: str, subfolder: PurePosixPath, target_folder: Path) -> dict[PurePosixPath, str]:
        """Write the spec files of a revision into a folder, under their paths in the repository.

        Args:
            commit: the object name of the commit.
            subfolder: the wanted folder within the repository.
            target_folder: an empty folder that no other process writes to.

        Returns:
            The kinds, by path, of symbolic links and submodules that were not read but may contain specs.

        Raises:
            RevisionError: if the revision has too many or too large files, or if some of its files are missing here.
        """
        settings_paths = [folder / SETTINGS for folder in (subfolder, *subfolder.parents)]
        settings_entries = self._entries(commit, settings_paths, _may_matter)
        inner_paths = [subfolder] if subfolder.parts else []
        inner_entries = self._entries(commit, inner_paths, _may_matter)
        spec_entries = dict.fromkeys((*settings_entries, *inner_entries))
        written_entries = self._write(spec_entries, target_folder)
        words = _words_in_including_files(target_folder / entry.path for entry in written_entries)
        if words:
            mentioned_entries = self._entries(commit, inner_paths, lambda _, name: name in words)
            self._write([entry for entry in mentioned_entries if entry not in spec_entries], target_folder)
        return {
            entry.path: _KIND_OF_UNREAD_MODE[entry.mode]
            for entry in inner_entries
            if entry.mode in _KIND_OF_UNREAD_MODE
        }

    def _revision_hint(self, name: str) -> str:
        base_name = _ANCESTOR_STEPS.sub("", name)
        is_too_far = base_name != name and self._resolve_commit(base_name) is not None
        if self._is_shallow() and (is_too_far or self._similar_revision_name(name) is None):
            return "this clone is shallow: fetch the revision first, for example with git fetch --unshallow"
        if is_too_far:
            return f"'{base_name}' is a revision, but has no '{name.removeprefix(base_name)}'"
        similar_name = self._similar_revision_name(name)
        return (
            f"did you mean '{similar_name}'?" if similar_name else "name a file, a folder, a branch, a tag or a commit"
        )

    def _similar_revision_name(self, name: str) -> str | None:
        git_result = _run_git(("for-each-ref", f"--count={_MAX_SUGGESTED_REFS}", "--format=%(refname:short)"), self.top)
        names = ["HEAD", *os.fsdecode(git_result.stdout).split()]
        remote_branch = next((branch for branch in sorted(names) if branch.endswith(f"/{name}")), None)
        return remote_branch or suggest(name, names)

    def _is_shallow(self) -> bool:
        return _run_git(("rev-parse", "--is-shallow-repository"), self.top).stdout.strip() == b"true"

    def _entries(
        self, commit: str, paths: Sequence[PurePosixPath], is_wanted: Callable[[bytes, bytes], bool]
    ) -> tuple[_Entry, ...]:
        """Return the wanted files, links and submodules at and below some paths of a revision.

        Git's list is read while git writes it, and git is stopped if the list is too long.

        Args:
            commit: the object name of the commit.
            paths: files and folders in the revision; without them, everything is listed.
            is_wanted: decides from the mode and the name of an entry, without its folders, whether it is wanted.
        """
        # With -t the list has folders as well: otherwise git could walk through any number of empty folders in silence.
        arguments = ("ls-tree", "-r", "-t", "-z", "--full-tree", commit, "--", *map(str, paths))
        with _git_process(arguments, self.top) as process:
            assert process.stdout is not None
            lines = _limited_lines(process.stdout)
            entries = (entry for line in lines for entry in _wanted_entries(line, is_wanted))
            wanted_entries = tuple(islice(entries, MAX_FILES + 1))
            copy_counts = Counter(entry.object_name for entry in wanted_entries if entry.mode in _FILE_MODES)
            if len(wanted_entries) > MAX_FILES or max(copy_counts.values(), default=0) > MAX_COPIES:
                raise RevisionError(_TOO_MUCH_MESSAGE)
        if process.returncode != 0:
            raise RevisionError(f"git cannot list the files: folders are nested too deeply, or {_INCOMPLETE_MESSAGE}")
        return wanted_entries

    def _write(self, entries: Iterable[_Entry], target_folder: Path) -> tuple[_Entry, ...]:
        file_entries = tuple(entry for entry in entries if entry.mode in _FILE_MODES)
        sizes = self._sizes(file_entries)
        if sum(min(size, MAX_FILE_BYTES) for size in sizes.values()) > MAX_TOTAL_BYTES:
            raise RevisionError(_TOO_MUCH_MESSAGE)
        small_entries = [entry for entry in file_entries if sizes[entry] <= MAX_FILE_BYTES]
        for entry, data in zip(
            small_entries, self._read_blobs([entry.object_name for entry in small_entries]), strict=True
        ):
            _write_file(entry, target_folder, data)
        # Files that are too large are written without their data, but with a size that is reported as too large.
        for entry in set(file_entries) - set(small_entries):
            _write_file(entry, target_folder, None)
        return file_entries

    def _sizes(self, entries: Sequence[_Entry]) -> dict[_Entry, int]:
        names = "".join(f"{entry.object_name}\n" for entry in entries)
        git_result = _run_git(("cat-file", "--batch-check=%(objectsize)"), self.top, names.encode())
        sizes = git_result.stdout.split(b"\n")[: len(entries)]
        if not all(size.isdigit() for size in sizes):
            raise RevisionError(_INCOMPLETE_MESSAGE)
        return {entry: int(size) for entry, size in zip(entries, sizes, strict=True)}

    def _read_blobs(self, object_names: Sequence[str]) -> Iterator[bytes]:
        if not object_names:
            return
        with _git_process(("cat-file", "--batch"), self.top) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            for name in object_names:
                process.stdin.write(f"{name}\n".encode())
                process.stdin.flush()
                yield _read_blob(process.stdout)


def _read_blob(stream: IO[bytes]) -> bytes:
    fields = stream.readline().split()
    if len(fields) != 3 or fields[1] != b"blob" or int(fields[2]) > MAX_FILE_BYTES:
        raise RevisionError(_INCOMPLETE_MESSAGE)
    size = int(fields[2])
    data = stream.read(size + 1)
    return data[:size]


def _limited_lines(stream: IO[bytes]) -> Iterator[bytes]:
    """Yield the lines of a list, which end with a null character.

    Raises:
        RevisionError: if the list is too long.
    """
    rest, line_count, byte_count = b"", 0, 0
    while chunk := stream.read(_MAX_LINE_BYTES):
        *lines, rest = (rest + chunk).split(b"\0")
        yield from lines
        line_count, byte_count = line_count + len(lines), byte_count + len(chunk)
        if line_count > MAX_ENTRIES or byte_count > MAX_LISTED_BYTES or len(rest) > _MAX_LINE_BYTES:
            raise RevisionError(f"the revision has too many files, or too long paths: {_SMALLER_MESSAGE}")


def _wanted_entries(line: bytes, is_wanted: Callable[[bytes, bytes], bool]) -> Iterator[_Entry]:
    """Yield the entry of a line of git's list, unless it is a folder, unwanted, or has a path that leads elsewhere."""
    head, _, name = line.partition(b"\t")
    fields = head.split()
    if len(fields) != 3 or fields[1] == b"tree" or not is_wanted(fields[0], name.rpartition(b"/")[2]):
        return
    path = PurePosixPath(os.fsdecode(name))
    if not path.is_absolute() and not {"..", ".git"} & set(path.parts):
        yield _Entry(fields[0].decode(), fields[2].decode(), path)


def _may_matter(mode: bytes, name: bytes) -> bool:
    """Return whether an entry may be a spec, a part, settings, or a link or submodule that may contain them."""
    return mode == _SUBMODULE_MODE.encode() or name.endswith((b".yaml", b".yml")) or name == SETTINGS.encode()


def _write_file(entry: _Entry, target_folder: Path, data: bytes | None) -> None:
    """Write a file of a revision; None means a file that is too large."""
    target = target_folder / entry.path
    try:
        if len(entry.path.parts) > MAX_DEPTH:
            raise OSError(errno.ENAMETOOLONG, f"it is in more than {MAX_DEPTH} folders")
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("xb") as stream:
            stream.truncate(MAX_FILE_BYTES + 1) if data is None else stream.write(data)
    except OSError as error:
        name = ascii(str(entry.path))[1:-1]
        shown_name = name if len(name) <= _MAX_SHOWN_NAME else f"...{name[-_MAX_SHOWN_NAME:]}"
        raise RevisionError(f"the file '{shown_name}' of the revision cannot be read: {error.strerror}") from error


def _words_in_including_files(files: Iterable[Path]) -> set[bytes]:
    """Return all words in the files that include parts or name files of trees.

    Some of these words are names of files without a YAML suffix, which are read as well.
    """
    words: set[bytes] = set()
    for file in files:
        data = read_beginning(file, MAX_FILE_BYTES)
        if b"codra" in data and (b"include" in data or b"trees" in data):
            words.update(match[0] for match in _WORDS.finditer(data))
        if len(words) > _MAX_WORDS:
            raise RevisionError(_TOO_MUCH_MESSAGE)
    return words


@contextmanager
def _git_process(arguments: Sequence[str], folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Run git while its output is read. If an exception ends the reading, or the output is not read, git is stopped."""
    with _started_git(arguments, folder) as process:
        try:
            yield process
        except BrokenPipeError as error:
            raise RevisionError("git has ended too early") from error
        except BaseException:
            process.kill()
            raise
        finally:
            assert process.stdin is not None
            with suppress(BrokenPipeError):
                process.stdin.close()


def _run_git(arguments: Sequence[str], folder: Path, input_data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    with _started_git(arguments, folder, subprocess.PIPE) as process:
        output, error_output = process.communicate(input_data)
    return subprocess.CompletedProcess(arguments, process.returncode, output, error_output)


def _started_git(arguments: Sequence[str], folder: Path, stderr: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    """Start git with limits on its time and memory, where the system can set them for another process."""
    try:
        process = subprocess.Popen(
            (*_GIT, *arguments),
            cwd=folder,
            env=_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
        )
    except (OSError, ValueError) as error:
        raise _unrunnable(error) from error
    if hasattr(resource, "prlimit"):
        with suppress(ProcessLookupError):
            resource.prlimit(process.pid, resource.RLIMIT_DATA, (_MAX_GIT_DATA_BYTES, _MAX_GIT_DATA_BYTES))
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (_MAX_GIT_CPU_S, _MAX_GIT_CPU_S))
    return process


def _unrunnable(error: OSError | ValueError) -> RevisionError:
    if isinstance(error, FileNotFoundError):
        return RevisionError("git is not installed: compare two folders instead")
    return RevisionError(f"git cannot be run: {error}")


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if not name.startswith("GIT_")} | _SAFE_ENVIRONMENT
