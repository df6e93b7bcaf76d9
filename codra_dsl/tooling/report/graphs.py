"""The dependency graph of compiled specs as one value, and as JSON. Other modules of this package draw the graph.

In JSON and for Graphviz, an edge reads as a sentence. A skill decides on a variable; an observer runs an algorithm; an
algorithm requires one variable and identifies another. In pictures, arrows follow the flow of knowledge, from left to
right: from the variables that perception needs, through the variables that it identifies, to the decisions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from codra_dsl.generation.build_plan import BuildPlan, EdgeKind, Node, NodeKind
from codra_dsl.generation.build_plan.names import entry_names, module_name
from codra_dsl.generation.emit.graph_nodes import node_id
from codra_dsl.generation.emit.records import graph_nodes, list_json, object_json, places
from codra_dsl.language.check.latency import worst_cases
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model.knowledge import CONTEXT_NODE
from codra_dsl.tooling.selection import Choice, Choices


@dataclass(frozen=True, slots=True, kw_only=True)
class Element:
    """A node of the graph.

    Attributes:
        label: the name for people.
        spec: the name of the spec.
        group: the name of the generated module that has the element. The module is named after the use of a template or
            the file that declares the element.
        use: the use of a template that created the element; empty if no template created it.
        template: the name of this template; or empty.
        owner: the node of the knowledge graph that has the variable (`of`), or the phase of an agent; or empty.
        observer: the id of the observer that identifies or runs the element; for an observer, its own id; or empty.
        json_entry: the element's entry in `graph.json`.
        description: the description of a variable.
        worst_case_s: the longest time from declared to known, for a variable that observers identify.
        members: the elements that this element represents, if it is folded; see `folding`.
        lines: what a picture writes below the label of a folded element.
    """

    id: str
    kind: NodeKind
    name: str
    label: str
    spec: str
    group: str
    use: str
    template: str = ""
    owner: str = ""
    observer: str
    json_entry: Mapping[str, object]
    file: str
    line: int
    description: str = ""
    worst_case_s: float | None = None
    members: tuple[Element, ...] = ()
    lines: tuple[str, ...] = ()

    @property
    def is_given(self) -> bool:
        """Return whether the element is a variable that no observer identifies."""
        return self.kind is NodeKind.CONTEXT and not self.observer


@dataclass(frozen=True, slots=True)
class Link:
    """An edge of the graph. It reads as a sentence: `source kind target`."""

    source: str
    target: str
    kind: EdgeKind

    @property
    def flow(self) -> tuple[str, str]:
        """Return the needed element, then the element that needs it. Arrows in pictures have this direction."""
        return (self.target, self.source) if self.kind in _KINDS_AGAINST_FLOW else (self.source, self.target)


_KINDS_AGAINST_FLOW = frozenset(
    {
        EdgeKind.REQUIRES,
        EdgeKind.DECIDES_ON,
        EdgeKind.FEEDBACK,
        EdgeKind.READS,
        EdgeKind.EXECUTES,
        EdgeKind.LEADS_FROM,
        EdgeKind.WEIGHS,
    }
)
"""The kinds of edges that lead to the needed element. In pictures, their arrows have the opposite direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """The dependency graph of some specs.

    Attributes:
        specs: the names of the specs.
        unneeded_names: names that are declared, but are not elements because no decision needs them.
    """

    specs: tuple[str, ...]
    elements: tuple[Element, ...]
    links: tuple[Link, ...]
    unneeded_names: frozenset[str] = frozenset()

    def select_part(self, ids: Collection[str]) -> Graph:
        """Return the part of the graph with some elements, given by their ids, and all links between these elements."""
        return replace(
            self,
            elements=tuple(element for element in self.elements if element.id in ids),
            links=tuple(link for link in self.links if link.source in ids and link.target in ids),
        )

    def choices(self) -> Choices:
        """Return the nodes that selectors can match."""
        nodes = (
            Choice(
                id=element.id,
                name=element.name,
                kind=element.kind,
                label=element.label,
                file=element.file,
                use=element.use,
            )
            for element in self.elements
        )
        kinds = tuple(kind.value for kind in NodeKind)
        return Choices(
            nodes=tuple(nodes),
            edges=[link.flow for link in self.links],
            kinds=kinds,
            unneeded_names=self.unneeded_names,
        )


def graph_of(plans: Sequence[BuildPlan]) -> Graph:
    """Return the dependency graph of some plans. Elements are in the order of the plans, and then of their kinds."""
    elements = tuple(element for plan in plans for element in _elements(plan))
    links = (
        Link(node_id(plan, edge.source), node_id(plan, edge.target), edge.kind) for plan in plans for edge in plan.edges
    )
    declared_names = frozenset(name for plan in plans for name in (*plan.checked.variables, *plan.checked.algorithms))
    return Graph(
        specs=tuple(plan.name for plan in plans),
        elements=elements,
        links=tuple(links),
        unneeded_names=declared_names - {element.name for element in elements},
    )


