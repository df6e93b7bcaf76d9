"""Check well-formed trees. One run reports all findings, and only `check` creates a CheckedForest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import chain

from codra_dsl.language.behavior_trees.catalogue import (
    AUTOREMAP,
    BUILT_IN,
    EDITOR_ATTRIBUTES,
    POST_SCRIPTS,
    PRECONDITIONS,
    REFUSED_NODES,
    BuiltIn,
    BuiltInPort,
    PortContent,
)
from codra_dsl.language.behavior_trees.entries import entries_of_node
from codra_dsl.language.behavior_trees.library import report_what_library_refuses
from codra_dsl.language.behavior_trees.port_contents import (
    accepts_any_value,
    is_valid_content,
    is_value_of,
    type_family,
)
from codra_dsl.language.behavior_trees.ports import EntryKey, is_key, parse_port_value
from codra_dsl.language.behavior_trees.rules import TreeFindings
from codra_dsl.language.behavior_trees.scripts import ScriptProblem, parse_condition, parse_script
from codra_dsl.language.behavior_trees.values import (
    Attribute,
    BehaviorTree,
    CheckedForest,
    Direction,
    Forest,
    NodeKind,
    NodeModel,
    TreeNode,
)
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, has_errors, in_file_order, is_slip
from codra_dsl.language.graph import Needs, shortest_cycle, strong_components

MAX_NODES = 10_000
"""The maximum number of nodes in a tree; the nodes of a subtree count once for each use of the subtree."""

MAX_LEVELS = 100
"""The maximum number of levels in a tree, with its subtrees."""

_CHILD_COUNTS: Mapping[NodeKind | None, tuple[int, int | None]] = {
    NodeKind.ACTION: (0, 0),
    NodeKind.CONDITION: (0, 0),
    NodeKind.DECORATOR: (1, 1),
    NodeKind.CONTROL: (1, None),
    None: (0, None),
}
"""The minimum and the maximum number of children by the kind of a node; None is a node without a declaration."""


def check(
    forest: Forest, enums: Mapping[str, int] | None = None
) -> tuple[CheckedForest | None, tuple[Diagnostic, ...]]:
    """Return the trees, or None if they cannot be compiled; and all findings.

    Args:
        forest: the trees as they were read.
        enums: the names that scripts and switches can use for integers, with these integers.
    """
    findings = TreeFindings()
    checker = _Checker(forest, findings)
    checker.check_names()
    report_what_library_refuses(forest, findings)
    for tree in forest.trees:
        for node in tree.root.walk():
            checker.check_node(node, tree)
        checker.check_types(tree)
    checker.check_sizes()
    ordered_findings = in_file_order(findings.all())
    values = tuple(sorted((enums or {}).items()))
    return (None if has_errors(ordered_findings) else CheckedForest(forest=forest, enums=values)), ordered_findings


class _Checker:
    """Checks one forest."""

    def __init__(self, forest: Forest, findings: TreeFindings) -> None:
        self._forest = forest
        self._findings = findings
        self._trees = {tree.id: tree for tree in reversed(forest.trees)}
        self._models = {(model.kind is NodeKind.SUBTREE, model.id): model for model in reversed(forest.models)}
        self._names = [*BUILT_IN, *(name for of_subtree, name in self._models if not of_subtree)]
        self._entries: dict[str, frozenset[str]] = {}
        self._undeclared: set[str] = set()

    # The complete forest

    def check_names(self) -> None:
        """Check that ids of trees and models are unique, and that the main tree exists."""
        self._check_unique("tree", ((tree.id, tree.place) for tree in self._forest.trees))
        for tree in self._forest.trees:
            if tree.id in self._names:
                self._findings.add(
                    "duplicate-tree",
                    f"the tree '{tree.id}' has the name of a node",
                    tree.place,
                    help="rename the tree: the library distinguishes trees and nodes by their names",
                )
        models = self._forest.models
        self._check_unique("model", ((f"{model.kind} {model.id}", model.place) for model in models))
        first = self._forest.files[0]
        if not self._forest.trees:
            self._findings.add(
                "no-tree-file", "the file has no trees", first.place, help='write <BehaviorTree ID="...">'
            )
        if first.main is not None and first.main not in self._trees:
            help_text = self._findings.name_help(first.main, self._trees, "name one of the trees")
            self._findings.add("unknown-subtree", f"there is no tree '{first.main}'", first.main_place, help=help_text)

    def _check_unique(self, noun: str, names_and_places: Iterable[tuple[str, Place]]) -> None:
        first_places: dict[str, Place] = {}
        for name, place in names_and_places:
            first_place = first_places.setdefault(name, place)
            if first_place is not place:
                self._findings.add(
                    "duplicate-tree",
                    f"there is already a {noun} '{name}'",
                    place,
                    help="rename or remove one of the two",
                    related=[Related("the first one", first_place)],
                )

    def check_sizes(self) -> None:
        """Check that no tree contains itself, and that no tree is too large with its subtrees."""
        uses = {name: _nodes_by_subtree(tree, self._trees) for name, tree in self._trees.items()}
        needs: Needs = {name: tuple(subtree_nodes) for name, subtree_nodes in uses.items()}
        if strong_components(needs):
            cycle = shortest_cycle(needs)
            node = uses[cycle[0]][cycle[1 % len(cycle)]]
            path = " -> ".join([*cycle, cycle[0]])
            help_text = "a tree cannot contain itself: repeat with Repeat or KeepRunningUntilFailure"
            self._findings.add("subtree-recursion", f"subtrees form a cycle: {path}", node.place, help=help_text)
            return
        sizes: dict[str, tuple[int, int]] = {}
        for name in _order_leaves_first(needs):
            sizes[name] = nodes, levels = _size(self._trees[name].root, sizes)
            if nodes > MAX_NODES or levels > MAX_LEVELS:
                self._findings.add(
                    "too-many-tree-nodes",
                    f"with its subtrees the tree '{name}' has {nodes:,} nodes on {levels} levels",
                    self._trees[name].place,
                    help=f"at most {MAX_NODES:,} nodes on {MAX_LEVELS} levels are allowed",
                )
                return

    # One node

    def check_node(self, node: TreeNode, tree: BehaviorTree) -> None:
        """Check one node."""
        path = f"{tree.id}.{node.label}"
        self._check_scripts(node, path)
        self._check_extras(node, path)
        if node.id in REFUSED_NODES and (False, node.id) not in self._models:
            message = f"'{node.id}' is not supported"
            self._findings.add("unsupported-tree-node", message, node.place, help=REFUSED_NODES[node.id], path=path)
        elif node.subtree is not None:
            self._check_child_count(node, 0, 0, path)
            self._check_subtree(node, path)
        elif node.id in BUILT_IN and node.id != "SubTree":
            built_in = BUILT_IN[node.id]
            self._check_child_count(node, built_in.min_children, built_in.max_children, path)
            self._check_ports(node, [port.name for port in built_in.ports], path)
            self._check_built_in(node, built_in, path)
        else:
            self._check_robot_node(node, path)

    def _check_robot_node(self, node: TreeNode, path: str) -> None:
        model = self._models.get((False, node.id))
        kind = node.kind if model is None else model.kind
        if kind is None and not self._check_undeclared_node(node, path):
            return
        self._check_child_count(node, *_CHILD_COUNTS[kind], path)
        if model is None:
            for attribute in node.ports:
                self._read_port(attribute, path)
            return
        self._check_declared_ports(node, model, path)

    def _check_undeclared_node(self, node: TreeNode, path: str) -> bool:
        """Return whether a node can be a node of the robot: it is neither a tree nor a misspelt built-in node.

        The declarations in `TreeNodesModel` are for editors. A library finds the nodes in the robot's program.
        """
        message = f"unknown node '{node.id}'"
        if node.id in self._trees:
            help_text = f'write <SubTree ID="{node.id}"/>'
            self._findings.add("unknown-tree-node", message, node.place, help=help_text, path=path)
            return False
        suggestion = self._findings.suggestion(node.id, self._names)
        if suggestion is not None and suggestion in BUILT_IN and is_slip(node.id, suggestion):
            help_text = f"did you mean '{suggestion}'?"
            self._findings.add("unknown-tree-node", message, node.place, help=help_text, path=path)
            return False
        if node.id not in self._undeclared:
            self._undeclared.add(node.id)
            kind = "Action" if not node.children else "Decorator" if len(node.children) == 1 else "Control"
            self._findings.add(
                "undeclared-tree-node",
                f"the node '{node.id}' is not declared, so its ports are not checked",
                node.place,
                help=f"did you mean '{suggestion}'?"
                if suggestion
                else f'add <{kind} ID="{node.id}"> with its ports to <TreeNodesModel>, or use --models FILE',
                path=path,
            )
        return True

    def _check_declared_ports(self, node: TreeNode, model: NodeModel, path: str) -> None:
        self._check_ports(node, [port.name for port in model.ports], path, is_built_in=False)
        attributes = {attribute.name for attribute in node.ports}
        unset_names = [
            port.name
            for port in model.ports
            if port.direction is not Direction.OUT and port.default is None and port.name not in attributes
        ]
        if unset_names:
            names_text = ", ".join(f"'{name}'" for name in unset_names)
            self._findings.add(
                "port-without-value",
                f"'{node.id}' has no value for {names_text}",
                node.place,
                help=f'write {unset_names[0]}="...", or add default="..." to the port in <TreeNodesModel>',
                path=path,
            )
        for attribute in node.ports:
            port_model = model.port(attribute.name)
            port_value = self._read_port(attribute, path)
            if port_model is not None and isinstance(port_value, str):
                self._check_declared_port(attribute, port_model.direction, port_model.type, path)

    def _check_declared_port(self, attribute: Attribute, direction: Direction, type_: str | None, path: str) -> None:
        """Check a text that is given to a port with a declared direction and type."""
        if direction is not Direction.IN:
            name = attribute.value if is_key(attribute.value) else "entry"
            self._report_unfit_value(attribute, "an entry, since the node writes it", f"write {{{name}}}", path)
        elif not is_value_of(type_, attribute.value):
            self._report_unfit_value(attribute, f"a value of the type {type_}", "write one, or an entry {name}", path)

    def _check_child_count(self, node: TreeNode, min_count: int, max_count: int | None, path: str) -> None:
        count = len(node.children)
        if min_count <= count and (max_count is None or count <= max_count):
            return
        limit_text = f"{min_count} or more" if max_count is None else f"{min_count} to {max_count}"
        expected_text = f"{min_count}" if min_count == max_count else limit_text
        message = f"'{node.id}' has {count or 'no'} {'child' if count == 1 else 'children'}, not {expected_text}"
        is_decorator = min_count == max_count == 1
        help_text = "put them below one node, e.g. <Sequence>" if is_decorator else "add or remove nodes below it"
        if max_count == 0:
            help_text = "close the element at once: <.../>"
        self._findings.add("wrong-children", message, node.place, help=help_text, path=path)

    def _check_ports(self, node: TreeNode, port_names: Sequence[str], path: str, *, is_built_in: bool = True) -> None:
        for attribute in node.ports:
            if attribute.name in port_names:
                continue
            names = [*port_names, *PRECONDITIONS, *POST_SCRIPTS]
            port_list = f"its ports are {', '.join(port_names)}" if port_names else "it has none"
            suggestion = self._findings.suggestion(attribute.name, names)
            is_misspelt = suggestion is not None and is_slip(attribute.name, suggestion)
            self._findings.add(
                "unknown-port" if is_built_in or is_misspelt else "undeclared-port",
                f"'{node.id}' has no port '{attribute.name}'",
                attribute.place,
                help=f"did you mean '{suggestion}'?" if suggestion else port_list,
                path=path,
            )

    def _report_missing_port(self, node: TreeNode, port: str, path: str) -> None:
        message = f"'{node.id}' needs its port '{port}'"
        self._findings.add(
            "missing-port", message, node.place, help=f'write {port}="..." or {port}="{{entry}}"', path=path
        )

    def _check_extras(self, node: TreeNode, path: str) -> None:
        conditions = [*PRECONDITIONS, *POST_SCRIPTS, AUTOREMAP]
        for attribute in node.extras:
            help_text = self._findings.name_help(attribute.name, conditions, "")
            if help_text:
                message = f"unknown condition '{attribute.name}'"
                self._findings.add("unknown-port", message, attribute.place, help=help_text, path=path)
            elif attribute.name not in EDITOR_ATTRIBUTES:
                message = f"'{attribute.name}' has no effect"
                help_text = "remove it; codra does not remove it when it writes the file"
                self._findings.add("attribute-without-effect", message, attribute.place, help=help_text, path=path)

    # Values

    def _read_port(self, attribute: Attribute, path: str) -> EntryKey | str | None:
        port_value = parse_port_value(attribute.name, attribute.value)
        if port_value is None:
            self._report_unfit_value(attribute, "a text or an entry", "write {name}: letters, digits and _", path)
        return port_value

    def _report_unfit_value(self, attribute: Attribute, expected_text: str, help_text: str, path: str) -> None:
        message = f"'{attribute.name}' is {attribute.value[:60]!r}, not {expected_text}"
        self._findings.add("port-value", message, attribute.value_place, help=help_text, path=path)

    def _check_built_in(self, node: TreeNode, built_in: BuiltIn, path: str) -> None:
        attributes = {attribute.name: attribute for attribute in node.ports}
        port_names = {port.name for port in built_in.ports}
        for port in built_in.ports:
            attribute = attributes.get(port.name)
            if attribute is not None:
                self._check_port_content(attribute, port, node, path)
            elif port.default is None and not any(is_slip(name, port.name) for name in attributes.keys() - port_names):
                self._report_missing_port(node, port.name, path)

    def _check_port_content(self, attribute: Attribute, port: BuiltInPort, node: TreeNode, path: str) -> None:
        if port.content is PortContent.CONDITION:
            self._check_script(attribute, parse_condition(attribute.value), path)
            return
        if port.content is PortContent.SCRIPT:
            self._check_script(attribute, parse_script(attribute.value), path)
            return
        port_value = self._read_port(attribute, path)
        if port_value is None:
            return
        if isinstance(port_value, EntryKey):
            if port.content is PortContent.KEY:
                self._report_unfit_value(attribute, port.content, f"write {port_value.key}", path)
        elif not is_valid_content(port.content, port_value):
            self._report_unfit_value(attribute, port.content, "correct it", path)
        elif port.name.endswith(("_count", "_failures")) and int(port_value) > len(node.children):
            self._report_unfit_value(
                attribute, f"at most {len(node.children)}, the number of children", "correct it", path
            )

    def _check_scripts(self, node: TreeNode, path: str) -> None:
        for attribute in node.conditions:
            parse = parse_condition if attribute.name in PRECONDITIONS else parse_script
            self._check_script(attribute, parse(attribute.value), path)

    def _check_script(self, attribute: Attribute, script: object, path: str) -> None:
        if not isinstance(script, ScriptProblem):
            return
        place = attribute.value_place
        if attribute.is_literal and place.span.line == place.span.end_line:
            span = place.span
            begin = span.column + script.start
            end = max(span.column + script.end, begin + 1)
            place = Place(type(span)(span.file, span.line, begin, span.line, end))
        self._findings.add(script.rule, f"{attribute.name}: {script.message}", place, help=script.help, path=path)

    # Subtrees

    def _check_subtree(self, node: TreeNode, path: str) -> None:
        tree = self._trees.get(str(node.subtree))
        if tree is None:
            help_text = self._findings.name_help(
                str(node.subtree),
                self._trees,
                "write the tree, include the file that has it, or check the folder of both files with codra trees",
            )
            message = f"there is no tree '{node.subtree}'"
            self._findings.add("unknown-subtree", message, node.place, help=help_text, path=path)
            return
        model = self._models.get((True, tree.id))
        remappings = [attribute for attribute in node.ports if attribute.name != AUTOREMAP]
        for attribute in node.ports:
            if attribute.name == AUTOREMAP and not is_valid_content(PortContent.TRUTH, attribute.value):
                self._report_unfit_value(attribute, PortContent.TRUTH, "correct it", path)
        for attribute in remappings:
            self._read_port(attribute, path)
        if model is not None:
            self._check_subtree_ports(node, model, remappings, path)
            return
        entries = self._entries.get(tree.id)
        if entries is None:
            names = (
                entries_of_node(tree_node, self._models.get((False, tree_node.id))) for tree_node in tree.root.walk()
            )
            entries = self._entries[tree.id] = frozenset(chain.from_iterable(names))
        for attribute in remappings:
            if attribute.name not in entries:
                help_text = self._findings.name_help(attribute.name, entries, "remove it, or use the entry in the tree")
                message = f"the tree '{tree.id}' does not use the entry '{attribute.name}'"
                self._findings.add("unused-remap", message, attribute.place, help=help_text, path=path)

    def _check_subtree_ports(self, node: TreeNode, model: NodeModel, remappings: list[Attribute], path: str) -> None:
        port_names = [port.name for port in model.ports]
        attributes = {attribute.name: attribute for attribute in remappings}
        for name, attribute in attributes.items():
            if name not in port_names:
                help_text = self._findings.name_help(
                    name, port_names, f"its ports are {', '.join(port_names) or 'none'}"
                )
                message = f"the tree '{model.id}' has no port '{name}'"
                self._findings.add("unused-remap", message, attribute.place, help=help_text, path=path)
        is_autoremap = any(attribute.name == AUTOREMAP and attribute.value in ("true", "1") for attribute in node.ports)
        for port in model.ports:
            if port.name not in attributes and port.default is None and not is_autoremap:
                self._report_missing_port(node, port.name, path)
            is_text = port.name in attributes and isinstance(
                parse_port_value(port.name, attributes[port.name].value), str
            )
            if is_text and port.direction is Direction.OUT:
                self._check_declared_port(attributes[port.name], port.direction, port.type, path)

    # Entries

    def check_types(self, tree: BehaviorTree) -> None:
        """Check that each entry of a tree has the same type in all ports of the robot's nodes that read or write it."""
        first_types: dict[str, tuple[str, Place]] = {}
        for node in tree.root.walk():
            model = self._models.get((False, node.id))
            for attribute in node.ports if model is not None else ():
                port = model.port(attribute.name) if model is not None else None
                port_value = parse_port_value(attribute.name, attribute.value)
                if port is None or not isinstance(port_value, EntryKey) or accepts_any_value(port.type):
                    continue
                type_, place = first_types.setdefault(port_value.key, (str(port.type), attribute.place))
                if type_family(type_) != type_family(str(port.type)):
                    self._findings.add(
                        "entry-types-differ",
                        f"the entry '{port_value.key}' is {port.type} here, and {type_} elsewhere",
                        attribute.place,
                        help="use two entries, or correct the types in TreeNodesModel",
                        related=[Related(f"{type_} here", place)],
                        path=f"{tree.id}.{node.label}",
                    )


