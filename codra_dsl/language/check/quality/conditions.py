"""Conditions over results that can never hold, and conditions that always hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.contradictions import (
    StatedCondition,
    contradiction,
    limit_places,
    never_true_message,
    related_places,
    state_condition,
    types_without_ranges,
)
from codra_dsl.language.check.solver.satisfiable import always_holds, can_hold, has_exact_answers
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import Compare, Comparison, Name, Node, Not, Truth, names_in, spelt_out
from codra_dsl.language.model import Algorithm, Condition, Hysteresis, Identification, Kind, Members, Returned, Variable

MAX_MEMBERS = 30
"""The maximum number of earlier members with which a member is compared. Further members are not compared at all."""

MAX_RELATED_PLACES = 5
"""The maximum number of other values with the same cause that a finding lists."""


def never_holding_conditions(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Some result passes `accept_when`, and some accepted result gives each value under `identifies`."""
    yield from _once_per_shape(spec_index, faults, _never_holding_findings)


def _never_holding_findings(
    spec_index: SpecIndex, faults: FaultyElements, algorithm: Algorithm
) -> Iterator[Diagnostic]:
    accepted_conditions = tuple(sound_conditions(spec_index, algorithm.accept_when))
    types = spec_index.returned_types[algorithm.name]
    core = contradiction(accepted_conditions, types)
    if core:
        yield _never_holds_finding(algorithm, "accept_when", "rejects every result", core, types)
        return
    for entry in algorithm.identifies:
        if faults.is_sound("context", entry.variable.name) and entry.variable.name in spec_index.variables:
            yield from _never_identified_findings(spec_index, algorithm, entry, accepted_conditions)


