"""Tree values -> XML that Groot2 opens. Reading it again gives equal values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.language.behavior_trees.reader import FORMAT
from codra_dsl.language.behavior_trees.values import Attribute, BehaviorTree, NodeModel, Port, TreeFile, TreeNode

_STEP = "  "
_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
_ESCAPE = str.maketrans(_ESCAPES)
Pairs = Iterable[tuple[str, str]]


def write(file: TreeFile) -> str:
    """Return a file as XML: its includes, its trees, its models."""
    main = [] if file.main is None else [("main_tree_to_execute", file.main)]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        _opened("root", [("BTCPP_format", FORMAT), *main, *_pairs(file.extras)]),
        *(f"{_STEP}{_alone('include', [('path', include.path)])}" for include in file.includes),
    ]
    for tree in file.trees:
        lines += [*_commented(tree.comments, 1), *_tree(tree)]
    if file.models:
        lines += [f"{_STEP}<TreeNodesModel>", *(line for model in file.models for line in _model(model))]
        lines.append(f"{_STEP}</TreeNodesModel>")
    lines += [*_commented(file.last_comments, 1), "</root>"]
    return "\n".join(lines) + "\n"


def _tree(tree: BehaviorTree) -> Iterator[str]:
    yield _STEP + _opened("BehaviorTree", [("ID", tree.id), *_pairs(tree.extras)])
    yield from _node(tree.root, 2)
    yield from _commented(tree.last_comments, 2)
    yield f"{_STEP}</BehaviorTree>"


def _node(node: TreeNode, level: int) -> Iterator[str]:
    yield from _commented(node.comments, level)
    tag = node.id if node.kind is None else node.kind.value
    named = node.subtree if node.subtree is not None else node.id if node.kind is not None else None
    pairs = [
        *([] if named is None else [("ID", named)]),
        *([] if node.name is None else [("name", node.name)]),
        *_pairs((*node.ports, *node.conditions, *node.extras)),
    ]
    if not node.children and not node.last_comments:
        yield _STEP * level + _alone(tag, pairs)
        return
    yield _STEP * level + _opened(tag, pairs)
    for child in node.children:
        yield from _node(child, level + 1)
    yield from _commented(node.last_comments, level + 1)
    yield f"{_STEP * level}</{tag}>"


def _model(model: NodeModel) -> Iterator[str]:
    pairs = [("ID", model.id), *_pairs(model.extras)]
    if not model.ports:
        yield _STEP * 2 + _alone(model.kind, pairs)
        return
    yield _STEP * 2 + _opened(model.kind, pairs)
    yield from (_STEP * 3 + _port(port) for port in model.ports)
    yield f"{_STEP * 2}</{model.kind}>"


def _port(port: Port) -> str:
    given = (("name", port.name), ("type", port.type), ("default", port.default))
    pairs = [(name, value) for name, value in given if value is not None]
    if not port.description:
        return _alone(port.direction, pairs)
    return f"{_opened(port.direction, pairs)}{port.description.translate(_ESCAPE)}</{port.direction}>"


def _pairs(attributes: Iterable[Attribute]) -> Pairs:
    return ((attribute.name, attribute.value) for attribute in attributes)


def _commented(comments: Iterable[str], level: int) -> Iterator[str]:
    return (f"{_STEP * level}<!-- {comment} -->" for comment in comments)


def _opened(tag: str, pairs: Pairs) -> str:
    return f"<{_inside(tag, pairs)}>"


def _alone(tag: str, pairs: Pairs) -> str:
    return f"<{_inside(tag, pairs)}/>"


def _inside(tag: str, pairs: Pairs) -> str:
    return " ".join([tag, *(f'{name}="{value.translate(_ESCAPE)}"' for name, value in pairs)])
