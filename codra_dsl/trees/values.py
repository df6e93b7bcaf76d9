"""Behaviour trees as values. Two are equal if they say the same, wherever they stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.diagnostics import Place


class NodeKind(StrEnum):
    """The kinds of node, as `TreeNodesModel` and the explicit form of a node name them."""

    ACTION = "Action"
    CONDITION = "Condition"
    CONTROL = "Control"
    DECORATOR = "Decorator"
    SUBTREE = "SubTree"


class Direction(StrEnum):
    """Which way a value goes through a port; the names are those of the model's elements."""

    IN = "input_port"
    OUT = "output_port"
    BOTH = "inout_port"


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribute:
    """`name="value"`.

    Attributes:
        place: of all of it.
        value_place: of what stands between the quotes.
        is_literal: whether the value is written as it is, without references such as `&lt;`.
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
        id: the name under which it is registered, e.g. `Sequence`; of a subtree `SubTree`.
        kind: as the explicit form says, `<Action ID="..."/>`; None of the compact form.
        subtree: of a subtree, the tree that it stands for.
        name: of this node among others of its id; None where it has none.
        ports: in the order of the file.
        conditions: the attributes such as `_skipIf` and `_onSuccess`.
        extras: further attributes that begin with `_`, which have no effect.
        comments: those before it; `last_comments` those after its last child.
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
        """Yield it and all nodes below it, each before those below it."""
        pending = [self]
        while pending:
            node = pending.pop()
            yield node
            pending.extend(reversed(node.children))

    @property
    def label(self) -> str:
        """Return what it is called for people."""
        return self.name or self.subtree or self.id


@dataclass(frozen=True, slots=True, kw_only=True)
class BehaviorTree:
    """A tree by its name."""

    id: str
    root: TreeNode
    extras: tuple[Attribute, ...] = ()
    comments: tuple[str, ...] = ()
    last_comments: tuple[str, ...] = ()
    place: Place = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Port:
    """A port as a model declares it."""

    direction: Direction
    name: str
    type: str | None = None
    default: str | None = None
    description: str = ""
    place: Place = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeModel:
    """What `TreeNodesModel` says of the robot's nodes of one id, or of a tree as a subtree."""

    kind: NodeKind
    id: str
    ports: tuple[Port, ...] = ()
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
        file: relative to the project root, with `/`.
        main: the tree with which to begin; None where the file does not say.
        extras: further attributes of `root`.
        last_comments: those after the last tree.
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
    """The trees of a file and of those that it includes, the file itself first."""

    files: tuple[TreeFile, ...]

    @property
    def main(self) -> str | None:
        """Return the tree with which to begin: the one that the first file names, or its only one."""
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
    """Trees in which `check` found no error; only it makes one.

    Attributes:
        enums: names that scripts and switches may use for whole numbers.
    """

    forest: Forest
    enums: tuple[tuple[str, int], ...]
