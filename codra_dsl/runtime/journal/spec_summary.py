"""The summary of a spec: the content that explanations of a run need, in a form that can be written to a file.

The summary is made from the running forest and from `sources.json` beside the generated code. A journal contains it, so
`why` needs neither the package nor the spec.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from codra_dsl.logic import Term
from codra_dsl.runtime.values.condition_text import format_condition, parse_condition
from codra_dsl.runtime.values.model import SkillModel, ValueType, VariableModel


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A place in a spec.

    Attributes:
        use: if the place is in a template, the place where this template is used; otherwise None.
        site: if a site states values of the element at the place, the place of the first of them; otherwise None.
        replaces: if the place is in the file of a site, the place in the spec of the value that the site replaces;
            otherwise None.
    """

    file: str
    line: int
    use: Place | None = None
    site: Place | None = None
    replaces: Place | None = None

    def __str__(self) -> str:
        notes = (("used at", self.use), ("changed at", self.site), ("replaces", self.replaces))
        notes_text = ", ".join(f"{verb} {place}" for verb, place in notes if place is not None)
        return f"{self.file}:{self.line}{f' ({notes_text})' if notes_text else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A condition of the spec.

    Attributes:
        python_text: the Python expression that builds the condition.
        source_text: the text of the condition in the spec; None if this text is not known.
    """

    python_text: str
    source_text: str | None = None
    place: Place | None = None

    @property
    def term(self) -> Term:
        """Return the parsed condition."""
        return parse_condition(self.python_text)

    @property
    def text(self) -> str:
        """Return the condition's text in the spec; if this text is not known, a text formatted from `python_text`."""
        return format_condition(self.python_text) if self.source_text is None else self.source_text


@dataclass(frozen=True, slots=True, kw_only=True)
class AlgorithmSummary:
    """A perception algorithm: its preconditions and how its results are evaluated.

    Attributes:
        preconditions: the observability preconditions.
        acceptance_conditions: the conditions that a result must meet to be accepted.
        identifies: for each variable, the condition or value that is computed from a result.
        returns: the type of each value in a result.
        host: the program that runs the function; empty for the program of the context manager.
    """

    name: str
    preconditions: tuple[Rule, ...]
    acceptance_conditions: tuple[Rule, ...]
    identifies: Mapping[str, Rule]
    returns: Mapping[str, ValueType]
    timeout_s: float
    host: str = ""
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverSummary:
    """An observer; its algorithms are sorted by rank."""

    name: str
    identifies: tuple[str, ...]
    algorithms: tuple[str, ...]
    period_s: float
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecSummary:
    """The summary of a complete spec.

    Attributes:
        places: the places of variables, skills and elements of knowledge. The keys are like `context/NAME` for a
            variable and `skill/NAME` for a skill.
        previews: for each skill whose preview has conditions, these conditions.
        nodes: for each variable, the graph node that has this variable as an attribute; empty without a knowledge
            graph.
    """

    name: str
    variables: Mapping[str, VariableModel]
    observers: Mapping[str, ObserverSummary]
    algorithms: Mapping[str, AlgorithmSummary]
    skills: Mapping[str, SkillModel]
    places: Mapping[str, Place]
    nodes: Mapping[str, str] = field(default_factory=dict)
    previews: Mapping[str, tuple[Rule, ...]] = field(default_factory=dict)

    def find_observer(self, variable: str) -> ObserverSummary | None:
        """Return the observer of a variable; None if the variable has no observer."""
        return next((observer for observer in self.observers.values() if variable in observer.identifies), None)

    def find_algorithms(self, variable: str) -> tuple[AlgorithmSummary, ...]:
        """Return the algorithms that identify a variable, sorted by rank."""
        observer = self.find_observer(variable)
        if observer is None:
            return ()
        return tuple(
            self.algorithms[name] for name in observer.algorithms if variable in self.algorithms[name].identifies
        )

    def find_derivation(self, variable: str) -> Rule | None:
        """Return the expression of a derived variable; None for other variables."""
        term = self.variables[variable].derived
        place = self.places.get(f"context/{variable}/derived")
        return None if term is None else Rule(python_text=repr(term), place=place)

    def rules(self) -> Iterator[Rule]:
        """Return the conditions of all algorithms and previews, and the expressions of all derived variables."""
        for name in self.variables:
            derivation = self.find_derivation(name)
            yield from () if derivation is None else (derivation,)
        for algorithm in self.algorithms.values():
            yield from (*algorithm.preconditions, *algorithm.acceptance_conditions, *algorithm.identifies.values())
        for rules in self.previews.values():
            yield from rules


def place_from_data(data: Any) -> Place | None:
    """Return the place that plain data describes; None if the data contains no place."""
    if not isinstance(data, Mapping) or "file" not in data:
        return None
    return Place(
        file=str(data["file"]),
        line=int(data["line"]),
        use=place_from_data(data.get("use")),
        site=place_from_data(data.get("site")),
        replaces=place_from_data(data.get("replaces")),
    )