def always_holding_conditions(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every condition is false for some value. A condition that is always true has no effect."""
    for algorithm in spec_index.algorithms.values():
        if not faults.is_sound("perception", algorithm.name):
            continue
        context_types = spec_index.context_types
        for condition in parts_of_conditions(spec_index, algorithm.observable_when):
            if always_holds(condition.tree, context_types):
                variables = [
                    spec_index.variables[name] for name in names_of_condition(condition) if name in spec_index.variables
                ]
                yield _always_holds_finding(algorithm, "observable_when", condition, context_types, variables)
    yield from _once_per_shape(spec_index, faults, _always_holding_findings)


def _always_holding_findings(
    spec_index: SpecIndex, faults: FaultyElements, algorithm: Algorithm
) -> Iterator[Diagnostic]:
    returned_types = spec_index.returned_types[algorithm.name]
    optional_names = frozenset(returned_value.name for returned_value in algorithm.returns if returned_value.optional)
    for condition in parts_of_conditions(spec_index, algorithm.accept_when):
        if always_holds(condition.tree, returned_types, optional_names=optional_names):
            yield _always_holds_finding(algorithm, "accept_when", condition, returned_types, algorithm.returns)
    for entry in algorithm.identifies:
        for condition in _true_conditions(spec_index, faults, entry):
            if always_holds(condition.tree, returned_types, optional_names=optional_names):
                key = f"identifies.{entry.variable.name}"
                yield _always_holds_finding(algorithm, key, condition, returned_types, algorithm.returns)


def overlapping_hysteresis(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No accepted result satisfies both `enter` and `leave`."""
    yield from _once_per_shape(spec_index, faults, _overlap_findings)


def _overlap_findings(spec_index: SpecIndex, faults: FaultyElements, algorithm: Algorithm) -> Iterator[Diagnostic]:
    """Yield a finding for each hysteresis with two conditions that certainly overlap."""
    types = spec_index.returned_types[algorithm.name]
    for entry in algorithm.identifies:
        name = entry.variable.name
        if not isinstance(entry.by, Hysteresis) or entry.by.leave is None or not faults.is_sound("context", name):
            continue
        stated_conditions = [*sound_conditions(spec_index, [entry.by.enter, entry.by.leave])]
        accepted_conditions = [condition.tree for condition in sound_conditions(spec_index, algorithm.accept_when)]
        if len(stated_conditions) < 2 or any(isinstance(condition.tree, Truth) for condition in stated_conditions):
            continue
        enter, leave = stated_conditions
        both = [*accepted_conditions, enter.tree, leave.tree]
        is_exact = all(map(has_exact_answers, both))
        if not is_exact or not can_hold(both, (), types) or current_budget().has_undecided:
            continue
        if can_hold([*accepted_conditions, _negation(enter), leave.tree], (), types):  # or else `leave` is never used
            yield finding(
                "overlapping-hysteresis",
                f"'{enter.text}' and '{leave.text}' can hold together: then 'enter' decides, and '{name}' is true",
                leave.place,
                path=f"perception.{algorithm.name}.identifies.{name}",
                help="let the conditions exclude each other; the variable keeps its value where neither of them holds",
                related=(Related("'enter' is here", enter.place),),
            )


def never_derived_values(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The expression of a derived number has some value in the range of the variable."""
    types = spec_index.context_types
    for variable in spec_index.spec.context:
        declared, derived = types.get(variable.name), variable.derived
        tree = None if derived is None or not faults.is_sound("context", variable.name) else derived.tree
        if derived is None or tree is None or declared is None or declared.range is None:
            continue
        in_range = (Comparison.EQUAL, Name(start=0, end=0, name=variable.name))
        equality = Compare(start=0, end=0, first=tree, rest=(in_range,))
        if not can_hold([equality], (), types) and not current_budget().has_undecided:
            low, high = declared.range
            reason = f"no value of '{derived.text}' is in its range"
            yield finding(
                "never-holds",
                f"context-variable '{variable.name}' is never known: {reason}",
                derived.place,
                path=f"context.{variable.name}.derived",
                help="change the expression, or write another range",
                related=(
                    Related(f"the range is [{low:g}, {high:g}]", variable.type.places.get("range", variable.place)),
                ),
            )


CONDITION_CHECKS = (
    never_holding_conditions,
    always_holding_conditions,
    overlapping_hysteresis,
    never_derived_values,
)
"""The checks of this module."""


def _once_per_shape(
    spec_index: SpecIndex,
    faults: FaultyElements,
    rule: Callable[[SpecIndex, FaultyElements, Algorithm], Iterable[Diagnostic]],
) -> Iterator[Diagnostic]:
    """Apply a check of conditions over results to each algorithm, and yield its findings.

    Many algorithms of a large spec have the same shape. If one of them has no finding, the others have no findings.
    """
    clean_shapes: set[object] = set()
    for algorithm in spec_index.algorithms.values():
        if faults.is_sound("perception", algorithm.name):
            shape = spec_index.shape_over_results(algorithm, faults)
            findings = () if shape in clean_shapes else tuple(rule(spec_index, faults, algorithm))
            yield from findings
            if not findings:
                clean_shapes.add(shape)


def sound_conditions(spec_index: SpecIndex, conditions: Iterable[Condition]) -> Iterator[StatedCondition]:
    """Yield the conditions without a problem."""
    for condition in conditions:
        judgement = spec_index.judgement(condition)
        if judgement is not None and not judgement.problems:
            yield state_condition(condition, spelt_out(judgement.typed.node))


def parts_of_conditions(spec_index: SpecIndex, conditions: Iterable[Condition]) -> Iterator[StatedCondition]:
    """Yield the conditions of a list, except plain and negated names. The parts of an `and` are yielded separately."""
    for condition in conditions:
        if isinstance(condition.tree, Name) and condition.tree.pose_comparison is None:
            continue  # the most frequent case
        for stated_condition in sound_conditions(spec_index, [condition]):
            for part in stated_condition.parts or (stated_condition,):
                if not isinstance(part.tree.operand if isinstance(part.tree, Not) else part.tree, Name):
                    yield part


def names_of_condition(condition: StatedCondition) -> Iterable[str]:
    """Return the names in a condition, each once."""
    return dict.fromkeys(name.name for name in names_in(condition.tree))


def _true_conditions(spec_index: SpecIndex, faults: FaultyElements, entry: Identification) -> Iterator[StatedCondition]:
    """Yield the condition under which a bool is True. Yield nothing for literals and plain names: they are intended."""
    variable = spec_index.variables.get(entry.variable.name)
    by = entry.by.enter if isinstance(entry.by, Hysteresis) else entry.by
    if variable is None or not faults.is_sound("context", variable.name) or not isinstance(by, Condition):
        return
    if _is_bool(spec_index, entry):
        yield from (
            condition
            for condition in sound_conditions(spec_index, [by])
            if not isinstance(condition.tree, (Truth, Name))
        )


def _always_holds_finding(
    algorithm: Algorithm, key: str, condition: StatedCondition, types: Types, variables: Iterable[Variable | Returned]
) -> Diagnostic:
    depends_on_range = not always_holds(condition.tree, types_without_ranges(types, [condition.tree]))
    names = tuple(names_of_condition(condition))
    place = f"'{key.partition('.')[0]}' of algorithm '{algorithm.name}'"
    precondition_help = (
        f"remove the condition, or write 'known({names[0]})' if this is intended" if names else "remove it"
    )
    help_by_key = {"observable_when": precondition_help, "accept_when": "change the condition, or remove it"}
    return finding(
        "always-holds",
        f"'{condition.text}' holds for every possible value ({place})",
        condition.place,
        path=f"perception.{algorithm.name}.{key}",
        help=help_by_key.get(key, "change the condition: as it is, the variable is never False"),
        related=tuple(limit_places([condition.tree], variables)) if depends_on_range else (),
    )


def _never_identified_findings(
    spec_index: SpecIndex, algorithm: Algorithm, entry: Identification, accepted_conditions: tuple[StatedCondition, ...]
) -> Iterator[Diagnostic]:
    """Yield findings about values that a variable never gets. Shadowed values with the same cause share one finding."""
    types = spec_index.returned_types[algorithm.name]
    earlier_conditions: dict[str, tuple[str, StatedCondition]] = {}
    shadowed_values: dict[tuple[str, ...], list[tuple[str, StatedCondition]]] = {}
    for value, condition in _values(spec_index, entry):
        for stated_condition in sound_conditions(spec_index, [condition]):
            if isinstance(stated_condition.tree, Truth) and not stated_condition.tree.value:
                continue
            core = contradiction((*accepted_conditions, stated_condition), types)
            if core:
                name = entry.variable.name
                yield _never_holds_finding(
                    algorithm, f"identifies.{name}", f"never identifies '{name}' as {value}", core, types
                )
                continue
            if len(earlier_conditions) == MAX_MEMBERS:
                break
            if not earlier_conditions:
                earlier_conditions[value] = value, stated_condition
                continue
            negated_conditions = [
                StatedCondition(_negation(other), other.text, other.place) for _, other in earlier_conditions.values()
            ]
            blocking_core = contradiction((*accepted_conditions, *negated_conditions, stated_condition), types)
            blocking_values = [
                name
                for name, negated_condition in zip(earlier_conditions, negated_conditions, strict=True)
                if negated_condition in blocking_core
            ]
            if blocking_core:
                shadowed_values.setdefault(tuple(blocking_values), []).append((value, stated_condition))
            else:
                earlier_conditions[value] = value, stated_condition
    for names, values in shadowed_values.items():
        if not isinstance(entry.by, Hysteresis) or not always_holds(earlier_conditions["true"][1].tree, types):
            yield _shadowed_value_finding(algorithm, entry, values, [earlier_conditions[name] for name in names])


def _values(spec_index: SpecIndex, entry: Identification) -> Iterator[tuple[str, Condition]]:
    """Yield the values of a variable with their conditions, in the order in which they are tried."""
    by = entry.by
    if isinstance(by, Members):
        yield from ((f"'{member.name}'", condition) for member, condition in by.cases)
    elif isinstance(by, Hysteresis):
        yield "true", by.enter
        if by.leave is not None:
            yield "false", by.leave
    elif _is_bool(spec_index, entry):
        yield "true", by


def _is_bool(spec_index: SpecIndex, entry: Identification) -> bool:
    declared = spec_index.context_types.get(entry.variable.name)
    return declared is not None and declared.kind is Kind.BOOL


def _negation(condition: StatedCondition) -> Node:
    return Not(start=condition.tree.start, end=condition.tree.end, operand=condition.tree)


def _never_holds_finding(
    algorithm: Algorithm, key: str, effect: str, core: Sequence[StatedCondition], types: Types
) -> Diagnostic:
    return finding(
        "never-holds",
        f"algorithm '{algorithm.name}' {effect}: {never_true_message(core)}",
        core[-1].place,
        path=f"perception.{algorithm.name}.{key}",
        help="change the condition",
        related=tuple(related_places(core, types, algorithm.returns)),
    )


def _shadowed_value_finding(
    algorithm: Algorithm,
    entry: Identification,
    values: Sequence[tuple[str, StatedCondition]],
    blocking_conditions: Sequence[tuple[str, StatedCondition]],
) -> Diagnostic:
    name = entry.variable.name
    (value, first), *others = values
    blocking_text = " or ".join(f"'{condition.text}'" for _, condition in blocking_conditions)
    return finding(
        "never-holds",
        f"algorithm '{algorithm.name}' never identifies '{name}' as {value}: whenever '{first.text}' holds, "
        f"{blocking_text} above it also holds",
        first.place,
        path=f"perception.{algorithm.name}.identifies.{name}",
        help="change the order: the first condition that holds gives the value"
        if isinstance(entry.by, Members)
        else "change the condition",
        related=(
            *(Related("holds first in these cases", condition.place) for _, condition in blocking_conditions),
            *(
                Related(f"'{name}' is never {other} either", condition.place)
                for other, condition in others[:MAX_RELATED_PLACES]
            ),
        ),
    )
