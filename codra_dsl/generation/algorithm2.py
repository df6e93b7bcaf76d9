"""Algorithm 2 of P1: "Building a system of context observers as behavior forest".

     1  procedure BUILD_OBSERVER_SYSTEM(E)
     2    F <- {}, M <- {}
     3    Pi <- IDENTIFY_PERCEPTION_ALGORITHMS(E)             where decisions are based on perception
     4    for all pi_i in Pi do
     5      c_i <- DEFINE_CONTEXT_VARIABLE(pi_i)
     6      PROCESS_CONTEXT_VARIABLE(c_i, F, M)
     8    return F, M
    10  procedure PROCESS_CONTEXT_VARIABLE(c_i, F, M)
    11    if c_i in C_M then
    12      return                                            already defined
    14    C_M <- C_M + {c_i}
    15    if HAS_PERCEPTION_ALGORITHM(c_i) then
    16      O_i <- CREATE_BEHAVIOR_TREE()
    17      ADD_PERCEPTION_BEHAVIOR(O_i, pi_i)
    18      V_j <- DEFINE_ADDITIONAL_CONTEXT_VARIABLES(pi_i)  based on observability conditions
    19      for all c'_i in V_j do
    20        ADD_PRECONDITION_NODE(O_i, c'_i)
    21        PROCESS_CONTEXT_VARIABLE(c'_i, F, M)
    23      F <- F + {O_i}

`plan` decides only which trees exist, the content of each tree, and what everything is called in Python. The paper
describes one variable and one algorithm per tree, but its text allows more (section 3.2, Figure 4C), and so does
`plan`. Variables of one algorithm share a tree. Algorithms that share a variable are alternatives in one tree, tried by
rank. Trees with the same conditions are joined if `observers` names their variables together.

A derived variable has no perception algorithm. Algorithm 2 goes on with its inputs, without a tree.

The generated model has every declared variable. C_M has the variables that decisions need, directly or indirectly, and
the variables that are identified together with these. Only variables in C_M have trees. The dependency graph has the
variables in C_M, and further variables that agents or loops read or write.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, pairwise

from codra_dsl.generation.build_plan.dependencies import dependencies
from codra_dsl.generation.build_plan.module_assignment import assign_modules
from codra_dsl.generation.build_plan.names import MODULE_NAMES, class_name, python_name
from codra_dsl.generation.build_plan.values import Branch, BuildPlan, Tree
from codra_dsl.language import graph
from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedSpec
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import ObserverSetting


def plan(checked: CheckedSpec) -> BuildPlan:
    """Return the build plan of a checked spec, made by Algorithm 2 (line 1)."""
    in_force, forest = _build_observer_system(checked)
    return BuildPlan(
        checked=checked,
        class_name=class_name(checked.spec.name),
        in_force=in_force,
        forest=forest,
        modules=assign_modules(checked, forest),
        edges=dependencies(checked, in_force, forest),
    )


def _build_observer_system(checked: CheckedSpec) -> tuple[tuple[str, ...], tuple[Tree, ...]]:
    """Return C_M and F. A stack replaces the recursion of line 21, so that no chain of variables is too long.

    Each frame of the stack is a tree, with its additional variables that are not processed yet. The first frame has no
    tree: its variables are the decisions of line 3.
    """
    outlines = _outlines(checked)
    in_force: dict[str, None] = {}  # line 2
    forest: list[Tree] = []  # line 2
    pending: list[tuple[Tree | None, Iterator[str]]] = [(None, iter(checked.decisions))]  # lines 3 to 6
    while pending:
        tree, variables = pending[-1]
        for variable in variables:  # lines 4 and 19
            if variable in in_force:  # line 11
                continue  # line 12
            in_force[variable] = None  # line 14
            if variable in checked.derived:  # its inputs take its place: line 21 without a tree
                pending.append((None, iter(checked.derived[variable].variables)))
                break
            if variable in outlines:  # line 15
                new_tree = _create_tree(checked, outlines[variable])  # lines 16 to 18, 20
                # line 14, for the variables that are identified together with this one
                in_force.update(dict.fromkeys(new_tree.identifies))
                pending.append((new_tree, iter(new_tree.needs)))  # line 21
                break
        else:
            pending.pop()
            forest += [tree] if tree is not None else []  # line 23
    return tuple(in_force), tuple(forest)  # line 8


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outline:
    """The algorithms of one tree, as groups of alternatives, and the tree's setting in `observers`."""

    groups: tuple[tuple[str, ...], ...]
    setting: ObserverSetting | None


