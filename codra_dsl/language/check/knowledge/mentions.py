"""All uses of names in knowledge: every mention of a type, node, edge or attribute, and the patterns of agents."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.index.mentions import Mention, mention_of, user_of
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.expression import Count, EdgeTerm, Name, Node, NodeTerm, Path, names_in, reads_of, walk
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Agent, AgentRule, Condition, Course, PoseCondition, Variable


@dataclass(frozen=True, slots=True)
class Pattern:
    """A pattern and its position in the spec.

    Attributes:
        rule: the rule that contains the pattern; None for a pattern of `wakes`.
        tree: the syntax tree of `condition`.
    """

    agent: Agent
    role: Role
    rule: AgentRule | None
    condition: Condition
    tree: Node

    @property
    def path(self) -> str:
        """Return the path of the key that contains the pattern."""
        within = f".rules.{self.rule.name}" if self.rule is not None else ""
        return f"agents.{self.agent.name}{within}.{self.role}"

    @property
    def user(self) -> str:
        """Return the agent's name in messages."""
        return f"agent '{self.agent.name}'"


@dataclass(frozen=True, slots=True)
class CountedPath:
    """A path that a derived variable counts."""

    variable: Variable
    condition: Condition
    tree: Path

    @property
    def path(self) -> str:
        """Return the path of the key that contains the counted path."""
        return f"context.{self.variable.name}.derived"

    @property
    def user(self) -> str:
        """Return the variable's name in messages."""
        return user_of("context", self.variable.name)


@dataclass(frozen=True, slots=True)
class Step:
    """An edge of a path, with the nodes at its ends."""

    pattern: Pattern | CountedPath
    origin: NodeTerm
    link: EdgeTerm
    target: NodeTerm


def patterns(spec_index: SpecIndex) -> Iterator[Pattern]:
    """Yield every pattern that could be parsed."""
    for agent in spec_index.spec.agents:
        yield from patterns_of(agent)


def counted_paths(spec_index: SpecIndex) -> Iterator[CountedPath]:
    """Yield every path that a derived variable counts."""
    for variable in spec_index.spec.context:
        tree = None if variable.derived is None else variable.derived.tree
        for name in () if tree is None else names_in(tree):
            if isinstance(name.pose_comparison, Count) and variable.derived is not None:
                yield CountedPath(variable, variable.derived, name.pose_comparison.path)


def paths(spec_index: SpecIndex) -> Iterator[Pattern | CountedPath]:
    """Yield every pattern that is a path, and every counted path."""
    yield from (pattern for pattern in patterns(spec_index) if isinstance(pattern.tree, Path))
    yield from counted_paths(spec_index)


def patterns_of(agent: Agent) -> Iterator[Pattern]:
    """Yield every pattern of an agent that could be parsed."""
    wakes = agent.conduct.wakes
    yield from (
        Pattern(agent, Role.WAKES, None, condition, condition.tree) for condition in wakes if condition.tree is not None
    )
    for rule in agent.conduct.rules:
        yield from patterns_in(agent, rule)


def patterns_in(agent: Agent, rule: AgentRule) -> Iterator[Pattern]:
    """Yield every pattern of a rule that could be parsed."""
    for role, conditions in ((Role.BEFORE, rule.before), (Role.DURING, rule.during), (Role.AFTER, rule.after)):
        yield from (
            Pattern(agent, role, rule, condition, condition.tree)
            for condition in conditions
            if condition.tree is not None
        )


def steps(pattern: Pattern | CountedPath) -> Iterator[Step]:
    """Yield the edges of a pattern that is a path; nothing for a condition."""
    if isinstance(pattern.tree, Path):
        yield from (Step(pattern, *step) for step in pattern.tree.steps())


def names_in_pattern(pattern: Pattern) -> Iterator[Name]:
    """Yield the names in a pattern that is a condition; nothing for a path."""
    if not isinstance(pattern.tree, Path):
        yield from (part for part in walk(pattern.tree) if isinstance(part, Name))


def mention_in_pattern(pattern: Pattern | CountedPath, name: str, part: Node) -> Mention:
    """Return the mention of a name in a pattern."""
    return Mention(name, pattern.condition.place_of(part), pattern.user, pattern.path)


def type_mentions(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every name in patterns that can only be the name of a type."""
    for pattern in paths(spec_index):
        for term in pattern.tree.terms if isinstance(pattern.tree, Path) else ():
            if term.type:
                yield mention_in_pattern(pattern, term.type, _type_position(pattern, term))


def _type_position(pattern: Pattern | CountedPath, term: NodeTerm) -> Node:
    """Return a node with the position of the type in `some TYPE as NAME`."""
    term_text = pattern.condition.text[term.start : term.end]
    start = term.start + term_text.index(term.type, len("some"))
    return Node(start=start, end=start + len(term.type))


def node_mentions(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every name that can only be the name of a node."""
    for variable in spec_index.spec.context:
        if "of" in variable.places:
            place = variable.places["of"]
            yield Mention(variable.node, place, user_of("context", variable.name), f"context.{variable.name}.of")
        if variable.pose_condition is not None:
            yield from _pose_mentions(variable.pose_condition)
    for adaptation in spec_index.spec.adaptation:
        if isinstance(adaptation.does, Course) and adaptation.does.node is not None and adaptation.does.node.name:
            yield mention_of(adaptation.does.node, "adaptation", adaptation.name, "of")
    for task in spec_index.spec.tasks:
        if task.origin.name:
            yield mention_of(task.origin, "tasks", task.name, "from")
    yield from node_mentions_in_paths(spec_index)
    for pattern in patterns(spec_index):
        for name in names_in_pattern(pattern):
            function, first, second = reads_of(name.name)
            if function:
                yield from (mention_in_pattern(pattern, node_name, name) for node_name in (first, second))
            elif first:
                node = Node(start=name.start, end=name.start + len(first))
                yield mention_in_pattern(pattern, first, node)


def node_mentions_in_paths(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every name of a node in a path."""
    for path in paths(spec_index):
        for term in path.tree.terms if isinstance(path.tree, Path) else ():
            if term.name:
                yield mention_in_pattern(path, term.name, term)


def _pose_mentions(pose_condition: PoseCondition) -> Iterator[Mention]:
    """Yield the mentions of nodes in a comparison of poses."""
    section, element, _ = pose_condition.owner
    for name in names_in(pose_condition.tree):
        for node in reads_of(name.name)[1:]:
            yield Mention(
                node, pose_condition.condition.place_of(name), user_of(section, element), ".".join(pose_condition.owner)
            )


def end_mentions(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every name at an end of a declared edge, which is the name of a type or of a node."""
    for edge in spec_index.spec.edges:
        yield from (mention_of(origin, "edges", edge.name, "from") for origin in edge.origins)
        yield from (mention_of(target, "edges", edge.name, "to") for target in edge.targets)


def edge_mentions(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every name of an edge in a path."""
    for pattern in paths(spec_index):
        for step in steps(pattern):
            start = step.link.start + pattern.condition.text[step.link.start : step.link.end].index(step.link.edge)
            yield mention_in_pattern(pattern, step.link.edge, Node(start=start, end=start + len(step.link.edge)))
