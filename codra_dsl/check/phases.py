"""All checks in their order, and the making of a `CheckedSpec`.

What one phase found wrong silences later phases about that element only, so that one run reports every cause once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from codra_dsl.check.checked import CheckedAlgorithm, CheckedCondition, CheckedExpectation, CheckedSpec
from codra_dsl.check.conditions import parts_of
from codra_dsl.check.cycles import GRAPH, feedback
from codra_dsl.check.knowledge.chains import CHAINS
from codra_dsl.check.knowledge.ends import KNOWLEDGE_TYPES
from codra_dsl.check.knowledge.frames import FRAMES
from codra_dsl.check.knowledge.handovers import HANDOVERS
from codra_dsl.check.knowledge.leftovers import KNOWLEDGE_LEFTOVERS
from codra_dsl.check.knowledge.lowered import checked_knowledge
from codra_dsl.check.knowledge.names import KNOWLEDGE_NAMES
from codra_dsl.check.knowledge.owners import OWNERS
from codra_dsl.check.knowledge.posed import POSED, python_of_poses
from codra_dsl.check.knowledge.stale import TRUSTED_POSES
from codra_dsl.check.knowledge.triplets import TRIPLETS
from codra_dsl.check.lowering import python_text
from codra_dsl.check.mape.branches import BRANCHES, TREE_FILES
from codra_dsl.check.mape.feedback import FED_BACK, SELF_DEFEATING
from codra_dsl.check.mape.firing import FIRING
from codra_dsl.check.mape.inputs import LOOP_TYPES
from codra_dsl.check.mape.leaving import LEAVING
from codra_dsl.check.mape.lowered import checked_mape
from codra_dsl.check.mape.names import LOOP_NAMES
from codra_dsl.check.mape.parts import LOOP_LEFTOVERS, LOOP_PARTS
from codra_dsl.check.meanings import TYPES
from codra_dsl.check.meant import read_as_meant
from codra_dsl.check.members import members_to_blame
from codra_dsl.check.names import NAMES
from codra_dsl.check.quality import QUALITY
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.check.sources import SOURCES
from codra_dsl.check.types import Type
from codra_dsl.diagnostics import Diagnostic, Severity, has_binding_errors, in_file_order, once_per_template
from codra_dsl.expression import Name
from codra_dsl.model import Algorithm, Condition, Expectation, Hysteresis, Identification, Members, Skill, Spec
from codra_dsl.trees.named import UNREAD, Read

Rule = Callable[[Scope, Faults], Iterator[Diagnostic]]

NO_TREES: Mapping[str, Read] = {}
"""Of a spec that names no trees."""

PHASES: tuple[tuple[Rule, ...], ...] = (
    (*NAMES, *KNOWLEDGE_NAMES, *LOOP_NAMES, *TREE_FILES),
    (*SOURCES, *OWNERS),
    (*TYPES, *KNOWLEDGE_TYPES, *POSED, *LOOP_TYPES),
    (*GRAPH, *FRAMES, *HANDOVERS, *TRIPLETS, *CHAINS, *LOOP_PARTS, *BRANCHES, *SELF_DEFEATING),
    (*QUALITY, *KNOWLEDGE_LEFTOVERS, *TRUSTED_POSES, *FIRING, *LOOP_LEFTOVERS, *FED_BACK, *LEAVING),
)
"""The rules of each phase."""


def check(spec: Spec, forests: Mapping[str, Read] = NO_TREES) -> tuple[CheckedSpec | None, tuple[Diagnostic, ...]]:
    """Return a spec that can be planned, unless it has a binding error, and all findings about it in file order.

    `forests` has what `codra_dsl.trees.named.read_trees` read of the trees that the spec names.

    Keys that `load` found damaged are neither judged nor held against others; a spec that has some is never returned,
    though what they are about may be all that is wrong with it. Names that are misspelt are read as they are meant.
    """
    scope = Scope(spec, forests)
    faults = Faults()
    findings: list[Diagnostic] = []
    for phase in PHASES:
        found = [diagnostic for rule in phase for diagnostic in rule(scope, faults)]
        if any(diagnostic.rule.name == "unknown-member" for diagnostic in found):
            scope, found = _with_members_as_meant(scope, faults, phase, found)
        findings += found
        faults = Faults(faults.elements | _elements(found), scope.meant)
        if scope.meant_names:
            scope = Scope(read_as_meant(scope.spec, scope.meant_names), forests)
    found_in_order = in_file_order(once_per_template(findings))
    damaged = any(spec.damaged.values()) or any(forests.get(each.name, UNREAD)[0] is None for each in spec.trees)
    return (None if damaged or has_binding_errors(findings) else _checked(scope)), found_in_order


def _with_members_as_meant(
    scope: Scope, faults: Faults, phase: Sequence[Rule], found: list[Diagnostic]
) -> tuple[Scope, list[Diagnostic]]:
    """Return what a phase finds once members that are wrong where they are declared are reported there, and mended."""
    blamed = list(members_to_blame(scope))
    if not blamed:
        return scope, found
    mended = Scope(read_as_meant(scope.spec, scope.meant_names), scope.forests)
    return mended, blamed + [diagnostic for rule in phase for diagnostic in rule(mended, faults)]


def _elements(found: Iterable[Diagnostic]) -> frozenset[tuple[str, str]]:
    """Return the elements that errors are about: the first two steps of their paths; a file of trees is none."""
    paths = (each.path.removeprefix("knowledge.") for each in found if each.severity is Severity.ERROR)
    errors = (path.split(".") for path in paths if "." in path)
    return frozenset((section, name) for section, name, *_ in errors)


def _checked(scope: Scope) -> CheckedSpec:
    fed_back = feedback(scope)
    algorithms = {
        name: _checked_algorithm(scope, algorithm, fed_back.get(name, ()))
        for name, algorithm in scope.algorithms.items()
    }
    return CheckedSpec(
        spec=scope.spec,
        variables=scope.variables,
        algorithms=algorithms,
        producers=scope.producers,
        decisions=scope.decisions,
        expectations={skill.name: _checked_expectations(scope, skill) for skill in scope.spec.skills},
        poses=python_of_poses(scope),
        knowledge=checked_knowledge(scope),
        mape=checked_mape(scope),
    )


def _checked_expectations(scope: Scope, skill: Skill) -> tuple[CheckedExpectation, ...]:
    return tuple(
        CheckedExpectation(
            text=_said(each, each.condition), python=scope.python(each.condition, None), within_s=each.within_s
        )
        for each in skill.monitor
        if each.condition is not None
    )


def _said(expectation: Expectation, condition: Condition) -> str:
    """Return an expectation as a spec says it."""
    name = expectation.variable.name
    value = condition.text.removeprefix(name).strip().removeprefix("==").strip()
    within = "" if expectation.within_s is None else f" within {expectation.within_s:g} s"
    return f"{name} {expectation.expected} {value}{within}"


def _checked_algorithm(scope: Scope, algorithm: Algorithm, fed_back: Sequence[str]) -> CheckedAlgorithm:
    return CheckedAlgorithm(
        algorithm=algorithm,
        observable_when=tuple(_checked_condition(scope, condition) for condition in algorithm.observable_when),
        accept_when=tuple(_checked_condition(scope, condition) for condition in algorithm.accept_when),
        identifies=tuple(
            (entry.variable.name, _checked_identification(scope, entry)) for entry in algorithm.identifies
        ),
        waits_for=tuple(sorted(set(scope.needs[algorithm.name]) - set(fed_back))),
        feedback=tuple(fed_back),
    )


def _checked_condition(scope: Scope, condition: Condition, wanted: Type | None = None) -> CheckedCondition:
    judgement = scope.judgements[id(condition)]
    return CheckedCondition(
        text=condition.text,
        python=scope.python(condition, wanted),
        variables=_sorted_names(judgement.site.names),
        place=condition.place,
    )


def _sorted_names(names: tuple[Name, ...]) -> tuple[str, ...]:
    return (names[0].name,) if len(names) == 1 else tuple(sorted({name.name for name in names}))


def _checked_identification(scope: Scope, entry: Identification) -> CheckedCondition:
    by = entry.by
    if isinstance(by, Condition):
        return _checked_condition(scope, by, scope.context_types[entry.variable.name])
    parts = [_checked_condition(scope, condition) for condition in parts_of(entry)]
    if isinstance(by, Members):
        members = [member.name for member, _ in by.cases]
        text = "; ".join(f"{member}: {part.text}" for member, part in zip(members, parts, strict=True))
        cases = (f"({python_text(member)}, {part.python})" for member, part in zip(members, parts, strict=True))
        python = f"first_of({', '.join(cases)})"
    elif len(parts) == 1:
        text, python = parts[0].text, parts[0].python
    else:
        text = f"enter: {parts[0].text}; leave: {parts[1].text}"
        python = f"between({parts[0].python}, {parts[1].python})"
    if isinstance(by, Hysteresis) and by.confirm is not None:
        needed, among = by.confirm
        text, python = f"{text}; confirm: {needed} of {among}", f"confirmed({python}, {needed}, {among})"
    variables = sorted({name for part in parts for name in part.variables})
    return CheckedCondition(text=text, python=python, variables=tuple(variables), place=by.place)
