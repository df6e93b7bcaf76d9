"""The entry of a generated package: the model, typed access to it, and `start`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import camel_case, entry_names, knowledge_class
from codra_dsl.generation.emit.access import VariableGroup, alias_statement, methods
from codra_dsl.generation.emit.declarations import resource_declaration
from codra_dsl.generation.emit.handles import IGNORE_OVERRIDE, agents_with_handles, handle_signatures, literal_type
from codra_dsl.generation.emit.imports import Imports, import_statement
from codra_dsl.generation.emit.layout import WIDTH, Expression, call, lay_out, spread_call, spread_tuple, tuple_of
from codra_dsl.generation.emit.literals import text_literal
from codra_dsl.generation.emit.rendering import made_by_line, render
from codra_dsl.language.check.checked.knowledge import CheckedKnowledge
from codra_dsl.language.model import Kind

_PLAIN_TYPES: Mapping[Kind, str] = {Kind.BOOL: "bool", Kind.INT: "int", Kind.FLOAT: "float", Kind.STR: "str"}


MAX_ENUMS = 50
"""The maximum number of enums with their own type; members of further enums are plain strings for editors and mypy."""


def entry_text(plan: BuildPlan) -> str:
    """Return the text of the package's `__init__.py`."""
    imports = Imports()
    imports.use("Mapping", "Clock", "ContextManager", "ContextModel", "EventLog")
    groups, knowledge = _variable_groups(plan), plan.checked.knowledge
    imports.use_math_for(["math.inf"] if groups else [])
    imports.use(*(["TYPE_CHECKING"] if knowledge is not None else []))
    agents = [] if knowledge is None else list(_agent_signatures(knowledge, imports))
    adapts = plan.checked.mape is not None
    imports.use(*(["Leaves", "Mape"] if adapts else []))
    imports.use(*(["TYPE_CHECKING", "Callable", "Reading", "TypeVar"] if groups else []))
    imports.use(*(["overload", "Any", "Never"] if len(groups) > 1 else []))
    aliases = [
        *_variable_aliases(groups),
        alias_statement("SkillName", [skill.name for skill in plan.checked.spec.skills]),
    ]
    imports.use(*(word for word in ("Literal", "Never") if any(f" = {word}" in alias for alias in aliases)))
    return render(
        "entry.py.j2",
        title=f"The context of '{plan.name}': {_counts_text(plan)}.",
        made_by=made_by_line(plan),
        model=lay_out(_model(plan, imports)),
        imports=imports.lines(),
        modules=_local_imports(plan),
        aliases=aliases,
        name=plan.name,
        class_name=plan.class_name,
        methods=list(methods(groups)),
        knowledge=knowledge_class(plan.name) if knowledge is not None else "",
        agents=agents,
        adapts=adapts,
        has_hosts=_has_hosts(plan),
        call=lay_out(_manager_call(plan), before=len("    return "), indent=4),
    )


def _has_hosts(plan: BuildPlan) -> bool:
    return any(algorithm.algorithm.host for algorithm in plan.checked.algorithms.values())


def _manager_call(plan: BuildPlan) -> Expression:
    """Return the expression that creates the context manager."""
    arguments = {name: name for name in ("clock", "resources", "seed", "record")}
    arguments |= {"knowledge": "KNOWLEDGE"} if plan.checked.knowledge is not None else {}
    arguments |= {"hosts_here": "hosts_here"} if _has_hosts(plan) else {}
    return call(plan.class_name, "MODEL", **arguments)


def _variable_groups(plan: BuildPlan) -> list[VariableGroup]:
    """Return the variables in groups of one type, in the order in which the types first appear.

    Pose conditions are left out.
    """
    variables_by_type: dict[tuple[Kind, tuple[str, ...]], list[str]] = {}
    enums: set[tuple[str, ...]] = set()
    for variable in plan.checked.variables.values():
        if variable.pose_condition is not None:
            continue
        kind, members = variable.type.kind, variable.type.values
        if kind is Kind.ENUM and (members in enums or len(enums) < MAX_ENUMS):
            enums.add(members)
        elif kind is Kind.ENUM:
            kind, members = Kind.STR, ()
        variables_by_type.setdefault((kind, members), []).append(variable.name)
    taken_names = {plan.class_name, *entry_names(plan.checked.spec)}
    return [_variable_group(kind, members, names, taken_names) for (kind, members), names in variables_by_type.items()]


def _handle_names(plan: BuildPlan) -> list[str]:
    """Return the names of the types of agents' handles."""
    knowledge = plan.checked.knowledge
    return [] if knowledge is None else [handle for _, handle in agents_with_handles(knowledge)]


