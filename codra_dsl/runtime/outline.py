"""What a spec says, as far as a question about a run needs it, in a form that a file can hold.

It comes from the forest that runs and from `sources.json` beside the generated code. A journal keeps it, so that `why`
needs neither the package nor the spec.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from codra_dsl.logic import Term
from codra_dsl.runtime.branch import Branch
from codra_dsl.runtime.model import ObserverModel, SkillModel, ValueType, VariableModel
from codra_dsl.runtime.observer import Observer
from codra_dsl.runtime.term_text import spoken, term_of

MANIFEST = "manifest.json"
SOURCES = "sources.json"
_PLACED = frozenset({"context", "skill", "type", "node", "edge", "task"})
_MANIFEST_FORMAT = "codra-manifest"


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
class Outline:
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


def package_folder(manager: object) -> Path | None:
    """Return the folder of the generated package whose context manager this is; None if it was put together by hand."""
    for cls in type(manager).__mro__:
        file = getattr(sys.modules.get(cls.__module__), "__file__", None)
        if file is not None and manifest_of(Path(file).parent):
            return Path(file).parent
    return None


def manifest_of(folder: Path | None) -> Mapping[str, Any]:
    """Return the manifest of a generated package, empty if the folder is none."""
    if folder is None:
        return {}
    manifest = _json(folder / MANIFEST)
    return manifest if manifest.get("format") == _MANIFEST_FORMAT else {}


def _json(path: Path) -> Mapping[str, Any]:
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def place_of(about: Any) -> Place | None:
    """Return the place that plain data tells; None if it tells none."""
    if not isinstance(about, Mapping) or "file" not in about:
        return None
    return Place(file=str(about["file"]), line=int(about["line"]), use=place_of(about.get("use")))


def places_in(folder: Path | None, name: str) -> Mapping[str, Place]:
    """Return where all of a spec stands, by what it is and its name; nothing if there is no generated package.

    Args:
        folder: of the package.
        name: of the spec.
    """
    found = {} if folder is None else _json(folder / SOURCES)
    return {key.removeprefix(f"{name}/"): place for key, about in found.items() if (place := place_of(about))}


def outlined(
    name: str,
    variables: Iterable[VariableModel],
    observers: Iterable[Observer],
    skills: Iterable[SkillModel],
    folder: Path | None,
) -> Outline:
    """Return the outline of a spec whose forest is built.

    Args:
        name: of the spec.
        variables: C_M.
        observers: with their trees.
        skills: of the main execution.
        folder: of the generated package, which tells where all of it stands in the spec.
    """
    places = places_in(folder, name)
    branches = [(observer.model, branch) for observer in observers for branch in observer.branches]
    return Outline(
        name=name,
        variables={variable.name: variable for variable in variables},
        observers={
            model.name: _observer_outline(model, [each for other, each in branches if other is model], places)
            for model, _ in branches
        },
        algorithms={branch.algorithm.name: _algorithm_outline(branch, places) for _, branch in branches},
        skills={skill.name: skill for skill in skills},
        places={key: place for key, place in places.items() if key.split("/")[0] in _PLACED},
    )


def _observer_outline(model: ObserverModel, branches: Sequence[Branch], places: Mapping[str, Place]) -> ObserverOutline:
    return ObserverOutline(
        name=model.name,
        identifies=model.identifies,
        algorithms=tuple(branch.algorithm.name for branch in branches),
        period_s=model.period_s,
        place=places.get(f"observer/{model.name}"),
    )


def _algorithm_outline(branch: Branch, places: Mapping[str, Place]) -> AlgorithmOutline:
    algorithm = branch.algorithm
    key = f"perception/{algorithm.name}"
    identifies = {
        variable: Rule(python=repr(term), place=places.get(f"{key}/identifies/{variable}"))
        for variable, term in branch.tells.items()
    }
    return AlgorithmOutline(
        name=algorithm.name,
        conditions=_condition_rules(branch, key, places),
        accepts=_rules(branch.accepts, f"{key}/accept_when", places),
        identifies=identifies,
        returns=algorithm.returns,
        timeout_s=algorithm.timeout_s,
        place=places.get(key),
    )


def _condition_rules(branch: Branch, key: str, places: Mapping[str, Place]) -> tuple[Rule, ...]:
    """Return the preconditions of a branch; those that `given` brings stand where the algorithm does."""
    given = {f"known({name})" for name in branch.algorithm.given}
    own = [(text, term) for text, term in branch.conditions if text not in given]
    rules = {rule.said: rule for rule in _rules(own, f"{key}/observable_when", places)}
    return tuple(
        rules.get(text, Rule(said=text, python=repr(term), place=places.get(key))) for text, term in branch.conditions
    )


def _rules(conditions: Sequence[tuple[str, Term]], key: str, places: Mapping[str, Place]) -> tuple[Rule, ...]:
    """Return conditions with their places, if the places are those of as many conditions."""
    found = [places.get(f"{key}/{number}") for number in range(len(conditions))]
    if f"{key}/{len(conditions)}" in places:
        found = [None] * len(conditions)
    return tuple(
        Rule(said=text, python=repr(term), place=place) for (text, term), place in zip(conditions, found, strict=True)
    )
