"""Loops of a spec that passed every check: fuzzy engines, adaptations as Python text, and trees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from codra_dsl.language.behavior_trees import CheckedForest
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import Engine, Term
from codra_dsl.language.model import Adaptation, Loop, Output, RateKind, TreeElement, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedInput:
    """An input of an engine.

    Attributes:
        minimum: the lower end of the variable's range as a number; `maximum` is the upper end.
        members: the values of a bool or an enum. In the engine, the number of a value is its index in this tuple.
    """

    variable: Variable
    minimum: float
    maximum: float
    members: tuple[str, ...]
    terms: tuple[Term, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedOutput:
    """A metric, or an action. `variable` is the context-variable for the metric or for the weight of the action."""

    output: Output
    variable: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedFuzzyRule:
    """A fuzzy rule. `text` is the text of the rule in the engine."""

    text: str
    output: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedStage:
    """One fuzzy engine. The inputs, outputs and rules are in the order of the engine."""

    engine: Engine
    inputs: tuple[CheckedInput, ...]
    outputs: tuple[CheckedOutput, ...]
    rules: tuple[CheckedFuzzyRule, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedRate:
    """A rate, a share or a held bool. `factor` converts a change of 1 per second to the unit of the rate."""

    variable: Variable
    of: str
    over_s: float
    factor: float
    kind: RateKind


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAdaptation:
    """An adaptation.

    Attributes:
        python: as Python text, the conditions of the hard rules, or the value that the adaptation sets and, if the spec
            states it, the value under `otherwise`.
        reads: the context-variables that these conditions or this value read, sorted.
        holds_s: for a course, the hold of each action that states one.
    """

    adaptation: Adaptation
    python: tuple[str, ...]
    reads: tuple[str, ...]
    holds_s: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Return the adaptation's name."""
        return self.adaptation.name


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedTree:
    """A tree.

    Attributes:
        course: the adaptation that chooses the branch of the tree; empty if no adaptation does.
        entry: the entry of the blackboard that selects the branch.
        branches: a mapping from each action to the value of this entry.
        tasks: the tasks that the leaves of the tree hand over.
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
        metrics: the first stage; None if the spec has no metrics.
        actions: the second stage; None if the spec has no actions.
    """

    metrics: CheckedStage | None
    actions: CheckedStage | None
    rates: tuple[CheckedRate, ...]
    adaptation: tuple[CheckedAdaptation, ...]
    trees: tuple[CheckedTree, ...]
    loops: tuple[CheckedLoop, ...]