def _nodes_by_subtree(tree: BehaviorTree, trees: Mapping[str, BehaviorTree]) -> dict[str, TreeNode]:
    """Return the subtrees of a tree, each with the first node that uses it."""
    uses: dict[str, TreeNode] = {}
    for node in tree.root.walk():
        if node.subtree is not None and node.subtree in trees:
            uses.setdefault(node.subtree, node)
    return uses


def _order_leaves_first(needs: Needs) -> list[str]:
    """Return all names, each of them after the names that it needs; there must be no cycle."""
    ordered_names: dict[str, None] = {}
    pending = [(name, False) for name in reversed(list(needs))]
    while pending:
        name, are_needs_ordered = pending.pop()
        if name in ordered_names:
            continue
        if are_needs_ordered:
            ordered_names[name] = None
            continue
        pending.append((name, True))
        pending.extend((other, False) for other in needs[name] if other not in ordered_names)
    return list(ordered_names)


def _size(root: TreeNode, sizes: Mapping[str, tuple[int, int]]) -> tuple[int, int]:
    """Return the number of nodes and the number of levels in a tree with its subtrees."""
    nodes = levels = 0
    pending = [(root, 1)]
    while pending:
        node, level = pending.pop()
        inner_nodes, inner_levels = sizes.get(node.subtree or "", (0, 0))
        nodes += 1 + inner_nodes
        levels = max(levels, level + inner_levels)
        pending.extend((child, level + 1) for child in node.children)
    return nodes, levels
