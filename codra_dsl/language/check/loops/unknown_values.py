"""Checks of loops (phase 5): a parameter does not keep a value that nobody stated may be kept.

While the value of a `set` adaptation is unknown, its variable gets the value of `otherwise`. Without `otherwise`, the
last value would stay, such as a high speed after the lidar has failed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.loops.feedback import adapted_variables
from codra_dsl.language.check.loops.firing import silent_combinations
from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.satisfiable import is_always_known
from codra_dsl.language.check.solver.zeros import can_be_zero, is_known_in_all_cases
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import (
    Arithmetic,
    Count,
    Name,
    Node,
    is_distance,
    names_in,
    reads_of,
    to_text,
    walk,
)
from codra_dsl.language.expression.poses import map_parts
from codra_dsl.language.model import (
    ADAPTER,
    FOREVER_S,
    Course,
    Kind,
    Parameter,
    Variable,
    filtered_weight_name,
    weight_name,
)
from codra_dsl.language.units import UNITS

_MAX_LEVELS = 5
"""The maximum nesting depth of derived variables whose expressions are read."""

_MAX_NAMES = 50
"""The maximum number of names in an expression in which derived variables are replaced."""

_VARIABLE_KEYS = ("source", "valid_for", "when_unobservable")


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
        division = _division_by_zero(spec_index, tree)
        culprits = () if division else _decisive_names(spec_index, tree, tuple(reasons))
        if division is None and not culprits:
            continue
        state_text = f"{to_text(division)} divides by 0" if division else _state_text(spec_index, tree, culprits)
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


def _division_by_zero(spec_index: SpecIndex, tree: Node) -> Node | None:
    """Return a division that makes a value unknown although all names are known, because its divisor is 0; or None."""
    divisions = (part for part in walk(tree) if isinstance(part, Arithmetic) and part.operator == "/")
    division = next((part for part in divisions if _can_be_zero(spec_index, part.right)), None)
    types = spec_index.context_types
    for known_tree in () if division is None else (tree, _with_expressions(spec_index, tree)):
        if is_always_known(known_tree, (), types) or is_known_in_all_cases(known_tree, types):
            return None
    return None if current_budget().has_undecided else division


def _can_be_zero(spec_index: SpecIndex, divisor: Node) -> bool:
    """Return whether a divisor can be 0, by the ranges of its names and by the expressions of derived variables."""
    answers = [
        can_be_zero(tree, {**spec_index.context_types, **_types_of_graph(tree)})
        for tree in (divisor, _with_expressions(spec_index, divisor))
    ]
    return True in answers and False not in answers


def _types_of_graph(tree: Node) -> dict[str, Type]:
    """Return the types of the counts and distances in an expression, which are not negative."""
    types: dict[str, Type] = {}
    for name in names_in(tree):
        if isinstance(name.pose_comparison, Count) and name.pose_comparison.function == "count":
            types[name.name] = Type(Kind.INT, range=(0, math.inf))
        elif is_distance(name):
            types[name.name] = Type(Kind.FLOAT, UNITS["m"], range=(0, math.inf))
    return types


def _with_expressions(spec_index: SpecIndex, tree: Node) -> Node:
    """Return an expression in which derived variables are replaced by their expressions, as long as it stays small."""
    for _ in range(_MAX_LEVELS):
        names = {name.name for name in names_in(tree)}
        derivations = {name: spec_index.variables[name].derived for name in names if name in spec_index.variables}
        trees = {name: derived.tree for name, derived in derivations.items() if derived and derived.tree}
        if not trees or len(names_in(tree)) > _MAX_NAMES:
            break
        tree = _replaced(tree, trees)
    return tree


def _replaced(tree: Node, trees: Mapping[str, Node]) -> Node:
    if isinstance(tree, Name):
        return trees.get(tree.name, tree)
    return map_parts(tree, lambda part: _replaced(part, trees))


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
    if tree is not None and _division_by_zero(spec_index, tree):
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
