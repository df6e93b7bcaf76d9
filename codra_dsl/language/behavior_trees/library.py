"""Warnings about trees that run here, although newer versions of BehaviorTree.CPP refuse their file."""

from __future__ import annotations

import re
from collections.abc import Iterator

from codra_dsl.language.behavior_trees.rules import TreeFindings
from codra_dsl.language.behavior_trees.values import BehaviorTree, Forest, TreeNode
from codra_dsl.language.diagnostics import Place, Related

_REFUSED_CHARACTER = re.compile(r"""[\s<>&"'/\\:*?|.\x00-\x1f\x7f]""")
_RESERVED_NAMES = ("Root", "root")
_REFUSAL = "newer versions of BehaviorTree.CPP refuse the file"


def report_what_library_refuses(forest: Forest, findings: TreeFindings) -> None:
    """Report names and nodes that the library refuses when it reads a file."""
    for name, place in _names_of_nodes(forest):
        _check_characters(name, place, findings)
        if name in _RESERVED_NAMES:
            message = f"the name '{name}' is reserved: {_REFUSAL}"
            findings.add("library-refuses-name", message, place, help="choose another name, such as 'Main'")
    for port in (port for model in forest.models for port in model.ports):
        _check_characters(port.name, port.place, findings)
    for tree in forest.trees:
        _check_names_of_subtrees(tree, findings)
        for node in tree.root.walk():
            if node.id == "ReactiveSequence":
                _check_asynchronous_children(node, tree, findings)


def _names_of_nodes(forest: Forest) -> Iterator[tuple[str, Place]]:
    yield from ((tree.id, tree.place) for tree in forest.trees)
    yield from ((model.id, model.place) for model in forest.models)


def _check_characters(name: str, place: Place, findings: TreeFindings) -> None:
    match = _REFUSED_CHARACTER.search(name)
    if match is not None:
        message = f"{match[0]!r} in the name {name!r}: {_REFUSAL}"
        findings.add("library-refuses-name", message, place, help="use letters, digits, '_' and '-'")


def _check_names_of_subtrees(tree: BehaviorTree, findings: TreeFindings) -> None:
    """The subtrees of one tree have different names; the library makes names for subtrees without `name`."""
    first_nodes: dict[str, TreeNode] = {}
    for node in tree.root.walk():
        if node.subtree is not None and node.name is not None:
            first_node = first_nodes.setdefault(node.name, node)
            if first_node is not node:
                findings.add(
                    "library-refuses-name",
                    f"another subtree of '{tree.id}' has the name '{node.name}': {_REFUSAL}",
                    node.place,
                    help="rename or omit 'name' of one of the two",
                    path=f"{tree.id}.{node.label}",
                    related=[Related("the first one", first_node.place)],
                )


def _check_asynchronous_children(node: TreeNode, tree: BehaviorTree, findings: TreeFindings) -> None:
    asynchronous_children = [child for child in node.children if child.id == "AsyncSequence"]
    if len(asynchronous_children) > 1:
        findings.add(
            "library-refuses-children",
            f"'{node.id}' has {len(asynchronous_children)} children of type AsyncSequence: {_REFUSAL}",
            node.place,
            help="use at most one AsyncSequence, or Sequence instead",
            path=f"{tree.id}.{node.label}",
        )
