"""The verification that every plan passes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain

from codra_dsl.generation.build_plan.dependencies import dependencies
from codra_dsl.generation.build_plan.names import MODULE_NAMES, entry_names, python_name
from codra_dsl.generation.build_plan.values import Branch, BuildPlan
from codra_dsl.language import graph
from codra_dsl.language.check.checked.spec import CheckedSpec


class PlanError(Exception):
    """A plan that Algorithm 2 does not allow: a bug in the code that made it, never a user's mistake."""


def verify(plan: BuildPlan, checked: CheckedSpec) -> None:
    """Check that a plan is a correct plan for `checked`, independently of the code that made it.

    Raises:
        PlanError: with everything that is wrong.
    """
    complaints = [complaint for rule in _RULES for complaint in rule(plan, checked)]
    if complaints:
        raise PlanError("\n".join(complaints))


def _no_duplicates(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Each tree, algorithm and variable occurs once and is declared."""
    yield from _repeated("tree", (tree.name.casefold() for tree in plan.forest))
    yield from _repeated("algorithm", (branch.name for tree in plan.forest for branch in tree.branches))
    yield from _repeated("variable in trees", (name for tree in plan.forest for name in tree.identifies))
    yield from _repeated("variable in force", plan.in_force)
    yield from (f"{name} is not declared" for name in plan.in_force if name not in checked.variables)
    for tree in plan.forest:
        made_up = [
            branch.name for branch in tree.branches if branch.algorithm is not checked.algorithms.get(branch.name)
        ]
        yield from (f"{name} in tree {tree.name} is not an algorithm of the spec" for name in made_up)


def _every_variable_has_an_origin(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """One tree identifies a variable in force, with all its algorithms, or the variable has another source."""
    producers = {name: {branch.name for branch in tree.branches} for tree in plan.forest for name in tree.identifies}
    for name in plan.in_force:
        missing = set(checked.producers.get(name, ())) - producers.get(name, set())
        yield from (f"{name} is in force, but its trees lack {algorithm}" for algorithm in sorted(missing))
        outside = {source.name for source in checked.variables[name].sources} if name in checked.variables else set()
        if name not in producers and outside <= {"observer"}:
            yield f"{name} is in force, but no tree identifies it and it names no other source"


def _least_closed_set(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """The variables in force are exactly those that the decisions reach through the needs and results of algorithms."""
    beside = {name: tree for tree in plan.forest for name in tree.identifies}
    needs = {name: (*tree.identifies, *tree.needs) for name, tree in beside.items()}
    reached = set(graph.closure(needs, checked.decisions))
    yield from (f"{name} is needed but not in force" for name in sorted(reached - set(plan.in_force)))
    yield from (f"{name} is in force but not needed" for name in sorted(set(plan.in_force) - reached))
    yield from (f"tree {beside[name].name} is not needed" for name in sorted(set(beside) - reached))


def _trees_fit_their_algorithms(plan: BuildPlan, _: CheckedSpec) -> Iterator[str]:
    """A tree identifies and needs what its algorithms do; the first of a group identifies all; groups are ranked."""
    for tree in plan.forest:
        identified = {name for branch in tree.branches for name, _ in branch.algorithm.identifies}
        if identified != set(tree.identifies):
            yield f"tree {tree.name} identifies other variables than its algorithms"
        if set(tree.needs) != {name for branch in tree.branches for name in branch.algorithm.needs}:
            yield f"tree {tree.name} has other preconditions than its algorithms"
        for group in tree.groups:
            sets = [{name for name, _ in branch.algorithm.identifies} for branch in group]
            yield from (f"{tree.name}: an alternative identifies more than the first" for s in sets if not s <= sets[0])
            ranks = [(branch.algorithm.algorithm.rank, branch.name) for branch in group]
            yield from (f"tree {tree.name} is not in order of rank" for _ in [0] if ranks != sorted(ranks))


def _joined_only_where_asked(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Trees are joined only if `observers` asks for it and their conditions are equal; names follow `observers` too."""
    settings = {setting.name: setting for setting in checked.spec.observers}
    for tree in plan.forest:
        setting = settings.get(tree.name)
        asked = {reference.name for reference in setting.identifies} if setting is not None else set()
        if setting is not None and asked != set(tree.identifies):
            yield f"tree {tree.name} identifies other variables than its entry in `observers`"
        if setting is None and tree.name != tree.branches[0].name:
            yield f"tree {tree.name} has neither a name from `observers` nor that of its first algorithm"
        if len(tree.groups) > 1 and (setting is None or len(set(map(_guards, tree.branches))) > 1):
            yield f"tree {tree.name} joins algorithms that `observers` or their conditions keep apart"


def _guards(branch: Branch) -> frozenset[str]:
    """Return the conditions under which an algorithm runs, as a set."""
    given = (f"known({reference.name})" for reference in branch.algorithm.algorithm.given)
    return frozenset(chain((condition.python for condition in branch.algorithm.observable_when), given))


def _needed_trees_come_first(plan: BuildPlan, _: CheckedSpec) -> Iterator[str]:
    """A tree comes after the trees that it needs, unless they need each other (feedback)."""
    tree_of = {name: tree.name for tree in plan.forest for name in tree.identifies}
    needs = {tree.name: [tree_of[name] for name in tree.needs if name in tree_of] for tree in plan.forest}
    before: set[str] = set()
    early: list[tuple[str, str]] = []
    for tree in plan.forest:
        early += [(tree.name, need) for need in needs[tree.name] if need not in before]
        before.add(tree.name)
    circles = graph.strong_components(needs) if early else ()
    circle = {name: index for index, names in enumerate(circles) for name in names}
    for name, need in early:
        if need not in circle or circle[need] != circle.get(name):
            yield f"tree {name} comes before {need}, which it needs"


def _names_are_python(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Names are valid in Python, hide nothing in their scope, and are unique.

    Module names are unique even on disks that ignore case.
    """
    taken = entry_names(checked.spec)
    trees = {tree.name: tree for tree in plan.forest}
    yield from _python_names("the package", [plan.class_name, *(module.name for module in plan.modules)], taken)
    yield from _repeated("module", (module.name.casefold() for module in plan.modules))
    for module in plan.modules:
        made = [trees[name] for name in module.trees if name in trees]
        declared = [branch.constant for tree in made for branch in tree.branches]
        yield from _python_names(module.name, declared + [tree.function for tree in made], MODULE_NAMES)
    for tree in plan.forest:
        yield from _python_names(tree.name, [branch.local for branch in tree.branches], MODULE_NAMES)


def _python_names(where: str, names: list[str], taken: frozenset[str]) -> Iterator[str]:
    yield from _repeated(f"name in {where}", names)
    for name in names:
        if not (name.isidentifier() and name.isascii() and (name.endswith("_") or python_name(name, taken) == name)):
            yield f"{name!r} is not a valid name for {where}"


def _everything_has_a_module(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Every declared variable and skill, and every tree, is in exactly one module."""
    expected = {
        "variables": list(checked.variables),
        "trees": [tree.name for tree in plan.forest],
        "skills": [skill.name for skill in checked.spec.skills],
    }
    for section, names in expected.items():
        placed = sorted(chain.from_iterable(getattr(module, section) for module in plan.modules))
        if placed != sorted(names):
            yield f"modules hold the {section} {placed}, not {sorted(names)}"


def _edges_are_those_of_the_forest(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """The dependency graph matches the forest."""
    if plan.edges != dependencies(checked, plan.forest):
        yield "the dependency graph is not that of the forest"


def _repeated(what: str, names: Iterable[str]) -> Iterator[str]:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            yield f"{what} {name} occurs twice"
        seen.add(name)


_RULES: tuple[Callable[[BuildPlan, CheckedSpec], Iterator[str]], ...] = (
    _no_duplicates,
    _every_variable_has_an_origin,
    _least_closed_set,
    _trees_fit_their_algorithms,
    _joined_only_where_asked,
    _needed_trees_come_first,
    _names_are_python,
    _everything_has_a_module,
    _edges_are_those_of_the_forest,
)
