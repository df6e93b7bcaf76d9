"""Decisions whose parts exclude each other: a value of one variable prevents that another one is observed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import NEED_KEYS, OBSERVER, Silenced, SpecIndex
from codra_dsl.language.check.solver.satisfiable import can_hold
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import Node, names_in, spelt_out
from codra_dsl.language.model import Algorithm, Condition, Expectation, Expected, Reference, Skill, WhenUnobservable

MAX_STEPS = 100_000
"""The maximum number of evaluated algorithms; the search stops after them."""


def excluded_previews(scope: SpecIndex, faults: Silenced) -> Iterator[Diagnostic]:
    """Every variable that a skill previews can be observed with the values that other skills give the others.

    Let a skill preview `x` and `y`, and let other skills make `x` become V. Then `y` is excluded if every algorithm for
    it has preconditions that cannot be true with any such V. A kept value counts as known if the skill that makes `x`
    become V has previewed it before.
    """
    if scope.lost("perception", *NEED_KEYS, "identifies") or scope.lost("skills", "preview", "monitor"):
        return
    made = _made(scope, faults)
    search = _Search(scope, faults)
    reported: set[tuple[str, str]] = set()
    for skill in scope.spec.skills:
        for state in skill.preview:
            makers = made.get(state.name, [])
            if any(maker is not skill for maker, _ in makers):
                excluded = search.excluded(state.name, [expectation for _, expectation in makers])
                for wanted in skill.preview:
                    lost = excluded.get(wanted.name)
                    new = (state.name, wanted.name) not in reported
                    if lost is not None and new and not _is_kept(scope, wanted.name, makers):
                        reported.add((state.name, wanted.name))
                        yield _finding(skill, state, wanted, makers, lost)


_Makers = Sequence[tuple[Skill, Expectation]]


@dataclass(frozen=True, slots=True)
class _Exclusion:
    """Why an algorithm cannot run: its precondition, the place, and the variable that causes it, if another one."""

    algorithm: Algorithm
    text: str
    place: Place
    through: str | None


def _made(scope: SpecIndex, faults: Silenced) -> Mapping[str, list[tuple[Skill, Expectation]]]:
    """Return, by variable, the skills that make it become a value, with their expectations."""
    made: dict[str, list[tuple[Skill, Expectation]]] = {}
    for skill in scope.spec.skills:
        for expectation in skill.monitor:
            name, condition = expectation.variable.name, expectation.condition
            if expectation.expected is Expected.BECOMES and condition is not None and faults.sound("context", name):
                judgement = scope.judgement(condition)
                if judgement is not None and not judgement.problems and name in scope.variables:
                    made.setdefault(name, []).append((skill, expectation))
    return made


def _is_kept(scope: SpecIndex, name: str, makers: _Makers) -> bool:
    """Return whether all makers preview this variable before, and its value is kept."""
    keeps = scope.variables[name].when_unobservable is WhenUnobservable.KEEP
    return keeps and all(any(reference.name == name for reference in maker.preview) for maker, _ in makers)


def _finding(skill: Skill, state: Reference, wanted: Reference, makers: _Makers, lost: _Exclusion) -> Diagnostic:
    maker, expectation = makers[0]
    through = "" if lost.through is None else f", and '{lost.through}' cannot be observed then"
    return finding(
        "excluded-preview",
        f"skill '{skill.name}' decides on '{wanted.name}', which cannot be observed once '{state.name}' has the value "
        f"from skill '{maker.name}': algorithm '{lost.algorithm.name}' needs '{lost.text}'{through}",
        wanted.place,
        path=f"skills.{skill.name}.preview",
        help=f"preview '{wanted.name}' in skill '{maker.name}' instead, or add an algorithm that can run after it",
        related=(
            Related(f"'{state.name}' is in the same decision", state.place),
            Related(f"skill '{maker.name}' changes it", expectation.place),
            Related("cannot be true afterwards", lost.place),
        ),
    )


class _Search:
    """Finds variables that cannot be observed while a variable has a value, directly or through forgotten variables."""

    def __init__(self, scope: SpecIndex, faults: Silenced) -> None:
        self._scope = scope
        self._faults = faults
        self._left = MAX_STEPS
        self._known: dict[str, Mapping[str, _Exclusion]] = {}
        self._readers: dict[str, list[str]] = {}
        for name, needs in scope.needs.items():
            for need in needs:
                self._readers.setdefault(need, []).append(name)

    def excluded(self, name: str, expectations: Sequence[Expectation]) -> Mapping[str, _Exclusion]:
        """Return the variables that cannot be observed with any of the expected values of a variable."""
        if name not in self._known:
            conditions = (expectation.condition for expectation in expectations if expectation.condition is not None)
            facts = dict.fromkeys(condition.tree for condition in conditions if condition.tree is not None)
            exclusions = [self._excluded(name, fact) for fact in facts]
            common = set(exclusions[0]).intersection(*exclusions)
            self._known[name] = {excluded: lost for excluded, lost in exclusions[0].items() if excluded in common}
        return self._known[name]

    def _excluded(self, name: str, fact: Node) -> Mapping[str, _Exclusion]:
        """Return the variables that cannot be observed while a fact about a variable holds, with the reasons."""
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
                if variable != name and variable not in lost and all(producer in blocked for producer in producers):
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
        conditions = [
            (condition, tree) for condition in algorithm.observable_when if (tree := self._sound_tree(condition))
        ]
        trees = [tree for _, tree in conditions]
        types = self._scope.context_types
        if can_hold([fact, *trees], unknown, types):
            return None
        for condition, tree in conditions:
            if not can_hold([fact, tree], unknown, types):
                through = next(
                    (unknown_name for unknown_name in sorted(unknown) if _is_through(condition, unknown_name)), None
                )
                directly = not can_hold([fact, tree], (), types)
                return _Exclusion(algorithm, condition.text, condition.place, None if directly else through)
        place = algorithm.places.get("observable_when", algorithm.place)
        return _Exclusion(algorithm, " and ".join(condition.text for condition, _ in conditions), place, None)

    def _sound_tree(self, condition: Condition) -> Node | None:
        judgement = self._scope.judgement(condition)
        return None if judgement is None or judgement.problems else spelt_out(judgement.typed.node)


def _is_through(condition: Condition, name: str) -> bool:
    return condition.tree is not None and any(read.name == name for read in names_in(condition.tree))
