"""Decisions that need a variable which cannot be observed while another variable of the decision has some value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import NEED_KEYS, OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.quality.conditions import sound_conditions
from codra_dsl.language.check.solver.satisfiable import can_hold
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import Node, names_in, spelt_out
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Algorithm, Condition, Expectation, Expected, Reference, Skill, WhenUnobservable

MAX_STEPS = 100_000
"""The maximum number of evaluated algorithms. After this number, the search stops."""


def excluded_previews(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable that a skill previews can be observed after other skills have changed the other variables.

    Let a skill preview `x` and `y`, and let other skills set `x` to V. Then `y` is excluded if every algorithm for `y`
    has preconditions that cannot be true with any such V. There is one exception: if the value of `y` is kept, and the
    skills that set `x` to V have previewed `y` before, then `y` is assumed to be known. If no such V satisfies the
    preview, the skill does not act, and nothing is reported.
    """
    if spec_index.has_damage("perception", *NEED_KEYS, "identifies") or spec_index.has_damage(
        "skills", "preview", "monitor"
    ):
        return
    achievers_by_variable = _achievers_by_variable(spec_index, faults)
    search = _Search(spec_index, faults)
    reported_pairs: set[tuple[str, str]] = set()
    for skill in spec_index.spec.skills:
        for state in skill.preview:
            achievers = achievers_by_variable.get(state.name, [])
            if any(achiever is not skill for achiever, _ in achievers) and _allows_one_of(spec_index, skill, achievers):
                exclusions = search.common_exclusions(state.name, [expectation for _, expectation in achievers])
                for preview in skill.preview:
                    exclusion = exclusions.get(preview.name)
                    is_new = (state.name, preview.name) not in reported_pairs
                    if exclusion is not None and is_new and not _is_kept(spec_index, preview.name, achievers):
                        reported_pairs.add((state.name, preview.name))
                        yield _exclusion_finding(skill, state, preview, achievers, exclusion)


_Achievers = Sequence[tuple[Skill, Expectation]]


@dataclass(frozen=True, slots=True)
class _Exclusion:
    """The reason why an algorithm cannot run.

    Attributes:
        text: the precondition that cannot be true.
        cause: the unknown variable that prevents the precondition from being true; None for other reasons.
    """

    algorithm: Algorithm
    text: str
    place: Place
    cause: str | None


def _achievers_by_variable(
    spec_index: SpecIndex, faults: FaultyElements
) -> Mapping[str, list[tuple[Skill, Expectation]]]:
    """Return a mapping from each variable to the skills that set it to a value, and their expectations about it."""
    achievers_by_variable: dict[str, list[tuple[Skill, Expectation]]] = {}
    for skill in spec_index.spec.skills:
        for expectation in skill.monitor:
            name, condition = expectation.variable.name, expectation.condition
            if expectation.expected is Expected.BECOMES and condition is not None and faults.is_sound("context", name):
                judgement = spec_index.judgement(condition)
                if judgement is not None and not judgement.problems and name in spec_index.variables:
                    achievers_by_variable.setdefault(name, []).append((skill, expectation))
    return achievers_by_variable


def _allows_one_of(spec_index: SpecIndex, skill: Skill, achievers: _Achievers) -> bool:
    """Return whether the conditions of a skill's preview can hold after one of the achievers has acted."""
    previewed = [condition.tree for condition in sound_conditions(spec_index, skill.preview_conditions)]
    facts = (expectation.condition.tree for _, expectation in achievers if expectation.condition is not None)
    return not previewed or any(
        fact is not None and can_hold([fact, *previewed], (), spec_index.context_types) for fact in facts
    )


def _is_kept(spec_index: SpecIndex, name: str, achievers: _Achievers) -> bool:
    """Return whether the value of a variable is kept, and all these skills preview the variable before they act."""
    is_kept = spec_index.variables[name].when_unobservable is WhenUnobservable.KEEP
    return is_kept and all(any(reference.name == name for reference in achiever.preview) for achiever, _ in achievers)


def _exclusion_finding(
    skill: Skill, state: Reference, preview: Reference, achievers: _Achievers, exclusion: _Exclusion
) -> Diagnostic:
    achiever, expectation = achievers[0]
    cause_text = "" if exclusion.cause is None else f", and '{exclusion.cause}' cannot be observed then"
    return finding(
        "excluded-preview",
        f"skill '{skill.name}' decides on '{preview.name}', which cannot be observed once skill '{achiever.name}' "
        f"has changed '{state.name}': algorithm '{exclusion.algorithm.name}' needs '{exclusion.text}'{cause_text}",
        preview.place,
        path=f"skills.{skill.name}.preview",
        help=f"preview '{preview.name}' in skill '{achiever.name}' instead, "
        "or add an algorithm that can run after this skill",
        related=(
            Related(f"'{state.name}' is in the same decision", state.place),
            Related(f"skill '{achiever.name}' changes '{state.name}'", expectation.place),
            Related("cannot be true afterwards", exclusion.place),
        ),
    )


