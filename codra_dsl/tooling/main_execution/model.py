"""A main execution as its decisions: the common form of all sources (P1, Algorithm 2, line 3)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from unicodedata import normalize

from codra_dsl.language.diagnostics import Diagnostic, Place, Rule, Severity
from codra_dsl.language.expression import MAX_NAME, is_identifier
from codra_dsl.language.frozen import dataclass

MAX_DECISIONS = 1_000
"""The maximum number of decisions of a source, each counted once for each place, skill and role."""

_MAX_LENGTH = MAX_NAME - 30
"""The maximum length of a name to which numbers and prefixes may be added."""

_LOWER_BEFORE_UPPER = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_MARKS = re.compile("[\u0300-\u036f]")
"""Combining marks, such as the dots of `ü` after its decomposition."""

_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9]+")


class Role(StrEnum):
    """When the main execution needs a value: before a skill acts, while it acts, or as the result of acting."""

    PRECONDITION = "precondition"
    HOLD = "hold"
    EFFECT = "effect"


class ValueType(StrEnum):
    """The types of decided values, as a spec writes them."""

    BOOL = "bool"
    FLOAT = "float"
    STR = "str"


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One place at which the main execution decides, or changes a value on which it decides.

    Attributes:
        name: the name of the context-variable; decisions with equal names need the same variable.
        text: what is asked, as the source writes it.
        skill: the name of the skill that needs the answer.
        call: the function or node that perceives the value; empty if the source names none.
        other_names: further names by which a spec may know the variable.
        is_made: whether the main execution decides at this place; otherwise it only changes the value there.
    """

    name: str
    text: str
    skill: str
    role: Role
    place: Place
    type: ValueType = ValueType.BOOL
    call: str = ""
    other_names: tuple[str, ...] = ()
    is_made: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class MainExecution:
    """What a source tells about a main execution.

    Attributes:
        decisions: the decisions, in the order of the source.
        skill_places: a mapping from the skills that decide to their first places, in the order of the source.
    """

    decisions: tuple[Decision, ...]
    skill_places: Mapping[str, Place]

    def by_variable(self) -> dict[str, list[Decision]]:
        """Return a mapping from the names of variables to their decisions, in the order of the source."""
        return _grouped(self.decisions, lambda decision: decision.name)

    def by_skill(self) -> dict[str, list[Decision]]:
        """Return a mapping from the names of skills to their decisions, in the order of the source."""
        return _grouped(self.decisions, lambda decision: decision.skill)


def _grouped(decisions: Iterable[Decision], key: Callable[[Decision], str]) -> dict[str, list[Decision]]:
    groups: dict[str, list[Decision]] = {}
    for decision in decisions:
        groups.setdefault(key(decision), []).append(decision)
    return groups


class SourceError(Exception):
    """Raised if a source cannot be read; it has the finding."""

    def __init__(self, message: str, place: Place, help: str) -> None:
        super().__init__(message)
        self.finding = Diagnostic(rule=_UNREADABLE, message=message, place=place, help=help)


_UNREADABLE = Rule(code="unreadable-source", name="unreadable-source", severity=Severity.ERROR)


class Names:
    """Gives each thing of a source a name that a spec can declare."""

    def __init__(self, fallback: str) -> None:
        self._fallback = fallback
        self._name_by_key: dict[tuple[str, ...], str] = {}
        self._taken_names: set[str] = set()

    def name(self, key: tuple[str, ...], words: Iterable[str]) -> str:
        """Return the name of a thing. Things with equal keys have the same name, and all others have other names."""
        if key not in self._name_by_key:
            name = _identifier(words, self._fallback)
            candidates = (name, *(f"{name}_{number}" for number in range(2, 2 * MAX_DECISIONS)))
            unique_name = next(candidate for candidate in candidates if candidate not in self._taken_names)
            self._taken_names.add(unique_name)
            self._name_by_key[key] = unique_name
        return self._name_by_key[key]


def _identifier(words: Iterable[str], fallback: str) -> str:
    """Return words in lower case, joined by `_`: `IsDoorOpen` gives `is_door_open`, and `Tür` gives `tur`."""
    plain_words = (_MARKS.sub("", normalize("NFKD", word[:_MAX_LENGTH])) for word in words)
    text = "_".join(_LOWER_BEFORE_UPPER.sub("_", word) for word in plain_words)
    name = _NOT_IN_NAMES.sub("_", text).strip("_").lower()[:_MAX_LENGTH].rstrip("_")
    candidates = (name, f"{fallback}_{name}", f"{name}_{fallback}")
    return next((candidate for candidate in candidates if name and is_identifier(candidate)), fallback)


class DecisionCollector:
    """Collects the decisions of a source, once for each variable, skill, role and place."""

    def __init__(self) -> None:
        self._decisions: dict[tuple[str, str, Role, Place], Decision] = {}
        self._skill_places: dict[str, Place] = {}

    def add(self, decision: Decision, skill_place: Place) -> None:
        """Add a decision.

        Raises:
            SourceError: if there are too many decisions.
        """
        self._decisions.setdefault((decision.name, decision.skill, decision.role, decision.place), decision)
        self._skill_places.setdefault(decision.skill, skill_place)
        if len(self._decisions) > MAX_DECISIONS:
            message = f"the source has more than {MAX_DECISIONS:,} decisions"
            raise SourceError(message, decision.place, help="import its parts one after the other")

    def main_execution(self) -> MainExecution:
        """Return the decisions, in the order of their places."""
        decisions = sorted(self._decisions.values(), key=lambda decision: decision.place)
        skills = sorted(self._skill_places.items(), key=lambda skill_and_place: skill_and_place[1])
        return MainExecution(decisions=tuple(decisions), skill_places=dict(skills))
