"""Read the files of folders as one forest: a tree can be a subtree of trees in other files, which do not include it.

The library loads such files one after the other, and nodes are declared in files of their own, such as Nav2's
`nav2_tree_nodes.xml`. Each file is checked with only the trees and models of other files that it needs, because the
main trees of a folder often have the same name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from codra_dsl.language.behavior_trees.checks import check
from codra_dsl.language.behavior_trees.elements import MAX_BYTES
from codra_dsl.language.behavior_trees.reader import read
from codra_dsl.language.behavior_trees.rules import TreeFindings
from codra_dsl.language.behavior_trees.values import BehaviorTree, Forest, NodeKind, NodeModel, TreeFile, TreeNode
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, Span, in_file_order
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import relative_path, root_of
from codra_dsl.regular_files import read_beginning

MAX_FOLDER_FILES = 1_000
"""The maximum number of files in a folder."""

_TREE_FILE = re.compile(rb"<root[\s/>]")


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedFiles:
    """Files of trees that were read and checked.

    Attributes:
        forests: each file with the trees and models of other files that it needs.
        diagnostics: all findings, in file order.
    """

    forests: tuple[Forest, ...]
    diagnostics: tuple[Diagnostic, ...]


def check_files(paths: Sequence[Path], model_files: Sequence[Path], root: Path) -> CheckedFiles:
    """Read and check files and folders.

    Args:
        paths: files of trees, and folders with such files. Other XML files in folders are ignored. No file outside of
            their projects is read.
        model_files: files whose `TreeNodesModel` declares nodes.
        root: the folder to which the paths in findings are relative.
    """
    findings = TreeFindings()
    within = {file: root_of(path) for path in paths for file in _tree_files(path, root, findings)}
    forests = [forest for file in within if (forest := _read(file, root, within[file], findings)) is not None]
    model_forests = [_read(file, root, root_of(file), findings) for file in model_files]
    models = [replace(file, trees=()) for forest in model_forests if forest is not None for file in forest.files]
    is_folder = any(path.is_dir() for path in paths)
    library = _Library([*((forest.files[0] for forest in forests) if is_folder else ()), *models])
    completed = [_complete(forest, library, findings) for forest in forests]
    for forest in completed:
        if forest.trees or not forest.models:
            findings.extend(check(forest)[1])
    return CheckedFiles(forests=tuple(completed), diagnostics=in_file_order(findings.all()))


class _Library:
    """The trees and models of files, by their ids."""

    def __init__(self, files: Iterable[TreeFile]) -> None:
        self.files: dict[str, TreeFile] = {}
        self.trees: dict[str, list[tuple[str, BehaviorTree]]] = {}
        self.models: dict[tuple[bool, str], tuple[str, NodeModel]] = {}
        for file in files:
            self.files.setdefault(file.file, file)
            for tree in file.trees:
                self.trees.setdefault(tree.id, []).append((file.file, tree))
            for model in file.models:
                self.models.setdefault(_key(model), (file.file, model))


def _complete(forest: Forest, library: _Library, findings: TreeFindings) -> Forest:
    """Return a forest with the trees and models of other files that its nodes need and do not have."""
    known_ids = {tree.id for tree in forest.trees}
    trees: dict[str, list[BehaviorTree]] = {}
    models: dict[str, list[NodeModel]] = {}
    known_models = {_key(model) for model in forest.models}
    pending = list(forest.trees)
    while pending:
        for node in pending.pop(0).root.walk():
            candidates = library.trees.get(node.subtree or "", [])
            if node.subtree is not None and node.subtree not in known_ids and candidates:
                known_ids.add(node.subtree)
                file, tree = candidates[0]
                if len(candidates) > 1:
                    _report_ambiguous_tree(node, candidates, findings)
                trees.setdefault(file, []).append(tree)
                pending.append(tree)
            key = (node.subtree is not None, node.subtree or node.id)
            if key in library.models and key not in known_models:
                known_models.add(key)
                file, model = library.models[key]
                models.setdefault(file, []).append(model)
    new_files = (
        replace(
            library.files[file],
            main=None,
            includes=(),
            trees=tuple(trees.get(file, ())),
            models=tuple(models.get(file, ())),
        )
        for file in sorted(trees.keys() | models.keys())
    )
    return replace(forest, files=(*forest.files, *new_files))


def _key(model: NodeModel) -> tuple[bool, str]:
    return model.kind is NodeKind.SUBTREE, model.id


def _report_ambiguous_tree(
    node: TreeNode, candidates: Sequence[tuple[str, BehaviorTree]], findings: TreeFindings
) -> None:
    (first, _), *others = candidates
    findings.add(
        "duplicate-tree",
        f"{len(candidates)} files have a tree '{node.subtree}'",
        node.place,
        help=f'include one of them: <include path="..."/>; here {first} is used',
        related=[Related("another one", tree.place) for _, tree in others[:5]],
    )


def _read(path: Path, root: Path, within: Path, findings: TreeFindings) -> Forest | None:
    forest, read_findings = read(path, root, within)
    findings.extend(read_findings)
    return forest


def _tree_files(path: Path, root: Path, findings: TreeFindings) -> Iterator[Path]:
    """Yield a file, or the files of trees in a folder, in alphabetical order. Hidden folders are not entered."""
    if not path.is_dir():
        yield path
        return
    files = [file for file in _xml_files(path) if _has_trees(file, path)]
    if len(files) > MAX_FOLDER_FILES:
        place = Place(Span(relative_path(path, root), 1, 1, 1, 1))
        message = f"the folder has {len(files):,} files of trees, and only {MAX_FOLDER_FILES:,} of them are checked"
        findings.add("tree-include", message, place, help="check parts of the folder one after the other")
    yield from files[:MAX_FOLDER_FILES]


def _xml_files(folder: Path) -> list[Path]:
    """Return the XML files in or below a folder. Folders that cannot be read are left out."""
    files: list[Path] = []
    pending_folders = [os.fspath(folder)]  # not a recursion: there may be more folders in folders than Python can call
    while pending_folders:
        with suppress(OSError), os.scandir(pending_folders.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    pending_folders += [] if entry.name.startswith(".") else [entry.path]
                elif entry.name.endswith(".xml"):
                    files.append(Path(entry.path))
    return sorted(files)


def _has_trees(path: Path, folder: Path) -> bool:
    """Return whether a file may be a file of trees. A file that cannot be read is one, so that it is reported."""
    try:
        return _TREE_FILE.search(read_beginning(path, MAX_BYTES, within=folder)) is not None
    except OSError:
        return path.is_file()
