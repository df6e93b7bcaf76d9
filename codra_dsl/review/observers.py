"""What became of observers and of what they share: names, periods, priorities, handles, slots, modules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from codra_dsl.build_plan import Tree
from codra_dsl.diagnostics import Place
from codra_dsl.model import Access
from codra_dsl.review.changes import Category, Change
from codra_dsl.review.version import Pair, Side, seconds

_KEPT_IN_MODULES = ("variables", "trees", "skills")


def observer_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of each observer that shares a variable with one in A."""
    for tree in pair.new.plan.forest:
        before = _predecessors(pair, tree)
        if before:
            yield from _renamed(pair, before, tree)
            yield from _period(pair, before, tree)
            yield from _priority(pair, before, tree)


def resource_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of handles and slots."""
    for name in dict.fromkeys((*pair.old.resources, *pair.new.resources)):
        yield from _handle(pair, name)
        yield from _slots(pair, name)


def layout_changes(pair: Pair) -> Iterator[Change]:
    """Yield which elements stand in another module of the generated package, once for each pair of modules."""
    moved: dict[tuple[str, str], list[str]] = {}
    old, new = _modules(pair.old), _modules(pair.new)
    for element, module in old.items():
        if element in new and new[element] != module:
            moved.setdefault((module, new[element]), []).append(element[1])
    for (before, after), names in sorted(moved.items()):
        message = f"{', '.join(names)} stand{'s' if len(names) == 1 else ''} in another module"
        spec = pair.new.plan.checked.spec
        yield Change(
            category=Category.LAYOUT, element=pair.new.name, message=message, was=before, now=after, after=spec.place
        )


def _predecessors(pair: Pair, tree: Tree) -> tuple[Tree, ...]:
    found = {each.name: each for name in tree.identifies if (each := pair.old.observer_of.get(name)) is not None}
    return tuple(found.values())


def _change(pair: Pair, trees: tuple[Tree, Tree], category: Category, key: str, message: str, *told: str) -> Change:
    (old, new), (was, now) = trees, told
    return Change(
        category=category,
        element=pair.new.id("observer", new.name),
        key=key,
        message=message,
        was=was,
        now=now,
        before=_at(pair.old, old, key),
        after=_at(pair.new, new, key),
    )


def _at(side: Side, tree: Tree, key: str) -> Place:
    places = side.settings.get(tree.name, {})
    return places.get(key) or places.get("name") or tree.branches[0].algorithm.algorithm.place


def _renamed(pair: Pair, before: tuple[Tree, ...], tree: Tree) -> Iterator[Change]:
    names = [each.name for each in before]
    first = before[0].branches[0].name
    by_algorithm = names == [first] and pair.algorithms.get(first) == tree.branches[0].name == tree.name
    if names != [tree.name] and not by_algorithm:
        message = "has another name" if len(names) == 1 else "observers are joined"
        yield _change(pair, (before[0], tree), Category.RENAMED, "name", message, ", ".join(names), tree.name)


def _period(pair: Pair, before: tuple[Tree, ...], tree: Tree) -> Iterator[Change]:
    for old in before:
        if old.period_s != tree.period_s:
            longer = tree.period_s > old.period_s
            category = Category.SLOWER if longer else Category.FASTER
            message = f"'period' is {'longer' if longer else 'shorter'}"
            yield _change(pair, (old, tree), category, "period", message, seconds(old.period_s), seconds(tree.period_s))


def _priority(pair: Pair, before: tuple[Tree, ...], tree: Tree) -> Iterator[Change]:
    """Yield whether an observer whose priority changed takes a slot in another order than another observer."""
    old = before[0]
    if old.priority == tree.priority:
        return
    slots = _slots_of(tree) & _slots_of(old)
    passed = []
    for other in pair.new.plan.forest:
        rivals = _predecessors(pair, other)
        if other is tree or not rivals or not slots & _slots_of(other) & _slots_of(rivals[0]):
            continue
        if _order(old, rivals[0]) != _order(tree, other):
            passed.append(other.name)
    if passed:
        message = f"takes a slot in another order than {', '.join(sorted(passed))}"
        yield _change(pair, (old, tree), Category.SLOWER, "priority", message, str(old.priority), str(tree.priority))


def _order(one: Tree, other: Tree) -> int:
    return (one.priority > other.priority) - (one.priority < other.priority)


def _slots_of(tree: Tree) -> frozenset[str]:
    uses = (use for branch in tree.branches for use in branch.algorithm.algorithm.uses)
    return frozenset(use.resource.name for use in uses if use.access is Access.SLOT)


def _handle(pair: Pair, name: str) -> Iterator[Change]:
    was, now = (bool(side.users(name, Access.READ)) for side in (pair.old, pair.new))
    if was is now:
        return
    category = Category.NEEDS_HANDLE if now else Category.EASED
    message = f"'start' needs its handle{'' if now else ' no longer'}"
    yield _about_resource(pair, name, category, message)


def _slots(pair: Pair, name: str) -> Iterator[Change]:
    old, new = pair.old.resources.get(name), pair.new.resources.get(name)
    had, has = (None if each is None else each.slots for each in (old, new))
    if old is not None and had is not None and new is None:
        yield _about_resource(pair, name, Category.REMOVED, "the resource is gone")
    elif new is not None and has is not None and old is None:
        yield _about_resource(pair, name, Category.ADDED, "new resource with slots")
    elif old is not None and new is not None:
        users = [side.users(name, Access.SLOT) for side in (pair.old, pair.new)]
        before, after = _crowding(len(users[0]), had), _crowding(len(users[1]), has)
        if before != after:
            category = Category.SLOWER if after > before else Category.FASTER
            was, now = (
                f"{len(names)} for {'any number' if slots is None else slots}"
                for names, slots in zip(users, (had, has), strict=True)
            )
            message = f"{'more' if after > before else 'fewer'} algorithms share its slots"
            yield _about_resource(pair, name, category, message, was, now)


def _crowding(users: int, slots: int | None) -> float:
    """Return how many algorithms there are for each slot, 1 where all of them can have one."""
    return 1.0 if slots is None or users <= slots else users / slots


def _about_resource(pair: Pair, name: str, category: Category, message: str, *told: str) -> Change:
    was, now = told or (None, None)
    old, new = pair.old.resources.get(name), pair.new.resources.get(name)
    return Change(
        category=category,
        element=pair.new.id("resource", name),
        message=message,
        was=was,
        now=now,
        before=None if old is None else old.place,
        after=None if new is None else new.place,
    )


def _modules(side: Side) -> Mapping[tuple[str, str], str]:
    """Return the module of each variable, observer and skill."""
    return {
        (section, name): module.name
        for module in side.plan.modules
        for section in _KEPT_IN_MODULES
        for name in getattr(module, section)
    }
