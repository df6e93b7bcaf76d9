"""Write the module of a spec's knowledge and agents: each declaration is a call of a class of the runtime."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.dependencies import node_type_names
from codra_dsl.generation.emit.conditions import condition_with_words
from codra_dsl.generation.emit.declarations import non_default_fields, tuple_of_names, value_type
from codra_dsl.generation.emit.handles import aliases, knowledge_classes
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import Expression, call, dictionary, lay_out, spread_call, spread_tuple, tuple_of
from codra_dsl.generation.emit.literals import literal, text_literal
from codra_dsl.generation.emit.rendering import made_by_line, render
from codra_dsl.language.check.checked.knowledge import CheckedAgent, CheckedKnowledge, CheckedPattern, CheckedRule
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.expression import Count, EdgeTerm, NodeTerm, Path
from codra_dsl.language.model import (
    CONTEXT_NODE,
    Attribute,
    EdgeType,
    Motion,
    Spec,
    StartingPose,
    Task,
    Variable,
    View,
    Writer,
)

KNOWLEDGE_DEFAULTS: Mapping[str, Mapping[str, Expression]] = {
    "AgentModel": {
        "phase": "None",
        "wakes": "()",
        "owns": "()",
        "reads": "()",
        "rules": "()",
        "label": '""',
    },
    "AttributeModel": {"sources": "()", "valid_for_s": "math.inf", "history": "100", "label": '""'},
    "EdgeModel": {"pose": "Pose()"},
    "EdgeTypeModel": {"label": '""', "sources": "()", "attributes": "()", "motion": "None"},
    "Motion": {"history_s": "10.0", "extrapolate_s": "0.0", "valid_for_s": "math.inf", "is_static": "False"},
    "NodeModel": {"attributes": "()", "values": "{}", "label": '""'},
    "NodeTypeModel": {"sources": "()", "attributes": "()", "view": "None", "label": '""'},
    "RuleModel": {"before": "()", "during": "()", "after": "()"},
    "TaskModel": {"acknowledge_s": "math.inf", "finish_s": "math.inf", "attributes": "()", "label": '""'},
    "ViewModel": {"nearest_m": "0.0", "farthest_m": "math.inf"},
}
"""The runtime's default values for knowledge. Generated code leaves out a field that has its default value."""

_DECIMAL_PLACES = 12
"""The decimal places of a quaternion's components.

There are so few places that the generated text does not depend on the library that computes sines and cosines. The
runtime normalises the quaternion.
"""


def knowledge_text(plan: BuildPlan, knowledge: CheckedKnowledge) -> str:
    """Return the text of the module of a spec's knowledge."""
    imports = Imports()
    imports.use("TYPE_CHECKING")
    writer = _Writer(knowledge, imports)
    model = spread_call(
        "KnowledgeModel",
        name=text_literal(plan.name),
        node_types=spread_tuple(writer.node_types()),
        edge_types=spread_tuple(map(writer.edge_type, knowledge.world.edges.values())),
        nodes=spread_tuple(writer.nodes()),
        edges=spread_tuple(writer.edges()),
        tasks=spread_tuple(map(writer.task, knowledge.world.tasks.values())),
        agents=spread_tuple(map(writer.agent, knowledge.agents)),
        **writer.counts(plan.checked.spec),
    )
    imports.use("KnowledgeModel")
    classes, type_aliases = knowledge_classes(plan, knowledge, imports), list(aliases(knowledge))
    imports.use_in(type_aliases, ("Literal", "Never"))
    return render(
        "knowledge.py.j2",
        title=f"The declared knowledge of '{plan.name}', and who may write it.",
        made_by=made_by_line(plan),
        aliases=type_aliases,
        model=lay_out(model),
        handles=classes,
        imports=imports.lines(),
    )


