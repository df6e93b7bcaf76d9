"""A spec that passed every check, with its conditions typed and lowered: the only input of the build plan.

Only `codra_dsl.language.check` makes a `CheckedSpec`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from codra_dsl.language.check.checked.knowledge import CheckedKnowledge
from codra_dsl.language.check.checked.loops import CheckedMape
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.model import Algorithm, Spec, Variable


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedCondition:
    """A condition, typed and lowered.

    Attributes:
        text: as written, on one line; people read it on the node of the tree.
        python: the expression that builds it from `codra_dsl.runtime.values.conditions`, e.g. `value("markers") >= 3`.
        variables: the names it reads, sorted: context-variables in `observable_when`, returned values elsewhere.
    """

    text: str
    python: str
    variables: tuple[str, ...]
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedAlgorithm:
    """A perception algorithm with its conditions.

    Attributes:
        identifies: (variable's name, how its value follows from the result), in file order.
        waits_for: the context-variables that it needs, without `feedback`, sorted: the edges drawn as `requires`.
        feedback: the context-variables that it reads without waiting for them, although they need a variable that it
            identifies, directly or through others: it can run while only one of them is unknown. Sorted; drawn as
            `feedback`.
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
        """Return C_Oi of this algorithm (P1, Equation 7): every context-variable that it reads, sorted."""
        return tuple(sorted((*self.waits_for, *self.feedback))) if self.feedback else self.waits_for


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedExpectation:
    """An expectation of a skill about a monitored variable, lowered.

    Attributes:
        text: as people read it, e.g. `door_open becomes true within 20 s`.
        python: the condition that is expected to become true, or to stay true.
        within_s: how long it may take to become true; None if it is expected to stay true.
    """

    text: str
    python: str
    within_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedSpec:
    """A spec that can be planned.

    Attributes:
        variables: C_M as declared, by name, in file order.
        algorithms: by name, in file order.
        producers: for each variable that has algorithms: their names by `rank`, then name.
        decisions: the variables that Algorithm 2 starts from (its line 3), in order: those that skills preview and
            monitor, then those with an algorithm that loops read or that wake agents; if no skill is declared, every
            variable that has an algorithm.
        expectations: by skill, its expectations about the variables that it monitors.
        poses: by the name of each variable that follows from poses, the expression that builds its comparison.
        knowledge: None if the spec declares none; likewise `mape`, its loops.
    """

    spec: Spec
    variables: Mapping[str, Variable]
    algorithms: Mapping[str, CheckedAlgorithm]
    producers: Mapping[str, tuple[str, ...]]
    decisions: tuple[str, ...]
    expectations: Mapping[str, tuple[CheckedExpectation, ...]] = field(default_factory=dict)
    poses: Mapping[str, str] = field(default_factory=dict)
    knowledge: CheckedKnowledge | None = None
    mape: CheckedMape | None = None
