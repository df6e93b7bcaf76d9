"""A checked spec, which has no binding errors and is the only input of the build plan.

The conditions of the spec are typed and translated to Python expressions.
Only `codra_dsl.language.check` makes a `CheckedSpec`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from codra_dsl.language.check.checked.knowledge import CheckedKnowledge
from codra_dsl.language.check.checked.loops import CheckedMape
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Algorithm, Spec, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedCondition:
    """A condition and its Python expression.

    Attributes:
        text: the condition as written, on one line. The node of the generated tree shows this text to people.
        python: the Python expression that builds the condition from `codra_dsl.runtime.values.conditions`, e.g.
            `value("markers") >= 3`.
        variables: the names that the condition reads, sorted. They are context-variables in `observable_when`, and
            returned values elsewhere.
    """

    text: str
    python: str
    variables: tuple[str, ...]
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAlgorithm:
    """A perception algorithm with its conditions.

    Attributes:
        identifies: for each variable, its name and the condition that computes its value from the result, in file
            order.
        waits_for: the context-variables that the algorithm needs, except those in `feedback`, sorted. The variables are
            drawn as edges `requires`.
        feedback: the context-variables that the algorithm reads without waiting for them, sorted. Each of them needs,
            directly or through other variables, a variable that the algorithm identifies. The algorithm can run
            although any single one of them is unknown. The variables are drawn as edges `feedback`.
    """

    algorithm: Algorithm
    observable_when: tuple[CheckedCondition, ...]
    accept_when: tuple[CheckedCondition, ...]
    identifies: tuple[tuple[str, CheckedCondition], ...]
    waits_for: tuple[str, ...]
    feedback: tuple[str, ...]

    @property
    def name(self) -> str:
        """Return the algorithm's name."""
        return self.algorithm.name

    @property
    def needs(self) -> tuple[str, ...]:
        """Return C_Oi of this algorithm (P1, Equation 7): every context-variable that the algorithm reads, sorted."""
        return tuple(sorted((*self.waits_for, *self.feedback))) if self.feedback else self.waits_for


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedExpectation:
    """An expectation of a skill about a monitored variable, and its Python expression.

    Attributes:
        text: the expectation as people read it, e.g. `door_open becomes true within 20 s`.
        python: the condition that is expected to become true, or to stay true.
        within_s: the time within which the condition must become true; None if the condition is expected to stay true.
    """

    text: str
    python: str
    within_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedSpec:
    """A spec without errors, from which a build plan can be made.

    Attributes:
        variables: the declared context-variables C_M, by name, in file order.
        algorithms: the perception algorithms, by name, in file order.
        producers: for each variable that algorithms identify, the names of these algorithms, sorted by `rank`, then by
            name.
        decisions: the variables that Algorithm 2 starts from (line 3 of the algorithm), in order. First come the
            variables that skills preview and monitor. Then come those variables that loops read or that are in `wakes`
            patterns of agents, if an algorithm identifies them. If no skill is declared, all variables that an
            algorithm identifies are included.
        expectations: for each skill, the expectations about the variables that the skill monitors.
        previews: for each skill, the conditions of its preview. A variable that is named alone, and that a condition
            reads as well, has a condition that holds if it is known.
        poses: a mapping from the name of each variable that is computed from poses to the Python expression of its
            comparison.
        derived: the expression of each derived variable.
        knowledge: the checked knowledge; None if the spec declares no knowledge.
        mape: the checked loops; None if the spec declares no loops.
    """

    spec: Spec
    variables: Mapping[str, Variable]
    algorithms: Mapping[str, CheckedAlgorithm]
    producers: Mapping[str, tuple[str, ...]]
    decisions: tuple[str, ...]
    expectations: Mapping[str, tuple[CheckedExpectation, ...]] = field(default_factory=dict)
    previews: Mapping[str, tuple[CheckedCondition, ...]] = field(default_factory=dict)
    poses: Mapping[str, str] = field(default_factory=dict)
    derived: Mapping[str, CheckedCondition] = field(default_factory=dict)
    knowledge: CheckedKnowledge | None = None
    mape: CheckedMape | None = None

    @property
    def expressions_of_variables(self) -> Mapping[str, str]:
        """The Python expression of each variable that is computed from the graph or derived from other variables."""
        return {**self.poses, **{name: condition.python for name, condition in self.derived.items()}}
