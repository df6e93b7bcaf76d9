"""Annotations of states: their semantic data under `codra`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rafcon.core.states.container_state import ContainerState
from rafcon.core.states.library_state import LibraryState
from rafcon.core.states.state import State

from codra_dsl.runtime import ContextManager, UnknownNameError

KEY = "codra"

_KEYS = ("skill", "acting", "expect", "decide", "outcomes", "wait_up_to_s", "max_age_s")
_DECISION_KEYS = ("outcomes", "wait_up_to_s", "max_age_s")


class AnnotationError(ValueError):
    """Annotations of states contradict the spec or make no sense. The message lists all mistakes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotation:
    """The annotation of one state.

    Attributes:
        skill: the name of the skill, if the state as a whole is a skill; otherwise empty.
        acting: the name of the skill, if the state is the acting part of this skill; otherwise empty.
        expect: the skills that come next.
        decide: the variable, if the state looks for the value of a variable; otherwise empty.
        outcomes: a mapping from each value of this variable, as text, to the name of the state's outcome.
        wait_up_to_s: how long the decision waits for observers before the state looks.
        max_age_s: a value with older evidence is treated as unknown.
    """

    skill: str = ""
    acting: str = ""
    expect: tuple[str, ...] = ()
    decide: str = ""
    outcomes: Mapping[str, str] = field(default_factory=dict)
    wait_up_to_s: float = 0.0
    max_age_s: float = math.inf

    def outcome_of(self, value: object) -> str:
        """Return the name of the outcome for a value of the variable."""
        text = value_text(value)
        return self.outcomes.get(text, text)


def value_text(value: object) -> str:
    """Return the text of a value in outcomes and semantic data: `true`, `false`, a member, a number."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def states_within(state: State) -> Iterator[State]:
    """Yield a state and all states within it, including those of libraries."""
    yield state
    if isinstance(state, LibraryState):
        yield from states_within(state.state_copy)
    elif isinstance(state, ContainerState):
        for child in state.states.values():
            yield from states_within(child)


def annotated_states(root: State, codra: ContextManager[Any, Any]) -> list[tuple[State, Annotation]]:
    """Return the annotated states below a root, with their annotations.

    Raises:
        AnnotationError: if annotations are wrong.
    """
    annotations: list[tuple[State, Annotation]] = []
    mistakes: list[str] = []
    for state in states_within(root):
        data = state.semantic_data.get(KEY)
        if data:
            try:
                annotation = _read_annotation(data)
                _check(state, annotation, codra)
                annotations.append((state, annotation))
            except (AnnotationError, UnknownNameError) as error:
                mistakes.append(f"{state.get_path()} ({state.name}): {error}")
    if mistakes:
        raise AnnotationError("\n".join(mistakes))
    return annotations


def _read_annotation(data: object) -> Annotation:
    if not isinstance(data, Mapping):
        raise AnnotationError(f"'{KEY}' holds keys and values, not {data!r}")
    unknown_keys = [key for key in data if key not in _KEYS]
    if unknown_keys:
        raise AnnotationError(f"unknown key {unknown_keys[0]!r}: there are {', '.join(_KEYS)}")
    misplaced_keys = [key for key in _DECISION_KEYS if key in data and not data.get("decide")]
    if misplaced_keys:
        raise AnnotationError(f"{misplaced_keys[0]!r} is for a state that decides: add 'decide'")
    return Annotation(
        skill=str(data.get("skill", "")),
        acting=str(data.get("acting", "")),
        expect=_names(data.get("expect", "")),
        decide=str(data.get("decide", "")),
        outcomes={str(value): str(name) for value, name in data.get("outcomes", {}).items()},
        wait_up_to_s=_seconds(data, "wait_up_to_s", 0.0),
        max_age_s=_seconds(data, "max_age_s", math.inf),
    )


def _names(raw_names: str | Sequence[str]) -> tuple[str, ...]:
    """Return names from a list, or from a text with commas, which RAFCON's editor writes."""
    names = raw_names.split(",") if isinstance(raw_names, str) else raw_names
    return tuple(stripped_name for name in names if (stripped_name := name.strip()))


def _seconds(data: Mapping[str, Any], key: str, default: float) -> float:
    try:
        seconds = float(data.get(key, default))
    except (TypeError, ValueError):
        seconds = math.nan
    if not seconds >= 0:
        raise AnnotationError(f"{key!r} is a number of seconds, not {data[key]!r}")
    return seconds


def _check(state: State, annotation: Annotation, codra: ContextManager[Any, Any]) -> None:
    skills = codra.skills()
    for name in (annotation.skill, annotation.acting, *annotation.expect):
        if name and name not in skills:
            raise AnnotationError(f"the spec has no skill {name!r}; it has {', '.join(map(repr, skills)) or 'none'}")
    if annotation.acting and annotation.acting not in _skills_around(state):
        raise AnnotationError(f"it acts for {annotation.acting!r}, but no state around it has this 'skill'")
    if annotation.decide:
        _check_decision(state, annotation, codra)


def _check_decision(state: State, annotation: Annotation, codra: ContextManager[Any, Any]) -> None:
    codra.get(annotation.decide)  # raises an error if the spec does not declare the variable
    if annotation.skill or annotation.acting:
        raise AnnotationError("it decides, so it may be skipped: it cannot also be a skill or an action")
    if state.output_data_ports:
        names = ", ".join(repr(port.name) for port in state.output_data_ports.values())
        raise AnnotationError(f"it may be skipped, and then its output {names} is missing: decide in another state")
    outcome_names = {outcome.name for outcome in state.outcomes.values()}
    needed_outcome_names = tuple(annotation.outcomes.values()) or ("true", "false")
    missing_outcome_names = [name for name in needed_outcome_names if name not in outcome_names]
    if missing_outcome_names:
        raise AnnotationError(
            f"it has no outcome {missing_outcome_names[0]!r}: add it, or map values to outcomes in 'outcomes'"
        )


def _skills_around(state: State) -> Iterator[str]:
    parent = state.parent
    while isinstance(parent, State):
        data = parent.semantic_data.get(KEY)
        if isinstance(data, Mapping) and data.get("skill"):
            yield str(data["skill"])
        parent = parent.parent
