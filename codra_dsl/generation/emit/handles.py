"""Typed access to knowledge, as signatures: the elements that each agent may write, and all that can be read.

The signatures are for editors and type checkers, which find wrong names and writes to elements of other agents before
the robot moves. At run time the classes are those of the runtime, which refuse the same.

A method of an agent's handle accepts fewer names than the method that it overrides, which is not a subtype. Each handle
therefore tells mypy in its first line to accept the override.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.dependencies import node_type_names
from codra_dsl.generation.build_plan.names import camel_case, knowledge_class
from codra_dsl.generation.emit.access import alias
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import WIDEST, WIDTH, Brackets, Expression, bracketed, laid_out
from codra_dsl.generation.emit.literals import text_literal
from codra_dsl.language.check.checked.knowledge import CheckedKnowledge
from codra_dsl.language.check.index.graph_schema import STATES, DeclaredGraph, is_rigid
from codra_dsl.language.check.knowledge.owners import owns
from codra_dsl.language.model import CONTEXT_NODE, TASK_ATTRIBUTES, TASK_TYPE

MOST_HANDLES = 50
"""The number of agents that get handles of their own type; handles of further agents accept any declared name."""

_TYPES = (
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
"""The names that signatures use."""

_INDENT = 8
_STEP = 4
NARROWER = "  # type: ignore[override]  # takes fewer names, on purpose"
_NARROW = "  # type: ignore[misc]  # takes fewer names, on purpose"


@dataclass(frozen=True, slots=True, kw_only=True)
class Class:
    """A class as its template takes it.

    Attributes:
        head: its name, bases and colon.
        stands_for: the class that it is at run time; empty if it exists only for type checkers.
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
    """Yield the statements that define aliases for declared names."""
    world = knowledge.world
    labels = (edge.label for edge in world.edges.values())
    states = sorted(STATES) if world.tasks else ()
    yield alias("AgentName", knowledge.writers)
    yield alias("AttributeName", _attributes(world))
    yield alias("EdgeName", (*world.edges, *labels, *states))
    yield alias("NodeTypeName", _types(world))
    yield alias("TaskName", world.tasks)


def named_handles(knowledge: CheckedKnowledge) -> list[tuple[str, str]]:
    """Return the agents that have handles of their own type, with the name of that type."""
    taken = {"AgentHandle"}
    return [(agent, _handle_name(agent, taken)) for agent in knowledge.writers[:MOST_HANDLES]]


def taking(method: str, taken: Sequence[tuple[Expression, str]], definition: str) -> Iterator[str]:
    """Yield the signatures of a method that takes agents' handles.

    Args:
        method: its name.
        taken: names of agents, with the type of their handles.
        definition: the definition that follows several signatures.
    """
    if len(taken) < 2:
        yield from (_method(method, handle, (_typed("name", names),)) for names, handle in taken)
        return
    for names, handle in taken:
        yield f"@overload\n{' ' * _INDENT}{_method(method, handle, (_typed('name', names),))}"
    yield definition


def handles(plan: BuildPlan, knowledge: CheckedKnowledge, imports: Imports) -> list[Class]:
    """Return the classes of a spec's graph and of its agents' handles."""
    named = named_handles(knowledge)
    classes = [class_ for agent, name in named for class_ in _handle(agent, name, _names_of(agent, knowledge))]
    rest = knowledge.writers[MOST_HANDLES:]
    classes = [*classes, *_graph(plan, named, rest)]
    imports.use_in((text for class_ in classes for text in (class_.head, class_.stands_for, *class_.methods)), _TYPES)
    return classes


def _handle_name(agent: str, taken: set[str]) -> str:
    name = f"{camel_case(agent)}Handle"
    while name in taken:
        name = f"{name.removesuffix('Handle')}_Handle"
    taken.add(name)
    return name