def _outlines(checked: CheckedSpec) -> Mapping[str, _Outline]:
    """Return, for each variable that has a perception algorithm, the outline of its tree (line 15)."""
    group_by_variable = {
        variable: group for group in _alternatives(checked) for variable in _identified_variables(checked, group)
    }
    outlines: dict[str, _Outline] = {}
    for setting in checked.spec.observers:
        variables = [reference.name for reference in setting.identifies if reference.name in group_by_variable]
        groups = tuple(dict.fromkeys(group_by_variable[name] for name in variables))
        outline = _Outline(groups=groups, setting=setting)
        outlines |= {name: outline for group in groups for name in _identified_variables(checked, group)}
    single_group_outlines = {group: _Outline(groups=(group,), setting=None) for group in group_by_variable.values()}
    return {name: single_group_outlines[group] for name, group in group_by_variable.items()} | outlines


def _alternatives(checked: CheckedSpec) -> list[tuple[str, ...]]:
    """Return groups of algorithms that share variables. Each group is in order of rank, then of name."""
    algorithms_with_shared_variables: dict[str, list[str]] = {name: [] for name in checked.algorithms}
    for names in checked.producers.values():
        for one, other in pairwise(names):
            algorithms_with_shared_variables[one].append(other)
            algorithms_with_shared_variables[other].append(one)
    groups: dict[str, tuple[str, ...]] = {}
    for name in checked.algorithms:
        if name not in groups:
            group = sorted(
                graph.closure(algorithms_with_shared_variables, [name]),
                key=lambda algorithm: (checked.algorithms[algorithm].algorithm.rank, algorithm),
            )
            groups |= dict.fromkeys(group, tuple(group))
    return list(dict.fromkeys(groups.values()))


def _identified_variables(checked: CheckedSpec, names: Iterable[str]) -> tuple[str, ...]:
    """Return the variables that the given algorithms identify, in the order of the algorithms."""
    pairs = chain.from_iterable(checked.algorithms[name].identifies for name in names)
    return tuple(dict.fromkeys(variable for variable, _ in pairs))


def _create_tree(checked: CheckedSpec, outline: _Outline) -> Tree:
    """Return a tree with perception behaviours (lines 16, 17) and the variables of its preconditions (lines 18, 20)."""
    first, setting = outline.groups[0][0], outline.setting
    algorithms = [checked.algorithms[name] for group in outline.groups for name in group]
    name = setting.name if setting is not None else first
    return Tree(
        name=name,
        function=python_name(name.lower(), MODULE_NAMES),
        groups=tuple(tuple(_add_perception_behaviour(checked, name) for name in group) for group in outline.groups),
        identifies=_identified_variables(checked, chain.from_iterable(outline.groups)),
        needs=tuple(dict.fromkeys(chain.from_iterable(map(_additional_context_variables, algorithms)))),
        period_s=setting.period_s if setting is not None else 1.0,  # P1, section 3.3: "a tick-rate of 1 s"
        priority=setting.priority if setting is not None else 0,
    )


def _add_perception_behaviour(checked: CheckedSpec, name: str) -> Branch:
    """Return an algorithm's branch of a tree (line 17)."""
    return Branch(
        algorithm=checked.algorithms[name],
        constant=python_name(name.upper(), MODULE_NAMES),
        local_name=python_name(name.lower(), MODULE_NAMES),
    )


def _additional_context_variables(algorithm: CheckedAlgorithm) -> Iterator[str]:
    """Yield the variables V_j of an algorithm, in the order of its conditions (line 18)."""
    for condition in algorithm.observable_when:
        yield from condition.variables
    yield from (reference.name for reference in algorithm.algorithm.given)
