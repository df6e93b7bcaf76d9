"""Changes of context-variables that concern more than one field: their algorithms, and names in generated packages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from codra_dsl.generation.build_plan.names import camel_case, entry_names
from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.expression import Fallback, walk
from codra_dsl.language.model import Condition, Kind, Reference, Variable
from codra_dsl.tooling.diff.algorithms import context_types
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.comparers import compare_variable_writers
from codra_dsl.tooling.diff.guards import is_equal, normal_text
from codra_dsl.tooling.diff.version import Pair, Side
from codra_dsl.tooling.diff.walk import Scope, Wording, element_comparer, text_of


def compare_variables(scope: Scope, key: str, old: Sequence[Variable], new: Sequence[Variable]) -> Iterator[Change]:
    """Yield the changes of all variables."""
    yield from element_comparer("context", "context-variable", _find_successor)(scope, key, old, new)
    yield from _compare_producers(scope)
    yield from _compare_aliases(scope)


def compare_sources(scope: Scope, key: str, old: Sequence[Reference], new: Sequence[Reference]) -> Iterator[Change]:
    """Yield the changes of the writers of a variable; a derived variable has no writers."""
    if not any(variable.derived for variable in scope.values):
        yield from compare_variable_writers(scope, key, old, new)


def compare_derivation(scope: Scope, key: str, old: Condition | None, new: Condition | None) -> Iterator[Change]:
    """Yield a change if a variable is derived in another way."""
    if old is None and new is None:
        return
    if old is None or new is None:
        message = "it follows from other variables now" if old is None else "it no longer follows from other variables"
        yield scope.make_change(Category.REDEFINED, key, message, *(text_of(side) for side in (old, new)))
    elif not _is_same_derivation(scope, old, new):
        message = "the value is computed in another way"
        yield scope.make_change(Category.REDEFINED, key, message, old.text, new.text)


def _is_same_derivation(scope: Scope, old: Condition, new: Condition) -> bool:
    """Return whether two expressions have the same text, or are conditions that always have the same value."""
    if old.text == new.text or old.tree is None or new.tree is None:
        return True  # a changed resolution is reported by itself
    if normal_text(old.tree) == normal_text(new.tree):
        return True
    is_condition = all(variable.type.kind is Kind.BOOL for variable in scope.values)
    has_fallback = any(isinstance(part, Fallback) for tree in (old.tree, new.tree) for part in walk(tree))
    return is_condition and not has_fallback and is_equal(old.tree, new.tree, context_types(scope, None))


def _find_successor(pair: Pair, old: Variable) -> str | None:
    """Return the name of the new variable that is probably a removed variable under a new name, or None.

    The new variable has the same type, and is identified by an algorithm that identified the removed variable. If B has
    no such algorithm, the new variable has a similar name, and no algorithm identifies it.
    """
    same_type_names = [name for name in sorted(pair.added_variable_names) if pair.new.variables[name].type == old.type]
    paired_algorithms = {pair.algorithms.get(name) for name in pair.old.producers.get(old.name, ())} - {None}
    identified_names = [name for name in same_type_names if paired_algorithms & {*pair.new.producers.get(name, ())}]
    if identified_names:
        return identified_names[0] if len(identified_names) == 1 else suggest(old.name, identified_names)
    return suggest(
        old.name, [name for name in same_type_names if not paired_algorithms and name not in pair.new.producers]
    )


def _compare_producers(scope: Scope) -> Iterator[Change]:
    """Yield changes of the algorithms that identify variables.

    If several variables have the same algorithms, and only the order has changed, this is reported once.
    """
    pair, reported_orders = scope.pair, set[tuple[str, ...]]()
    for name in pair.old.variables:
        before = [pair.algorithms.get(old_name, f"-{old_name}") for old_name in pair.old.producers.get(name, ())]
        after = pair.new.producers.get(name, ())
        is_reordered = {*before} == {*after}
        if name in pair.one_sided_variable_names or before == [*after] or (is_reordered and after in reported_orders):
            continue
        if is_reordered:
            reported_orders.add(after)
        category, message = _producers_wording(before, [*after])
        old_text, new_text = (
            ", ".join(name.removeprefix("-") for name in names) or "no algorithm" for names in (before, after)
        )
        first_producers = (_first_producer(side, name) for side in pair.sides)
        yield scope.element_scope("context", name, *first_producers).make_change(
            category, "", message, old_text, new_text
        )


def _producers_wording(before: list[str], after: list[str]) -> Wording:
    kept_names = [name for name in after if name in before]
    if not before:
        return Category.OBSERVABLE, "an observer identifies it now"
    if not after:
        return Category.UNOBSERVABLE, "no observer identifies it any more"
    if not kept_names:
        return Category.PERCEIVED_OTHERWISE, "other algorithms identify it"
    if {*before} - {*after}:
        return Category.STRONGER, "it has fewer alternatives"
    if kept_names != before:
        return Category.PERCEIVED_OTHERWISE, "its alternatives are tried in another order"
    if after[: len(before)] != before:
        return Category.PERCEIVED_OTHERWISE, "a new alternative is tried before an old one"
    return Category.ADDED, "it has one more alternative"


def _first_producer(side: Side, name: str) -> Any:
    producers = side.producers.get(name)
    return side.algorithms[producers[0]].algorithm if producers else side.variables[name]


# Names in the generated package


def names_by_enum_type(side: Side) -> dict[str, tuple[str, ...]]:
    """Return a mapping from the name of each enum type in the generated package to the variables of this type."""
    names_by_values: dict[tuple[str, ...], list[str]] = {}
    for variable in side.variables.values():
        if variable.type.kind is Kind.ENUM:
            names_by_values.setdefault(variable.type.values, []).append(variable.name)
    taken_names = {side.plan.class_name, *entry_names(side.spec)}
    names_by_type: dict[str, tuple[str, ...]] = {}
    for names in names_by_values.values():
        alias = camel_case(names[0])
        while {alias, f"{alias}Name"} & taken_names:
            alias += "_"
        taken_names |= {alias, f"{alias}Name"}
        names_by_type[alias] = tuple(names)
    return names_by_type


def _compare_aliases(scope: Scope) -> Iterator[Change]:
    """Yield a change for each enum type whose name the generated package no longer has."""
    old, new = scope.pair.sides
    new_names_by_type = names_by_enum_type(new)
    for alias, names in names_by_enum_type(old).items():
        enum_names = [name for name in names if name in new.variables and new.variables[name].type.kind is Kind.ENUM]
        if alias not in new_names_by_type and enum_names:
            new_alias = next(
                other_alias for other_alias, other_names in new_names_by_type.items() if enum_names[0] in other_names
            )
            variable_scope = scope.element_scope(
                "context", enum_names[0], old.variables[names[0]], new.variables[enum_names[0]]
            )
            message = "the generated package has another name for its values"
            yield variable_scope.make_change(Category.API, "values", message, alias, new_alias)
