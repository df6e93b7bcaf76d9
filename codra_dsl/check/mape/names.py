"""Phase 1 for loops: what rules, adaptations, trees and loops name is declared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.check.mape.book import ReadRule
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic
from codra_dsl.model import Course, Reference

_READ_AS: Mapping[str, str] = {"fll-unknown-name": "unknown-in-fuzzy-rule"}


def wrong_rules(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every fuzzy rule can be read, and names variables and terms that there are."""
    if scope.spec.damaged.get("context") or scope.spec.damaged.get("metrics"):
        return
    for section, output in scope.book.outputs:
        for number, rule in enumerate(scope.book.rules[section, output.name]):
            for problem in rule.problems:
                yield _about_rule(scope, rule, problem, f"{section}.{output.name}.rules.{number}")


def _about_rule(scope: Scope, rule: ReadRule, problem: Diagnostic, path: str) -> Diagnostic:
    place = rule.place_of(problem)
    way_out = problem.help or "write 'if VARIABLE is TERM then TERM'"
    word = rule.phrase.text[problem.place.span.column - 1 : problem.place.span.end_column - 1]
    metric = word in scope.book.metrics and path.startswith("metrics.")
    way_out = "rules of metrics see context; what follows from metrics is an action" if metric else way_out
    return finding(
        _READ_AS.get(problem.rule.name, "fuzzy-rule-syntax"), problem.message, place, path=path, way_out=way_out
    )


def unknown_parts(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Whatever adaptations, trees and loops name is declared."""
    for section, noun, reference, path in _named(scope):
        if scope.declares(section, reference.name) or not reference.name or scope.lost(section):
            continue
        element = path.split(".")
        user = f"{_NOUNS[element[0]]} '{element[1]}'"
        near = scope.nearest(reference.name, section, scope.names(section))
        way_out = f"did you mean '{near}'?" if near else f"declare '{reference.name}' under '{section}'"
        message = f"unknown {noun} '{reference.name}' in {user}"
        yield finding("unknown-part", message, reference.place, path=path, way_out=way_out)


_NOUNS = {"adaptation": "adaptation", "trees": "tree", "loops": "loop"}


def _named(scope: Scope) -> Iterator[tuple[str, str, Reference, str]]:
    """Yield the section, its noun, the name and the path of all that loops and their parts name."""
    for adaptation in scope.spec.adaptation:
        path, does = f"adaptation.{adaptation.name}", adaptation.does
        if isinstance(does, Course):
            named = (*does.choose, *(rule.action for rule in does.always), does.otherwise)
            yield from (("actions", "action", each, path) for each in named)
            yield "trees", "tree", does.within, f"{path}.in"
    for tree in scope.spec.trees:
        path = f"trees.{tree.name}"
        yield from (("actions", "action", action, f"{path}.course") for action, _ in tree.course)
        if tree.agent is not None:
            yield "agents", "agent", tree.agent, f"{path}.agent"
        yield from (("tasks", "task", task, f"{path}.leaves") for leaf in tree.leaves for task in leaf.tasks)
    for loop in scope.spec.loops:
        path = f"loops.{loop.name}"
        yield from (("agents", "agent", each, f"{path}.monitor") for each in loop.monitor)
        yield from (("metrics", "metric", each, f"{path}.analyse") for each in loop.analyse)
        yield from (("adaptation", "adaptation", each, f"{path}.adapt") for each in loop.adapt)
        yield from (("trees", "tree", each, f"{path}.execute") for each in loop.execute)


LOOP_NAMES = (wrong_rules, unknown_parts)
"""The rules of this subject."""
