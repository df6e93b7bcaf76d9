"""Checks of loops (phase 5): a parameter does not keep a value that nobody stated may be kept.

While the value of a `set` adaptation is unknown, its variable gets the value of `otherwise`. Without `otherwise`, the
last value would stay, such as a high speed after the lidar has failed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.loops.feedback import adapted_variables
from codra_dsl.language.check.loops.firing import silent_combinations
from codra_dsl.language.check.solver.breakpoints import is_curved
from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.case_split import names_of
from codra_dsl.language.check.solver.satisfiable import can_hold, is_always_known
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import (
    And,
    Arithmetic,
    Choice,
    Compare,
    Comparison,
    Count,
    Fallback,
    Node,
    Not,
    Number,
    Or,
    names_in,
    parts,
    reads_of,
    to_text,
)
from codra_dsl.language.model import ADAPTER, FOREVER_S, Course, Parameter, Variable, filtered_weight_name, weight_name

_VARIABLE_KEYS = ("source", "valid_for", "when_unobservable")
_ZERO = Number(start=0, end=0, value=0.0, unit=None)


def unknown_adapted_values(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A parameter whose value can become unknown states `otherwise`."""
    for adaptation, name, tree in adapted_variables(spec_index, faults):
        does = adaptation.does
        if not isinstance(does, Parameter) or does.otherwise is not None:
            continue
        if not spec_index.is_readable("adaptation", adaptation.name, "otherwise"):
            continue
        reasons_of_derived: dict[str, str] = {}
        reasons = {
            read_name: reason
            for read_name in dict.fromkeys(read_name.name for read_name in names_in(tree))
            if read_name not in _set_by_same_loop(spec_index, adaptation.name)
            and (reason := _reason_for_unknown(spec_index, faults, read_name, reasons_of_derived))
        }
        division = _division_by_zero(tree, spec_index.context_types)
        culprits = () if division else _decisive_names(spec_index, tree, tuple(reasons))
        if division is None and not culprits:
            continue
        state_text = f"'{to_text(division.right)}' is 0" if division else _state_text(spec_index, tree, culprits)
        yield finding(
            "unknown-adapted-value",
            f"adaptation '{adaptation.name}' keeps the last value of '{name}' while {state_text}",
            does.value.place,
            path=f"adaptation.{adaptation.name}.value",
            help="add 'otherwise: VALUE' with a value that is right while nothing is known",
            related=tuple(
                Related(f"'{culprit}' can become unknown: {reasons[culprit]}", spec_index.variables[culprit].place)
                for culprit in culprits
                if culprit in spec_index.variables
            ),
        )


def _set_by_same_loop(spec_index: SpecIndex, adaptation: str) -> frozenset[str]:
    """Return the variables that only the loop of an adaptation sets; they stay valid while the loop runs."""
    loops = (loop for loop in spec_index.spec.loops if adaptation in {reference.name for reference in loop.adapt})
    names = {reference.name for loop in loops for reference in loop.adapt}
    targets = (
        other.does.variable.name
        for other in spec_index.spec.adaptation
        if other.name in names and isinstance(other.does, Parameter)
    )
    return frozenset(
        target
        for target in targets
        if target in spec_index.variables
        and [source.name for source in spec_index.variables[target].sources] == [ADAPTER]
    )


