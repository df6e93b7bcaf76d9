"""What a state says in its semantic data, under `codra`."""

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
_OF_DECISIONS = ("outcomes", "wait_up_to_s", "max_age_s")


class AnnotationError(ValueError):
    """States say what the spec does not know, or what makes no sense. All of it is told at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotation:
    """What one state has to do with context.

    Attributes:
        skill: that the state is, from its start to its end; empty if none.
        acting: the skill of which the state is the acting part; empty if none.
        expect: skills that come next.
        decide: the variable that the state looks for; empty if none.
        outcomes: the state's outcome for each value of that variable, as text.
        wait_up_to_s: how long the decision waits for observers before the state looks.
        max_age_s: older evidence does not do.
    """

    skill: str = ""
    acting: str = ""
    expect: tuple[str, ...] = ()
    decide: str = ""
    outcomes: Mapping[str, str] = field(default_factory=dict)
    wait_up_to_s: float = 0.0
    max_age_s: float = math.inf

    def outcome_of(self, value: object) -> str:
        """Return the name of the outcome that says that the variable has a value."""
        text = value_text(value)
        return self.outcomes.get(text, text)


def value_text(value: object) -> str:
    """Return a value as outcomes and semantic data say it: `true`, `false`, a member, a number."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def states_within(state: State) -> Iterator[State]:
    """Yield a state and all that it consists of, into libraries."""
    yield state
    if isinstance(state, LibraryState):
        yield from states_within(state.state_copy)
    elif isinstance(state, ContainerState):
        for child in state.states.values():
            yield from states_within(child)


def annotated(root: State, codra: ContextManager[Any, Any]) -> list[tuple[State, Annotation]]:
    """Return the states below a root that say something, and what.

    Raises:
        AnnotationError: if what they say is wrong.
    """
    found: list[tuple[State, Annotation]] = []
    mistakes: list[str] = []
    for state in states_within(root):
        said = state.semantic_data.get(KEY)
        if said:
            try:
                annotation = _read(said)
                _check(state, annotation, codra)
                found.append((state, annotation))
            except (AnnotationError, UnknownNameError) as error:
                mistakes.append(f"{state.get_path()} ({state.name}): {error}")
    if mistakes:
        raise AnnotationError("\n".join(mistakes))
    return found


def _read(said: object) -> Annotation:
    if not isinstance(said, Mapping):
        raise AnnotationError(f"'{KEY}' holds keys and values, not {said!r}")
    unknown = [key for key in said if key not in _KEYS]
    if unknown:
        raise AnnotationError(f"unknown key {unknown[0]!r}: there are {', '.join(_KEYS)}")
    lost = [key for key in _OF_DECISIONS if key in said and not said.get("decide")]
    if lost:
        raise AnnotationError(f"{lost[0]!r} is for a state that decides: add 'decide'")
    return Annotation(
        skill=str(said.get("skill", "")),
        acting=str(said.get("acting", "")),
        expect=_names(said.get("expect", "")),
        decide=str(said.get("decide", "")),
        outcomes={str(value): str(name) for value, name in said.get("outcomes", {}).items()},
        wait_up_to_s=_seconds(said, "wait_up_to_s", 0.0),
        max_age_s=_seconds(said, "max_age_s", math.inf),
    )


def _names(said: str | Sequence[str]) -> tuple[str, ...]:
    """Return names out of a list, or out of a text with commas, as RAFCON's editor has it."""
    names = said.split(",") if isinstance(said, str) else said
    return tuple(stripped for name in names if (stripped := name.strip()))


def _seconds(said: Mapping[str, Any], key: str, default: float) -> float:
    try:
        seconds = float(said.get(key, default))
    except (TypeError, ValueError):
        seconds = math.nan
    if not seconds >= 0:
        raise AnnotationError(f"{key!r} is a number of seconds, not {said[key]!r}")
    return seconds


def _check(state: State, annotation: Annotation, codra: ContextManager[Any, Any]) -> None:
    skills = codra.skills()
    for name in (annotation.skill, annotation.acting, *annotation.expect):
        if name and name not in skills:
            raise AnnotationError(f"the spec has no skill {name!r}; it has {', '.join(map(repr, skills)) or 'none'}")
    if annotation.acting and annotation.acting not in _skills_around(state):
        raise AnnotationError(f"it acts for {annotation.acting!r}, and no state around it has that as 'skill'")
    if annotation.decide:
        _check_decision(state, annotation, codra)


def _check_decision(state: State, annotation: Annotation, codra: ContextManager[Any, Any]) -> None:
    codra.get(annotation.decide)  # raises if the spec lacks it
    if annotation.skill or annotation.acting:
        raise AnnotationError("it decides, and may be left out: then it can be neither skill nor action")
    if state.output_data_ports:
        names = ", ".join(repr(port.name) for port in state.output_data_ports.values())
        raise AnnotationError(f"it may be left out, and then nobody makes its output {names}: decide in another state")
    named = {outcome.name for outcome in state.outcomes.values()}
    wanted = tuple(annotation.outcomes.values()) or ("true", "false")
    missing = [name for name in wanted if name not in named]
    if missing:
        raise AnnotationError(f"it has no outcome {missing[0]!r}: add it, or say in 'outcomes' which means what")


def _skills_around(state: State) -> Iterator[str]:
    parent = state.parent
    while isinstance(parent, State):
        said = parent.semantic_data.get(KEY)
        if isinstance(said, Mapping) and said.get("skill"):
            yield str(said["skill"])
        parent = parent.parent
