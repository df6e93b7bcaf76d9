"""Checks of loops (phases 4 and 5): each part belongs to one loop, and all results are used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from codra_dsl.language.check.conditions.conditions import CONTEXT_ROLES
from codra_dsl.language.check.index.mentions import references
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import reads_of
from codra_dsl.language.model import Adaptation, Course, Loop, Output, Reference, TreeElement

_LOOP_KEYS = ("analyse", "adapt", "execute")
_SECTIONS = (("metrics", "analyse", "computes"), ("adaptation", "adapt", "makes"), ("trees", "execute", "executes"))


def parts_of_loops(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every metric, adaptation and tree belongs to one loop."""
    if any(spec_index.has_damage(section) for section in ("metrics", "adaptation", "trees")) or spec_index.has_damage(
        "loops", *_LOOP_KEYS
    ):
        return
    if not all(faults.is_sound("loops", loop.name) for loop in spec_index.spec.loops):
        return
    elements: Mapping[str, tuple[Output | Adaptation | TreeElement, ...]] = {
        "metrics": spec_index.spec.metrics,
        "adaptation": spec_index.spec.adaptation,
        "trees": spec_index.spec.trees,
    }
    for section, key, verb in _SECTIONS:
        owners: dict[str, tuple[Loop, Reference]] = {}
        for loop in spec_index.spec.loops:
            for reference in getattr(loop, key):
                owner, first = owners.setdefault(reference.name, (loop, reference))
                if owner is not loop:
                    message = f"loop '{owner.name}' also {verb} '{reference.name}'"
                    related = (Related("the other entry", first.place),)
                    path = f"loops.{loop.name}.{key}"
                    help = f"name '{reference.name}' in only one of the two loops"
                    yield finding("two-loops", message, reference.place, path=path, help=help, related=related)
        for element in elements[section]:
            if element.name not in owners:
                message = f"no loop {verb} '{element.name}'"
                path, help = f"{section}.{element.name}", f"name it under '{key}' of a loop, or remove it"
                yield finding("part-without-loop", message, element.place, path=path, help=help)


def split_courses(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The loop that adapts a course also executes its tree, and each tree has one course."""
    first_adaptations: dict[str, Adaptation] = {}
    adapting_loops, executing_loops = _loops_by_part(spec_index, "adapt"), _loops_by_part(spec_index, "execute")
    for adaptation in spec_index.spec.adaptation:
        does = adaptation.does
        if not isinstance(does, Course) or not does.within.name:
            continue
        path = f"adaptation.{adaptation.name}.in"
        other = first_adaptations.setdefault(does.within.name, adaptation)
        if other is not adaptation:
            message = f"adaptation '{other.name}' also chooses the course of tree '{does.within.name}'"
            help = "put all actions under 'choose' of only one of the two adaptations"
            yield finding("two-adaptations", message, does.within.place, path=path, help=help)
        adapting, executing = adapting_loops.get(adaptation.name, ()), executing_loops.get(does.within.name, ())
        if adapting and set(adapting).isdisjoint(executing):
            where_text = f"which loop '{executing[0]}' executes" if executing else "which no loop executes"
            message = f"loop '{adapting[0]}' chooses the course of tree '{does.within.name}', {where_text}"
            help = f"name '{does.within.name}' under 'execute' of loop '{adapting[0]}'"
            yield finding("two-loops", message, does.within.place, path=path, help=help)


_READING_KEYS = {
    "metrics": ("rules",),
    "actions": ("rules",),
    "adaptation": ("choose", "always", "value"),
    "agents": ("reads",),
}


def unread_outputs(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every metric is read, and every action can be chosen."""
    if not (spec_index.spec.metrics or spec_index.spec.actions):
        return
    if any(spec_index.has_damage(section, *keys) for section, keys in _READING_KEYS.items()):
        return
    read_names = {name for key in spec_index.parsed_rules.rules for name in spec_index.parsed_rules.input_names(*key)}
    read_names |= {mention.name for mention in references(spec_index)}
    read_names |= {
        reads_of(name.name)[2] for site in spec_index.sites if site.role in CONTEXT_ROLES for name in site.names
    }
    read_names |= {reference.name for agent in spec_index.spec.agents for reference in agent.conduct.reads}
    for metric in spec_index.spec.metrics:
        if metric.name not in read_names and faults.is_sound("metrics", metric.name):
            message = f"nothing reads metric '{metric.name}'"
            help = "name it in a rule of an action or in an adaptation, or remove it"
            yield finding("unread-output", message, metric.place, path=f"metrics.{metric.name}", help=help)
    courses = [adaptation.does for adaptation in spec_index.spec.adaptation if isinstance(adaptation.does, Course)]
    chosen_actions = {reference.name for course in courses for reference in course.choose}
    for action in spec_index.spec.actions:
        if action.name not in chosen_actions and faults.is_sound("actions", action.name):
            message = f"no adaptation chooses action '{action.name}'"
            help = "name it under 'choose' of an adaptation, or remove it"
            yield finding("unread-output", message, action.place, path=f"actions.{action.name}", help=help)


def _loops_by_part(spec_index: SpecIndex, key: str) -> Mapping[str, Sequence[str]]:
    """Return a mapping from each name under a key of loops to the names of these loops."""
    loops: dict[str, list[str]] = {}
    for loop in spec_index.spec.loops:
        for reference in getattr(loop, key):
            loops.setdefault(reference.name, []).append(loop.name)
    return loops


LOOP_PART_CHECKS = (parts_of_loops, split_courses)
"""The checks of phase 4."""

UNREAD_OUTPUT_CHECKS = (unread_outputs,)
"""The checks of phase 5."""
