"""What a spec says, as far as a question about a run needs it, in a form that a file can hold.

It comes from the forest that runs and from `sources.json` beside the generated code. A journal keeps it, so that `why`
needs neither the package nor the spec.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from codra_dsl.logic import Term
from codra_dsl.runtime.branch import Branch
from codra_dsl.runtime.model import Kind, ObserverModel, SkillModel, ValueType, VariableModel
from codra_dsl.runtime.observer import Observer
from codra_dsl.runtime.term_text import spoken, term_of

MANIFEST = "manifest.json"
SOURCES = "sources.json"
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
        places: of variables and skills, by `context/NAME` and `skill/NAME`.
    """

    name: str
    variables: Mapping[str, VariableModel]
    observers: Mapping[str, ObserverOutline]
    algorithms: Mapping[str, AlgorithmOutline]
    skills: Mapping[str, SkillModel]
    places: Mapping[str, Place]

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
    found = {} if folder is None else _json(folder / SOURCES)
    places = {key.removeprefix(f"{name}/"): place for key, about in found.items() if (place := _place(about))}
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
        places={key: place for key, place in places.items() if key.split("/")[0] in ("context", "skill")},
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


# As plain data


def plain_outline(outline: Outline) -> dict[str, Any]:
    """Return an outline as JSON can hold it."""
    return {
        "name": outline.name,
        "variables": {name: _plain_variable(each) for name, each in outline.variables.items()},
        "observers": {
            name: {
                "identifies": list(each.identifies),
                "algorithms": list(each.algorithms),
                "period_s": each.period_s,
                "place": _plain_place(each.place),
            }
            for name, each in outline.observers.items()
        },
        "algorithms": {name: _plain_algorithm(each) for name, each in outline.algorithms.items()},
        "skills": {
            name: {"preview": list(each.preview), "monitor": list(each.monitor), "changes": list(each.changes)}
            for name, each in outline.skills.items()
        },
        "places": {key: _plain_place(place) for key, place in outline.places.items()},
    }


def _plain_variable(variable: VariableModel) -> dict[str, Any]:
    return {
        **_plain_type(variable.type),
        "label": variable.label,
        "sources": list(variable.sources),
        "valid_for_s": _finite(variable.valid_for_s),
        "when_unobservable": variable.when_unobservable,
    }


def _plain_type(declared: ValueType) -> dict[str, Any]:
    return {
        "type": declared.kind,
        "unit": declared.unit,
        "range": None if declared.range is None else [_finite(end) for end in declared.range],
        "values": list(declared.members),
        "optional": declared.optional,
    }


def _plain_algorithm(algorithm: AlgorithmOutline) -> dict[str, Any]:
    return {
        "observable_when": [_plain_rule(rule) for rule in algorithm.conditions],
        "accept_when": [_plain_rule(rule) for rule in algorithm.accepts],
        "identifies": {name: _plain_rule(rule) for name, rule in algorithm.identifies.items()},
        "returns": {name: _plain_type(each) for name, each in algorithm.returns.items()},
        "timeout_s": _finite(algorithm.timeout_s),
        "place": _plain_place(algorithm.place),
    }


def _plain_rule(rule: Rule) -> dict[str, Any]:
    return {"text": rule.said, "python": rule.python, "place": _plain_place(rule.place)}


def _plain_place(place: Place | None) -> dict[str, Any] | None:
    if place is None:
        return None
    use = {} if place.use is None else {"use": _plain_place(place.use)}
    return {"file": place.file, "line": place.line, **use}


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def outline_of(plain: Mapping[str, Any]) -> Outline:
    """Return the outline that plain data holds.

    Raises:
        ValueError: if it holds none; KeyError, TypeError and AttributeError likewise.
    """
    return Outline(
        name=str(plain["name"]),
        variables={name: _variable_of(name, about) for name, about in plain["variables"].items()},
        observers={
            name: ObserverOutline(
                name=name,
                identifies=tuple(about["identifies"]),
                algorithms=tuple(about["algorithms"]),
                period_s=float(about["period_s"]),
                place=_place(about["place"]),
            )
            for name, about in plain["observers"].items()
        },
        algorithms={name: _algorithm_of(name, about) for name, about in plain["algorithms"].items()},
        skills={
            name: SkillModel(
                name=name,
                preview=tuple(about["preview"]),
                monitor=tuple(about["monitor"]),
                changes=tuple(about["changes"]),
            )
            for name, about in plain["skills"].items()
        },
        places={key: place for key, about in plain["places"].items() if (place := _place(about))},
    )


def _variable_of(name: str, about: Mapping[str, Any]) -> VariableModel:
    return VariableModel(
        name=name,
        type=_type_of(about),
        label=about["label"],
        sources=tuple(about["sources"]),
        valid_for_s=_bound(about["valid_for_s"], math.inf),
        when_unobservable=about["when_unobservable"],
    )


def _type_of(about: Mapping[str, Any]) -> ValueType:
    ends = about["range"]
    return ValueType(
        kind=cast("Kind", about["type"]),
        unit=about["unit"],
        range=None if ends is None else (_bound(ends[0], -math.inf), _bound(ends[1], math.inf)),
        members=tuple(about["values"]),
        optional=bool(about["optional"]),
    )


def _bound(number: float | None, instead: float) -> float:
    return instead if number is None else float(number)


def _algorithm_of(name: str, about: Mapping[str, Any]) -> AlgorithmOutline:
    return AlgorithmOutline(
        name=name,
        conditions=tuple(map(_rule_of, about["observable_when"])),
        accepts=tuple(map(_rule_of, about["accept_when"])),
        identifies={variable: _rule_of(rule) for variable, rule in about["identifies"].items()},
        returns={key: _type_of(each) for key, each in about["returns"].items()},
        timeout_s=_bound(about["timeout_s"], math.inf),
        place=_place(about["place"]),
    )


def _rule_of(about: Mapping[str, Any]) -> Rule:
    return Rule(said=about["text"], python=str(about["python"]), place=_place(about["place"]))


def _place(about: Any) -> Place | None:
    if not isinstance(about, Mapping) or "file" not in about:
        return None
    return Place(file=str(about["file"]), line=int(about["line"]), use=_place(about.get("use")))
