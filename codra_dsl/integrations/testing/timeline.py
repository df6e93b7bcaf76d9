"""The model of a timeline, as frozen values: stories, each a sequence of moments."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.language.model import Handle, Literal
from codra_dsl.runtime import Reason
from codra_dsl.runtime.behavior_trees import Result
from codra_dsl.runtime.knowledge.operations import Operation
from codra_dsl.runtime.observers.expectations import Outcome as ExpectationOutcome


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentValues:
    """The values that an agent writes; None means that the agent falls silent."""

    agent: str
    values: Mapping[str, Literal | None] | None
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of an algorithm.

    Attributes:
        raises: the text of the error that the algorithm raises; None if it raises none.
        hangs: whether the algorithm never returns.
        garbage: a tuple with the result that the algorithm returns in spite of the spec; empty without this fault.
        late_s: the delay of the result.
        jobs: the number of jobs that the fault affects.
    """

    raises: str | None = None
    hangs: bool = False
    garbage: tuple[object, ...] = ()
    late_s: float = 0.0
    jobs: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """The behavior of an algorithm from now on; an attribute that is None stays unchanged, except the fault.

    Attributes:
        returns: the returned values that change.
        takes_s: how long a job takes.
        evidence_s: the interval in which the evidence of a job is taken, counted from the start of the job.
        fault: the fault of the algorithm; None if it works.
    """

    algorithm: str
    place: Place
    returns: Mapping[str, Literal | None] | None = None
    takes_s: float | None = None
    evidence_s: tuple[float, float] | None = None
    fault: Fault | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Alteration:
    """Attributes of a handle that change."""

    resource: str
    attributes: Mapping[str, object]
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Overriding:
    """An override of a context-variable by an operator; without a value, the variable is unknown."""

    variable: str
    value: Literal | None
    for_s: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearing:
    """The end of the override of a context-variable."""

    variable: str


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphChange:
    """A change of the knowledge graph by an agent.

    Attributes:
        agent: the agent. Empty if the change deletes a node that is not in the initial graph: then the agent that
            inserted the node deletes it.
        operation: inserts or places an edge, deletes an edge or a node, or inserts a node.
        new_nodes: the insertions of the ends of an edge that are not in the initial graph.
    """

    agent: str
    operation: Operation
    place: Place
    new_nodes: tuple[GraphChange, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSwitch:
    """A loop that starts or stops."""

    loop: str
    runs: bool
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class LeafBehaviour:
    """The behavior of a leaf of behavior trees from now on.

    Attributes:
        result: the result of the leaf; `RUNNING` if it never completes.
        takes_s: how long the leaf runs before it completes.
    """

    leaf: str
    result: Result
    takes_s: float = 0.0


Change = AgentValues | Behaviour | Alteration | Overriding | Clearing | GraphChange | LoopSwitch | LeafBehaviour
"""A change in the world, or of a loop."""


class Verb(StrEnum):
    """The actions of a main execution; each is a key of `main_execution`."""

    DECLARE = "declare"
    WITHDRAW = "withdraw"
    SET = "set"
    EXPECT = "expect"
    BEGIN = "begin"
    ACT = "act"
    ACTED = "acted"
    END = "end"
    PREVIEW = "preview"
    DECIDE = "decide"


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionArguments:
    """The arguments of a decision.

    Attributes:
        otherwise: the value that the robot itself sees; None if it sees none.
        since_s: the start of the oldest evidence that may be used, counted from the start of the story.
    """

    otherwise: Literal | None = None
    max_age_s: float = math.inf
    since_s: float = -math.inf
    wait_up_to_s: float = 0.0
    shadow: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step of the main execution.

    Attributes:
        names: the names of variables or skills.
        value: the value to which the step sets a variable.
        decision_arguments: the arguments of the step's decision.
    """

    verb: Verb
    names: tuple[str, ...]
    place: Place
    value: Literal | None = None
    decision_arguments: DecisionArguments = field(default_factory=DecisionArguments)


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """A check of a variable.

    Attributes:
        is_unknown: whether the variable must be unknown; if there is a `reason`, for this reason.
        value: the value that the variable must have, if `is_stated`.
        within: the tolerance for a number; None for equality up to rounding.
        source: the required writer; empty if any writer is allowed.
        because: a text that must occur in the explanation of `why`.
    """

    variable: str
    place: Place
    is_unknown: bool = False
    reason: Reason | None = None
    is_stated: bool = False
    value: Literal | None = None
    within: float | None = None
    source: str = ""
    because: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunningCheck:
    """A check of whether an observer runs."""

    observer: str
    is_running: bool
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A check of how the last decision on a variable was answered: `answered`, `fell_back` or `shadowed`."""

    variable: str
    expected_outcome: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectationCheck:
    """A check of the last outcome of a skill's expectations of a variable."""

    skill: str
    variable: str
    expected_outcome: ExpectationOutcome
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewCheck:
    """A check of the answer to a skill's preview.

    Attributes:
        expected_outcome: `holds`, `violated` or `unknown`.
        because: a text that must occur in the explanation of `why`.
    """

    skill: str
    expected_outcome: str
    because: str
    place: Place


Check = Belief | RunningCheck | Outcome | ExpectationCheck | PreviewCheck
"""A check of a moment."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """One instant, counted from the beginning: changes of the world, steps of the main execution, and checks."""

    at_s: float
    place: Place
    changes: tuple[Change, ...] = ()
    steps: tuple[Step, ...] = ()
    checks: tuple[Check, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Story:
    """A sequence of moments. If the timeline has a `start`, which all stories share, it is the first moment."""

    name: str
    place: Place
    moments: tuple[Moment, ...]

    @property
    def end_s(self) -> float:
        """Return the instant of the last moment."""
        return self.moments[-1].at_s

    @property
    def scripted_algorithms(self) -> frozenset[str]:
        """Return the algorithms that the story scripts; the functions of other algorithms are called."""
        changes = (change for moment in self.moments for change in moment.changes)
        return frozenset(
            change.algorithm for change in changes if isinstance(change, Behaviour) and change.returns is not None
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """A complete file.

    Attributes:
        spec: the name of the spec that is tested.
        seed: the seed of the random numbers that jobs use.
        handles: how the handles of resources are made for each story.
        repeat_intervals_s: a mapping from agents to the intervals at which they repeat their last values.
    """

    source: Source
    spec: str
    seed: int
    handles: tuple[Handle, ...]
    repeat_intervals_s: Mapping[str, float]
    stories: tuple[Story, ...]
