"""Changes that follow from the build plan: of observers, of handles and slots, and of modules of the package."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from codra_dsl.generation.build_plan import Tree
from codra_dsl.language.model import Access
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.comparers import growth_comparer, order_comparer, show_nothing
from codra_dsl.tooling.diff.version import Pair, Side
from codra_dsl.tooling.diff.walk import Scope, element_comparer, pair_by_name

_PERIOD_COMPARER = growth_comparer(Category.SLOWER, Category.FASTER)
_HANDLE_COMPARER = order_comparer(
    (Category.NEEDS_HANDLE, "'start' needs its handle"),
    (Category.EASED, "'start' no longer needs its handle"),
    show_nothing,
)
_SLOTS_COMPARER = order_comparer(
    (Category.SLOWER, "more algorithms share its slots"),
    (Category.FASTER, "fewer algorithms share its slots"),
    show=lambda share: f"{share[0]} for {share[1] or 'any number'}",
    rank=lambda share: 1.0 if share[1] is None else max(1.0, share[0] / share[1]),
)
"""Compares pairs of the number of algorithms and the number of slots by the algorithms for each slot, at least 1."""

_SECTIONS_OF_MODULES = ("variables", "trees", "skills")


def compare_observers(scope: Scope, key: str, *settings: Any) -> Iterator[Change]:
    """Yield the changes of each observer that shares a variable with an observer in A."""
    yield from element_comparer("observer", "")(scope, key, *settings)
    pair = scope.pair
    for tree in pair.new.plan.forest:
        before = _predecessors(pair, tree)
        for old in before:
            inner = scope.element_scope(
                "observer", tree.name, _element_with_places(pair.old, old), _element_with_places(pair.new, tree)
            )
            yield from _PERIOD_COMPARER(inner, "period", old.period_s, tree.period_s)
            if old is before[0]:
                yield from _compare_names(inner, before, tree)
                yield from _compare_priority(inner, old, tree)


def _predecessors(pair: Pair, tree: Tree) -> tuple[Tree, ...]:
    trees = (pair.old.observer_of[name] for name in tree.identifies if name in pair.old.observer_of)
    return tuple({tree.name: tree for tree in trees}.values())


def _element_with_places(side: Side, tree: Tree) -> Any:
    """Return the element that gives the places of an observer's changes.

    This is its entry in `observers`, or else its first algorithm.
    """
    settings = (setting for setting in side.spec.observers if setting.name == tree.name)
    return next(settings, tree.branches[0].algorithm.algorithm)


def _compare_names(scope: Scope, before: tuple[Tree, ...], tree: Tree) -> Iterator[Change]:
    names, first_algorithm = [old.name for old in before], before[0].branches[0].name
    is_named_after_algorithm = (
        names == [first_algorithm] and scope.pair.algorithms.get(first_algorithm) == tree.branches[0].name == tree.name
    )
    if names != [tree.name] and not is_named_after_algorithm:
        message = "has another name" if len(names) == 1 else "observers are joined"
        yield scope.make_change(Category.RENAMED, "name", message, ", ".join(names), tree.name)


def _compare_priority(scope: Scope, old: Tree, tree: Tree) -> Iterator[Change]:
    """Yield a change if a new priority of an observer changes the order in which it and others get a slot."""
    slots, reordered_names = _slots_of(tree) & _slots_of(old), []
    for other in scope.pair.new.plan.forest if old.priority != tree.priority else ():
        predecessors = () if other is tree else _predecessors(scope.pair, other)
        if predecessors and slots & _slots_of(other) & _slots_of(predecessors[0]):
            is_reordered = _priority_order(old, predecessors[0]) != _priority_order(tree, other)
            reordered_names += [other.name] if is_reordered else []
    if reordered_names:
        message = f"the order in which it and {', '.join(sorted(reordered_names))} take a slot has changed"
        yield scope.make_change(Category.SLOWER, "priority", message, str(old.priority), str(tree.priority))


def _priority_order(one: Tree, other: Tree) -> int:
    return (one.priority > other.priority) - (one.priority < other.priority)


def _slots_of(tree: Tree) -> frozenset[str]:
    uses = (use for branch in tree.branches for use in branch.algorithm.algorithm.uses)
    return frozenset(use.resource.name for use in uses if use.access is Access.SLOT)


def compare_resources(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
    """Yield the changes of handles and slots."""
    yield from element_comparer("resource", "")(scope, key, old, new)
    for name, before, after in pair_by_name(old, new):
        inner = scope.element_scope("resource", name, before, after)
        yield from _HANDLE_COMPARER(inner, "", *(bool(side.users(name, Access.READ)) for side in scope.pair.sides))
        if before and after:
            users = (len(side.users(name, Access.SLOT)) for side in scope.pair.sides)
            yield from _SLOTS_COMPARER(inner, "", *zip(users, (before.slots, after.slots), strict=True))
        elif before and before.slots:
            yield inner.make_change(Category.REMOVED, "", "the resource is gone")
        elif after and after.slots:
            yield inner.make_change(Category.ADDED, "", "new resource with slots")


def compare_layout(scope: Scope) -> Iterator[Change]:
    """Yield the moves of elements to other modules of the generated package: one change for each pair of modules."""
    moves: dict[tuple[str, str], list[str]] = {}
    old, new = map(_module_of_elements, scope.pair.sides)
    for element, module in old.items():
        if element in new and new[element] != module:
            moves.setdefault((module, new[element]), []).append(element[1])
    for modules, names in sorted(moves.items()):
        message = f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} in another module"
        yield scope.make_change(Category.LAYOUT, "", message, *modules)


def _module_of_elements(side: Side) -> Mapping[tuple[str, str], str]:
    """Return the module of each variable, observer and skill."""
    return {
        (section, name): module.name
        for module in side.plan.modules
        for section in _SECTIONS_OF_MODULES
        for name in getattr(module, section)
    }
