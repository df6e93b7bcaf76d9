"""Write tree values as XML, which Groot2 opens. Reading this XML again gives equal values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.language.behavior_trees.reader import FORMAT
from codra_dsl.language.behavior_trees.values import Attribute, BehaviorTree, NodeModel, Port, TreeFile, TreeNode

_INDENT = "  "
_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
_ESCAPE = str.maketrans(_ESCAPES)
Pairs = Iterable[tuple[str, str]]


def write(file: TreeFile) -> str:
    """Return a file as XML: its includes, its trees, then its models."""
    main = [] if file.main is None else [("main_tree_to_execute", file.main)]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        _start_tag("root", [("BTCPP_format", FORMAT), *main, *_name_value_pairs(file.extras)]),
        *(f"{_INDENT}{_empty_element('include', [('path', include.path)])}" for include in file.includes),
    ]
    for tree in file.trees:
        lines += [*_comment_lines(tree.comments, 1), *_tree(tree)]
    if file.models:
        lines += [f"{_INDENT}<TreeNodesModel>", *(line for model in file.models for line in _model(model))]
        lines.append(f"{_INDENT}</TreeNodesModel>")
    lines += [*_comment_lines(file.last_comments, 1), "</root>"]
    return "\n".join(lines) + "\n"


def _tree(tree: BehaviorTree) -> Iterator[str]:
    yield _INDENT + _start_tag("BehaviorTree", [("ID", tree.id), *_name_value_pairs(tree.extras)])
    yield from _node(tree.root, 2)
    yield from _comment_lines(tree.last_comments, 2)
    yield f"{_INDENT}</BehaviorTree>"


def _node(node: TreeNode, level: int) -> Iterator[str]:
    yield from _comment_lines(node.comments, level)
    tag = node.id if node.kind is None else node.kind.value
    node_id = node.subtree if node.subtree is not None else node.id if node.kind is not None else None
    pairs = [
        *([] if node_id is None else [("ID", node_id)]),
        *([] if node.name is None else [("name", node.name)]),
        *_name_value_pairs((*node.ports, *node.conditions, *node.extras)),
    ]
    if not node.children and not node.last_comments:
        yield _INDENT * level + _empty_element(tag, pairs)
        return
    yield _INDENT * level + _start_tag(tag, pairs)
    for child in node.children:
        yield from _node(child, level + 1)
    yield from _comment_lines(node.last_comments, level + 1)
    yield f"{_INDENT * level}</{tag}>"


def _model(model: NodeModel) -> Iterator[str]:
    pairs = [("ID", model.id), *_name_value_pairs(model.extras)]
    if not (model.ports or model.description or model.metadata):
        yield _INDENT * 2 + _empty_element(model.kind, pairs)
        return
    yield _INDENT * 2 + _start_tag(model.kind, pairs)
    if model.metadata:
        fields = (f"{_INDENT * 4}{_empty_element('Metadata', _name_value_pairs(field))}" for field in model.metadata)
        yield from (f"{_INDENT * 3}<MetadataFields>", *fields, f"{_INDENT * 3}</MetadataFields>")
    if model.description:
        yield f"{_INDENT * 3}<description>{model.description.translate(_ESCAPE)}</description>"
    yield from (_INDENT * 3 + _port(port) for port in model.ports)
    yield f"{_INDENT * 2}</{model.kind}>"


def _port(port: Port) -> str:
    port_attributes = (("name", port.name), ("type", port.type), ("default", port.default))
    pairs = [(name, value) for name, value in port_attributes if value is not None]
    if not port.description:
        return _empty_element(port.direction, pairs)
    return f"{_start_tag(port.direction, pairs)}{port.description.translate(_ESCAPE)}</{port.direction}>"


def _name_value_pairs(attributes: Iterable[Attribute]) -> Pairs:
    return ((attribute.name, attribute.value) for attribute in attributes)


def _comment_lines(comments: Iterable[str], level: int) -> Iterator[str]:
    return (f"{_INDENT * level}<!-- {comment} -->" for comment in comments)


def _start_tag(tag: str, pairs: Pairs) -> str:
    return f"<{_tag_content(tag, pairs)}>"


def _empty_element(tag: str, pairs: Pairs) -> str:
    return f"<{_tag_content(tag, pairs)}/>"


def _tag_content(tag: str, pairs: Pairs) -> str:
    return " ".join([tag, *(f'{name}="{value.translate(_ESCAPE)}"' for name, value in pairs)])
