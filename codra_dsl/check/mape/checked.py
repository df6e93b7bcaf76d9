"""Loops of a spec that passed every check: its fuzzy engines, its adaptations lowered, its trees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.diagnostics import Place
from codra_dsl.fuzzy.model import Engine, Term
from codra_dsl.model import Adaptation, Loop, Output, TreeElement, Variable
from codra_dsl.trees import CheckedForest


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedInput:
    """An input of an engine.

    Attributes:
        minimum: with `maximum` all that it can be, as a number.
        members: of an enum, in the order in which they count from 0.
    """

    variable: Variable
    minimum: float
    maximum: float
    members: tuple[str, ...]
    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedOutput:
    """A metric, or an action with its weight; `variable` holds it."""

    output: Output
    variable: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedFuzzyRule:
    """A rule; `text` is that of the engine."""

    text: str
    output: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedStage:
    """One fuzzy engine; its inputs, outputs and rules in its own order."""

    engine: Engine
    inputs: tuple[CheckedInput, ...]
    outputs: tuple[CheckedOutput, ...]
    rules: tuple[CheckedFuzzyRule, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedRate:
    """A rate; `factor` is what a change of 1 a second is in its unit."""

    variable: Variable
    of: str
    over_s: float
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAdaptation:
    """An adaptation; `python` has the conditions of its hard rules, or its value, in the words of the runtime.

    Attributes:
        reads: the context-variables that they read, sorted.
    """

    adaptation: Adaptation
    python: tuple[str, ...]
    reads: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return the adaptation's name."""
        return self.adaptation.name


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedTree:
    """A tree.

    Attributes:
        course: the adaptation that chooses its branch; empty if none does.
        entry: of the blackboard, that says which branch runs.
        branches: of each action what the entry becomes.
        tasks: that its leaves hand over.
    """

    element: TreeElement
    forest: CheckedForest
    course: str
    entry: str
    branches: Mapping[str, str]
    tasks: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return the tree's name."""
        return self.element.name


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedLoop:
    """A loop, and the rates that it works out."""

    loop: Loop
    rates: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedMape:
    """All that a spec says of loops.

    Attributes:
        metrics: the first stage; None without metrics. `actions` is the second.
    """

    metrics: CheckedStage | None
    actions: CheckedStage | None
    rates: tuple[CheckedRate, ...]
    adaptation: tuple[CheckedAdaptation, ...]
    trees: tuple[CheckedTree, ...]
    loops: tuple[CheckedLoop, ...]
