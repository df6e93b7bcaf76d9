"""Read and check the trees that a spec names.

This happens between the stages `load` and `check`, so that neither of them depends on the format of tree files. A
finding about the content of a tree file has a place in that file.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath

from codra_dsl.language.behavior_trees.checks import check
from codra_dsl.language.behavior_trees.reader import read
from codra_dsl.language.behavior_trees.rules import TreeFindings
from codra_dsl.language.behavior_trees.values import CheckedForest
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.file_queries import is_file, leads_into
from codra_dsl.language.model import Spec

ReadResult = tuple[CheckedForest | None, tuple[Diagnostic, ...]]
"""The trees of a file, or None if an error prevents their compilation; and the findings about the file."""


UNREAD_RESULT: ReadResult = (None, ())
"""The result for a tree whose file has not been read."""


def read_trees(spec: Spec, root: Path) -> Mapping[str, ReadResult]:
    """Return a mapping from the name of each tree in a spec to the result of reading its file.

    Each file is read once. Only the result of the first tree that names a file has the findings about this file.

    Args:
        spec: the spec as it was loaded.
        root: the folder of the project. Paths in findings are relative to this folder, and files outside of the folder
            are not read.
    """
    results_by_file: dict[Path, ReadResult] = {}
    results_by_tree: dict[str, ReadResult] = {}
    for tree in spec.trees:
        spec_file = root / tree.file.place.span.file
        path = Path(os.path.normpath(spec_file.parent / tree.file.name)) if tree.file.name else root
        is_inside_project = leads_into(path, root)
        if not tree.file.name or not is_inside_project or not is_file(path):
            findings = TreeFindings()
            message = (
                f"there is no file '{tree.file.name}'"
                if is_inside_project
                else f"'{tree.file.name}' is outside of the project"
            )
            help_text = "name a file of the project, by a path relative to this file"
            findings.add("tree-include", message, tree.file.place, help=help_text, path=f"trees.{tree.name}.file")
            results_by_tree[tree.name] = None, findings.all() if tree.file.name else ()
        elif path in results_by_file:
            results_by_tree[tree.name] = results_by_file[path][0], ()
        else:
            results_by_tree[tree.name] = results_by_file[path] = _read_and_check(path, root)
    return results_by_tree


def named_tree_files(spec: Spec, trees: Mapping[str, ReadResult]) -> Iterator[str]:
    """Yield the files from which a spec's trees were read, and all files that the spec names; these may be missing."""
    for tree in spec.trees:
        forest, _ = trees.get(tree.name, UNREAD_RESULT)
        path = os.path.normpath(PurePosixPath(tree.file.place.span.file).parent / tree.file.name)
        yield from [file.file for file in forest.forest.files] if forest is not None else []
        if not path.startswith("..") and not PurePosixPath(path).is_absolute():
            yield path


def _read_and_check(path: Path, root: Path) -> ReadResult:
    forest, findings = read(path, root)
    checked_forest, check_findings = check(forest) if forest is not None else (None, ())
    return checked_forest, (*findings, *check_findings)
