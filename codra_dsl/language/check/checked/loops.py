"""Loops of a spec that passed every check: fuzzy engines, lowered adaptations, and trees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.language.behavior_trees import CheckedForest
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.fuzzy.model import Engine, Term
from codra_dsl.language.model import Adaptation, Loop, Output, TreeElement, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedInput:
    """An input of an engine.

    Attributes:
        minimum: with `maximum`, its range as numbers.
        members: of an enum, in the order of their numbers from 0.
    """

    variable: Variable
    minimum: float
    maximum: float
    members: tuple[str, ...]
    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedOutput:
    """A metric, or an action with its weight; `variable` has the value."""

    output: Output
    variable: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedFuzzyRule:
    """A rule; `text` is its text in the engine."""

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
    """A rate; `factor` converts a change of 1 per second to its unit."""

    variable: Variable
    of: str
    over_s: float
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAdaptation:
    """An adaptation; `python` has the conditions of its hard rules, or its value, as Python text.

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
        entry: the entry of the blackboard that selects the branch.
        branches: by action, the value of the entry.
        tasks: the tasks that its leaves hand over.
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
    """A loop, and the rates that it computes."""

    loop: Loop
    rates: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedMape:
    """The loops of a spec.

    Attributes:
        metrics: the first stage; None without metrics. `actions` is the second stage.
    """

    metrics: CheckedStage | None
    actions: CheckedStage | None
    rates: tuple[CheckedRate, ...]
    adaptation: tuple[CheckedAdaptation, ...]
    trees: tuple[CheckedTree, ...]
    loops: tuple[CheckedLoop, ...]
