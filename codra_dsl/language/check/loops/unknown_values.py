"""Checks of loops (phase 5): a parameter keeps a value only if the spec states that the value may be kept.

While the value of a `set` adaptation is unknown, its variable gets the value of `otherwise`. Without `otherwise`, the
last value would stay, such as a high speed after the lidar has failed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from codra_dsl.language import graph
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
    variables_in,
)
from codra_dsl.language.model import (
    ADAPTER,
    FOREVER_S,
    Course,
    Parameter,
    RateKind,
    filtered_weight_name,
    weight_name,
)

_VARIABLE_KEYS = ("source", "valid_for", "when_unobservable")
_RATE_REASONS = {
    RateKind.RATE: "a rate is known only while readings span half of 'over'",
    RateKind.SHARE: "a share is known only while readings span half of 'over'",
    RateKind.HELD: "it is known only after its bool was known for the time under 'for'",
}
_ZERO = Number(start=0, end=0, value=0.0, unit=None)


def unknown_adapted_values(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A parameter whose value can become unknown states `otherwise`."""
    reasons = _Reasons(spec_index, faults)
    steady_names = _steady_names(spec_index)
    for adaptation, name, tree in adapted_variables(spec_index, faults):
        does = adaptation.does
        if not isinstance(does, Parameter) or does.otherwise is not None:
            continue
        if not spec_index.is_readable("adaptation", adaptation.name, "otherwise"):
            continue
        steady_name_sets = steady_names.get(adaptation.name, ())
        doubtful_names = [
            read_name
            for read_name in variables_in(tree)
            if not any(read_name in names for names in steady_name_sets) and reasons.of(read_name)
        ]
        division = _division_by_zero(tree, spec_index.context_types)
        decisive_names = () if division else _decisive_names(spec_index, tree, doubtful_names)
        if division is None and not decisive_names:
            continue
        state_text = f"'{to_text(division.right)}' is 0" if division else _state_text(spec_index, tree, decisive_names)
        yield finding(
            "unknown-adapted-value",
            f"adaptation '{adaptation.name}' keeps the last value of '{name}' while {state_text}",
            does.value.place,
            path=f"adaptation.{adaptation.name}.value",
            help="add 'otherwise: VALUE' with a value that is right while nothing is known",
            related=tuple(
                Related(f"'{unknown}' can become unknown: {reasons.of(unknown)}", spec_index.variables[unknown].place)
                for unknown in decisive_names
                if unknown in spec_index.variables
            ),
        )


def _steady_names(spec_index: SpecIndex) -> Mapping[str, Sequence[frozenset[str]]]:
    """Return, for each adaptation, the variables that only its loops set; they stay valid while these loops run."""
    targets = {
        adaptation.name: adaptation.does.variable.name
        for adaptation in spec_index.spec.adaptation
        if isinstance(adaptation.does, Parameter) and _is_only_adapted(spec_index, adaptation.does.variable.name)
    }
    steady_names: dict[str, list[frozenset[str]]] = {}
    for loop in spec_index.spec.loops:
        names = frozenset(targets[reference.name] for reference in loop.adapt if reference.name in targets)
        for reference in loop.adapt:
            steady_names.setdefault(reference.name, []).append(names)
    return steady_names


def _is_only_adapted(spec_index: SpecIndex, name: str) -> bool:
    variable = spec_index.variables.get(name)
    return variable is not None and [source.name for source in variable.sources] == [ADAPTER]


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


def _state_text(spec_index: SpecIndex, tree: Node, decisive_names: Sequence[str]) -> str:
    """Return in which state of its inputs a value is unknown."""
    names = [f"'{name}'" for name in decisive_names]
    is_each_decisive = not is_always_known(tree, decisive_names[:1], spec_index.context_types)
    return f"{' or '.join(names)} is unknown" if is_each_decisive else f"{' and '.join(names)} are unknown"


class _Reasons:
    """The reasons why variables can become unknown after they were known. Each variable is judged once."""

    def __init__(self, spec_index: SpecIndex, faults: FaultyElements) -> None:
        self._spec_index = spec_index
        self._faults = faults
        self._reasons: dict[str, str] = {}

    def of(self, name: str) -> str:
        """Return why a variable can become unknown; empty if it cannot, or if this is not certain.

        Metrics, weights and courses are computed even while inputs are unknown. A stated `valid_for: forever` means
        that the value may be kept. Variables that are derived from each other have no reason.
        """
        if name not in self._reasons:
            needed_names = graph.needs_first(self._spec_index.derived_inputs, name)
            new_names = [needed_name for needed_name in needed_names if needed_name not in self._reasons]
            self._reasons |= dict.fromkeys(new_names, "")
            for new_name in new_names:
                self._reasons[new_name] = self._judge(new_name)
        return self._reasons[name]

    def _judge(self, name: str) -> str:
        spec_index = self._spec_index
        function, first, second = reads_of(name)
        if function:
            return "a pose can become stale" if _can_pose_become_stale(spec_index, first, second) else ""
        variable = spec_index.variables.get(name)
        if variable is None or not self._faults.is_sound("context", name):
            return ""
        if variable.derived is not None:
            return "" if variable.derived.tree is None else self._reason_of_inputs(variable.derived.tree)
        if variable.is_derived:
            return "in some cases no rule fires" if _can_be_silent(spec_index, self._faults, name) else ""
        if variable.rate is not None:
            return _RATE_REASONS[variable.rate.kind]
        if not spec_index.is_readable("context", name, *_VARIABLE_KEYS):
            return ""
        if variable.valid_for_s < FOREVER_S:
            return f"its evidence is valid for {variable.valid_for_s:g} s"
        skills = spec_index.spec.skills
        skill = next((skill for skill in skills if any(change.name == name for change in skill.changes)), None)
        if skill is not None:
            return f"skill '{skill.name}' changes it"
        return "its algorithm can fail" if name in spec_index.producers else ""

    def _reason_of_inputs(self, tree: Node) -> str:
        """Return which input makes a derived variable unknown, and why; empty if none does."""
        if _division_by_zero(tree, self._spec_index.context_types):
            return "it divides by a number that can be 0"
        reasons: dict[str, str] = {}
        for name in names_in(tree):
            source = name.pose_comparison or name
            input_names = () if isinstance(source, Count) else variables_in(source)  # a count is always known
            for reason in filter(None, map(self.of, input_names)):
                reasons.setdefault(name.name, reason)
        decisive_names = _decisive_names(self._spec_index, tree, tuple(reasons))
        return f"it is derived from '{decisive_names[0]}': {reasons[decisive_names[0]]}" if decisive_names else ""


def _can_pose_become_stale(spec_index: SpecIndex, first: str, second: str) -> bool:
    declared_graph = spec_index.declared_graph
    motions = (declared_graph.edges[name].motion for name in declared_graph.pose_edges_between(first, second))
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
