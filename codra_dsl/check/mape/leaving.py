"""Phase 5 for loops: values of adaptations that leave the range of what is set."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from codra_dsl.check.intervals import Interval, Number, in_base
from codra_dsl.check.mape.feedback import set_variables
from codra_dsl.check.outcomes import AGES, UNKNOWN, Context, age_key, known_values, outcomes
from codra_dsl.check.possible import can_hold
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.check.types import Type
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.expression import Choice, Compare, Comparison, Name, Node, Not, names_in
from codra_dsl.model import Parameter

_END = "the end of the range"
"""A name that no condition can have."""


def leaving_values(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What an adaptation sets lies in the range of the variable, as far as ranges tell what its value can be."""
    for adaptation, own, tree in set_variables(scope, faults):
        wanted, variable = scope.context_types[own], scope.variables[own]
        if wanted is None or wanted.range is None or not isinstance(adaptation.does, Parameter):
            continue
        low, high = (f"{end:g}" if end else "0" for end in wanted.range)
        unit = "" if variable.type.unit is None else f" {wanted.unit}"
        for branch, held in _branches(tree, ()):
            sides = [_SAYS[operator] for operator in _left(scope, wanted, branch, held)]
            if sides:
                said = " or ".join(sides).format(low=f"{low}{unit}", high=f"{high}{unit}")
                yield finding(
                    "value-leaves-range",
                    f"adaptation '{adaptation.name}' can set '{own}' to {said}, where its range ends",
                    adaptation.does.value.place_of(branch),
                    path=f"adaptation.{adaptation.name}.value",
                    way_out=f"keep the value in [{low}, {high}]{unit}, as by 'min' and 'max', or state a wider range",
                    related=(Related("declared here", variable.type.places.get("range", variable.place)),),
                )


_SAYS = {Comparison.LESS: "less than {low}", Comparison.GREATER: "more than {high}"}


def _branches(tree: Node, held: Sequence[Node]) -> Iterator[tuple[Node, Sequence[Node]]]:
    """Yield each part that a value can be, with the conditions that hold then."""
    if not isinstance(tree, Choice):
        yield tree, held
        return
    yield from _branches(tree.then, (*held, tree.condition))
    yield from _branches(tree.otherwise, (*held, Not(start=0, end=0, operand=tree.condition)))


def _left(scope: Scope, wanted: Type, branch: Node, held: Sequence[Node]) -> Iterator[Comparison]:
    """Yield on which sides a value can leave the range of its variable.

    Where something in it has no range, or stands in it twice, a side counts only if the value cannot but lie there.
    """
    types = scope.context_types
    mentioned = [each.name for each in names_in(branch)]
    names = set(mentioned)
    is_exact = len(names) == len(mentioned)
    values = {name: known_values(types.get(name)) | UNKNOWN for name in names}
    found = outcomes(branch, Context(values | {age_key(name): AGES for name in names}))
    numbers = [each for each in found if isinstance(each, Interval)]
    assert wanted.range is not None
    for operator, end in zip(_SAYS, wanted.range, strict=True):
        limit = in_base(end, wanted.unit)
        if any(_is_beyond(each, operator, limit) or (is_exact and _ends(each, operator)) for each in numbers):
            point = Type(wanted.kind, wanted.unit, range=(end, end))
            beyond = Compare(start=0, end=0, first=branch, rest=((operator, Name(start=0, end=0, name=_END)),))
            if can_hold([*held, beyond], (), {**types, _END: point}):
                yield operator


def _ends(numbers: Interval, operator: Comparison) -> bool:
    """Return whether ranges tell how far some numbers go to one side."""
    return isinstance(numbers.low if operator is Comparison.LESS else numbers.high, Fraction)


def _is_beyond(numbers: Interval, operator: Comparison, limit: Number) -> bool:
    return numbers.high < limit if operator is Comparison.LESS else numbers.low > limit


LEAVING = (leaving_values,)
"""The rules of this subject."""
