"""The function that builds an observer's tree, in the order of P1's Figure 4.

Control flag, preconditions, due or running, perception, refinements, identify. Alternatives are children of a selector,
each under its own preconditions; joined algorithms are children of a parallel under the preconditions that they share.
Each is wrapped in `FailureIsSuccess`, because py_trees' `Parallel` would cancel the other job when one fails.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from codra_dsl.generation.build_plan import Branch, Tree
from codra_dsl.generation.emit.conditions import condition
from codra_dsl.generation.emit.imports import Imports
from codra_dsl.generation.emit.layout import WIDTH, Expression, call, laid_out, spread_call, spread_list
from codra_dsl.generation.emit.literals import literal

_ONLY = "perception"
_BODY = "    return "


@dataclass(frozen=True, slots=True)
class TreeText:
    """A tree in the form that its template takes: only names and texts.

    Attributes:
        branches: (local name, constant) of each algorithm.
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
        branches=tuple((writer.local(branch), branch.constant) for branch in tree.branches),
        body=laid_out(writer.body(), indent=4, before=len(_BODY)),
    )


def _docstring(tree: Tree) -> str:
    """Return the docstring of the function, wrapped if it names many variables."""
    *most, last = tree.identifies
    names = f"{', '.join(most)} and {last}" if most else last
    line = f"Identify {names} (P1, Figure 4)."
    if len(line) + 10 <= WIDTH:
        return line
    wrapped = textwrap.fill(f"They are {names}.", WIDTH - 4, break_long_words=False)
    listed = textwrap.indent(wrapped, "    ")
    return f"Identify {len(tree.identifies)} context-variables (P1, Figure 4).\n\n{listed}\n    "


class _TreeWriter:
    """Writes one tree; every method returns a part of it."""

    def __init__(self, tree: Tree, imports: Imports) -> None:
        self._tree = tree
        self._imports = imports

    def local(self, branch: Branch) -> str:
        """Return the name of a branch within the function."""
        return branch.local if len(self._tree.branches) > 1 else _ONLY

    def body(self) -> Expression:
        """Return the whole tree."""
        flag = self._behaviour("ControlFlag", "observer")
        return self._sequence(self._tree.name, [flag, *self._below_the_flag()])

    def _below_the_flag(self) -> list[Expression]:
        groups = self._tree.groups
        if len(groups) > 1:
            branches = self._tree.branches
            return [*self._preconditions(branches), self._parallel(groups)]
        (group,) = groups
        if len(group) > 1:
            return [self._selector((branch.name, self._guarded(branch)) for branch in group)]
        return self._guarded(group[0])

    def _guarded(self, branch: Branch) -> list[Expression]:
        return [*self._preconditions((branch,)), *self._looking(branch)]

    def _parallel(self, groups: Iterable[tuple[Branch, ...]]) -> Expression:
        """Return joined groups side by side; a failing group must not fail the parallel and so cancel the others."""
        self._imports.use("Parallel", "ParallelPolicy", "FailureIsSuccess")
        together = (
            spread_call("FailureIsSuccess", name=literal(group[0].name), child=self._group(group)) for group in groups
        )
        policy = call("ParallelPolicy.SuccessOnAll", synchronise="False")
        return spread_call("Parallel", name=literal("joined"), policy=policy, children=spread_list(together))

    def _group(self, group: tuple[Branch, ...]) -> Expression:
        if len(group) > 1:
            return self._selector((branch.name, self._looking(branch)) for branch in group)
        return self._sequence(group[0].name, self._looking(group[0]))

    def _selector(self, alternatives: Iterable[tuple[str, list[Expression]]]) -> Expression:
        self._imports.use("Selector")
        children = spread_list(self._sequence(name, nodes) for name, nodes in alternatives)
        return spread_call("Selector", name=literal("alternatives"), memory="False", children=children)

    def _sequence(self, name: str, children: list[Expression]) -> Expression:
        self._imports.use("Sequence")
        return spread_call("Sequence", name=literal(name), memory="False", children=spread_list(children))

    def _preconditions(self, branches: tuple[Branch, ...]) -> Iterator[Expression]:
        """Yield Algorithm 2's precondition nodes; joined branches have the same ones."""
        locals_ = [self.local(branch) for branch in branches]
        algorithm = branches[0].algorithm
        for checked in algorithm.observable_when:
            yield self._behaviour("Precondition", literal(checked.text), self._condition(checked.python), *locals_)
        for reference in algorithm.algorithm.given:
            known = self._condition(f"known({literal(reference.name)})")
            yield self._behaviour("Precondition", literal(f"known({reference.name})"), known, *locals_)

    def _looking(self, branch: Branch) -> list[Expression]:
        """Return perception and the nodes that process its result."""
        local, algorithm = self.local(branch), branch.algorithm
        return [
            self._behaviour("DueOrRunning", local),
            self._behaviour("Perceive", local),
            *(
                self._behaviour("Accept", literal(checked.text), self._condition(checked.python), local)
                for checked in algorithm.accept_when
            ),
            *(
                self._behaviour("Identify", literal(variable), self._condition(checked.python), local)
                for variable, checked in algorithm.identifies
            ),
        ]

    def _behaviour(self, name: str, *arguments: Expression) -> Expression:
        self._imports.use(name)
        return call(name, *arguments)

    def _condition(self, python: str) -> Expression:
        expression, words = condition(python)
        self._imports.use(*words)
        return expression
