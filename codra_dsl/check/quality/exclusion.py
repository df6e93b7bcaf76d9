"""Decisions whose parts exclude each other: what makes the one true keeps the other from being observed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.check.possible import can_hold
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import NEED_KEYS, OBSERVER, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import Node, names_in, spelt_out
from codra_dsl.model import Algorithm, Condition, Expectation, Expected, Reference, Skill, WhenUnobservable

MAX_STEPS = 100_000
"""How often algorithms are judged; what comes later is not looked at."""


def excluded_previews(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a skill decides on can be observed where other parts of the decision are as skills make them.

    For `x` that a skill previews and that others make become V, `y` beside it is excluded if every algorithm for it has
    preconditions that cannot be true with any such V. A value that is kept counts as known if whoever makes `x` so has
    decided on it before.
    """
    if scope.lost("perception", *NEED_KEYS, "identifies") or scope.lost("skills", "preview", "monitor"):
        return
    made = _made(scope, faults)
    search = _Search(scope, faults)
    told: set[tuple[str, str]] = set()
    for skill in scope.spec.skills:
        for state in skill.preview:
            makers = made.get(state.name, [])
            if any(maker is not skill for maker, _ in makers):
                excluded = search.excluded(state.name, [expectation for _, expectation in makers])
                for wanted in skill.preview:
                    lost = excluded.get(wanted.name)
                    new = (state.name, wanted.name) not in told
                    if lost is not None and new and not _is_kept(scope, wanted.name, makers):
                        told.add((state.name, wanted.name))
                        yield _finding(skill, state, wanted, makers, lost)


_Makers = Sequence[tuple[Skill, Expectation]]


@dataclass(frozen=True, slots=True)
class _Exclusion:
    """Why an algorithm cannot run: what it asks for, where, and through which variable that is so."""

    algorithm: Algorithm
    text: str
    place: Place
    through: str | None


def _made(scope: Scope, faults: Faults) -> Mapping[str, list[tuple[Skill, Expectation]]]:
    """Return, for each variable that skills make become something, which do and what."""
    found: dict[str, list[tuple[Skill, Expectation]]] = {}
    for skill in scope.spec.skills:
        for expectation in skill.monitor:
            name, condition = expectation.variable.name, expectation.condition
            if expectation.expected is Expected.BECOMES and condition is not None and faults.sound("context", name):
                judgement = scope.judgement(condition)
                if judgement is not None and not judgement.problems and name in scope.variables:
                    found.setdefault(name, []).append((skill, expectation))
    return found


def _is_kept(scope: Scope, name: str, makers: _Makers) -> bool:
    """Return whether who makes the other variable so has looked at this one before, and its value stays."""
    keeps = scope.variables[name].when_unobservable is WhenUnobservable.KEEP
    return keeps and all(any(each.name == name for each in maker.preview) for maker, _ in makers)


def _finding(skill: Skill, state: Reference, wanted: Reference, makers: _Makers, lost: _Exclusion) -> Diagnostic:
    maker, expectation = makers[0]
    through = "" if lost.through is None else f", and '{lost.through}' cannot be observed then"
    return finding(
        "excluded-preview",
        f"skill '{skill.name}' decides on '{wanted.name}', which cannot be observed once '{state.name}' is as skill "
        f"'{maker.name}' makes it: algorithm '{lost.algorithm.name}' needs '{lost.text}'{through}",
        wanted.place,
        path=f"skills.{skill.name}.preview",
        way_out=f"preview '{wanted.name}' in skill '{maker.name}' instead, or give it an algorithm that works after it",
        related=(
            Related(f"'{state.name}' is decided on with it", state.place),
            Related(f"skill '{maker.name}' makes it so", expectation.place),
            Related("cannot be true then", lost.place),
        ),
    )


class _Search:
    """Finds what cannot be observed while a variable has some value, directly and through what is forgotten then."""

    def __init__(self, scope: Scope, faults: Faults) -> None:
        self._scope = scope
        self._faults = faults
        self._left = MAX_STEPS
        self._known: dict[str, Mapping[str, _Exclusion]] = {}
        self._readers: dict[str, list[str]] = {}
        for name, needs in scope.needs.items():
            for need in needs:
                self._readers.setdefault(need, []).append(name)

    def excluded(self, name: str, expectations: Sequence[Expectation]) -> Mapping[str, _Exclusion]:
        """Return the variables that cannot be observed, whichever of its expected values a variable has."""
        if name not in self._known:
            conditions = (each.condition for each in expectations if each.condition is not None)
            facts = dict.fromkeys(condition.tree for condition in conditions if condition.tree is not None)
            found = [self._excluded(name, fact) for fact in facts]
            common = set(found[0]).intersection(*found)
            self._known[name] = {each: lost for each, lost in found[0].items() if each in common}
        return self._known[name]

    def _excluded(self, name: str, fact: Node) -> Mapping[str, _Exclusion]:
        """Return the variables that cannot be observed while a fact about one of them holds, and why."""
        blocked: dict[str, _Exclusion] = {}
        lost: dict[str, _Exclusion] = {}
        unknown: set[str] = set()
        waiting = list(self._readers.get(name, ()))
        while waiting and self._left > 0:
            self._left -= 1
            reader = waiting.pop()
            why = None if reader in blocked else self._exclusion(self._scope.algorithms[reader], fact, unknown)
            if why is None:
                continue
            blocked[reader] = why
            for entry in why.algorithm.identifies:
                variable = entry.variable.name
                producers = self._scope.producers[variable]
                if variable != name and variable not in lost and all(each in blocked for each in producers):
                    if self._has_other_sources(variable):
                        continue
                    lost[variable] = blocked[producers[0]]
                    if self._scope.variables[variable].when_unobservable is WhenUnobservable.FORGET:
                        unknown.add(variable)
                        waiting += self._readers.get(variable, ())
        return lost if self._left > 0 else {}

    def _has_other_sources(self, name: str) -> bool:
        variable = self._scope.variables.get(name)
        if variable is None or not self._faults.sound("context", name):
            return True
        keys = ("source", "when_unobservable")
        others = any(source.name != OBSERVER for source in variable.sources)
        return others or not self._scope.readable("context", name, *keys)

    def _exclusion(self, algorithm: Algorithm, fact: Node, unknown: set[str]) -> _Exclusion | None:
        """Return why an algorithm cannot run while a fact holds and some variables are unknown; None if it can."""
        if not self._faults.sound("perception", algorithm.name):
            return None
        for reference in algorithm.given:
            if reference.name in unknown:
                return _Exclusion(algorithm, reference.name, reference.place, reference.name)
        conditions = [(each, tree) for each in algorithm.observable_when if (tree := self._sound_tree(each))]
        trees = [tree for _, tree in conditions]
        types = self._scope.context_types
        if can_hold([fact, *trees], unknown, types):
            return None
        for condition, tree in conditions:
            if not can_hold([fact, tree], unknown, types):
                through = next((each for each in sorted(unknown) if _is_through(condition, each)), None)
                directly = not can_hold([fact, tree], (), types)
                return _Exclusion(algorithm, condition.text, condition.place, None if directly else through)
        place = algorithm.places.get("observable_when", algorithm.place)
        return _Exclusion(algorithm, " and ".join(each.text for each, _ in conditions), place, None)

    def _sound_tree(self, condition: Condition) -> Node | None:
        judgement = self._scope.judgement(condition)
        return None if judgement is None or judgement.problems else spelt_out(judgement.typed.node)


def _is_through(condition: Condition, name: str) -> bool:
    return condition.tree is not None and any(each.name == name for each in names_in(condition.tree))
