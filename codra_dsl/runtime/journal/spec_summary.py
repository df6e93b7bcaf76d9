"""What a spec says, as far as a question about a run needs it, in a form that a file can hold.

It comes from the forest that runs and from `sources.json` beside the generated code. A journal keeps it, so that `why`
needs neither the package nor the spec.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from codra_dsl.logic import Term
from codra_dsl.runtime.values.condition_text import spoken, term_of
from codra_dsl.runtime.values.model import SkillModel, ValueType, VariableModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where something stands in a spec.

    Attributes:
        use: where the template that it stands in is used.
    """

    file: str
    line: int
    use: Place | None = None

    def __str__(self) -> str:
        used = "" if self.use is None else f" (used at {self.use})"
        return f"{self.file}:{self.line}{used}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A condition of the spec.

    Attributes:
        python: the text that builds it.
        said: as the spec says it, where that is known.
    """

    python: str
    said: str | None = None
    place: Place | None = None

    @property
    def term(self) -> Term:
        """Return the condition itself."""
        return term_of(self.python)

    @property
    def text(self) -> str:
        """Return it as the spec says it, or nearly so."""
        return spoken(self.python) if self.said is None else self.said


@dataclass(frozen=True, slots=True, kw_only=True)
class AlgorithmOutline:
    """A perception algorithm: when it can be trusted, and what its results tell.

    Attributes:
        conditions: its observability preconditions.
        accepts: what a result must be to be good enough.
        identifies: by variable, what a result says of it.
        returns: the type of each value of its result.
    """

    name: str
    conditions: tuple[Rule, ...]
    accepts: tuple[Rule, ...]
    identifies: Mapping[str, Rule]
    returns: Mapping[str, ValueType]
    timeout_s: float
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverOutline:
    """An observer, with its algorithms by rank."""

    name: str
    identifies: tuple[str, ...]
    algorithms: tuple[str, ...]
    period_s: float
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecSummary:
    """A whole spec.

    Attributes:
        places: of variables and skills, by `context/NAME` and `skill/NAME`; of knowledge, likewise.
        nodes: by variable, the node of the knowledge graph of which it is an attribute; empty if there is no graph.
    """

    name: str
    variables: Mapping[str, VariableModel]
    observers: Mapping[str, ObserverOutline]
    algorithms: Mapping[str, AlgorithmOutline]
    skills: Mapping[str, SkillModel]
    places: Mapping[str, Place]
    nodes: Mapping[str, str] = field(default_factory=dict)

    def observer_of(self, variable: str) -> ObserverOutline | None:
        """Return the observer of a variable, if it has one."""
        return next((each for each in self.observers.values() if variable in each.identifies), None)

    def algorithms_of(self, variable: str) -> tuple[AlgorithmOutline, ...]:
        """Return the algorithms that identify a variable, by rank."""
        observer = self.observer_of(variable)
        if observer is None:
            return ()
        return tuple(
            self.algorithms[name] for name in observer.algorithms if variable in self.algorithms[name].identifies
        )


def place_of(about: Any) -> Place | None:
    """Return the place that plain data tells; None if it tells none."""
    if not isinstance(about, Mapping) or "file" not in about:
        return None
    return Place(file=str(about["file"]), line=int(about["line"]), use=place_of(about.get("use")))
