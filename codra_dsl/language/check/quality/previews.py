"""Previews that can never hold, conditions of previews that always hold, and names that a preview repeats."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.quality.conditions import names_of_condition, parts_of_conditions, sound_conditions
from codra_dsl.language.check.solver.contradictions import (
    StatedCondition,
    contradiction,
    limit_places,
    never_true_message,
    related_places,
    types_without_ranges,
)
from codra_dsl.language.check.solver.satisfiable import always_holds, implies, known_call
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import Call, reads_of
from codra_dsl.language.model import Reference, Skill, Variable


def never_holding_previews(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """In some situation, all variables that a preview names alone are known, and all its conditions hold."""
    types = spec_index.context_types
    for skill in _skills_with_conditions(spec_index, faults):
        names = [
            StatedCondition(known_call(reference.name), f"known({reference.name})", reference.place)
            for reference in skill.preview_names
        ]
        core = contradiction((*names, *sound_conditions(spec_index, skill.preview_conditions)), types)
        if core:
            yield finding(
                "never-holds",
                f"the preview of skill '{skill.name}' never holds: {never_true_message(core)}",
                core[-1].place,
                path=f"skills.{skill.name}.preview",
                help="change the condition",
                related=tuple(related_places(core, types, _variables_of(spec_index, *core))),
            )


def always_holding_previews(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every condition of a preview is false for some values of its variables."""
    types = spec_index.context_types
    for skill in _skills_with_conditions(spec_index, faults):
        for condition in parts_of_conditions(spec_index, skill.preview_conditions):
            if always_holds(condition.tree, types):
                depends_on_range = not always_holds(condition.tree, types_without_ranges(types, [condition.tree]))
                names = tuple(names_of_condition(condition))
                names_text = " and ".join(f"'{name}'" for name in names)
                yield finding(
                    "always-holds",
                    f"'{condition.text}' holds for every possible value ('preview' of skill '{skill.name}')",
                    condition.place,
                    path=f"skills.{skill.name}.preview",
                    help=f"change the condition, or name {names_text} alone if it is enough that the value is known"
                    if names and all(map(_can_be_named, names))
                    else "remove the condition",
                    related=tuple(limit_places([condition.tree], _variables_of(spec_index, condition)))
                    if depends_on_range
                    else (),
                )


def repeated_previews(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A preview does not name a variable alone if one of its conditions holds only if the variable is known."""
    types = spec_index.context_types
    for skill in _skills_with_conditions(spec_index, faults):
        conditions = list(sound_conditions(spec_index, skill.preview_conditions))
        for reference in skill.preview_names:
            for condition in conditions:
                if reference.name in names_of_condition(condition) and implies(
                    [condition.tree], [known_call(reference.name)], types
                ):
                    yield _repeated_preview_finding(skill, reference, condition)
                    break


def known_calls_in_previews(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No condition of a preview needs `known(x)`: it is false while `x` is unknown, so no look for `x` begins."""
    for skill in _skills_with_conditions(spec_index, faults):
        for condition in parts_of_conditions(spec_index, skill.preview_conditions):
            if isinstance(condition.tree, Call) and condition.tree.function == "known":
                (name,) = names_of_condition(condition)
                if not _can_be_named(name):
                    continue
                yield finding(
                    "known-in-preview",
                    f"'{condition.text}' is violated while '{name}' is unknown, so that nobody looks for '{name}' "
                    f"('preview' of skill '{skill.name}')",
                    condition.place,
                    path=f"skills.{skill.name}.preview",
                    help=f"name '{name}' alone: then the preview is unknown, and the main execution can look",
                )


PREVIEW_CHECKS = (never_holding_previews, always_holding_previews, repeated_previews, known_calls_in_previews)
"""The checks of this module."""


def _skills_with_conditions(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Skill]:
    for skill in spec_index.spec.skills:
        is_readable = spec_index.is_readable("skills", skill.name, "preview")
        if skill.preview_conditions and is_readable and faults.is_sound("skills", skill.name):
            yield skill


def _can_be_named(name: str) -> bool:
    """Return whether a preview can name something alone: a variable, but no poses, which no look can determine."""
    return not reads_of(name)[0]


def _variables_of(spec_index: SpecIndex, *conditions: StatedCondition) -> list[Variable]:
    names = dict.fromkeys(name for condition in conditions for name in names_of_condition(condition))
    return [spec_index.variables[name] for name in names if name in spec_index.variables]


def _repeated_preview_finding(skill: Skill, reference: Reference, condition: StatedCondition) -> Diagnostic:
    return finding(
        "repeated-preview",
        f"the preview of skill '{skill.name}' names '{reference.name}' alone, but '{condition.text}' "
        "already needs its value",
        reference.place,
        path=f"skills.{skill.name}.preview",
        help="remove the name",
        related=(Related("the condition", condition.place),),
    )