class _Search:
    """Finds variables that cannot be observed while another variable has some value.

    The value prevents the observation directly, or through other variables that are forgotten.
    """

    def __init__(self, spec_index: SpecIndex, faults: FaultyElements) -> None:
        self._spec_index = spec_index
        self._faults = faults
        self._steps_left = MAX_STEPS
        self._exclusions: dict[str, Mapping[str, _Exclusion]] = {}
        self._readers: dict[str, list[str]] = {}
        for name, needs in spec_index.needs.items():
            for need in needs:
                self._readers.setdefault(need, []).append(name)

    def common_exclusions(self, name: str, expectations: Sequence[Expectation]) -> Mapping[str, _Exclusion]:
        """Return the variables, with reasons, that cannot be observed with any expected value of a variable."""
        if name not in self._exclusions:
            conditions = (expectation.condition for expectation in expectations if expectation.condition is not None)
            facts = dict.fromkeys(condition.tree for condition in conditions if condition.tree is not None)
            exclusions = [self._find_exclusions(name, fact) for fact in facts]
            common_names = set(exclusions[0]).intersection(*exclusions)
            self._exclusions[name] = {
                variable: exclusion for variable, exclusion in exclusions[0].items() if variable in common_names
            }
        return self._exclusions[name]

    def _find_exclusions(self, name: str, fact: Node) -> Mapping[str, _Exclusion]:
        """Return the variables that cannot be observed while a fact about a variable is true, and the reasons."""
        exclusion_by_algorithm: dict[str, _Exclusion] = {}
        exclusions: dict[str, _Exclusion] = {}
        unknown_names: set[str] = set()
        readers = list(self._readers.get(name, ()))
        while readers and self._steps_left > 0:
            self._steps_left -= 1
            reader = readers.pop()
            exclusion = (
                None
                if reader in exclusion_by_algorithm
                else self._exclusion(self._spec_index.algorithms[reader], fact, unknown_names)
            )
            if exclusion is None:
                continue
            exclusion_by_algorithm[reader] = exclusion
            for entry in exclusion.algorithm.identifies:
                variable = entry.variable.name
                producers = self._spec_index.producers[variable]
                if (
                    variable != name
                    and variable not in exclusions
                    and all(producer in exclusion_by_algorithm for producer in producers)
                ):
                    if self._has_other_sources(variable):
                        continue
                    exclusions[variable] = exclusion_by_algorithm[producers[0]]
                    if self._spec_index.variables[variable].when_unobservable is WhenUnobservable.FORGET:
                        unknown_names.add(variable)
                        readers += self._readers.get(variable, ())
        return exclusions if self._steps_left > 0 else {}

    def _has_other_sources(self, name: str) -> bool:
        variable = self._spec_index.variables.get(name)
        if variable is None or not self._faults.is_sound("context", name):
            return True
        keys = ("source", "when_unobservable")
        has_other_source = any(source.name != OBSERVER for source in variable.sources)
        return has_other_source or not self._spec_index.is_readable("context", name, *keys)

    def _exclusion(self, algorithm: Algorithm, fact: Node, unknown_names: set[str]) -> _Exclusion | None:
        """Return why an algorithm cannot run while a fact holds and some variables are unknown; None if it can run."""
        if not self._faults.is_sound("perception", algorithm.name):
            return None
        for reference in algorithm.given:
            if reference.name in unknown_names:
                return _Exclusion(algorithm, reference.name, reference.place, reference.name)
        conditions = [
            (condition, tree) for condition in algorithm.observable_when if (tree := self._sound_tree(condition))
        ]
        trees = [tree for _, tree in conditions]
        types = self._spec_index.context_types
        if can_hold([fact, *trees], unknown_names, types):
            return None
        for condition, tree in conditions:
            if not can_hold([fact, tree], unknown_names, types):
                cause = next(
                    (unknown_name for unknown_name in sorted(unknown_names) if _reads_name(condition, unknown_name)),
                    None,
                )
                is_direct = not can_hold([fact, tree], (), types)
                return _Exclusion(algorithm, condition.text, condition.place, None if is_direct else cause)
        place = algorithm.places.get("observable_when", algorithm.place)
        return _Exclusion(algorithm, " and ".join(condition.text for condition, _ in conditions), place, None)

    def _sound_tree(self, condition: Condition) -> Node | None:
        judgement = self._spec_index.judgement(condition)
        return None if judgement is None or judgement.problems else spelt_out(judgement.typed.node)


def _reads_name(condition: Condition, name: str) -> bool:
    return condition.tree is not None and any(read_name.name == name for read_name in names_in(condition.tree))
