"""Write the function that builds an observer's tree, with the nodes in the order of P1's Figure 4.

This order is: control flag, preconditions, due or running, perception, refinements, identify. Alternatives are children
of a selector, each under its own preconditions. Joined algorithms are children of a parallel, under the preconditions
that they share; each child is wrapped in `FailureIsSuccess`, because py_trees' `Parallel` would cancel the other jobs
when one child fails.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from codra_dsl.generation.build_plan import Branch, Tree
from codra_dsl.generation.emit.conditions import condition_with_words
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import WIDTH, Expression, call, lay_out, spread_call, spread_list
from codra_dsl.generation.emit.literals import literal
from codra_dsl.language.frozen import dataclass

_SINGLE_BRANCH_NAME = "perception"
_BODY = "    return "


@dataclass(frozen=True, slots=True)
class TreeText:
    """A tree in the form that its template needs: only names and texts.

    Attributes:
        branches: the local name and the constant of each algorithm.
    """

    function: str
    docstring: str
    branches: tuple[tuple[str, str], ...]
    body: str


def tree_text(tree: Tree, imports: Imports) -> TreeText:
    """Return the texts of the function that builds a tree."""
    imports.use("Behaviour", "Observer")
    writer = _TreeWriter(tree, imports)
    return TreeText(
        function=tree.function,
        docstring=_docstring(tree),
        branches=tuple((writer.local_name(branch), branch.constant) for branch in tree.branches),
        body=lay_out(writer.body(), indent=4, before=len(_BODY)),
    )


def _docstring(tree: Tree) -> str:
    """Return the docstring of the function, wrapped if it names many variables."""
    *most, last = tree.identifies
    names = f"{', '.join(most)} and {last}" if most else last
    line = f"Identify {names} (P1, Figure 4)."
    if len(line) + 10 <= WIDTH:
        return line
    wrapped_names = textwrap.fill(f"They are {names}.", WIDTH - 4, break_long_words=False)
    indented_names = textwrap.indent(wrapped_names, "    ")
    return f"Identify {len(tree.identifies)} context-variables (P1, Figure 4).\n\n{indented_names}\n    "


class _TreeWriter:
    """Writes one tree; each method returns a part of the tree."""

    def __init__(self, tree: Tree, imports: Imports) -> None:
        self._tree = tree
        self._imports = imports

    def local_name(self, branch: Branch) -> str:
        """Return the name of a branch within the function."""
        return branch.local_name if len(self._tree.branches) > 1 else _SINGLE_BRANCH_NAME

    def body(self) -> Expression:
        """Return the whole tree."""
        flag = self._behaviour("ControlFlag", "observer")
        return self._sequence(self._tree.name, [flag, *self._nodes_below_flag()])

    def _nodes_below_flag(self) -> list[Expression]:
        groups = self._tree.groups
        if len(groups) > 1:
            branches = self._tree.branches
            return [*self._preconditions(branches), self._parallel(groups)]
        (group,) = groups
        if len(group) > 1:
            return [self._selector((branch.name, self._guarded_branch_nodes(branch)) for branch in group)]
        return self._guarded_branch_nodes(group[0])

    def _guarded_branch_nodes(self, branch: Branch) -> list[Expression]:
        return [*self._preconditions((branch,)), *self._perception_nodes(branch)]

    def _parallel(self, groups: Iterable[tuple[Branch, ...]]) -> Expression:
        """Return joined groups as a parallel.

        A group that fails must not make the parallel fail, because this would cancel the other groups.
        """
        self._imports.use("Parallel", "ParallelPolicy", "FailureIsSuccess")
        wrapped_groups = (
            spread_call("FailureIsSuccess", name=literal(group[0].name), child=self._group(group)) for group in groups
        )
        policy = call("ParallelPolicy.SuccessOnAll", synchronise="False")
        return spread_call("Parallel", name=literal("joined"), policy=policy, children=spread_list(wrapped_groups))

    def _group(self, group: tuple[Branch, ...]) -> Expression:
        if len(group) > 1:
            return self._selector((branch.name, self._perception_nodes(branch)) for branch in group)
        return self._sequence(group[0].name, self._perception_nodes(group[0]))

    def _selector(self, alternatives: Iterable[tuple[str, list[Expression]]]) -> Expression:
        self._imports.use("Selector")
        children = spread_list(self._sequence(name, nodes) for name, nodes in alternatives)
        return spread_call("Selector", name=literal("alternatives"), memory="False", children=children)

    def _sequence(self, name: str, children: list[Expression]) -> Expression:
        self._imports.use("Sequence")
        return spread_call("Sequence", name=literal(name), memory="False", children=spread_list(children))

    def _preconditions(self, branches: tuple[Branch, ...]) -> Iterator[Expression]:
        """Yield the precondition nodes of Algorithm 2. Joined branches have the same preconditions."""
        local_names = [self.local_name(branch) for branch in branches]
        algorithm = branches[0].algorithm
        for checked in algorithm.observable_when:
            yield self._behaviour("Precondition", literal(checked.text), self._condition(checked.python), *local_names)
        for reference in algorithm.algorithm.given:
            known_condition = self._condition(f"known({literal(reference.name)})")
            yield self._behaviour("Precondition", literal(f"known({reference.name})"), known_condition, *local_names)

    def _perception_nodes(self, branch: Branch) -> list[Expression]:
        """Return perception and the nodes that process its result."""
        local_name, algorithm = self.local_name(branch), branch.algorithm
        return [
            self._behaviour("DueOrRunning", local_name),
            self._behaviour("Perceive", local_name),
            *(
                self._behaviour("Accept", literal(checked.text), self._condition(checked.python), local_name)
                for checked in algorithm.accept_when
            ),
            *(
                self._behaviour("Identify", literal(variable), self._condition(checked.python), local_name)
                for variable, checked in algorithm.identifies
            ),
        ]

    def _behaviour(self, name: str, *arguments: Expression) -> Expression:
        self._imports.use(name)
        return call(name, *arguments)

    def _condition(self, python: str) -> Expression:
        expression, words = condition_with_words(python)
        self._imports.use(*words)
        return expression
