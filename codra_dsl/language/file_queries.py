"""Queries about the files of a project. They are recorded, so that a result can be kept until an answer changes.

The result of reading a spec depends on the contents of files, on links, on the names in folders, and on files that do
not exist. All code that reads a spec asks the functions of this module. Inside of `recorded_queries`, each query is
recorded with its answer. `PresentAnswers` asks recorded queries again.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from codra_dsl.regular_files import TooLargeError, read_regular_file
from codra_dsl.regular_files import real_path as unrecorded_real_path

Query = tuple[str | int, ...]
"""The name of a function of this module, then its arguments."""

Answers = dict[Query, str]
"""Queries with their answers: a digest, a path, a truth value or the name of an error."""

MAX_SPEC_BYTES = 32 * 1024 * 1024
"""The maximum size of a spec, of a part and of a file of behaviour trees."""

_CHANGED = ""
"""Replaces the answers of a query that was asked twice, if they differ. No query has this answer."""

_recorded_answers: ContextVar[Answers | None] = ContextVar("recorded_answers", default=None)


@contextmanager
def recorded_queries() -> Iterator[Answers]:
    """Record all queries inside of the `with` statement. An enclosing `recorded_queries` does not record them."""
    answers: Answers = {}
    token = _recorded_answers.set(answers)
    try:
        yield answers
    finally:
        _recorded_answers.reset(token)


def merged_answers(all_answers: Iterable[Answers]) -> Answers:
    """Return all answers. `PresentAnswers` never agree with them if a file has changed between two of the answers."""
    merged: Answers = {}
    for answers in all_answers:
        for query, answer in answers.items():
            _add(merged, query, answer)
    return merged


def read_file(
    path: Path, max_bytes: int, within: Path, file: str = "", texts: Mapping[str, bytes] | None = None
) -> bytes:
    """Return the content of a regular file, as `read_regular_file` does, or the content that replaces it.

    Args:
        path: the file.
        max_bytes: the largest allowed size of a file on disk.
        within: the folder in which the file must be after all links are followed.
        file: the name of the file in `texts`; empty if the file is always read from disk.
        texts: contents that replace the contents of files on disk.

    Raises:
        OSError: if the file cannot be read. The subclasses are those of `read_regular_file`.
    """
    query = ("read_file", _text(path), max_bytes, _text(within), file)
    if file and texts is not None and file in texts:
        data = texts[file]
    else:
        try:
            data = read_regular_file(path, max_bytes, within=within)
        except OSError as error:
            _record(query, f"{type(error).__name__} {error.errno}")
            raise
    _record(query, hashlib.sha256(data).hexdigest())
    return data


def file_size(path: Path, file: str, texts: Mapping[str, bytes]) -> int:
    """Return the size of a regular file in bytes, or the size of the content that replaces it in `texts`.

    The size of a file that is not regular, or that cannot be examined, is 0.
    """
    text = texts.get(file)
    size_on_disk_bytes = os.path.getsize(path) if os.path.isfile(path) else 0  # noqa: PTH113, PTH202 - faster than Path
    size_bytes = size_on_disk_bytes if text is None else len(text)
    _record(("file_size", _text(path), file), str(size_bytes))
    return size_bytes


def real_path(path: Path) -> Path:
    """Return an absolute path with all links followed; links that form a circle stay in it."""
    followed_path = unrecorded_real_path(path)
    _record(("real_path", _text(path)), str(followed_path))
    return followed_path


def leads_into(path: Path, folder: Path) -> bool:
    """Return whether a path is in a folder after all links of both are followed."""
    return real_path(path).is_relative_to(real_path(folder))


def is_file(path: Path) -> bool:
    """Return whether a path leads to a regular file. A path that cannot be examined does not."""
    answer = os.path.isfile(path)  # noqa: PTH113 - it never raises
    _record(("is_file", _text(path)), str(answer))
    return answer


def is_folder(path: Path) -> bool:
    """Return whether a path leads to a folder. A path that cannot be examined does not."""
    answer = os.path.isdir(path)  # noqa: PTH112 - it never raises
    _record(("is_folder", _text(path)), str(answer))
    return answer


def folder_names(folder: Path, max_count: int, pattern: str) -> frozenset[str]:
    """Return those names in a folder that match a regular expression completely.

    The narrower the expression is, the fewer new files change the answer.

    Raises:
        TooLargeError: if the folder has more than `max_count` names.
        OSError: if the folder cannot be read.
    """
    query = ("folder_names", _text(folder), max_count, pattern)
    try:
        with os.scandir(folder) as entries:
            all_names = [entry.name for _, entry in zip(range(max_count + 1), entries, strict=False)]
        if len(all_names) > max_count:
            raise TooLargeError(errno.EFBIG, f"it has more than {max_count} entries", str(folder))
    except OSError as error:
        _record(query, f"{type(error).__name__} {error.errno}")
        raise
    names = frozenset(filter(re.compile(pattern, re.DOTALL).fullmatch, all_names))
    _record(query, hashlib.sha256("\0".join(sorted(names)).encode(errors="surrogateescape")).hexdigest())
    return names


_FUNCTIONS: Mapping[str, tuple[Callable[..., Any], tuple[type, ...]]] = {
    read_file.__name__: (read_file, (str, int, str, str)),
    file_size.__name__: (file_size, (str, str)),
    real_path.__name__: (real_path, (str,)),
    is_file.__name__: (is_file, (str,)),
    is_folder.__name__: (is_folder, (str,)),
    folder_names.__name__: (folder_names, (str, int, str)),
}
"""The functions by the names in queries, with the types of the arguments in queries."""


_FUNCTIONS_OF_CONTENTS = {read_file.__name__, file_size.__name__}


def is_query(values: tuple[object, ...]) -> bool:
    """Return whether values are a query of this module."""
    name, *arguments = values
    return name in _FUNCTIONS and tuple(map(type, arguments)) == _FUNCTIONS[str(name)][1]


class PresentAnswers:
    """The answers that queries have now. Each query is asked once."""

    def __init__(self, texts: Mapping[str, bytes] | None = None) -> None:
        """Initialize; `texts` has contents that replace the contents of files on disk."""
        self._texts = texts
        self._answers: Answers = {}

    def add(self, answers: Answers) -> None:
        """Add answers that are already known to be present."""
        self._answers.update(answers)

    def agree_with(self, answers: Answers) -> bool:
        """Return whether all queries have the answers that were recorded."""
        return all(self._answer(query) == answer for query, answer in answers.items())

    def _answer(self, query: Query) -> str | None:
        """Return the present answer to a query, or None if there is none."""
        if query not in self._answers:
            name, *arguments = query
            more_arguments = (self._texts or {},) if name in _FUNCTIONS_OF_CONTENTS else ()
            with recorded_queries() as answers, suppress(OSError, ValueError):
                _FUNCTIONS[str(name)][0](*arguments, *more_arguments)
            self._answers.update(answers)
        return self._answers.get(query)


def _record(query: Query, answer: str) -> None:
    answers = _recorded_answers.get()
    if answers is not None:
        _add(answers, query, answer)


def _add(answers: Answers, query: Query, answer: str) -> None:
    answers[query] = answer if answers.get(query, answer) == answer else _CHANGED


def _text(path: Path) -> str:
    text = os.fspath(path)
    return text if text.startswith("/") else os.path.join(os.getcwd(), text)  # noqa: PTH109, PTH118 - faster than Path
