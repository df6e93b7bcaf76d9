"""Checks of loops (phase 5): adaptations do not set a variable to a value outside the variable's range."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.loops.feedback import adapted_variables
from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.intervals import Interval, Number, in_base
from codra_dsl.language.check.solver.satisfiable import can_hold
from codra_dsl.language.check.solver.values import AGES, UNKNOWN, Context, age_key, known_values, possible_values
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import Choice, Compare, Comparison, Name, Node, Not, names_in
from codra_dsl.language.model import Condition, Parameter

_END_NAME = "the end of the range"
"""A name that cannot occur in a condition, because it contains spaces."""


def values_leaving_range(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The value that an adaptation sets is in the range of the variable.

    The check uses the ranges of the names in the value. A finding is reported only if it follows from these ranges.
    """
    for adaptation, name, tree in adapted_variables(spec_index, faults):
        variable_type, variable = spec_index.context_types[name], spec_index.variables[name]
        if variable_type is None or variable_type.range is None or not isinstance(adaptation.does, Parameter):
            continue
        low, high = (f"{end:g}" if end else "0" for end in variable_type.range)
        unit_text = "" if variable.type.unit is None else f" {variable_type.unit}"
        for key, condition, branch, assumptions in _stated_values(adaptation.does, tree):
            side_texts = [
                _SIDE_TEXTS[operator] for operator in _exit_sides(spec_index, variable_type, branch, assumptions)
            ]
            if side_texts:
                sides_text = " or ".join(side_texts).format(low=f"{low}{unit_text}", high=f"{high}{unit_text}")
                is_constant = not any(names_in(branch))
                limits_text = f"[{low}, {high}]{unit_text}"
                help = f"keep the value in {limits_text}, e.g. with 'min' and 'max', or write a wider range"
                yield finding(
                    "constant-out-of-range" if is_constant else "value-leaves-range",
                    f"adaptation '{adaptation.name}' {'sets' if is_constant else 'can set'} '{name}' to {sides_text}, "
                    "outside of its range",
                    condition.place_of(branch),
                    path=f"adaptation.{adaptation.name}.{key}",
                    help=f"write a value in {limits_text}, or a wider range" if is_constant else help,
                    related=(Related("declared here", variable.type.places.get("range", variable.place)),),
                )


_SIDE_TEXTS = {Comparison.LESS: "less than {low}", Comparison.GREATER: "more than {high}"}


def _stated_values(does: Parameter, tree: Node) -> Iterator[tuple[str, Condition, Node, Sequence[Node]]]:
    """Yield each value that an adaptation can set, with its key, its condition, and when it is used."""
    for branch, assumptions in _choice_branches(tree, ()):
        yield "value", does.value, branch, assumptions
    if does.otherwise is not None and does.otherwise.tree is not None:
        yield "otherwise", does.otherwise, does.otherwise.tree, ()


def _choice_branches(tree: Node, assumptions: Sequence[Node]) -> Iterator[tuple[Node, Sequence[Node]]]:
    """Yield each branch of a value that is a choice, with the conditions under which this branch is used."""
    if not isinstance(tree, Choice):
        yield tree, assumptions
        return
    yield from _choice_branches(tree.then, (*assumptions, tree.condition))
    yield from _choice_branches(tree.otherwise, (*assumptions, Not(start=0, end=0, operand=tree.condition)))


def _exit_sides(
    spec_index: SpecIndex, variable_type: Type, branch: Node, assumptions: Sequence[Node]
) -> Iterator[Comparison]:
    """Yield the sides on which a value can leave the range of its variable.

    If a name in the value has no range, or occurs twice, a side is yielded only if the value is certainly on this side
    of the range.
    """
    types = spec_index.context_types
    occurrences = [occurrence.name for occurrence in names_in(branch)]
    names = set(occurrences)
    is_exact = len(names) == len(occurrences)
    values = {name: known_values(types.get(name)) | UNKNOWN for name in names}
    context = Context(values | {age_key(name): AGES for name in names})
    branch_values = current_budget().answer(lambda: possible_values(branch, context), [branch], undecided=UNKNOWN)
    intervals = [value for value in branch_values if isinstance(value, Interval)]
    assert variable_type.range is not None
    for operator, end in zip(_SIDE_TEXTS, variable_type.range, strict=True):
        limit = in_base(end, variable_type.unit)
        if any(
            _is_beyond(interval, operator, limit) or (is_exact and _has_finite_end(interval, operator))
            for interval in intervals
        ):
            end_type = Type(variable_type.kind, variable_type.unit, range=(end, end))
            exit_condition = Compare(
                start=0, end=0, first=branch, rest=((operator, Name(start=0, end=0, name=_END_NAME)),)
            )
            can_leave = can_hold([*assumptions, exit_condition], (), {**types, _END_NAME: end_type})
            if can_leave and not current_budget().has_undecided:  # an undecided question does not cause a finding
                yield operator


def _has_finite_end(interval: Interval, operator: Comparison) -> bool:
    """Return whether an interval has a finite end on one side."""
    return isinstance(interval.low if operator is Comparison.LESS else interval.high, Fraction)


def _is_beyond(interval: Interval, operator: Comparison, limit: Number) -> bool:
    return interval.high < limit if operator is Comparison.LESS else interval.low > limit


RANGE_EXIT_CHECKS = (values_leaving_range,)
"""The checks of this module."""
