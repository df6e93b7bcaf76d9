"""Checks of names in MAPE-K loops (phase 1): all names in fuzzy rules, adaptations, trees and loops are declared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.language.check.index.parsed_rules import ParsedRule
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.model import Course, Reference

_SPEC_RULE_BY_FLL_RULE: Mapping[str, str] = {"fll-unknown-name": "unknown-in-fuzzy-rule"}


def wrong_rules(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every fuzzy rule can be parsed, and its variables and terms exist."""
    if spec_index.spec.damaged.get("context") or spec_index.spec.damaged.get("metrics"):
        return
    for section, output in spec_index.parsed_rules.outputs:
        for number, rule in enumerate(spec_index.parsed_rules.rules[section, output.name]):
            for problem in rule.problems:
                yield _parser_finding(spec_index, rule, problem, f"{section}.{output.name}.rules.{number}")


def _parser_finding(spec_index: SpecIndex, rule: ParsedRule, problem: Diagnostic, path: str) -> Diagnostic:
    place = rule.place_of(problem)
    help = problem.help or "write 'if VARIABLE is TERM then TERM'"
    word = rule.phrase.text[problem.place.span.column - 1 : problem.place.span.end_column - 1]
    is_metric = word in spec_index.parsed_rules.metrics and path.startswith("metrics.")
    help = "use it in a rule of an action: rules of metrics read context" if is_metric else help
    return finding(
        _SPEC_RULE_BY_FLL_RULE.get(problem.rule.name, "fuzzy-rule-syntax"), problem.message, place, path=path, help=help
    )


def unknown_parts(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """All names in adaptations, trees and loops are declared."""
    for section, noun, reference, path in references_in_loops(spec_index):
        if spec_index.declares(section, reference.name) or not reference.name or spec_index.has_damage(section):
            continue
        path_parts = path.split(".")
        user_text = f"{_NOUNS[path_parts[0]]} '{path_parts[1]}'"
        nearest_name = spec_index.nearest_name(reference.name, section, spec_index.names(section))
        help = f"did you mean '{nearest_name}'?" if nearest_name else f"declare '{reference.name}' under '{section}'"
        message = f"unknown {noun} '{reference.name}' in {user_text}"
        yield finding("unknown-part", message, reference.place, path=path, help=help)


_NOUNS = {"adaptation": "adaptation", "trees": "tree", "loops": "loop"}


def references_in_loops(spec_index: SpecIndex) -> Iterator[tuple[str, str, Reference, str]]:
    """Yield, for each reference in loops and their parts: the section, its noun, the reference, and the path."""
    for adaptation in spec_index.spec.adaptation:
        path, does = f"adaptation.{adaptation.name}", adaptation.does
        if isinstance(does, Course):
            references = (*does.choose, *(rule.action for rule in does.always), does.otherwise)
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


LOOP_NAME_CHECKS = (wrong_rules, unknown_parts)
"""The checks of this module."""
