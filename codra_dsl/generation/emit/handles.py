"""Typed access to knowledge, as signatures: the elements that each agent may write, and those that all agents may read.

The signatures are for editors and type checkers, which find wrong names and writes to elements of other agents before
the robot moves. At run time, classes of the runtime are used instead. They refuse the same names and writes.

A method of an agent's handle accepts fewer names than the method that it overrides, so mypy refuses the override. The
first line of each handle therefore makes mypy accept it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.dependencies import node_type_names
from codra_dsl.generation.build_plan.names import handle_class, knowledge_class
from codra_dsl.generation.emit.access import alias_statement
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import UNLIMITED_WIDTH, WIDTH, Brackets, Expression, lay_out, make_brackets
from codra_dsl.generation.emit.literals import text_literal
from codra_dsl.language.check.checked.knowledge import CheckedKnowledge
from codra_dsl.language.check.index.graph_schema import STATES, DeclaredGraph, holds_poses
from codra_dsl.language.check.knowledge.owners import writable_elements
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import CONTEXT_NODE, TASK_ATTRIBUTES, TASK_TYPE

MAX_HANDLES = 50
"""The maximum number of agents with their own type of handle; handles of further agents accept any declared name."""

_IMPORTED_NAMES = (
    *(
        "AbstractContextManager",
        "RuleExecution",
        "AgentHandle",
        "Any",
        "Edge",
        "Handover",
        "Knowledge",
        "Literal",
        "Never",
    ),
    *("Node", "Pose", "Reading", "Request", "Snapshot", "Term", "Transaction", "overload"),
)
"""The imported names that signatures use."""

_INDENT = 8
_STEP = 4
IGNORE_OVERRIDE = "  # type: ignore[override]  # takes fewer names, on purpose"
_IGNORE_SUBCLASS = "  # type: ignore[misc]  # takes fewer names, on purpose"


@dataclass(frozen=True, slots=True, kw_only=True)
class Class:
    """A class in the form that its template needs.

    Attributes:
        head: the name, the bases and the colon.
        stands_for: the class of the runtime that replaces this class at run time; empty if this class exists only for
            type checkers.
    """

    name: str
    head: str
    docstring: str
    methods: tuple[str, ...]
    stands_for: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Names:
    """The types of the names that methods accept."""

    types: Expression
    attributes: Expression
    edges: Expression
    motions: Expression
    all_edges: Expression
    edges_with_attributes: Expression
    attributes_of_edges: Expression
    tasks: Expression
    results: Expression
    rules: Expression


def aliases(knowledge: CheckedKnowledge) -> Iterator[str]:
    """Yield the statements that define aliases for the literal types of declared names."""
    world = knowledge.world
    labels = (edge.label for edge in world.edges.values())
    states = sorted(STATES) if world.tasks else ()
    yield alias_statement("AgentName", knowledge.writers)
    yield alias_statement("AttributeName", _attribute_names(world))
    yield alias_statement("EdgeName", (*world.edges, *labels, *states))
    yield alias_statement("NodeTypeName", _node_types(world))
    yield alias_statement("TaskName", world.tasks)


def agents_with_handles(knowledge: CheckedKnowledge) -> list[tuple[str, str]]:
    """Return the agents whose handles have their own type, each with the name of that type."""
    taken_names = {"AgentHandle"}
    return [(agent, _handle_name(agent, taken_names)) for agent in knowledge.writers[:MAX_HANDLES]]


def handle_signatures(method: str, handle_types: Sequence[tuple[Expression, str]], definition: str) -> Iterator[str]:
    """Yield the signatures of a method that returns the handle of an agent.

    Args:
        method: the name of the method.
        handle_types: the types of agents' names, each with the type of the handle for these names.
        definition: the definition that follows several signatures.
    """
    if len(handle_types) < 2:
        yield from (_method_text(method, handle, (_typed_argument("name", names),)) for names, handle in handle_types)
        return
    for names, handle in handle_types:
        yield f"@overload\n{' ' * _INDENT}{_method_text(method, handle, (_typed_argument('name', names),))}"
    yield definition


def knowledge_classes(plan: BuildPlan, knowledge: CheckedKnowledge, imports: Imports) -> list[Class]:
    """Return the classes of a spec's graph and of its agents' handles."""
    agents_and_handles = agents_with_handles(knowledge)
    classes = [
        class_
        for agent, name in agents_and_handles
        for class_ in _handle_classes(agent, name, _accepted_names(agent, knowledge))
    ]
    other_agents = knowledge.writers[MAX_HANDLES:]
    classes = [*classes, *_graph_classes(plan, agents_and_handles, other_agents)]
    imports.use_in(
        (text for class_ in classes for text in (class_.head, class_.stands_for, *class_.methods)), _IMPORTED_NAMES
    )
    return classes


def _handle_name(agent: str, taken_names: set[str]) -> str:
    name = handle_class(agent)
    while name in taken_names:
        name = f"{name.removesuffix('Handle')}_Handle"
    taken_names.add(name)
    return name


def _handle_classes(agent: str, name: str, names: _Names) -> Iterator[Class]:
    write_methods_class, transaction = (
        f"_{name.removesuffix('Handle')}Writes",
        f"{name.removesuffix('Handle')}Transaction",
    )
    methods = (
        _method_text(
            "insert_node", "None", ("name: str", _typed_argument("type", names.types), "/", "**values: object")
        ),
        _method_text("set", "None", ("name: str", _typed_argument("attribute", names.attributes), *_VALUE_ARGUMENTS)),
        _method_text(
            "insert_edge",
            "None",
            ("origin: str", _typed_argument("type", names.edges), "target: str", "/", "**values: object"),
        ),
        _method_text("delete_edge", "None", ("origin: str", _typed_argument("type", names.all_edges), "target: str")),
        _method_text(
            "set_of_edge",
            "None",
            (
                "origin: str",
                _typed_argument("type", names.edges_with_attributes),
                "target: str",
                _typed_argument("attribute", names.attributes_of_edges),
                *_VALUE_ARGUMENTS,
            ),
        ),
        _method_text(
            "place",
            "None",
            (
                "origin: str",
                _typed_argument("type", names.motions),
                "target: str",
                "pose: Pose",
                "*",
                "stamp_s: float | None = None",
            ),
        ),
        _method_text("request", "Request", (_typed_argument("task", names.tasks), "/", "**values: object")),
        _method_text("finish", "None", ("request: Request", _typed_argument("result", names.results))),
    )
    yield Class(
        name=write_methods_class,
        head=f"{write_methods_class}:",
        docstring=f"What agent '{agent}' may write.",
        methods=methods,
    )
    transaction_method = _method_text("transaction", f"AbstractContextManager[{transaction}]", ()).removesuffix(" ...")
    transaction_method += f'\n{" " * (_INDENT + _STEP)}"""Begin changes that become visible together, or not at all."""'
    acting_method = _method_text(
        "acting", f"RuleExecution[{transaction}]", (_typed_argument("rule", names.rules),)
    ).removesuffix(" ...")
    first_line, *other_lines = acting_method.splitlines()
    acting_method = "\n".join([f"{first_line}{IGNORE_OVERRIDE}", *other_lines])
    acting_method += f'\n{" " * (_INDENT + _STEP)}"""Begin an action that a rule describes, for a `with` statement."""'
    yield Class(
        name=transaction,
        head=_class_head(transaction, write_methods_class, "Transaction"),
        docstring=f"Changes of agent '{agent}' that become visible together.",
        methods=(),
        stands_for="Transaction",
    )
    yield Class(
        name=name,
        head=_class_head(name, write_methods_class, "AgentHandle"),
        docstring=f"The handle of agent '{agent}'.",
        methods=(transaction_method, acting_method),
        stands_for="AgentHandle",
    )


def _class_head(name: str, mixin: str, base: str) -> str:
    """Return the head of a class that accepts fewer names than its base, as `ruff format` writes it."""
    flat, step = f"{name}({mixin}, {base}):", _STEP * " "
    is_short = len("    class ") + len(flat) <= WIDTH
    return f"{flat if is_short else f'{name}({chr(10)}{2 * step}{mixin}, {base}{chr(10)}{step}):'}{_IGNORE_SUBCLASS}"


_VALUE_ARGUMENTS = ("value: object", "*", "evidence_s: float | None = None")


def _graph_classes(
    plan: BuildPlan, agents_and_handles: list[tuple[str, str]], other_agents: Sequence[str]
) -> Iterator[Class]:
    """Yield the classes of the graph and its snapshots."""
    graph, snapshot = knowledge_class(plan.name), f"{plan.class_name}Snapshot"
    get_method = _method_text("get", "Reading[Any]", ("name: str", "attribute: AttributeName"))
    read_methods = (
        _method_text(
            "nodes", "tuple[Node, ...]", ('type_name: NodeTypeName | Literal[""] = ""', "where: Term | None = None")
        ),
        _method_text("edge", "Edge", ("origin: str", "edge: EdgeName", "target: str")),
        _method_text("has_edge", "bool", ("origin: str", "edge: EdgeName", "target: str")),
        _method_text(
            "edges",
            "tuple[Edge, ...]",
            ('edge: EdgeName | Literal[""] = ""', "*", 'origin: str = ""', 'target: str = ""'),
        ),
        get_method,
        _method_text("handover", "Handover", ("task: TaskName",)),
    )
    yield Class(name="_Reads", head="_Reads:", docstring="The methods that read.", methods=read_methods)
    yield Class(
        name=snapshot,
        head=_class_head(snapshot, "_Reads", "Snapshot"),
        docstring=f"The graph of '{plan.name}' at one instant.",
        methods=(),
        stands_for="Snapshot",
    )
    handle_types = [
        *((literal_type([agent]), handle) for agent, handle in agents_and_handles),
        *([(literal_type(other_agents), "AgentHandle")] if other_agents else []),
    ]
    fallback_definition = _method_text("as_agent", "Any", ("name: Any",))
    methods = (
        *handle_signatures("as_agent", handle_types, fallback_definition),
        _method_text("snapshot", snapshot, ()),
        get_method,
    )
    docstring = "Access for agents, and the methods that read."
    yield Class(name="_Graph", head="_Graph:", docstring=docstring, methods=methods)
    yield Class(
        name=graph,
        head=_class_head(graph, "_Graph", "Knowledge"),
        docstring=f"The graph of '{plan.name}'.",
        methods=(),
        stands_for="Knowledge",
    )


def _accepted_names(agent: str, knowledge: CheckedKnowledge) -> _Names:
    world = knowledge.world
    owned_elements = writable_elements(world, agent)
    edges = [
        world.edges[element.name] for element in owned_elements if element.section == "edges" and not element.attribute
    ]
    tasks = world.tasks.values()
    return _Names(
        types=literal_type(
            element.name for element in owned_elements if element.section == "types" and not element.attribute
        ),
        attributes=literal_type(
            element.attribute or element.name
            for element in owned_elements
            if element.section == "context" or (element.section == "types" and element.attribute)
        ),
        edges=literal_type(edge.name for edge in edges if not holds_poses(edge)),
        motions=literal_type(edge.name for edge in edges if holds_poses(edge)),
        all_edges=literal_type(edge.name for edge in edges),
        edges_with_attributes=literal_type(
            element.name for element in owned_elements if element.section == "edges" and element.attribute
        ),
        attributes_of_edges=literal_type(
            element.attribute for element in owned_elements if element.section == "edges" and element.attribute
        ),
        tasks=literal_type(task.name for task in tasks if agent in (requester.name for requester in task.requesters)),
        results=literal_type(result.name for task in tasks if task.by.name == agent for result in task.results),
        rules=literal_type(
            rule.name
            for declared_agent in knowledge.agents
            if declared_agent.name == agent
            for rule in declared_agent.rules
        ),
    )


def _node_types(world: DeclaredGraph) -> Iterator[str]:
    yield from node_type_names(world)
    if world.tasks:
        yield TASK_TYPE
    if any(variable.node == CONTEXT_NODE for variable in world.variables.values()):
        yield CONTEXT_NODE


def _attribute_names(world: DeclaredGraph) -> Iterator[str]:
    yield from (attribute.name for kind in world.types.values() for attribute in kind.attributes)
    yield from world.variables
    yield from TASK_ATTRIBUTES if world.tasks else ()


def literal_type(names: Iterable[str]) -> Expression:
    """Return the literal type of some names, or `Never` if there are none."""
    items = tuple(map(text_literal, dict.fromkeys(names)))
    return make_brackets("Literal[", items, "]") if items else "Never"


def _typed_argument(argument: str, type_: Expression) -> Expression:
    """Return an argument with its type."""
    if isinstance(type_, Brackets):
        return make_brackets(f"{argument}: {type_.opening}", type_.items, type_.closing)
    return f"{argument}: {type_ if isinstance(type_, str) else lay_out(type_)}"


def _method_text(name: str, returns: str, arguments: Iterable[Expression]) -> str:
    """Return a method as `ruff format` writes it: on one line, with all arguments on one line, or with one per line."""
    before, after = f"def {name}(", f") -> {returns}: ..."
    all_arguments: tuple[Expression, ...] = ("self", *arguments)
    flat = ", ".join(lay_out(argument, before=-UNLIMITED_WIDTH) for argument in all_arguments)
    if _INDENT + len(before) + len(flat) + len(after) <= WIDTH:
        return f"{before}{flat}{after}"
    inner = " " * (_INDENT + _STEP)
    if len(inner) + len(flat) <= WIDTH:
        return f"{before}\n{inner}{flat}\n{' ' * _INDENT}{after}"
    lines = (lay_out(argument, indent=len(inner), before=len(inner), after=1) for argument in all_arguments)
    return f"{before}\n{inner}{f',{chr(10)}{inner}'.join(lines)},\n{' ' * _INDENT}{after}"
