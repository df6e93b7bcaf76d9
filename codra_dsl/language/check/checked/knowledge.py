"""Knowledge of a spec that passed every check: what agents own and read, and their patterns as Python text."""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Path
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Agent


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedPattern:
    """A pattern.

    Attributes:
        text: the pattern as it is written.
        path: the pattern as a path; None if the pattern is a condition.
        python: the expression that builds the condition from functions of the runtime; empty if the pattern is a path.
            The expression reads context-variables and attributes as `value("node.attribute")`, and poses as
            `distance("a", "b")`.
    """

    text: str
    place: Place
    path: Path | None
    python: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedRule:
    """A rule of an agent, which P2 calls a triplet."""

    name: str
    place: Place
    before: tuple[CheckedPattern, ...]
    during: tuple[CheckedPattern, ...]
    after: tuple[CheckedPattern, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAgent:
    """An agent.

    Attributes:
        owns: the elements that the agent may write, in file order.
        reads: the elements that the agent's rules and `wakes` patterns read, and the elements under the key `reads`.
    """

    agent: Agent
    owns: tuple[KnowledgeElement, ...]
    reads: tuple[KnowledgeElement, ...]
    wakes: tuple[CheckedPattern, ...]
    rules: tuple[CheckedRule, ...]

    @property
    def name(self) -> str:
        """Return the agent's name."""
        return self.agent.name


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedKnowledge:
    """The knowledge of a spec.

    Attributes:
        world: the tables of the declarations.
        agents: the declared agents, in file order.
        writers: the names of the agents, then the name of the main execution if it requests tasks or owns part of the
            graph.
        values: for each node, the initial values of its attributes, in the units of the attributes.
    """

    world: DeclaredGraph
    agents: tuple[CheckedAgent, ...]
    writers: tuple[str, ...]
    values: Mapping[str, Mapping[str, bool | int | float | str]]
