"""Behaviour trees as values, which are compared without their places."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass


class NodeKind(StrEnum):
    """The kinds of nodes, with their names in `TreeNodesModel` and in the explicit form of a node."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


class Direction(StrEnum):
    """The direction of a port; the values are the tags of the model's elements."""

    IN = "input_port"
    OUT = "output_port"
    BOTH = "inout_port"


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribute:
    """`name="value"`.

    Attributes:
        place: the place of the attribute.
        value_place: the place of the text between the quotes.
        is_literal: whether the value is written without references such as `&lt;`.
    """

    name: str
    value: str
    place: Place = field(compare=False)
    value_place: Place = field(compare=False)
    is_literal: bool = field(compare=False, default=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeNode:
    """One node.

    Attributes:
        id: the name under which the node is registered, e.g. `Sequence`; `SubTree` for a subtree.
        kind: the kind in the explicit form, `<Action ID="..."/>`; None in the compact form.
        subtree: for a subtree, the id of its tree; otherwise None.
        name: a name that distinguishes nodes with the same id; None if the node has no name.
        ports: the ports, in the order of the file.
        conditions: the attributes such as `_skipIf` and `_onSuccess`.
        extras: other attributes that begin with `_`, which have no effect.
        comments: the comments before the node.
        last_comments: the comments after its last child.
    """

    id: str
    kind: NodeKind | None = None
    subtree: str | None = None
    name: str | None = None
    ports: tuple[Attribute, ...] = ()
    conditions: tuple[Attribute, ...] = ()
    extras: tuple[Attribute, ...] = ()
    children: tuple[TreeNode, ...] = ()
    comments: tuple[str, ...] = ()
    last_comments: tuple[str, ...] = ()
    place: Place = field(compare=False)

    def walk(self) -> Iterator[TreeNode]:
        """Yield this node and all nodes below it, parents first."""
        pending = [self]
        while pending:
            node = pending.pop()
            yield node
            pending.extend(reversed(node.children))

    @property
    def label(self) -> str:
        """Return the name of the node for people."""
        return self.name or self.subtree or self.id


@dataclass(frozen=True, slots=True, kw_only=True)
class BehaviorTree:
    """A tree with an id."""

    id: str
    root: TreeNode
    extras: tuple[Attribute, ...] = ()
    comments: tuple[str, ...] = ()
    last_comments: tuple[str, ...] = ()
    place: Place = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A port as declared in a model."""

    direction: Direction
    name: str
    type: str | None = None
    default: str | None = None
    description: str = ""
    place: Place = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeModel:
    """An entry of `TreeNodesModel`: the robot's nodes with one id, or a tree that is used as a subtree.

    Attributes:
        metadata: the attributes of each `<Metadata>`, which editors write; they have no effect.
    """

    kind: NodeKind
    id: str
    ports: tuple[Port, ...] = ()
    description: str = ""
    metadata: tuple[tuple[Attribute, ...], ...] = ()
    extras: tuple[Attribute, ...] = ()
    place: Place = field(compare=False)

    def port(self, name: str) -> Port | None:
        """Return a port by its name."""
        return next((port for port in self.ports if port.name == name), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Include:
    """`<include path="..."/>`; the path is relative to the file."""

    path: str
    place: Place = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeFile:
    """One file.

    Attributes:
        file: the path relative to the project root, with `/`.
        main: the id of the tree to start with; None if the file does not name one.
        extras: other attributes of `root`.
        last_comments: the comments after the last tree.
    """

    file: str
    main: str | None = None
    includes: tuple[Include, ...] = ()
    trees: tuple[BehaviorTree, ...] = ()
    models: tuple[NodeModel, ...] = ()
    extras: tuple[Attribute, ...] = ()
    last_comments: tuple[str, ...] = ()
    place: Place = field(compare=False)
    main_place: Place = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forest:
    """The trees of a file and of its included files, the file itself first.

    Raises:
        ValueError: if there is no file.
    """

    files: tuple[TreeFile, ...]

    def __post_init__(self) -> None:
        """Refuse a forest without files: its first file names the tree to start with."""
        if not self.files:
            raise ValueError("a forest has at least one file")

    @property
    def main(self) -> str | None:
        """Return the id of the tree to start with: the main tree of the first file, or its only tree."""
        first = self.files[0]
        if first.main is None and len(first.trees) == 1:
            return first.trees[0].id
        return first.main

    @property
    def trees(self) -> tuple[BehaviorTree, ...]:
        """Return the trees of all files."""
        return tuple(tree for file in self.files for tree in file.trees)

    @property
    def models(self) -> tuple[NodeModel, ...]:
        """Return the models of all files."""
        return tuple(model for file in self.files for model in file.models)


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedForest:
    """Trees without errors; only `check` creates one.

    Attributes:
        enums: the names that scripts and switches can use for integers, with these integers.
    """

    forest: Forest
    enums: tuple[tuple[str, int], ...]
