"""Changes that follow from the build plan: of observers, of handles and slots, and of modules of the package."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from codra_dsl.generation.build_plan import Tree
from codra_dsl.language.model import Access, Handle
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
    show=lambda counts: f"{counts[0]} for {counts[1] or 'any number'}",
    rank_of=lambda counts: 1.0 if counts[1] is None else max(1.0, counts[0] / counts[1]),
)
"""Compares pairs of the number of algorithms and the number of slots by their ratio; a ratio below 1 is taken as 1."""

_SECTIONS_OF_MODULES = ("variables", "trees", "skills")


def compare_observers(scope: Scope, key: str, *settings: Any) -> Iterator[Change]:
    """Yield the changes of each observer that shares a variable with an observer in A."""
    yield from element_comparer("observer", "")(scope, key, *settings)
    pair = scope.pair
    for tree in pair.new.plan.forest:
        predecessors = _predecessors(pair, tree)
        for old in predecessors:
            observer_scope = scope.element_scope(
                "observer", tree.name, _element_with_places(pair.old, old), _element_with_places(pair.new, tree)
            )
            yield from _PERIOD_COMPARER(observer_scope, "period", old.period_s, tree.period_s)
            if old is predecessors[0]:
                yield from _compare_names(observer_scope, predecessors, tree)
                yield from _compare_priority(observer_scope, old, tree)


def _predecessors(pair: Pair, tree: Tree) -> tuple[Tree, ...]:
    trees = (pair.old.observer_by_variable[name] for name in tree.identifies if name in pair.old.observer_by_variable)
    return tuple({tree.name: tree for tree in trees}.values())


def _element_with_places(side: Side, tree: Tree) -> Any:
    """Return the element that gives the places of an observer's changes.

    This is the observer's entry in `observers`, or else the observer's first algorithm.
    """
    settings = (setting for setting in side.spec.observers if setting.name == tree.name)
    return next(settings, tree.branches[0].algorithm.algorithm)


def _compare_names(scope: Scope, predecessors: tuple[Tree, ...], tree: Tree) -> Iterator[Change]:
    names, first_algorithm = [old.name for old in predecessors], predecessors[0].branches[0].name
    is_named_after_algorithm = (
        names == [first_algorithm] and scope.pair.algorithms.get(first_algorithm) == tree.branches[0].name == tree.name
    )
    if names != [tree.name] and not is_named_after_algorithm:
        message = "has another name" if len(names) == 1 else "observers are joined"
        yield scope.make_change(Category.RENAMED, "name", message, ", ".join(names), tree.name)


def _compare_priority(scope: Scope, old: Tree, tree: Tree) -> Iterator[Change]:
    """Yield a change if a new priority of an observer changes the order in which it and other observers get a slot."""
    slot_names, reordered_names = _slot_names(tree) & _slot_names(old), []
    for other_tree in scope.pair.new.plan.forest if old.priority != tree.priority else ():
        predecessors = () if other_tree is tree else _predecessors(scope.pair, other_tree)
        if predecessors and slot_names & _slot_names(other_tree) & _slot_names(predecessors[0]):
            is_reordered = _priority_order(old, predecessors[0]) != _priority_order(tree, other_tree)
            reordered_names += [other_tree.name] if is_reordered else []
    if reordered_names:
        message = f"the order in which it and {', '.join(sorted(reordered_names))} get a slot has changed"
        yield scope.make_change(Category.SLOWER, "priority", message, str(old.priority), str(tree.priority))


def _priority_order(first: Tree, second: Tree) -> int:
    return (first.priority > second.priority) - (first.priority < second.priority)


def _slot_names(tree: Tree) -> frozenset[str]:
    usages = (usage for branch in tree.branches for usage in branch.algorithm.algorithm.uses)
    return frozenset(usage.resource.name for usage in usages if usage.access is Access.SLOT)


def compare_resources(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
    """Yield the changes of handles and slots."""
    yield from element_comparer("resource", "")(scope, key, old, new)
    for name, before, after in pair_by_name(old, new):
        resource_scope = scope.element_scope("resource", name, before, after)
        yield from _HANDLE_COMPARER(
            resource_scope, "", *(bool(side.users(name, Access.READ)) for side in scope.pair.sides)
        )
        handles = _handle(scope.pair.old, name), _handle(scope.pair.new, name)
        texts = [None if handle is None else str(handle) for handle in handles]
        if texts[0] != texts[1]:
            message = "the site makes the handle in another way"
            yield resource_scope.make_change(Category.PERCEIVED_OTHERWISE, "", message, *texts, changed_parts=handles)
        if before and after:
            user_counts = (len(side.users(name, Access.SLOT)) for side in scope.pair.sides)
            yield from _SLOTS_COMPARER(resource_scope, "", *zip(user_counts, (before.slots, after.slots), strict=True))
        elif before and before.slots:
            yield resource_scope.make_change(Category.REMOVED, "", "the resource is gone")
        elif after and after.slots:
            yield resource_scope.make_change(Category.ADDED, "", "new resource with slots")


def _handle(side: Side, resource: str) -> Handle | None:
    """Return how the site makes the handle of a resource; None if no site does."""
    site = side.spec.site
    return next((handle for handle in (() if site is None else site.handles) if handle.resource == resource), None)


def compare_layout(scope: Scope) -> Iterator[Change]:
    """Yield one change for each pair of modules of the generated package between which elements have moved."""
    names_by_move: dict[tuple[str, str], list[str]] = {}
    old, new = map(_module_by_element, scope.pair.sides)
    for element, module in old.items():
        if element in new and new[element] != module:
            names_by_move.setdefault((module, new[element]), []).append(element[1])
    for modules, names in sorted(names_by_move.items()):
        message = f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} in another module"
        yield scope.make_change(Category.LAYOUT, "", message, *modules)


def _module_by_element(side: Side) -> Mapping[tuple[str, str], str]:
    """Return a mapping from the section and name of each variable, observer and skill to its module."""
    return {
        (section, name): module.name
        for module in side.plan.modules
        for section in _SECTIONS_OF_MODULES
        for name in getattr(module, section)
    }
