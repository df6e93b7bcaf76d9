"""Knowledge of a spec that passed every check: what agents own and read, and their patterns, typed and lowered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.check.knowledge.world import Thing, World
from codra_dsl.diagnostics import Place
from codra_dsl.expression import Path
from codra_dsl.model import Agent


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedPattern:
    """A pattern.

    Attributes:
        text: as written.
        path: what it is if it is a path.
        python: what it is if it is a condition: the expression that builds it from the words of the runtime. It reads
            context-variables and attributes as `value("node.attribute")`, and poses as `distance("a", "b")`.
    """

    text: str
    place: Place
    path: Path | None
    python: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedRule:
    """P2's triplet."""

    name: str
    place: Place
    before: tuple[CheckedPattern, ...]
    during: tuple[CheckedPattern, ...]
    after: tuple[CheckedPattern, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAgent:
    """An agent.

    Attributes:
        owns: what it may write, in file order.
        reads: what its rules and wakes read, and what it says that it reads.
    """

    agent: Agent
    owns: tuple[Thing, ...]
    reads: tuple[Thing, ...]
    wakes: tuple[CheckedPattern, ...]
    rules: tuple[CheckedRule, ...]

    @property
    def name(self) -> str:
        """Return the agent's name."""
        return self.agent.name


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedKnowledge:
    """All that a spec says of knowledge.

    Attributes:
        world: what is declared, in tables.
        agents: those that are declared, in file order.
        writers: the names of those, then of the main execution where it asks for tasks or owns something of the graph.
        values: by node, what is known of it from the start, in the units of the attributes.
    """

    world: World
    agents: tuple[CheckedAgent, ...]
    writers: tuple[str, ...]
    values: Mapping[str, Mapping[str, bool | int | float | str]]
