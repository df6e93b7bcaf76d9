"""What a spec says of MAPE-K loops: metrics, actions, adaptations, trees and loops (P2, sections 3.3 and 5.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.diagnostics import Place
from codra_dsl.fuzzy.words import Defuzzification, SNorm, TNorm
from codra_dsl.model.elements import Condition, FuzzyTerm, Letters, Reference

ANALYST = "analysis"
"""The agent that writes rates, metrics and weights."""

ADAPTER = "adaptation"
"""The agent that writes courses and parameters."""


def weight_name(action: str) -> str:
    """Return the context-variable that holds the weight of an action."""
    return f"weight_of_{action}"


class Worse(StrEnum):
    """The end of a metric that is bad."""

    LOW = "low"
    HIGH = "high"


class Inference(StrEnum):
    """How rules come to a number."""

    MAMDANI = "mamdani"
    TAKAGI_SUGENO = "takagi_sugeno"


class Repeat(StrEnum):
    """What becomes of a tree whose root has completed."""

    ALWAYS = "always"
    ON_SWITCH = "on_switch"


@dataclass(frozen=True, slots=True, kw_only=True)
class Phrase:
    """A fuzzy rule as written; it is parsed where its words are known.

    Attributes:
        letters: where the letters of `text` stand; None where text and file cannot be matched.
    """

    text: str
    place: Place
    letters: Letters | None = field(default=None, compare=False)

    def place_between(self, start: int, end: int) -> Place:
        """Return the place of a range of `text`, or of the whole where letters cannot be matched."""
        part = self.letters.place(start, end) if self.letters is not None else None
        return self.place if part is None else part


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """What the words of rules mean; None is what goes with the inference."""

    inference: Inference = Inference.MAMDANI
    conjunction: TNorm = TNorm.MINIMUM
    disjunction: SNorm = SNorm.MAXIMUM
    implication: TNorm = TNorm.MINIMUM
    aggregation: SNorm = SNorm.MAXIMUM
    defuzzifier: Defuzzification | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A metric, or an action with its weight: a number from 0 to 1 that follows from fuzzy rules.

    Attributes:
        worse: of a metric, which end counts when an input is unknown.
        terms: its own words; empty where the usual ones serve.
        places: by key; also `name`.
    """

    name: str
    place: Place
    label: str = ""
    description: str = ""
    worse: Worse = Worse.LOW
    rules: tuple[Phrase, ...] = ()
    terms: tuple[FuzzyTerm, ...] = ()
    method: Method = Method()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class HardRule:
    """While a condition holds, an action is the course."""

    condition: Condition
    action: Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """A choice among actions by their weights, filtered; `lead` is a share of 1."""

    choose: tuple[Reference, ...]
    within: Reference
    otherwise: Reference
    smooth_s: float = 0.0
    lead: float = 0.0
    hold_s: float = 0.0
    cooldown_s: float = 0.0
    abort_s: float = 2.0
    always: tuple[HardRule, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A context-variable that is set by a condition."""

    variable: Reference
    value: Condition


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """A choice among actions, or a variable that is set.

    Attributes:
        dwell_s: how long an action or a value stands at least.
        places: by key; also `name`.
    """

    name: str
    place: Place
    does: Course | Parameter
    label: str = ""
    dwell_s: float = 0.0
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeafTasks:
    """A leaf that is the robot's own, and the tasks that it hands over."""

    leaf: Reference
    tasks: tuple[Reference, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeElement:
    """A behaviour tree in a file.

    Attributes:
        file: relative to the file of the spec that names it.
        agent: who executes it; None where the spec says nothing.
        course: of each action the tree in the file that is its branch.
        places: by key; also `name`.
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
    """What is monitored, analysed, adapted and executed together.

    Attributes:
        places: by key; also `name`.
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
