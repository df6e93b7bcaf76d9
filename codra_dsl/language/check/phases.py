"""All checks in their order, and the construction of the `CheckedSpec`.

If an element has an error in one phase, later phases report nothing more about this element. They still check all other
elements, so that one run reports every cause once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from codra_dsl.language.behavior_trees.named import UNREAD_RESULT, ReadResult
from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedCondition, CheckedExpectation, CheckedSpec
from codra_dsl.language.check.conditions.conditions import parts_of
from codra_dsl.language.check.conditions.lowering import python_text
from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.graph.cycles import CYCLE_CHECKS, feedback
from codra_dsl.language.check.graph.derivations import DERIVATION_SOURCE_CHECKS, DERIVATION_TYPE_CHECKS
from codra_dsl.language.check.graph.sources import SOURCE_CHECKS
from codra_dsl.language.check.index.corrections import apply_corrections
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.chains import CHAIN_CHECKS
from codra_dsl.language.check.knowledge.construction import checked_knowledge
from codra_dsl.language.check.knowledge.ends import KNOWLEDGE_TYPE_CHECKS
from codra_dsl.language.check.knowledge.frames import FRAME_CHECKS
from codra_dsl.language.check.knowledge.handovers import HANDOVER_CHECKS
from codra_dsl.language.check.knowledge.names import KNOWLEDGE_NAME_CHECKS
from codra_dsl.language.check.knowledge.owners import OWNER_CHECKS
from codra_dsl.language.check.knowledge.pose_conditions import POSE_CONDITION_CHECKS, pose_condition_texts
from codra_dsl.language.check.knowledge.stale import STALE_POSE_CHECKS
from codra_dsl.language.check.knowledge.triplets import TRIPLET_CHECKS
from codra_dsl.language.check.knowledge.unused import UNUSED_TYPE_CHECKS
from codra_dsl.language.check.loops.branches import BRANCH_CHECKS, TREE_FILE_CHECKS
from codra_dsl.language.check.loops.construction import checked_mape
from codra_dsl.language.check.loops.feedback import FEEDBACK_CHECKS, SELF_DEFEAT_CHECKS
from codra_dsl.language.check.loops.firing import FIRING_CHECKS
from codra_dsl.language.check.loops.inputs import LOOP_TYPE_CHECKS
from codra_dsl.language.check.loops.names import LOOP_NAME_CHECKS
from codra_dsl.language.check.loops.parts import LOOP_PART_CHECKS, UNREAD_OUTPUT_CHECKS
from codra_dsl.language.check.loops.range_exit import RANGE_EXIT_CHECKS
from codra_dsl.language.check.loops.rate_coverage import RATE_CHECKS
from codra_dsl.language.check.loops.unknown_values import UNKNOWN_VALUE_CHECKS
from codra_dsl.language.check.names.names import NAME_CHECKS
from codra_dsl.language.check.quality import QUALITY_CHECKS
from codra_dsl.language.check.quality.undecided import budget_of, undecided_conditions
from codra_dsl.language.check.solver.budget import shared_budget
from codra_dsl.language.check.types.condition_types import TYPE_CHECKS
from codra_dsl.language.check.types.members import wrong_member_findings
from codra_dsl.language.diagnostics import Diagnostic, Severity, has_binding_errors, in_file_order, once_per_template
from codra_dsl.language.expression import Name
from codra_dsl.language.model import Algorithm, Condition, Hysteresis, Identification, Members, Skill, Spec

Rule = Callable[[SpecIndex, FaultyElements], Iterator[Diagnostic]]

NO_TREES: Mapping[str, ReadResult] = {}
"""The default of `forests`, for a spec without trees."""

PHASES: tuple[tuple[Rule, ...], ...] = (
    (*NAME_CHECKS, *KNOWLEDGE_NAME_CHECKS, *LOOP_NAME_CHECKS, *TREE_FILE_CHECKS),
    (*SOURCE_CHECKS, *DERIVATION_SOURCE_CHECKS, *OWNER_CHECKS),
    (*TYPE_CHECKS, *DERIVATION_TYPE_CHECKS, *KNOWLEDGE_TYPE_CHECKS, *POSE_CONDITION_CHECKS, *LOOP_TYPE_CHECKS),
    (
        *CYCLE_CHECKS,
        *FRAME_CHECKS,
        *HANDOVER_CHECKS,
        *TRIPLET_CHECKS,
        *CHAIN_CHECKS,
        *LOOP_PART_CHECKS,
        *BRANCH_CHECKS,
        *SELF_DEFEAT_CHECKS,
    ),
    (
        *QUALITY_CHECKS,
        *UNUSED_TYPE_CHECKS,
        *STALE_POSE_CHECKS,
        *FIRING_CHECKS,
        *UNREAD_OUTPUT_CHECKS,
        *FEEDBACK_CHECKS,
        *RANGE_EXIT_CHECKS,
        *UNKNOWN_VALUE_CHECKS,
        *RATE_CHECKS,
    ),
)
"""The rules of each phase."""


def check(
    spec: Spec, forests: Mapping[str, ReadResult] = NO_TREES
) -> tuple[CheckedSpec | None, tuple[Diagnostic, ...]]:
    """Return the checked spec and all findings in file order. If there is a binding error, the checked spec is None.

    `forests` is the result of `codra_dsl.language.behavior_trees.named.read_trees` for the trees that the spec names.

    Keys that `load` marked as damaged are not checked and cause no findings about other elements. A spec with damaged
    keys is never returned, even if it has no other error. Where the intended name of a misspelt name is clear, the
    following phases read the intended name.
    """
    spec_index = SpecIndex(spec, forests)
    with shared_budget(budget_of(spec_index)) as budget:
        spec_index, findings = _run_phases(spec_index)
    findings += undecided_conditions(spec_index, budget)
    findings_in_order = in_file_order(once_per_template(findings))
    is_damaged = any(spec.damaged.values()) or any(
        forests.get(tree.name, UNREAD_RESULT)[0] is None for tree in spec.trees
    )
    if is_damaged or has_binding_errors(findings):
        return None, findings_in_order
    with shared_budget(budget_of(spec_index)):  # a separate budget: the result does not depend on the work of the rules
        return _checked(spec_index), findings_in_order


def _run_phases(spec_index: SpecIndex) -> tuple[SpecIndex, list[Diagnostic]]:
    """Return the index with the intended names for misspelt names, and the findings of all phases."""
    faults = FaultyElements()
    findings: list[Diagnostic] = []
    for phase in PHASES:
        diagnostics = [diagnostic for rule in phase for diagnostic in rule(spec_index, faults)]
        if any(diagnostic.rule.name == "unknown-member" for diagnostic in diagnostics):
            spec_index, diagnostics = _correct_members(spec_index, faults, phase, diagnostics)
        findings += diagnostics
        faults = FaultyElements(faults.elements | _elements(diagnostics), spec_index.suggested_variables)
        if spec_index.corrections:
            spec_index = SpecIndex(apply_corrections(spec_index.spec, spec_index.corrections), spec_index.forests)
    return spec_index, findings


def _correct_members(
    spec_index: SpecIndex, faults: FaultyElements, phase: Sequence[Rule], diagnostics: list[Diagnostic]
) -> tuple[SpecIndex, list[Diagnostic]]:
    """Return the index and the findings of a phase after declarations with wrong members are corrected.

    The findings about these declarations come first. Then come the findings of the phase, which runs again on the
    corrected spec. If no declaration is wrong, the given index and findings are returned.
    """
    member_findings = list(wrong_member_findings(spec_index))
    if not member_findings:
        return spec_index, diagnostics
    corrected_index = SpecIndex(apply_corrections(spec_index.spec, spec_index.corrections), spec_index.forests)
    return corrected_index, member_findings + [
        diagnostic for rule in phase for diagnostic in rule(corrected_index, faults)
    ]


def _elements(diagnostics: Iterable[Diagnostic]) -> frozenset[tuple[str, str]]:
    """Return the section and the name of each element with an error. A tree file is not an element."""
    paths = (
        diagnostic.path.removeprefix("knowledge.")
        for diagnostic in diagnostics
        if diagnostic.severity is Severity.ERROR
    )
    split_paths = (path.split(".") for path in paths if "." in path)
    return frozenset((section, name) for section, name, *_ in split_paths)


def _checked(spec_index: SpecIndex) -> CheckedSpec:
    feedback_by_algorithm = feedback(spec_index)
    algorithms = {
        name: _checked_algorithm(spec_index, algorithm, feedback_by_algorithm.get(name, ()))
        for name, algorithm in spec_index.algorithms.items()
    }
    return CheckedSpec(
        spec=spec_index.spec,
        variables=spec_index.variables,
        algorithms=algorithms,
        producers=spec_index.producers,
        decisions=spec_index.decisions,
        expectations={skill.name: _checked_expectations(spec_index, skill) for skill in spec_index.spec.skills},
        previews={skill.name: _checked_preview(spec_index, skill) for skill in spec_index.spec.skills},
        poses=pose_condition_texts(spec_index),
        derived=_checked_derivations(spec_index),
        knowledge=checked_knowledge(spec_index),
        mape=checked_mape(spec_index),
    )


def _checked_derivations(spec_index: SpecIndex) -> dict[str, CheckedCondition]:
    return {
        variable.name: _checked_condition(spec_index, variable.derived, spec_index.context_types[variable.name])
        for variable in spec_index.variables.values()
        if variable.derived is not None
    }


def _checked_expectations(spec_index: SpecIndex, skill: Skill) -> tuple[CheckedExpectation, ...]:
    return tuple(
        CheckedExpectation(
            text=expectation.text,
            python=spec_index.python(expectation.condition, None),
            within_s=expectation.within_s,
        )
        for expectation in skill.monitor
        if expectation.condition is not None
    )


def _checked_preview(spec_index: SpecIndex, skill: Skill) -> tuple[CheckedCondition, ...]:
    conditions = [_checked_condition(spec_index, condition) for condition in skill.preview_conditions]
    names_in_conditions = {name for condition in conditions for name in condition.variables}
    names_alone = [
        CheckedCondition(
            text=reference.name,
            python=f'value("{reference.name}") == value("{reference.name}")',  # unknown if the variable is unknown
            variables=(reference.name,),
            place=reference.place,
        )
        for reference in skill.preview_names
        if reference.name in names_in_conditions
    ]
    return (*conditions, *names_alone)


def _checked_algorithm(spec_index: SpecIndex, algorithm: Algorithm, feedback_names: Sequence[str]) -> CheckedAlgorithm:
    return CheckedAlgorithm(
        algorithm=algorithm,
        observable_when=tuple(_checked_condition(spec_index, condition) for condition in algorithm.observable_when),
        accept_when=tuple(_checked_condition(spec_index, condition) for condition in algorithm.accept_when),
        identifies=tuple(
            (entry.variable.name, _checked_identification(spec_index, entry)) for entry in algorithm.identifies
        ),
        waits_for=tuple(sorted(set(spec_index.needs[algorithm.name]) - set(feedback_names))),
        feedback=tuple(feedback_names),
    )


def _checked_condition(
    spec_index: SpecIndex, condition: Condition, wanted_type: Type | None = None
) -> CheckedCondition:
    judgement = spec_index.judgements[id(condition)]
    return CheckedCondition(
        text=condition.text,
        python=spec_index.python(condition, wanted_type),
        variables=_sorted_names(judgement.site.names),
        place=condition.place,
    )


def _sorted_names(names: tuple[Name, ...]) -> tuple[str, ...]:
    return (names[0].name,) if len(names) == 1 else tuple(sorted({name.name for name in names}))


def _checked_identification(spec_index: SpecIndex, entry: Identification) -> CheckedCondition:
    by = entry.by
    if isinstance(by, Condition):
        return _checked_condition(spec_index, by, spec_index.context_types[entry.variable.name])
    parts = [_checked_condition(spec_index, condition) for condition in parts_of(entry)]
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
        needed_count, recent_count = by.confirm
        text, python = (
            f"{text}; confirm: {needed_count} of {recent_count}",
            f"confirmed({python}, {needed_count}, {recent_count})",
        )
    variables = sorted({name for part in parts for name in part.variables})
    return CheckedCondition(text=text, python=python, variables=tuple(variables), place=by.place)
