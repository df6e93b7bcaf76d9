"""Changes of perception algorithms: functions, guards, identified variables, and the times for which they wait."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import starmap
from typing import Any

from codra_dsl.language.check import Types
from codra_dsl.language.check.solver.satisfiable import known_call
from codra_dsl.language.expression import Node, names_in, reads_of, spelt_out
from codra_dsl.language.model import (
    Access,
    Algorithm,
    Condition,
    Hysteresis,
    Identification,
    Kind,
    Literal,
    Members,
    Reference,
    Returned,
    Usage,
    ValueType,
)
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.comparers import compare_inline, guard_comparer, order_comparer, quote_names, show_nothing
from codra_dsl.tooling.diff.guards import is_equal, is_same_choice, is_same_value, joined_types
from codra_dsl.tooling.diff.version import Pair, Side, duration_text
from codra_dsl.tooling.diff.walk import Scope, Wording, entry_comparer, equality_comparer, text_of

_LENGTH_TYPE = ValueType(kind=Kind.FLOAT, unit="m", range=(0.0, math.inf))
_LITERALS_COMPARER = equality_comparer(Category.PERCEIVED_OTHERWISE, "gets another value", select_part=frozenset)
_OPTIONALITY_COMPARER = order_comparer(
    (Category.EASED, "is optional now"), (Category.CONTRACT, "is no longer optional"), show_nothing
)
_FUNCTION_FIELDS = frozenset({"parameters", "given", "returns", "uses"})


def compare_algorithms(scope: Scope, *_: Any) -> Iterator[Change]:
    """Yield the changes of each algorithm that observers run in both versions.

    For an algorithm that replaces another algorithm, yield only the changes of its observability preconditions.
    """
    for old_name, new_name in scope.pair.algorithms.items():
        algorithm_scope = _algorithm_scope(scope, old_name, new_name)
        old, new = algorithm_scope.values
        yield from algorithm_scope.changes(skipped_fields=_FUNCTION_FIELDS if old.call != new.call else frozenset())
        yield from _compare_waiting_times(algorithm_scope, old_name, new_name)
    for old_name, new_name in _replacements(scope.pair):
        yield from compare_observability(_algorithm_scope(scope, old_name, new_name), "observable_when")


def _algorithm_scope(scope: Scope, old_name: str, new_name: str) -> Scope:
    old, new = scope.pair.old.algorithms[old_name], scope.pair.new.algorithms[new_name]
    return scope.element_scope("perception", new_name, old.algorithm, new.algorithm)


def _replacements(pair: Pair) -> Iterable[tuple[str, str]]:
    """Return the first algorithm in A and in B of each variable, if B has replaced all of its algorithms."""
    replacements: dict[tuple[str, str], None] = {}
    for variable, old_names in pair.old.producers.items():
        new_names = pair.new.producers.get(variable, ())
        if new_names and not {pair.algorithms.get(old_name) for old_name in old_names} & {*new_names}:
            replacements[old_names[0], new_names[0]] = None
    return replacements


# Arguments of the function


def compare_literals(scope: Scope, key: str, old: Sequence[tuple[str, Literal]], new: Any) -> Iterator[Change]:
    """Yield a change if the function gets other literals."""
    before, after = ([f"{name} {type(value).__name__}" for name, value in literals] for literals in (old, new))
    yield from _compare_arguments(scope, key, before, after)
    if {*before} == {*after}:
        yield from _LITERALS_COMPARER(scope, key, old, new)


def compare_given_variables(
    scope: Scope, key: str, old: Sequence[Reference], new: Sequence[Reference]
) -> Iterator[Change]:
    """Yield a change if the function gets the values of other variables."""
    yield from _compare_arguments(scope, key, [*map(text_of, old)], [*map(text_of, new)])


def compare_usages(scope: Scope, key: str, old: Sequence[Usage], new: Sequence[Usage]) -> Iterator[Change]:
    """Yield a change if the function gets other handles, and the changes of how it uses resources."""
    before, after = ([usage.resource.name for usage in usages if usage.access is Access.READ] for usages in (old, new))
    yield from _compare_arguments(scope, key, before, after)
    yield from entry_comparer("")(scope, key, old, new)


def _compare_arguments(scope: Scope, key: str, old_arguments: list[str], new_arguments: list[str]) -> Iterator[Change]:
    if {*old_arguments} != {*new_arguments}:
        message = f"the function gets other arguments from '{key}'"
        yield scope.make_change(
            Category.CONTRACT, key, message, ", ".join(old_arguments) or "none", ", ".join(new_arguments) or "none"
        )


def result_wording(new: Returned | None) -> Wording:
    """Return the category and message for a result that only one version has."""
    if new is None:
        return Category.CONTRACT, "must no longer return '{}'"
    return (Category.EASED, "may now return '{}'") if new.optional else (Category.CONTRACT, "must now return '{}'")


def compare_optionality(scope: Scope, _: str, old: bool, new: bool) -> Iterator[Change]:
    """Yield a change, with the key of the result, if a result may now be absent or may no longer be absent."""
    yield from _OPTIONALITY_COMPARER(scope, "", old, new)


# Guards


def compare_observability(scope: Scope, key: str, *_: Any) -> Iterator[Change]:
    """Yield a change if the guard that `observable_when` and `given` form together has changed."""
    guards = (
        [*_conditions_with_pose_comparisons(algorithm.observable_when), *_known_conditions(algorithm.given)]
        for algorithm in scope.values
    )
    yield from guard_comparer(context_types)(scope, key, *guards)


def compare_preview_conditions(scope: Scope, _: str, old: Sequence[Condition], new: Any) -> Iterator[Change]:
    """Yield a change if the guard that the conditions of a preview form together has changed.

    A variable that is named alone must be known. This is a part of the guard if a condition reads the variable as well;
    all other names are compared as names.
    """
    trees = [condition.tree for condition in (*old, *new) if condition.tree is not None]
    read_names = {name.name for tree in trees for name in names_in(tree)}
    guards = (
        [
            *_conditions_with_pose_comparisons(skill.preview_conditions),
            *_known_conditions(reference for reference in skill.preview_names if reference.name in read_names),
        ]
        for skill in scope.values
    )
    yield from guard_comparer(context_types)(scope, "preview", *guards)


def context_types(scope: Scope, _: object) -> Types:
    """Return the types of all variables in both versions."""
    return joined_types(*(dict(_names_and_types(side)) for side in scope.pair.sides))


def returned_types(scope: Scope, _: object) -> Types:
    """Return the types of the values that an algorithm returns in either version."""
    return joined_types(*map(_result_types, scope.elements))


def _conditions_with_pose_comparisons(conditions: Iterable[Condition]) -> Iterator[Condition]:
    """Yield conditions in which each implicit variable is replaced by its comparison of poses."""
    for condition in conditions:
        yield replace(condition, tree=None if condition.tree is None else spelt_out(condition.tree))


def _known_conditions(references: Iterable[Reference]) -> Iterator[Condition]:
    for reference in references:
        yield Condition(text=f"known({reference.name})", tree=known_call(reference.name), place=reference.place)


def _names_and_types(side: Side) -> Iterator[tuple[str, ValueType]]:
    """Yield the name and type of each variable, and of each function of poses that occurs in a pose condition."""
    for variable in side.variables.values():
        yield variable.name, variable.type
        for name in () if variable.pose_condition is None else names_in(variable.pose_condition.tree):
            yield name.name, _LENGTH_TYPE if reads_of(name.name)[0] == "distance" else ValueType(kind=Kind.BOOL)


def _result_types(algorithm: Algorithm) -> dict[str, ValueType]:
    return {returned_value.name: returned_value.type for returned_value in algorithm.returns}


# Identified variables


def compare_identification(scope: Scope, _: str, *rules: Any) -> Iterator[Change]:
    """Yield a change if another rule identifies a variable, and a change if other numbers of looks confirm a value."""
    old, new = scope.values
    if old.variable.name in scope.pair.one_sided_variable_names:
        return
    if not _is_same_identification(scope, old, new):
        yield scope.make_change(
            Category.REDEFINED,
            "",
            "the value is computed in another way",
            _identification_text(old),
            _identification_text(new),
            changed_parts=(old.by, new.by),
        )
    before, after = map(_confirm_counts, rules)
    if before != after:
        category, message = _confirmation_wording(before, after)
        yield scope.make_change(category, "", message, *(f"{count} of {total}" for count, total in (before, after)))
    yield from compare_inline(scope, "", *rules)


def _is_same_identification(scope: Scope, old: Identification, new: Identification) -> bool:
    kinds = [side.variables[old.variable.name].type.kind for side in scope.pair.sides]
    if kinds[0] is not kinds[1]:
        return True  # the variable is reported as retyped
    before, after = map(_result_types, scope.elements)
    types = joined_types(before, after)
    if any(types[name] is None for name in before.keys() & after.keys()):
        return _identification_text(old) == _identification_text(new)
    return _is_same_rule(old.by, new.by, types, kinds[0])


def _is_same_rule(
    old: Condition | Members | Hysteresis, new: Condition | Members | Hysteresis, types: Types, kind: Kind
) -> bool:
    if isinstance(old, Members) and isinstance(new, Members):
        old_cases, new_cases = (
            [(member.name, _tree_of(condition)) for member, condition in rule.cases] for rule in (old, new)
        )
        return is_same_choice(old_cases, new_cases, types)
    before, after = _trees_of(old), _trees_of(new)
    is_same_tree = partial(is_equal if kind is Kind.BOOL else is_same_value, types=types)
    return len(before) == len(after) > 0 and all(starmap(is_same_tree, zip(before, after, strict=True)))


def _trees_of(rule: Condition | Members | Hysteresis) -> tuple[Node, ...]:
    if isinstance(rule, Members):
        return ()
    conditions = (rule,) if isinstance(rule, Condition) else (rule.enter, rule.leave)
    return tuple(_tree_of(condition) for condition in conditions if condition is not None)


def _tree_of(condition: Condition) -> Node:
    assert condition.tree is not None  # the spec is checked
    return spelt_out(condition.tree)


def _identification_text(identification: Identification) -> str:
    rule = identification.by
    if isinstance(rule, Members):
        return "; ".join(f"{member.name}: {condition.text}" for member, condition in rule.cases)
    if isinstance(rule, Hysteresis):
        leave_text = "" if rule.leave is None else f"; leave: {rule.leave.text}"
        return f"enter: {rule.enter.text}{leave_text}"
    return f"'{rule.text}'"


def _confirm_counts(rule: object) -> tuple[int, int]:
    return (rule.confirm if isinstance(rule, Hysteresis) else None) or (1, 1)


def _confirmation_wording(before: tuple[int, int], after: tuple[int, int]) -> Wording:
    (count, total), (new_count, new_total) = before, after
    if new_count <= count and (new_count == 1 or new_total >= total):
        return Category.WEAKER, "is confirmed by fewer looks"
    if new_count >= count and (count == 1 or new_total <= total):
        return Category.STRONGER, "needs more looks to be confirmed"
    return Category.GUARD_CHANGED, "is confirmed by another rule"


# Time


def _compare_waiting_times(scope: Scope, old_name: str, new_name: str) -> Iterator[Change]:
    """Yield a change if an algorithm waits for other variables, and therefore longer or shorter than before.

    The time of a variable can differ between A and B as well. To leave this difference out, both waiting times are
    computed with the times of one version: B shows whether the wait is longer, and A shows whether it is shorter.
    """
    old, new = scope.pair.sides
    before, after = {*old.algorithms[old_name].waits_for}, {*new.algorithms[new_name].waits_for}
    old_time_s, new_time_s = _longest_time_s(before, new, old), _longest_time_s(after, new)
    if new_time_s > old_time_s:
        message = f"waits for {quote_names(after - before) or 'none'}, which takes longer"
        yield scope.make_change(
            Category.SLOWER, "observable_when", message, duration_text(old_time_s), duration_text(new_time_s)
        )
    old_time_s, new_time_s = _longest_time_s(before, old), _longest_time_s(after, old, new)
    if new_time_s < old_time_s:
        message = f"no longer waits for {quote_names(before - after) or 'none'}"
        yield scope.make_change(
            Category.FASTER, "observable_when", message, duration_text(old_time_s), duration_text(new_time_s)
        )


def _longest_time_s(names: Iterable[str], side: Side, other_side: Side | None = None) -> float:
    """Return the longest worst-case time of some variables in one version.

    For a variable that this version does not have, the time in the other version is used.
    """
    other_times_s = {} if other_side is None else other_side.worst_latencies_s
    return max((side.worst_latencies_s.get(name, other_times_s.get(name, 0.0)) for name in names), default=0.0)