def render_json(graph: Graph) -> str:
    """Return the graph with the place of each node in the spec, and the worst case of each variable."""
    edges = ({"source": link.source, "target": link.target, "kind": link.kind.value} for link in graph.links)
    return object_json(nodes=list_json(map(_node_object, graph.elements)), edges=list_json(edges))


def _node_object(element: Element) -> dict[str, object]:
    latency = {"worst_case_s": element.worst_case_s} if element.kind is NodeKind.CONTEXT else {}
    place = {"file": element.file, "line": element.line}
    return {"id": element.id, "kind": element.kind.value, **element.json_entry, **latency, **place}


def _elements(plan: BuildPlan) -> Iterator[Element]:
    place_by_id, worst_cases_s = dict(places(plan)), worst_cases(plan.checked)
    groups, uses = _groups(plan)
    observers = _observers(plan)
    for node, json_entry in graph_nodes(plan):
        element_id = node_id(plan, node)
        span = place_by_id[element_id].span
        is_variable = node.kind is NodeKind.CONTEXT
        yield Element(
            id=element_id,
            kind=node.kind,
            name=node.name,
            label=str(json_entry["label"]),
            spec=plan.name,
            group=groups[node],
            use=uses.get(groups[node], ("", ""))[0],
            template=uses.get(groups[node], ("", ""))[1],
            owner=_owner(plan, node, json_entry),
            observer=observers.get(node, ""),
            json_entry=json_entry,
            file=span.file,
            line=span.line,
            description=plan.checked.variables[node.name].description if is_variable else "",
            worst_case_s=worst_cases_s.get(node.name) if is_variable else None,
        )


def _owner(plan: BuildPlan, node: Node, json_entry: Mapping[str, object]) -> str:
    if node.kind is not NodeKind.CONTEXT:
        return str(json_entry.get("phase", ""))
    owner = plan.checked.variables[node.name].node
    return "" if owner == CONTEXT_NODE else owner


def _groups(plan: BuildPlan) -> tuple[Mapping[Node, str], Mapping[str, tuple[str, str]]]:
    """Return a mapping from nodes to modules, and from the modules of template uses to these uses and templates."""
    trees = {tree.name: tree for tree in plan.forest}
    groups: dict[Node, str] = {}
    for module in plan.modules:
        module_trees = [trees[name] for name in module.trees]
        nodes = [Node(NodeKind.CONTEXT, name) for name in module.variables]
        nodes += [Node(NodeKind.OBSERVER, tree.name) for tree in module_trees]
        nodes += [Node(NodeKind.PERCEPTION, branch.name) for tree in module_trees for branch in tree.branches]
        nodes += [Node(NodeKind.SKILL, name) for name in module.skills]
        groups |= dict.fromkeys(nodes, module.name)
    taken_names = entry_names(plan.checked.spec)
    for node, _ in graph_nodes(plan):
        if node not in groups:  # a node of knowledge or of loops: these have other modules
            groups[node] = module_name(_origin(plan, node), taken_names)
    return groups, {
        module.name: (module.use.instance, module.use.template) for module in plan.modules if module.use is not None
    }


_SECTIONS = {
    NodeKind.CONTEXT: "context",
    NodeKind.AGENT: "agents",
    NodeKind.TYPE: "types",
    NodeKind.EDGE: "edges",
    NodeKind.TASK: "tasks",
    NodeKind.METRIC: "metrics",
    NodeKind.ACTION: "actions",
    NodeKind.ADAPTATION: "adaptation",
    NodeKind.TREE: "trees",
    NodeKind.LOOP: "loops",
}


def _origin(plan: BuildPlan, node: Node) -> str:
    """Return the origin of an element of knowledge or loops: the name of the use or file that declares it.

    The origin of an undeclared type is the origin of the first node with this type.
    """
    spec = plan.checked.spec
    key = (_SECTIONS[node.kind], node.name)
    if key in spec.origins:
        return spec.origins[key]
    return next(
        spec.origins["nodes", node_element.name] for node_element in spec.nodes if node_element.type.name == node.name
    )


def _observers(plan: BuildPlan) -> Mapping[Node, str]:
    """Return a mapping from nodes to the ids of the observers to which they belong."""
    observer_by_node: dict[Node, str] = {}
    for tree in plan.forest:
        observer = Node(NodeKind.OBSERVER, tree.name)
        nodes = [observer, *(Node(NodeKind.PERCEPTION, branch.name) for branch in tree.branches)]
        nodes += [Node(NodeKind.CONTEXT, name) for name in tree.identifies]
        observer_by_node |= dict.fromkeys(nodes, node_id(plan, observer))
    return observer_by_node