def _decisive_names(spec_index: SpecIndex, tree: Node, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names that make a value unknown if they become unknown; () if the value is known in every case.

    If no name does so by itself, but several names together do, all names are returned.
    """
    types = spec_index.context_types
    if not names or is_always_known(tree, names, types) or current_budget().has_undecided:
        return ()
    decisive_names = tuple(name for name in names if not is_always_known(tree, (name,), types))
    return decisive_names or tuple(names)


def _division_by_zero(tree: Node, types: Types) -> Arithmetic | None:
    """Return a division that makes a value unknown although all names are known, because its divisor is 0; or None.

    A division is not judged if the possible values of its divisor are not known exactly: because the divisor reads a
    name twice, or because a condition on one of its names is not linear.
    """
    for division, conditions in _divisions(tree):
        names = [name.name for name in names_in(division.right)]
        limits = [condition for condition in conditions if not set(names).isdisjoint(names_of([condition]))]
        is_exact = len(set(names)) == len(names) and not (limits and is_curved(division.right, *limits))
        is_zero = Compare(start=0, end=0, first=division.right, rest=((Comparison.EQUAL, _ZERO),))
        if is_exact and can_hold([is_zero, *conditions], (), types):
            return None if is_always_known(tree, (), types) or current_budget().has_undecided else division
    return None


def _divisions(node: Node, conditions: tuple[Node, ...] = ()) -> Iterator[tuple[Arithmetic, tuple[Node, ...]]]:
    """Yield the divisions of a value, each with the conditions under which the value depends on the division."""
    if isinstance(node, Arithmetic) and node.operator == "/":
        yield node, conditions
    for part in () if isinstance(node, Fallback) else parts(node):  # a fallback replaces a quotient that is unknown
        yield from _divisions(part, (*conditions, *_conditions_of_part(node, part)))


def _conditions_of_part(node: Node, part: Node) -> tuple[Node, ...]:
    """Return the conditions under which a value depends on one of its parts."""
    if isinstance(node, Choice) and part is not node.condition:
        return (node.condition if part is node.then else Not(start=0, end=0, operand=node.condition),)
    if isinstance(node, (And, Or)):
        others = (other for other in node.operands if other is not part)
        return tuple(other if isinstance(node, And) else Not(start=0, end=0, operand=other) for other in others)
    return ()


def _state_text(spec_index: SpecIndex, tree: Node, culprits: Sequence[str]) -> str:
    """Return in which state of its inputs a value is unknown."""
    names = [f"'{culprit}'" for culprit in culprits]
    is_each_decisive = not is_always_known(tree, culprits[:1], spec_index.context_types)
    return f"{' or '.join(names)} is unknown" if is_each_decisive else f"{' and '.join(names)} are unknown"


def _reason_for_unknown(
    spec_index: SpecIndex, faults: FaultyElements, name: str, reasons_of_derived: dict[str, str]
) -> str:
    """Return why a variable can become unknown after it was known; empty if it cannot, or if this is not certain.

    Metrics, weights and courses are computed even while inputs are unknown. A stated `valid_for: forever` means that
    the value may be kept. `reasons_of_derived` has the reasons of derived variables that follow from their inputs; the
    reason of a variable that is judged at present is empty.
    """
    function, first, second = reads_of(name)
    if function:
        return "a pose can become stale" if _can_pose_become_stale(spec_index, first, second) else ""
    variable = spec_index.variables.get(name)
    if variable is None or not faults.is_sound("context", name):
        return ""
    if variable.derived is not None:
        if name not in reasons_of_derived:
            reasons_of_derived[name] = ""
            reasons_of_derived[name] = _reason_of_inputs(spec_index, faults, variable, reasons_of_derived)
        return reasons_of_derived[name]
    if variable.is_derived:
        return "in some cases no rule fires" if _can_be_silent(spec_index, faults, name) else ""
    if variable.rate is not None:
        return f"a {'share' if variable.rate.is_share else 'rate'} is known only while readings span half of 'over'"
    if not spec_index.is_readable("context", name, *_VARIABLE_KEYS):
        return ""
    if variable.valid_for_s < FOREVER_S:
        return f"its evidence is valid for {variable.valid_for_s:g} s"
    skill = next((skill for skill in spec_index.spec.skills if name in {change.name for change in skill.changes}), None)
    if skill is not None:
        return f"skill '{skill.name}' changes it"
    return "its algorithm can fail" if name in spec_index.producers else ""


def _reason_of_inputs(
    spec_index: SpecIndex, faults: FaultyElements, variable: Variable, reasons_of_derived: dict[str, str]
) -> str:
    """Return which input makes a derived variable unknown, and why; empty if none does."""
    tree = variable.derived.tree if variable.derived is not None else None
    reasons: dict[str, str] = {}
    for name in () if tree is None else names_in(tree):
        compared_pose = name.pose_comparison
        is_count = isinstance(compared_pose, Count)  # it is always known
        for input_name in () if is_count else names_in(compared_pose or name):
            reason = _reason_for_unknown(spec_index, faults, input_name.name, reasons_of_derived)
            if reason:
                reasons.setdefault(name.name, reason)
    if tree is not None and _division_by_zero(tree, spec_index.context_types):
        return "it divides by a number that can be 0"
    culprits = () if tree is None else _decisive_names(spec_index, tree, tuple(reasons))
    return f"it is derived from '{culprits[0]}': {reasons[culprits[0]]}" if culprits else ""


def _can_pose_become_stale(spec_index: SpecIndex, first: str, second: str) -> bool:
    graph = spec_index.declared_graph
    motions = (graph.edges[name].motion for name in graph.pose_edges_between(first, second))
    moving = [motion for motion in motions if motion is not None and not motion.is_static]
    return any(motion.valid_for_s is not None and motion.valid_for_s < FOREVER_S for motion in moving)


def _can_be_silent(spec_index: SpecIndex, faults: FaultyElements, name: str) -> bool:
    """Return whether no rule of a metric or a weight fires in some case. A course always has an action."""
    is_course = any(
        adaptation.name == name and isinstance(adaptation.does, Course) for adaptation in spec_index.spec.adaptation
    )
    return not is_course and any(
        silent_combinations(spec_index, faults, section, output)
        for section, output in spec_index.parsed_rules.outputs
        if name
        in ((output.name,) if section == "metrics" else (weight_name(output.name), filtered_weight_name(output.name)))
    )


UNKNOWN_VALUE_CHECKS = (unknown_adapted_values,)
"""The checks of this module."""