class _Writer:
    """Writes the declarations of one spec. Each public method returns one declaration, or yields several."""

    def __init__(self, knowledge: CheckedKnowledge, imports: Imports) -> None:
        self._knowledge = knowledge
        self._world: DeclaredGraph = knowledge.world
        self._imports = imports
        self._has_context_node = CONTEXT_NODE not in self._world.nodes and any(
            variable.node == CONTEXT_NODE for variable in self._world.variables.values()
        )

    def node_types(self) -> Iterable[Expression]:
        """Yield the node types: first the declared types, then the undeclared types of nodes."""
        for name in node_type_names(self._world):
            declared = self._world.types.get(name)
            if declared is None:
                yield self._declaration("NodeTypeModel", name=literal(name))
                continue
            yield self._declaration(
                "NodeTypeModel",
                name=literal(name),
                sources=self._sources(self._world.writers(KnowledgeElement("types", name))),
                attributes=tuple_of(
                    self._attribute(attribute, KnowledgeElement("types", name, attribute.name))
                    for attribute in declared.attributes
                ),
                view="None" if declared.view is None else self._view(declared.view),
                label=_label(declared.label, name),
            )
        if self._has_context_node and CONTEXT_NODE not in node_type_names(self._world):
            yield self._declaration("NodeTypeModel", name=literal(CONTEXT_NODE))

    def edge_type(self, edge: EdgeType) -> Expression:
        """Return the declaration of a type of edges."""
        return self._declaration(
            "EdgeTypeModel",
            name=literal(edge.name),
            label=_label(edge.label, edge.name),
            origins=tuple_of_names(end.name for end in edge.origins),
            targets=tuple_of_names(end.name for end in edge.targets),
            sources=self._sources(self._world.writers(KnowledgeElement("edges", edge.name))),
            attributes=tuple_of(
                self._attribute(attribute, KnowledgeElement("edges", edge.name, attribute.name))
                for attribute in edge.attributes
            ),
            motion="None" if edge.motion is None else self._motion(edge.motion),
        )

    def nodes(self) -> Iterable[Expression]:
        """Yield the nodes that exist from the start, with the context-variables that belong to them."""
        for node in self._world.nodes.values():
            values = {text_literal(key): literal(value) for key, value in self._knowledge.values[node.name].items()}
            yield self._declaration(
                "NodeModel",
                name=literal(node.name),
                type=literal(node.type.name),
                attributes=self._variables_of(node.name),
                values=dictionary(values),
                label=_label(node.label, node.name),
            )
        if self._has_context_node:
            name = literal(CONTEXT_NODE)
            yield self._declaration("NodeModel", name=name, type=name, attributes=self._variables_of(CONTEXT_NODE))

    def edges(self) -> Iterable[Expression]:
        """Yield the edges that exist from the start."""
        for edge in self._world.edges.values():
            if self._world.exists_initially(edge):
                (origin,), (target,) = edge.origins, edge.targets
                ends = {"origin": literal(origin.name), "type": literal(edge.name), "target": literal(target.name)}
                pose = {} if edge.pose is None else {"pose": self._pose(edge.pose)}
                yield self._declaration("EdgeModel", **ends, **pose)

    def task(self, task: Task) -> Expression:
        """Return the declaration of a task."""
        return self._declaration(
            "TaskModel",
            name=literal(task.name),
            origin=literal(task.origin.name),
            by=literal(task.by.name),
            requesters=tuple_of_names(requester.name for requester in task.requesters),
            results=tuple_of_names(result.name for result in task.results),
            acknowledge_s=literal(task.acknowledge_s),
            finish_s=literal(task.finish_s),
            attributes=self._variables_of(task.name),
            label=_label(task.label, task.name),
        )

    def agent(self, agent: CheckedAgent) -> Expression:
        """Return the declaration of an agent."""
        phase = agent.agent.conduct.phase
        if phase is not None:
            self._imports.use("Phase")
        return self._declaration(
            "AgentModel",
            name=literal(agent.name),
            phase="None" if phase is None else f"Phase.{phase.name}",
            wakes=tuple_of(map(self._pattern, agent.wakes)),
            owns=tuple_of_names(self._runtime_name(element) for element in agent.owns),
            reads=tuple_of_names(self._runtime_name(element) for element in agent.reads),
            rules=tuple_of(map(self._rule, agent.rules)),
            label=_label(agent.agent.conduct.label, agent.name),
        )

    def counts(self, spec: Spec) -> Mapping[str, Expression]:
        """Return the field with the paths that derived variables count; nothing if there are none."""
        trees = (condition.tree for condition in spec.pose_conditions)
        paths = {str(tree.path): tree.path for tree in trees if isinstance(tree, Count)}
        return {"counts": spread_tuple(map(self._path, paths.values()))} if paths else {}

    def _rule(self, rule: CheckedRule) -> Expression:
        moments = {moment: tuple_of(map(self._pattern, getattr(rule, moment))) for moment in _MOMENTS}
        return self._declaration("RuleModel", name=literal(rule.name), **moments)

    def _runtime_name(self, element: KnowledgeElement) -> str:
        """Return the name of an element that an agent owns or reads, as the runtime spells it."""
        if element.section == "context":
            return f"{self._world.variables[element.name].node}.{element.name}"
        return f"{element.name}.{element.attribute}" if element.attribute else element.name

    def _variables_of(self, node: str) -> Expression:
        variables = [variable for variable in self._world.variables.values() if variable.node == node]
        return tuple_of(self._variable(variable) for variable in variables)

    def _variable(self, variable: Variable) -> Expression:
        """Return a context-variable as an attribute of its node."""
        writers = [writer.name for writer in self._world.writers(KnowledgeElement("context", variable.name))]
        self._imports.use("by")
        sources = call("by", *map(text_literal, writers or ["observer"]))
        return self._attribute_model(variable, sources)

    def _attribute(self, attribute: Attribute, element: KnowledgeElement) -> Expression:
        return self._attribute_model(attribute, self._sources(self._world.writers(element)))

    def _attribute_model(self, declared: Attribute | Variable, sources: Expression) -> Expression:
        return self._declaration(
            "AttributeModel",
            name=literal(declared.name),
            type=value_type(declared.type, self._imports),
            sources=sources,
            valid_for_s=literal(declared.valid_for_s),
            history=literal(declared.history),
            label=_label(declared.label, declared.name),
        )

    def _sources(self, writers: tuple[Writer, ...]) -> Expression:
        """Return the writers of an element.

        If all priorities are equal, they are left out. If all priorities differ, the writers are listed without
        priorities, the writer with the highest priority first.
        """
        priorities = [writer.priority or 0 for writer in writers]
        if len(set(priorities)) <= 1:
            self._imports.use(*(["by"] if writers else []))
            return call("by", *(literal(writer.name) for writer in writers)) if writers else "()"
        if len(set(priorities)) == len(writers):
            self._imports.use("ranked")
            return call(
                "ranked",
                *(literal(writer.name) for writer in sorted(writers, key=lambda writer: -(writer.priority or 0))),
            )
        self._imports.use("Writer")
        return tuple_of(
            call("Writer", agent=literal(writer.name), priority=literal(priority))
            for writer, priority in zip(writers, priorities, strict=True)
        )

    def _view(self, view: View) -> Expression:
        return self._declaration(
            "ViewModel",
            horizontal_rad=literal(view.horizontal_rad),
            vertical_rad=literal(view.vertical_rad),
            nearest_m=literal(view.nearest_m),
            farthest_m=literal(view.farthest_m),
        )

    def _motion(self, motion: Motion) -> Expression:
        declared_limits = {
            name: literal(value)
            for name in ("history_s", "extrapolate_s", "valid_for_s")
            if (value := getattr(motion, name)) is not None
        }
        return self._declaration("Motion", **declared_limits, is_static=literal(motion.is_static))

    def _pose(self, pose: StartingPose) -> Expression:
        self._imports.use("Pose")
        translation, quaternion = tuple_of(map(literal, pose.translation_m)), _quaternion(pose.rotation_rad)
        rotation = () if quaternion == (1.0, 0.0, 0.0, 0.0) else (tuple_of(map(literal, quaternion)),)
        return call("Pose.of", translation, *rotation)

    def _pattern(self, pattern: CheckedPattern) -> Expression:
        if pattern.path is not None:
            return self._path(pattern.path)
        expression, words = condition_with_words(pattern.python)
        self._imports.use(*words)
        return expression

    def _path(self, path: Path) -> Expression:
        word = "absent" if path.negated else "path"
        self._imports.use(word)
        parts = [self._place(path.terms[0])]
        for link, term in zip(path.links, path.terms[1:], strict=True):
            parts += (self._link(link), self._place(term))
        return call(word, *parts)

    def _place(self, term: NodeTerm) -> Expression:
        if term.name:
            return literal(term.name)
        word, type_arguments = ("some", [literal(term.type)]) if term.type else ("anything", [])
        self._imports.use(word)
        return call(word, *type_arguments, **({"called": literal(term.called)} if term.called else {}))

    def _link(self, link: EdgeTerm) -> Expression:
        if not link.is_backward:
            return literal(link.edge)
        self._imports.use("backward")
        return call("backward", literal(link.edge))

    def _declaration(self, model: str, **fields: Expression) -> Expression:
        return call(model, **non_default_fields(model, KNOWLEDGE_DEFAULTS[model], self._imports, fields))


_MOMENTS = ("before", "during", "after")


def _label(label: str, name: str) -> str:
    return text_literal(label if label != name else "")


def _quaternion(rotation_rad: tuple[float, float, float]) -> tuple[float, ...]:
    """Return the unit quaternion (w, x, y, z) of turns about the fixed axes x, then y, then z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle_rad / 2), math.sin(angle_rad / 2)) for angle_rad in rotation_rad)
    exact_components = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return tuple(round(component, _DECIMAL_PLACES) + 0.0 for component in exact_components)