def _handle(agent: str, name: str, names: _Names) -> Iterator[Class]:
    writes, transaction = f"_{name.removesuffix('Handle')}Writes", f"{name.removesuffix('Handle')}Transaction"
    methods = (
        _method("insert_node", "None", ("name: str", _typed("type", names.types), "/", "**values: object")),
        _method("set", "None", ("name: str", _typed("attribute", names.attributes), *_VALUE)),
        _method(
            "insert_edge", "None", ("origin: str", _typed("type", names.edges), "target: str", "/", "**values: object")
        ),
        _method("delete_edge", "None", ("origin: str", _typed("type", names.all_edges), "target: str")),
        _method(
            "set_of_edge",
            "None",
            (
                "origin: str",
                _typed("type", names.edges_with_attributes),
                "target: str",
                _typed("attribute", names.attributes_of_edges),
                *_VALUE,
            ),
        ),
        _method(
            "place",
            "None",
            (
                "origin: str",
                _typed("type", names.motions),
                "target: str",
                "pose: Pose",
                "*",
                "stamp_s: float | None = None",
            ),
        ),
        _method("request", "Request", (_typed("task", names.tasks), "/", "**values: object")),
        _method("finish", "None", ("request: Request", _typed("result", names.results))),
    )
    yield Class(name=writes, head=f"{writes}:", docstring=f"What agent '{agent}' may write.", methods=methods)
    begin = _method("transaction", f"AbstractContextManager[{transaction}]", ()).removesuffix(" ...")
    begin = f'{begin}\n{" " * (_INDENT + _STEP)}"""Begin changes that become visible together, or not at all."""'
    act = _method("acting", f"RuleExecution[{transaction}]", (_typed("rule", names.rules),)).removesuffix(" ...")
    head, *rest = act.splitlines()
    act = "\n".join([f"{head}{NARROWER}", *rest])
    act = f'{act}\n{" " * (_INDENT + _STEP)}"""Begin an action that a rule describes, for a `with` statement."""'
    yield Class(
        name=transaction,
        head=_head(transaction, writes, "Transaction"),
        docstring=f"Changes of agent '{agent}' that become visible together.",
        methods=(),
        stands_for="Transaction",
    )
    yield Class(
        name=name,
        head=_head(name, writes, "AgentHandle"),
        docstring=f"The handle of agent '{agent}'.",
        methods=(begin, act),
        stands_for="AgentHandle",
    )


def _head(name: str, writes: str, base: str) -> str:
    """Return the head of a class that accepts fewer names than its base, as `ruff format` writes it."""
    flat, step = f"{name}({writes}, {base}):", _STEP * " "
    fits = len("    class ") + len(flat) <= WIDTH
    return f"{flat if fits else f'{name}({chr(10)}{2 * step}{writes}, {base}{chr(10)}{step}):'}{_NARROW}"


_VALUE = ("value: object", "*", "evidence_s: float | None = None")


def _graph(plan: BuildPlan, named: list[tuple[str, str]], rest: Sequence[str]) -> Iterator[Class]:
    """Yield the classes of the graph and its snapshots."""
    graph, snapshot = knowledge_class(plan.name), f"{plan.class_name}Snapshot"
    get = _method("get", "Reading[Any]", ("name: str", "attribute: AttributeName"))
    reads = (
        _method(
            "nodes", "tuple[Node, ...]", ('type_name: NodeTypeName | Literal[""] = ""', "where: Term | None = None")
        ),
        _method("edge", "Edge", ("origin: str", "edge: EdgeName", "target: str")),
        _method("has_edge", "bool", ("origin: str", "edge: EdgeName", "target: str")),
        _method(
            "edges",
            "tuple[Edge, ...]",
            ('edge: EdgeName | Literal[""] = ""', "*", 'origin: str = ""', 'target: str = ""'),
        ),
        get,
        _method("handover", "Handover", ("task: TaskName",)),
    )
    yield Class(name="_Reads", head="_Reads:", docstring="The methods that read.", methods=reads)
    yield Class(
        name=snapshot,
        head=_head(snapshot, "_Reads", "Snapshot"),
        docstring=f"The graph of '{plan.name}' at one instant.",
        methods=(),
        stands_for="Snapshot",
    )
    taken = [
        *((literals([agent]), handle) for agent, handle in named),
        *([(literals(rest), "AgentHandle")] if rest else []),
    ]
    last = _method("as_agent", "Any", ("name: Any",))
    methods = (*taking("as_agent", taken, last), _method("snapshot", snapshot, ()), get)
    docstring = "Access for agents, and the methods that read."
    yield Class(name="_Graph", head="_Graph:", docstring=docstring, methods=methods)
    yield Class(
        name=graph,
        head=_head(graph, "_Graph", "Knowledge"),
        docstring=f"The graph of '{plan.name}'.",
        methods=(),
        stands_for="Knowledge",
    )


