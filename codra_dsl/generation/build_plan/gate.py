"""The verification that every plan must pass.

It takes as long as planning itself, and only a bug of codra can make it fail. So the tests verify every plan that they
make, `codra compile --check` verifies the plans of a project, and other runs do not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain

from codra_dsl.generation.build_plan.dependencies import dependencies
from codra_dsl.generation.build_plan.names import MODULE_NAMES, entry_names, python_name
from codra_dsl.generation.build_plan.values import Branch, BuildPlan
from codra_dsl.language import graph
from codra_dsl.language.check.checked.spec import CheckedSpec


class PlanError(Exception):
    """A plan that Algorithm 2 does not allow. This is a bug in the code that made the plan, never a user's mistake."""


def verify(plan: BuildPlan, checked: CheckedSpec) -> None:
    """Check that a plan is a correct plan for `checked`, independently of the code that made the plan.

    Raises:
        PlanError: if anything is wrong, with a list of all problems.
    """
    problems = [problem for rule in _RULES for problem in rule(plan, checked)]
    if problems:
        raise PlanError("\n".join(problems))


def _no_duplicates(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Each tree, algorithm and variable occurs only once and is declared."""
    yield from _duplicate_problems("tree", (tree.name.casefold() for tree in plan.forest))
    yield from _duplicate_problems("algorithm", (branch.name for tree in plan.forest for branch in tree.branches))
    yield from _duplicate_problems("variable in trees", (name for tree in plan.forest for name in tree.identifies))
    yield from _duplicate_problems("variable in force", plan.in_force)
    yield from (f"{name} is not declared" for name in plan.in_force if name not in checked.variables)
    for tree in plan.forest:
        undeclared_algorithms = [
            branch.name for branch in tree.branches if branch.algorithm is not checked.algorithms.get(branch.name)
        ]
        yield from (f"{name} in tree {tree.name} is not an algorithm of the spec" for name in undeclared_algorithms)


def _every_variable_has_an_origin(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Each variable in force has a tree that identifies the variable, or another source.

    If the spec has algorithms for the variable, the tree contains all of them.
    """
    producers = {name: {branch.name for branch in tree.branches} for tree in plan.forest for name in tree.identifies}
    for name in plan.in_force:
        missing_algorithms = set(checked.producers.get(name, ())) - producers.get(name, set())
        yield from (f"{name} is in force, but its trees lack {algorithm}" for algorithm in sorted(missing_algorithms))
        source_names = (
            {source.name for source in checked.variables[name].sources} if name in checked.variables else set()
        )
        if name not in producers and source_names <= {"observer"}:
            yield f"{name} is in force, but no tree identifies it and it names no other source"


def _least_closed_set(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """The variables in force are exactly those that can be reached from the decisions.

    Each variable leads to all variables that its tree identifies, and to all variables that its tree needs. A derived
    variable leads to its inputs.
    """
    tree_by_variable = {name: tree for tree in plan.forest for name in tree.identifies}
    needs = _inputs(checked) | {name: (*tree.identifies, *tree.needs) for name, tree in tree_by_variable.items()}
    reached_variables = set(graph.closure(needs, checked.decisions))
    yield from (f"{name} is needed but not in force" for name in sorted(reached_variables - set(plan.in_force)))
    yield from (f"{name} is in force but not needed" for name in sorted(set(plan.in_force) - reached_variables))
    yield from (
        f"tree {tree_by_variable[name].name} is not needed"
        for name in sorted(set(tree_by_variable) - reached_variables)
    )


def _inputs(checked: CheckedSpec) -> dict[str, tuple[str, ...]]:
    """Return a mapping from each derived variable to the variables that its expression reads."""
    return {name: condition.variables for name, condition in checked.derived.items()}


def _trees_fit_their_algorithms(plan: BuildPlan, _: CheckedSpec) -> Iterator[str]:
    """A tree identifies and needs the same variables as its algorithms.

    The first algorithm of each group identifies all variables of the group, and each group is in order of rank.
    """
    for tree in plan.forest:
        identified_names = {name for branch in tree.branches for name, _ in branch.algorithm.identifies}
        if identified_names != set(tree.identifies):
            yield f"tree {tree.name} identifies other variables than its algorithms"
        if set(tree.needs) != {name for branch in tree.branches for name in branch.algorithm.needs}:
            yield f"tree {tree.name} has other preconditions than its algorithms"
        for group in tree.groups:
            variable_sets = [{name for name, _ in branch.algorithm.identifies} for branch in group]
            yield from (
                f"{tree.name}: an alternative identifies more than the first"
                for names in variable_sets
                if not names <= variable_sets[0]
            )
            ranks = [(branch.algorithm.algorithm.rank, branch.name) for branch in group]
            yield from (f"tree {tree.name} is not in order of rank" for _ in [0] if ranks != sorted(ranks))


def _trees_joined_only_on_request(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Trees are joined only if `observers` names their variables together and their conditions are equal.

    A tree has the name of its setting in `observers`; a tree without a setting has the name of its first algorithm.
    """
    settings = {setting.name: setting for setting in checked.spec.observers}
    for tree in plan.forest:
        setting = settings.get(tree.name)
        requested_variables = {reference.name for reference in setting.identifies} if setting is not None else set()
        if setting is not None and requested_variables != set(tree.identifies):
            yield f"tree {tree.name} identifies other variables than its entry in `observers`"
        if setting is None and tree.name != tree.branches[0].name:
            yield f"tree {tree.name} has neither a name from `observers` nor that of its first algorithm"
        if len(tree.groups) > 1 and (setting is None or len(set(map(_guard_conditions, tree.branches))) > 1):
            yield f"tree {tree.name} joins algorithms that `observers` or their conditions keep apart"


def _guard_conditions(branch: Branch) -> frozenset[str]:
    """Return the conditions under which an algorithm runs, as a set."""
    known_conditions = (f"known({reference.name})" for reference in branch.algorithm.algorithm.given)
    return frozenset(chain((condition.python for condition in branch.algorithm.observable_when), known_conditions))


def _needed_trees_come_first(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """A tree comes after each tree that it needs, unless the two need each other (feedback)."""
    tree_name_by_variable = {name: tree.name for tree in plan.forest for name in tree.identifies}
    needs = {
        tree.name: [
            tree_name_by_variable[name]
            for name in graph.closure(_inputs(checked), tree.needs)
            if name in tree_name_by_variable
        ]
        for tree in plan.forest
    }
    earlier_trees: set[str] = set()
    unmet_needs: list[tuple[str, str]] = []
    for tree in plan.forest:
        unmet_needs += [(tree.name, need) for need in needs[tree.name] if need not in earlier_trees]
        earlier_trees.add(tree.name)
    cycles = graph.strong_components(needs) if unmet_needs else ()
    cycle_indices = {name: index for index, names in enumerate(cycles) for name in names}
    for name, need in unmet_needs:
        if need not in cycle_indices or cycle_indices[need] != cycle_indices.get(name):
            yield f"tree {name} comes before {need}, which it needs"


def _names_are_python(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Names are valid in Python, hide nothing in their scope, and are unique.

    Module names are unique even on disks that ignore case.
    """
    taken_names = entry_names(checked.spec)
    trees = {tree.name: tree for tree in plan.forest}
    yield from _python_names("the package", [plan.class_name, *(module.name for module in plan.modules)], taken_names)
    yield from _duplicate_problems("module", (module.name.casefold() for module in plan.modules))
    for module in plan.modules:
        module_trees = [trees[name] for name in module.trees if name in trees]
        algorithm_constants = [branch.constant for tree in module_trees for branch in tree.branches]
        yield from _python_names(
            module.name, algorithm_constants + [tree.function for tree in module_trees], MODULE_NAMES
        )
    for tree in plan.forest:
        yield from _python_names(tree.name, [branch.local_name for branch in tree.branches], MODULE_NAMES)


def _python_names(where: str, names: list[str], taken_names: frozenset[str]) -> Iterator[str]:
    yield from _duplicate_problems(f"name in {where}", names)
    for name in names:
        if not (
            name.isidentifier() and name.isascii() and (name.endswith("_") or python_name(name, taken_names) == name)
        ):
            yield f"{name!r} is not a valid name for {where}"


def _everything_has_a_module(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """Every declared variable and skill, and every tree, is in exactly one module."""
    expected_names = {
        "variables": list(checked.variables),
        "trees": [tree.name for tree in plan.forest],
        "skills": [skill.name for skill in checked.spec.skills],
    }
    for section, names in expected_names.items():
        placed_names = sorted(chain.from_iterable(getattr(module, section) for module in plan.modules))
        if placed_names != sorted(names):
            yield f"modules hold the {section} {placed_names}, not {sorted(names)}"


def _edges_are_those_of_the_forest(plan: BuildPlan, checked: CheckedSpec) -> Iterator[str]:
    """The dependency graph matches the forest."""
    if plan.edges != dependencies(checked, plan.in_force, plan.forest):
        yield "the dependency graph is not that of the forest"


def _duplicate_problems(noun: str, names: Iterable[str]) -> Iterator[str]:
    seen_names: set[str] = set()
    for name in names:
        if name in seen_names:
            yield f"{noun} {name} occurs twice"
        seen_names.add(name)


_RULES: tuple[Callable[[BuildPlan, CheckedSpec], Iterator[str]], ...] = (
    _no_duplicates,
    _every_variable_has_an_origin,
    _least_closed_set,
    _trees_fit_their_algorithms,
    _trees_joined_only_on_request,
    _needed_trees_come_first,
    _names_are_python,
    _everything_has_a_module,
    _edges_are_those_of_the_forest,
)
