"""Pictures of behaviour trees: for Graphviz, for Mermaid, and as SVG. Each tree has a frame."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping

from codra_dsl.language.behavior_trees import BehaviorTree, Forest, NodeKind, TreeNode
from codra_dsl.language.behavior_trees.catalogue import BUILT_IN, POST_SCRIPTS, PRECONDITIONS
from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.report.dot import (
    MAX_QUICK_NODES,
    DrawingError,
    attributes_text,
    digraph,
    draw_dot,
    label_text,
    quote,
    width_text,
)
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.mermaid import escape_label

_MAX_LINE_LENGTH = 60
_SHAPES: Mapping[NodeKind, tuple[str, str, tuple[str, str]]] = {
    NodeKind.CONTROL: ("box", "#dbe7f5", ("[", "]")),
    NodeKind.DECORATOR: ("hexagon", "#efe3f5", ("{{", "}}")),
    NodeKind.SUBTREE: ("box", "#eeeeee", ("[[", "]]")),
    NodeKind.CONDITION: ("ellipse", "#fdf3d0", ("([", "])")),
    NodeKind.ACTION: ("box", "#e0f0d9", ("(", ")")),
}
"""For each kind of node: the shape and the colour in Graphviz, and the brackets in Mermaid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Box:
    """The drawing of one node, with its number in the picture."""

    number: int
    node: TreeNode
    kind: NodeKind
    child_numbers: tuple[int, ...]

    @property
    def lines(self) -> Iterator[str]:
        """Yield the lines of the label: the name, the id if the name is another one, and the conditions."""
        yield _shorten(self.node.label)
        if self.node.label not in (self.node.id, self.node.subtree):
            yield _shorten(self.node.subtree or self.node.id)
        for attribute in self.node.conditions:
            if attribute.name in PRECONDITIONS or attribute.name in POST_SCRIPTS:
                yield _shorten(f"{attribute.name[1:]}: {attribute.value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class TreePicture:
    """The trees of a forest that are drawn, each with its nodes, the root first."""

    _boxes: tuple[tuple[BehaviorTree, tuple[_Box, ...]], ...]

    def dot(self) -> str:
        """Return the picture in Graphviz's language."""
        lines: list[str] = ['graph [ordering="out"];']
        for number, (tree, boxes) in enumerate(self._boxes):
            lines.append(f"subgraph {quote(f'cluster {number}')} {{")
            lines.append(f"  graph {attributes_text({'label': label_text(_shorten(tree.id)), 'style': 'rounded'})};")
            for box in boxes:
                shape, colour, _ = _SHAPES[box.kind]
                label = label_text("\n".join(box.lines))
                look = {"label": label, "shape": shape, "style": "filled", "fillcolor": colour}
                look |= {"width": width_text(label, shape), "class": box.kind.value.lower()}
                lines.append(f"  n{box.number} {attributes_text(look)};")
            lines += (f"  n{box.number} -> n{child};" for box in boxes for child in box.child_numbers)
            lines.append("}")
        lines += (f'n{source} -> n{target} [style="dashed", constraint="false"];' for source, target in self._uses())
        return digraph(lines, "TB")

    def mermaid(self) -> str:
        """Return the picture as a Mermaid flowchart."""
        lines = ["flowchart TB"]
        for number, (tree, boxes) in enumerate(self._boxes):
            lines.append(f'  subgraph t{number}["{escape_label(_shorten(tree.id))}"]')
            for box in boxes:
                opening, closing = _SHAPES[box.kind][2]
                label = "<br/>".join(map(escape_label, box.lines))
                lines.append(f'    n{box.number}{opening}"{label}"{closing}')
            lines += (f"    n{box.number} --> n{child}" for box in boxes for child in box.child_numbers)
            lines.append("  end")
        lines += (f"  n{source} -.-> n{target}" for source, target in self._uses())
        return "\n".join(lines) + "\n"

    def svg(self) -> str:
        """Return the drawing.

        Raises:
            DrawingError: if there are too many nodes, or Graphviz is not installed or cannot draw.
        """
        node_count = sum(len(boxes) for _, boxes in self._boxes)
        if node_count > MAX_QUICK_NODES:
            message = f"{node_count:,} nodes are too many for a drawing (limit {MAX_QUICK_NODES:,})"
            raise DrawingError(f"{message}: choose trees with --tree, or --format dot")
        return draw_dot(self.dot())

    def _uses(self) -> Iterator[tuple[int, int]]:
        """Yield the number of each subtree node, and the number of the root of its tree."""
        roots = {tree.id: boxes[0].number for tree, boxes in self._boxes}
        for _, boxes in self._boxes:
            yield from ((box.number, roots[box.node.subtree]) for box in boxes if box.node.subtree in roots)


def picture_of(forests: Iterable[Forest], tree_ids: Collection[str] = ()) -> TreePicture:
    """Return the picture of the trees with some ids, or of all trees if no ids are given; each tree is drawn once."""
    forests = list(forests)
    models = (model for forest in forests for model in forest.models if model.kind is not NodeKind.SUBTREE)
    kinds = {model.id: model.kind for model in models}
    trees = {tree.place: tree for forest in forests for tree in forest.trees}
    drawn: list[tuple[BehaviorTree, tuple[_Box, ...]]] = []
    first_number = 0
    for tree in trees.values():
        if tree_ids and tree.id not in tree_ids:
            continue
        nodes = list(tree.root.walk())
        number_by_identity = {id(node): number for number, node in enumerate(nodes, start=first_number)}
        boxes = (
            _Box(
                number=number_by_identity[id(node)],
                node=node,
                kind=_kind_of(node, kinds),
                child_numbers=tuple(number_by_identity[id(child)] for child in node.children),
            )
            for node in nodes
        )
        drawn.append((tree, tuple(boxes)))
        first_number += len(nodes)
    return TreePicture(_boxes=tuple(drawn))


def _kind_of(node: TreeNode, kinds: Mapping[str, NodeKind]) -> NodeKind:
    """Return the kind of a node. The number of children decides about a node without a declaration."""
    if node.subtree is not None:
        return NodeKind.SUBTREE
    by_children = (NodeKind.ACTION, NodeKind.DECORATOR, NodeKind.CONTROL)[min(len(node.children), 2)]
    built_in = BUILT_IN.get(node.id)
    return built_in.kind if built_in is not None else node.kind or kinds.get(node.id, by_children)


def _shorten(text: str) -> str:
    text = visible_text(text)
    return text if len(text) <= _MAX_LINE_LENGTH else f"{text[: _MAX_LINE_LENGTH - 1]}…"
