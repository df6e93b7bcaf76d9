"""Changes of skills, knowledge, agents and loops that concern more than one field."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import Any

from codra_dsl.language.check import Type, Types
from codra_dsl.language.expression import names_in
from codra_dsl.language.model import Agent, Condition, Expectation, Expected, Motion, Reference
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.comparers import GUARD_WORDINGS, growth_comparer, name_comparer, show_nothing, show_pose
from codra_dsl.tooling.diff.guards import Relation, find_relation, joined_types
from codra_dsl.tooling.diff.version import Pair, Side
from codra_dsl.tooling.diff.walk import Scope, element_comparer, equality_comparer, set_comparer

_MONITOR_COMPARER = name_comparer(
    (Category.UNDECLARED, "no longer monitors {}"), (Category.ADDED, "monitors {} as well")
)
_VALIDITY_COMPARER = growth_comparer(Category.WEAKER, Category.STRONGER)
_MOTION_COMPARER = equality_comparer(message="poses are kept or extrapolated in another way", show=show_nothing)
_POSE_COMPARER = equality_comparer(message="the starting pose has changed", show=show_pose)
_WAKES_COMPARER = name_comparer(
    (Category.GUARD_CHANGED, "some conditions no longer wake it"), (Category.WIDENED, "more conditions wake it")
)
TERMS_COMPARER = set_comparer("the terms have changed")


# Skills


def compare_monitor(scope: Scope, key: str, old: Sequence[Expectation], new: Sequence[Expectation]) -> Iterator[Change]:
    """Yield the changes of monitored variables and expectations.

    Expectations with the same variable and kind are paired in the order of the spec.
    """
    yield from _MONITOR_COMPARER(
        scope, key, *([expectation.variable for expectation in expectations] for expectations in (old, new))
    )
    before, after = _expectations_by_subject(old), _expectations_by_subject(new)
    for subject in dict.fromkeys((*before, *after)):
        if subject[0] not in scope.pair.one_sided_variable_names:
            for old_expectation, new_expectation in zip_longest(before.get(subject, ()), after.get(subject, ())):
                yield from _compare_expectation(scope, key, old_expectation, new_expectation)


def _expectations_by_subject(expectations: Iterable[Expectation]) -> dict[tuple[str, Expected], list[Expectation]]:
    expectations_by_subject: dict[tuple[str, Expected], list[Expectation]] = {}
    for expectation in expectations:
        if expectation.expected is not Expected.WATCHED:
            expectations_by_subject.setdefault((expectation.variable.name, expectation.expected), []).append(
                expectation
            )
    return expectations_by_subject


def _compare_expectation(scope: Scope, key: str, old: Expectation | None, new: Expectation | None) -> Iterator[Change]:
    if old is None or new is None:
        category, verb_phrase = (
            (Category.WEAKER, "is no longer expected") if old else (Category.STRONGER, "is expected now")
        )
        for expectation in filter(None, (old, new)):  # one of them
            yield scope.make_change(category, key, f"'{expectation.text}' {verb_phrase}", changed_parts=(old, new))
        return
    guard_relation = _expectation_relation(scope.pair, old, new)
    if guard_relation is not Relation.SAME:
        category, message = GUARD_WORDINGS[guard_relation]
        yield scope.make_change(
            category,
            key,
            f"an expectation {message}",
            f"'{old.text}'",
            f"'{new.text}'",
            changed_parts=(old, new),
        )
    yield from scope.inner_scope(key, old, new).changes()


def _expectation_relation(pair: Pair, old: Expectation, new: Expectation) -> Relation:
    """Return how an expectation has changed, from the changes of its time and of its condition."""
    name = new.variable.name
    types = joined_types(*({name: side.variables[name].type} for side in pair.sides))
    trees = [
        expectation.condition.tree for expectation in (old, new) if expectation.condition and expectation.condition.tree
    ]
    condition_relation = find_relation(trees[:1], trees[1:], types) if len(trees) == 2 else Relation.SAME
    before_s, after_s = (
        float("inf") if expectation.within_s is None else expectation.within_s for expectation in (old, new)
    )
    if before_s == after_s:
        return condition_relation
    time_relation = Relation.WEAKER if after_s > before_s else Relation.STRONGER
    return time_relation if condition_relation in (Relation.SAME, time_relation) else Relation.OTHER


# Knowledge


def compare_agents(scope: Scope, key: str, old: Sequence[Agent], new: Sequence[Agent]) -> Iterator[Change]:
    """Yield the changes of agents. Without knowledge, yield nothing: then agents are only sources of variables."""
    if has_knowledge(scope):
        yield from element_comparer("agent", "agent")(scope, key, old, new)


def has_knowledge(scope: Scope) -> bool:
    """Return whether one of the versions has knowledge. If so, agents refer to a variable by its node and its name."""
    return any(side.spec.knows for side in scope.pair.sides)


def compare_motion(scope: Scope, key: str, old: Motion | None, new: Motion | None) -> Iterator[Change]:
    """Yield the changes of how poses are kept and of how long they are valid.

    Conditions on poses are known as long as the poses are valid.
    """
    if old is not None and new is not None:
        yield from _VALIDITY_COMPARER(scope, "valid_for", old.valid_s, new.valid_s)
        yield from _MOTION_COMPARER(scope, key, replace(old, valid_for_s=new.valid_for_s), new)
        yield from _POSE_COMPARER(scope, "pose", *(edge.pose for edge in scope.values))


def compare_wakes(scope: Scope, key: str, old: Sequence[Condition], new: Sequence[Condition]) -> Iterator[Change]:
    """Yield a change if other conditions wake an agent. An agent without `wakes` is always active."""
    if old and new:
        yield from _WAKES_COMPARER(scope, key, old, new)
    elif new:
        yield scope.make_change(Category.GUARD_CHANGED, key, "is only active once it is woken")
    elif old:
        yield scope.make_change(Category.WIDENED, key, "is always active")


def rule_types(scope: Scope, conditions: Sequence[Condition]) -> Types:
    """Return the types of the names in patterns; None for a name that has another type in B."""
    types: dict[str, Type | None] = {}
    for name in {name.name for condition in conditions if condition.tree for name in names_in(condition.tree)}:
        before, after = (side.declared_graph.name_type(name) for side in scope.pair.sides)
        types[name] = before if before == after else None
    return types


# Loops


def compare_terms(scope: Scope, key: str, *values: Any) -> Iterator[Change]:
    """Yield a change if a variable has other terms.

    A derived variable has the terms of its metric or action. Changes of these terms are reported there.
    """
    if not scope.values[1].is_derived:
        yield from TERMS_COMPARER(scope, key, *values)


def compare_course_node(scope: Scope, key: str, old: Reference | None, new: Reference | None) -> Iterator[Change]:
    """Yield the change of the node of a course. A course without a node has no variables for filtered weights."""
    if old is not None and new is None:
        yield scope.make_change(Category.REMOVED, key, "the filtered weights of its actions are gone", old.name)
    else:
        yield from equality_comparer()(scope, key, old, new)


def compare_effect(scope: Scope, _: str, old: Any, new: Any) -> Iterator[Change]:
    """Yield the changes of the actions that an adaptation chooses and of the variable that it sets."""
    if type(old) is type(new):
        yield from scope.inner_scope("", old, new).changes()
    else:
        yield scope.make_change(
            Category.REDEFINED, "set", "chooses an action instead of setting a variable, or the reverse"
        )


def compare_tree_file(scope: Scope, key: str, *_: str) -> Iterator[Change]:
    """Yield a change if the file of a behaviour tree has other contents."""
    before, after = (_trees_in_files(side, scope.values[1].name) for side in scope.pair.sides)
    if before != after:
        yield scope.make_change(Category.REDEFINED, key, "the file has other contents")


def _trees_in_files(side: Side, name: str) -> object:
    trees = () if side.plan.checked.mape is None else side.plan.checked.mape.trees
    return next((tuple(file.trees for file in tree.forest.forest.files) for tree in trees if tree.name == name), None)