def _agent_signatures(knowledge: CheckedKnowledge, imports: Imports) -> Iterator[str]:
    """Yield the signatures of the method `agent`, which returns the handle of an agent."""
    agents_and_handles = agents_with_handles(knowledge)
    other_agents = knowledge.writers[len(agents_and_handles) :]
    agent_types = [(literal_type([agent]), f"Agent[VariableName, {handle}]") for agent, handle in agents_and_handles]
    agent_types += [(literal_type(other_agents), "Agent[VariableName, AgentHandle]")] if other_agents else []
    imports.use(*(["Agent", "Literal"] if agent_types else []), *(["AgentHandle"] if other_agents else []))
    imports.use(*(["overload", "Any"] if len(agent_types) > 1 else []))
    is_overloaded = len(agent_types) > 1
    for number, signature in enumerate(handle_signatures("agent", agent_types, "def agent(self, name: Any) -> Any:")):
        if number:
            yield signature
        else:
            yield (
                signature.replace("@overload", f"@overload{IGNORE_OVERRIDE}")
                if is_overloaded
                else signature.removesuffix(" ...") + IGNORE_OVERRIDE
            )


def _variable_group(kind: Kind, members: tuple[str, ...], variables: list[str], taken_names: set[str]) -> VariableGroup:
    """Return variables of one type, with names for that type. The names for an enum follow from its first variable."""
    if kind in _PLAIN_TYPES:
        python_type = _PLAIN_TYPES[kind]
        stem = python_type.capitalize()
        return VariableGroup(
            variables=tuple(variables), alias=f"{stem}Name", type=python_type, answer=f"{stem}Answer", members=()
        )
    stem = camel_case(variables[0])
    while {stem, f"{stem}Name", f"{stem}Answer"} & taken_names:
        stem += "_"
    taken_names |= {stem, f"{stem}Name", f"{stem}Answer"}
    return VariableGroup(
        variables=tuple(variables), alias=f"{stem}Name", type=stem, answer=f"{stem}Answer", members=members
    )


def _variable_aliases(groups: list[VariableGroup]) -> Iterator[str]:
    for group in groups:
        if group.members:
            yield alias_statement(group.type, group.members)
    if len(groups) > 1:
        yield from (alias_statement(group.alias, group.variables) for group in groups)
        yield _union_statement("VariableName", [group.alias for group in groups])
    else:
        yield alias_statement("VariableName", [name for group in groups for name in group.variables])
    for group in groups:
        type_variable = call("TypeVar", text_literal(group.answer), bound=f"{group.type} | None")
        yield f"{group.answer} = {lay_out(type_variable, before=len(group.answer) + 3)}"


def _union_statement(name: str, types: list[str]) -> str:
    """Return the statement that makes `name` an alias for the union of some types, as `ruff format` writes it."""
    flat = f"{name} = {' | '.join(types)}"
    spread = "\n    | ".join(types)
    return flat if len(flat) <= WIDTH else f"{name} = (\n    {spread}\n)"


def _counts_text(plan: BuildPlan) -> str:
    """Return how many elements of each kind there are, for the docstring."""
    counts_and_nouns = (
        (len(plan.forest), "observer"),
        (len(plan.checked.variables), "context-variable"),
        (len(plan.checked.spec.skills), "skill"),
    )
    return ", ".join(f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in counts_and_nouns)


def _local_imports(plan: BuildPlan) -> str:
    names = [module.name for module in plan.modules]
    flat = f"from . import {', '.join(names)}"
    statements = []
    if plan.checked.knowledge is not None:
        statements = [import_statement(".knowledge", ["KNOWLEDGE", knowledge_class(plan.name), *_handle_names(plan)])]
    statements += [] if plan.checked.mape is None else ["from .mape import MAPE"]
    if not names:
        return "\n".join(statements)
    module_import = flat if len(flat) <= WIDTH else f"from . import {lay_out(spread_tuple(names))}"
    return "\n".join([module_import, *statements])


def _model(plan: BuildPlan, imports: Imports) -> Expression:
    spec = plan.checked.spec
    handles = {handle.resource: handle for handle in (() if spec.site is None else spec.site.handles)}
    resources = [resource_declaration(resource, handles.get(resource.name), imports) for resource in spec.resources]
    return spread_call(
        "ContextModel",
        name=text_literal(plan.name),
        variables=_elements_of_modules(plan, "VARIABLES"),
        observers=_elements_of_modules(plan, "OBSERVERS"),
        skills=_elements_of_modules(plan, "SKILLS"),
        resources=tuple_of(resources),
    )


def _elements_of_modules(plan: BuildPlan, constant: str) -> Expression:
    return tuple_of(f"*{module.name}.{constant}" for module in plan.modules)
