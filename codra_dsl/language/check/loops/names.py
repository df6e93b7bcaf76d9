"""Checks of names in MAPE-K loops (phase 1): all names in fuzzy rules, adaptations, trees and loops are declared."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.index.words import declaration_help
from codra_dsl.language.check.loops.rule_texts import RULE_TEXT_CHECKS
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.model import ADAPTER, ANALYST, Course, Parameter, Reference


def unknown_parts(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """All names in adaptations, trees and loops are declared."""
    for section, noun, reference, path in references_in_loops(spec_index):
        if spec_index.declares(section, reference.name) or not reference.name or spec_index.has_damage(section):
            continue
        path_parts = path.split(".")
        user_text = f"{_NOUNS[path_parts[0]]} '{path_parts[1]}'"
        nearest_name = spec_index.nearest_name(reference.name, section, spec_index.names(section))
        setting_name = _adaptation_of(spec_index, reference.name) if section == "adaptation" else None
        nearest_name = setting_name or nearest_name
        help = declaration_help(reference.name, f"'{section}'", spec_index.names(section) - {ADAPTER, ANALYST})
        help = f"did you mean '{nearest_name}'?" if nearest_name else help
        message = f"unknown {noun} '{reference.name}' in {user_text}"
        yield finding("unknown-part", message, reference.place, path=path, help=help)


def _adaptation_of(spec_index: SpecIndex, name: str) -> str | None:
    """Return the adaptation that sets a variable, or None."""
    setting_names = (
        adaptation.name
        for adaptation in spec_index.spec.adaptation
        if isinstance(adaptation.does, Parameter) and adaptation.does.variable.name == name
    )
    return next(setting_names, None)


_NOUNS = {"adaptation": "adaptation", "trees": "tree", "loops": "loop"}


def references_in_loops(spec_index: SpecIndex) -> Iterator[tuple[str, str, Reference, str]]:
    """Yield, for each reference in loops and their parts: the section, its noun, the reference, and the path."""
    for adaptation in spec_index.spec.adaptation:
        path, does = f"adaptation.{adaptation.name}", adaptation.does
        if isinstance(does, Course):
            actions = (*does.choose, *(rule.action for rule in does.always))
            references = (*actions, does.otherwise) if does.choose else actions
            yield from (("actions", "action", reference, path) for reference in references)
            yield "trees", "tree", does.within, f"{path}.in"
    for tree in spec_index.spec.trees:
        path = f"trees.{tree.name}"
        yield from (("actions", "action", action, f"{path}.course") for action, _ in tree.course)
        if tree.agent is not None:
            yield "agents", "agent", tree.agent, f"{path}.agent"
        yield from (("tasks", "task", task, f"{path}.leaves") for leaf in tree.leaves for task in leaf.tasks)
    for loop in spec_index.spec.loops:
        path = f"loops.{loop.name}"
        yield from (("agents", "agent", reference, f"{path}.monitor") for reference in loop.monitor)
        yield from (("metrics", "metric", reference, f"{path}.analyse") for reference in loop.analyse)
        yield from (("adaptation", "adaptation", reference, f"{path}.adapt") for reference in loop.adapt)
        yield from (("trees", "tree", reference, f"{path}.execute") for reference in loop.execute)


LOOP_NAME_CHECKS = (*RULE_TEXT_CHECKS, unknown_parts)
"""The checks of this module, and those of rules."""
