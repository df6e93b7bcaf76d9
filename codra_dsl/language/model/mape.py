"""MAPE-K loops as a spec declares them: metrics, actions, adaptations, trees and loops (P2, sections 3.3 and 5.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.words import Defuzzification, SNorm, TNorm
from codra_dsl.language.model.elements import Condition, FuzzyTerm, Letters, Reference

ANALYST = "analysis"
"""The agent that writes rates, metrics and weights."""

ADAPTER = "adaptation"
"""The agent that writes courses and parameters."""


def weight_name(action: str) -> str:
    """Return the name of the context-variable that holds the weight of an action."""
    return f"weight_of_{action}"


def filtered_weight_name(action: str) -> str:
    """Return the name of the context-variable that holds the filtered weight of an action."""
    return f"filtered_weight_of_{action}"


class Worse(StrEnum):
    """The end of the interval from 0 to 1 that is bad for a metric."""

    LOW = "low"
    HIGH = "high"


class Inference(StrEnum):
    """How a number is inferred from rules."""

    MAMDANI = "mamdani"
    TAKAGI_SUGENO = "takagi_sugeno"


class Repeat(StrEnum):
    """When a tree starts again after its root has completed."""

    ALWAYS = "always"
    ON_SWITCH = "on_switch"


@dataclass(frozen=True, slots=True, kw_only=True)
class Phrase:
    """A fuzzy rule as written; the rule is parsed later, when its words are known.

    Attributes:
        letters: the positions of the letters of `text` in the file; None if text and file cannot be matched.
    """

    text: str
    place: Place
    letters: Letters | None = field(default=None, compare=False)

    def place_between(self, start: int, end: int) -> Place:
        """Return the place of a range of `text`, or of the complete text if letters cannot be matched."""
        part = self.letters.place(start, end) if self.letters is not None else None
        return self.place if part is None else part


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """The operators of fuzzy rules; a defuzzifier of None means the inference's default defuzzifier."""

    inference: Inference = Inference.MAMDANI
    conjunction: TNorm = TNorm.MINIMUM
    disjunction: SNorm = SNorm.MAXIMUM
    implication: TNorm = TNorm.MINIMUM
    aggregation: SNorm = SNorm.MAXIMUM
    defuzzifier: Defuzzification | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A metric, or an action with its weight: a number from 0 to 1 inferred from fuzzy rules.

    Attributes:
        hold_s: for an action, how long it must lead before it is chosen; None for the `hold` of the course.
        worse: for a metric, its bad end. If an input is unknown, the metric has the worst of its possible values.
        terms: the declared words for the number; empty if the default words are used.
        places: the places of the entries, by key; `name` is the place of the metric's or action's name.
    """

    name: str
    place: Place
    label: str = ""
    description: str = ""
    worse: Worse = Worse.LOW
    hold_s: float | None = None
    rules: tuple[Phrase, ...] = ()
    terms: tuple[FuzzyTerm, ...] = ()
    method: Method = Method()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class HardRule:
    """A rule that makes an action the course while a condition holds.

    Attributes:
        for_s: how long the condition must have held without interruption.
    """

    condition: Condition
    action: Reference
    for_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """A choice among actions by their filtered weights; `lead` is a fraction from 0 to 1.

    Attributes:
        node: the node of the knowledge graph that has the weights, the filtered weights and the course as attributes
            (the key `of`); None if the spec states none: then the course has no variables for filtered weights.
    """

    choose: tuple[Reference, ...]
    within: Reference
    otherwise: Reference
    node: Reference | None = None
    smooth_s: float = 0.0
    lead: float = 0.0
    hold_s: float = 0.0
    cooldown_s: float = 0.0
    abort_s: float = 2.0
    always: tuple[HardRule, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A context-variable that is set to the value of a condition.

    Attributes:
        otherwise: the constant to which the variable is set while the value is unknown; None if the spec states none.
    """

    variable: Reference
    value: Condition
    otherwise: Condition | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """A choice among actions, or a variable that is set.

    Attributes:
        dwell_s: the minimum time for which an action or a value is kept.
        places: the places of the entries, by key; `name` is the place of the adaptation's name.
    """

    name: str
    place: Place
    does: Course | Parameter
    label: str = ""
    dwell_s: float = 0.0
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeafTasks:
    """A leaf that the robot implements, and the tasks that this leaf hands over."""

    leaf: Reference
    tasks: tuple[Reference, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeElement:
    """A behaviour tree in a file.

    Attributes:
        file: the path of the file, relative to the folder of the spec or part that names it.
        agent: the agent that executes the tree; None if the spec names no agent.
        course: for each action, the tree in the file that is the branch of this action.
        places: the places of the entries, by key; `name` is the place of the tree's name.
    """

    name: str
    place: Place
    file: Reference
    label: str = ""
    agent: Reference | None = None
    course: tuple[tuple[Reference, Reference], ...] = ()
    leaves: tuple[LeafTasks, ...] = ()
    period_s: float = 0.1
    repeat: Repeat = Repeat.ALWAYS
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """The elements that are monitored, analysed, adapted and executed together.

    Attributes:
        places: the places of the entries, by key; `name` is the place of the loop's name.
    """

    name: str
    place: Place
    label: str = ""
    monitor: tuple[Reference, ...] = ()
    analyse: tuple[Reference, ...] = ()
    adapt: tuple[Reference, ...] = ()
    execute: tuple[Reference, ...] = ()
    period_s: float = 1.0
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)
