"""The trees that a spec names: read, and what is wrong with them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from codra_dsl.diagnostics import Diagnostic
from codra_dsl.model import Spec
from codra_dsl.trees.checks import check
from codra_dsl.trees.reader import read
from codra_dsl.trees.rules import Told
from codra_dsl.trees.values import CheckedForest

Read = tuple[CheckedForest | None, tuple[Diagnostic, ...]]
"""The trees of a file, None where an error keeps them from being compiled, and the findings about it."""


UNREAD: Read = (None, ())
"""Of a tree whose file nobody has read."""


def read_trees(spec: Spec, root: Path) -> Mapping[str, Read]:
    """Return what the file of each tree of a spec says, by the name of the tree; each file is read once.

    Args:
        spec: as it was loaded.
        root: of the project: findings name files relative to it, and nothing outside of it is read.
    """
    by_file: dict[Path, Read] = {}
    found: dict[str, Read] = {}
    for tree in spec.trees:
        holder = root / tree.file.place.span.file
        path = Path(os.path.normpath(holder.parent / tree.file.name)) if tree.file.name else root
        inside = Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root))
        if not tree.file.name or not inside or not os.path.isfile(path):  # noqa: PTH113 - whatever it is, it does not raise
            told = Told()
            message = (
                f"there is no file '{tree.file.name}'" if inside else f"'{tree.file.name}' is outside of the project"
            )
            way_out = "name a file of the project, by a path relative to this one"
            told.add("tree-include", message, tree.file.place, help=way_out, path=f"trees.{tree.name}.file")
            found[tree.name] = None, told.all() if tree.file.name else ()
        elif path in by_file:
            found[tree.name] = by_file[path][0], ()
        else:
            found[tree.name] = by_file[path] = _read(path, root)
    return found


def files_read(spec: Spec, trees: Mapping[str, Read]) -> Iterator[str]:
    """Yield the files that the trees of a spec come from, or in which they were looked for in vain."""
    for tree in spec.trees:
        forest, _ = trees.get(tree.name, UNREAD)
        path = os.path.normpath(PurePosixPath(tree.file.place.span.file).parent / tree.file.name)
        yield from [file.file for file in forest.forest.files] if forest is not None else []
        if not path.startswith("..") and not PurePosixPath(path).is_absolute():
            yield path


def _read(path: Path, root: Path) -> Read:
    forest, findings = read(path, root)
    checked, judged = check(forest) if forest is not None else (None, ())
    return checked, (*findings, *judged)