def _names_of(agent: str, knowledge: CheckedKnowledge) -> _Names:
    world = knowledge.world
    owned = owns(world, agent)
    edges = [world.edges[element.name] for element in owned if element.section == "edges" and not element.attribute]
    tasks = world.tasks.values()
    return _Names(
        types=literals(element.name for element in owned if element.section == "types" and not element.attribute),
        attributes=literals(
            element.attribute or element.name
            for element in owned
            if element.section == "context" or (element.section == "types" and element.attribute)
        ),
        edges=literals(edge.name for edge in edges if not is_rigid(edge)),
        motions=literals(edge.name for edge in edges if is_rigid(edge)),
        all_edges=literals(edge.name for edge in edges),
        edges_with_attributes=literals(
            element.name for element in owned if element.section == "edges" and element.attribute
        ),
        attributes_of_edges=literals(
            element.attribute for element in owned if element.section == "edges" and element.attribute
        ),
        tasks=literals(task.name for task in tasks if agent in (requester.name for requester in task.requesters)),
        results=literals(result.name for task in tasks if task.by.name == agent for result in task.results),
        rules=literals(rule.name for declared in knowledge.agents if declared.name == agent for rule in declared.rules),
    )


def _types(world: DeclaredGraph) -> Iterator[str]:
    yield from node_type_names(world)
    if world.tasks:
        yield TASK_TYPE
    if any(variable.node == CONTEXT_NODE for variable in world.variables.values()):
        yield CONTEXT_NODE


def _attributes(world: DeclaredGraph) -> Iterator[str]:
    yield from (attribute.name for kind in world.types.values() for attribute in kind.attributes)
    yield from world.variables
    yield from TASK_ATTRIBUTES if world.tasks else ()


def literals(names: Iterable[str]) -> Expression:
    """Return the type of one of some names, or `Never` without names."""
    items = tuple(map(text_literal, dict.fromkeys(names)))
    return bracketed("Literal[", items, "]") if items else "Never"


def _typed(argument: str, type_: Expression) -> Expression:
    """Return an argument with its type."""
    if isinstance(type_, Brackets):
        return bracketed(f"{argument}: {type_.opening}", type_.items, type_.closing)
    return f"{argument}: {type_ if isinstance(type_, str) else laid_out(type_)}"


def _method(name: str, returns: str, arguments: Iterable[Expression]) -> str:
    """Return a method as `ruff format` writes it: on one line, else all arguments on one, else one a line."""
    before, after = f"def {name}(", f") -> {returns}: ..."
    given: tuple[Expression, ...] = ("self", *arguments)
    flat = ", ".join(laid_out(argument, before=-WIDEST) for argument in given)
    if _INDENT + len(before) + len(flat) + len(after) <= WIDTH:
        return f"{before}{flat}{after}"
    inner = " " * (_INDENT + _STEP)
    if len(inner) + len(flat) <= WIDTH:
        return f"{before}\n{inner}{flat}\n{' ' * _INDENT}{after}"
    lines = (laid_out(argument, indent=len(inner), before=len(inner), after=1) for argument in given)
    return f"{before}\n{inner}{f',{chr(10)}{inner}'.join(lines)},\n{' ' * _INDENT}{after}"
