"""The decisions of Algorithm 2, as frozen values: trees, modules, names in Python, and the dependency graph."""

from __future__ import annotations

from enum import StrEnum
from itertools import chain
from typing import NamedTuple

from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedSpec
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Use


class EdgeKind(StrEnum):
    """How two elements depend on each other. An edge reads as a sentence: source, kind, target."""

    IDENTIFIES = "identifies"
    REQUIRES = "requires"
    RUNS = "runs"
    DECIDES_ON = "decides_on"
    FEEDBACK = "feedback"
    OWNS = "owns"
    READS = "reads"
    REQUESTS = "requests"
    EXECUTES = "executes"
    LEADS_FROM = "leads_from"
    LEADS_TO = "leads_to"
    WEIGHS = "weighs"
    SWITCHES = "switches"
    SETS = "sets"
    ANALYSES = "analyses"
    ADAPTS = "adapts"
    DERIVES = "derives"


class NodeKind(StrEnum):
    """The kinds of element in the dependency graph."""

    CONTEXT = "context"
    PERCEPTION = "perception"
    OBSERVER = "observer"
    SKILL = "skill"
    AGENT = "agent"
    TYPE = "type"
    EDGE = "edge"
    TASK = "task"
    METRIC = "metric"
    ACTION = "action"
    ADAPTATION = "adaptation"
    TREE = "tree"
    LOOP = "loop"


class Node(NamedTuple):
    """An element of the dependency graph."""

    kind: NodeKind
    name: str


class Edge(NamedTuple):
    """A dependency: an observer runs an algorithm, an algorithm identifies a variable, and so on."""

    source: Node
    target: Node
    kind: EdgeKind


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """One perception algorithm within a tree.

    Attributes:
        constant: the Python name of the algorithm's declaration.
        local_name: the Python name of the branch inside the function that builds the tree.
    """

    algorithm: CheckedAlgorithm
    constant: str
    local_name: str

    @property
    def name(self) -> str:
        """Return the algorithm's name."""
        return self.algorithm.name


@dataclass(frozen=True, slots=True, kw_only=True)
class Tree:
    """One observer O_i (P1, Equations 5 and 6).

    Attributes:
        name: the name in `observers`, otherwise the name of its first algorithm.
        function: the Python name of the function that builds the tree.
        groups: the branches in groups. The branches of one group are alternatives, in order of rank; several groups are
            joined under shared preconditions.
        identifies: V_i, in the order of the algorithms that identify these variables.
        needs: C_Oi (P1, Equation 7), in the order of the conditions.
    """

    name: str
    function: str
    groups: tuple[tuple[Branch, ...], ...]
    identifies: tuple[str, ...]
    needs: tuple[str, ...]
    period_s: float
    priority: int

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Return all branches, group by group."""
        return self.groups[0] if len(self.groups) == 1 else tuple(chain.from_iterable(self.groups))


@dataclass(frozen=True, slots=True, kw_only=True)
class Module:
    """One generated module: the elements that a spec file or a use of a template declares.

    Attributes:
        name: the Python name of the module.
        files: the spec files that declare elements of this module outside of templates, sorted.
        use: the use of a template that created elements of this module, or None.
        variables: the names of its variables, in file order.
        trees: the names of its trees, in the order of the forest.
        skills: the names of its skills, in file order.
    """

    name: str
    files: tuple[str, ...]
    use: Use | None
    variables: tuple[str, ...]
    trees: tuple[str, ...]
    skills: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildPlan:
    """The decisions of Algorithm 2 about a spec.

    Attributes:
        class_name: the Python name of the class of the spec's context.
        in_force: C_M, in the order in which Algorithm 2 adds the variables.
        forest: F, in Algorithm 2's order: a tree comes after the trees that it needs, except for feedback.
        modules: the generated modules, sorted by name; together they contain every declared variable and skill, and
            every tree.
        edges: the dependency graph, sorted.
    """

    checked: CheckedSpec
    class_name: str
    in_force: tuple[str, ...]
    forest: tuple[Tree, ...]
    modules: tuple[Module, ...]
    edges: tuple[Edge, ...]

    @property
    def name(self) -> str:
        """Return the spec's name, which is the name of the generated package."""
        return self.checked.spec.name
