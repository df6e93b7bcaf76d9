"""Phase 3 for poses in conditions over context: what is compared fits, cameras have views, and nodes can be related."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.knowledge.lowered import over_knowledge
from codra_dsl.check.knowledge.owners import is_whole
from codra_dsl.check.knowledge.world import World
from codra_dsl.check.lowering import lower
from codra_dsl.check.mentions import user_of
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.check.types import Problem, Typed, infer_condition
from codra_dsl.diagnostics import Diagnostic
from codra_dsl.expression import Name, names_in, reads_of
from codra_dsl.model import Posed


def wrong_comparisons(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """A distance is compared with lengths, and what a camera sees is true or false."""
    for posed in _posed(scope):
        for problem in _typed(scope, posed)[1]:
            place = posed.said.place_of(problem.node)
            message = f"{problem.message} ({_where(posed)})"
            yield finding(problem.rule, message, place, path=".".join(posed.owner), way_out=problem.way_out)


def wrong_poses(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What is to see has a view, and edges with poses can lead from one node to the other: else nothing is ever known.

    The nodes are there from the start; which edges lead to them may change as a program runs.
    """
    if not is_whole(scope, faults):
        return
    for posed in _posed(scope):
        if faults.sound(posed.owner[0], posed.owner[1]):
            for name in dict.fromkeys(names_in(posed.tree)):
                yield from _of_name(scope.world, posed, name)


POSED = (wrong_comparisons, wrong_poses)
"""The rules of this subject."""


def python_of_poses(scope: Scope) -> dict[str, str]:
    """Return each comparison with poses of a sound spec in the words of the runtime, by the name of its variable."""
    named = ((each.name, each.posed) for each in scope.spec.context if each.posed is not None)
    return {name: over_knowledge(scope.world, lower(_typed(scope, posed)[0])) for name, posed in named}


def _of_name(world: World, posed: Posed, name: Name) -> Iterator[Diagnostic]:
    function, first, second = reads_of(name.name)
    place, path = posed.said.place_of(name), ".".join(posed.owner)
    kind = world.types.get(world.type_of(second))
    if function == "in_view" and (kind is None or kind.view is None):
        message = f"nothing says what '{second}' sees ({_where(posed)})"
        yield finding("wrong-ends", message, place, path=path, way_out=f"give type '{world.type_of(second)}' a 'view'")
    elif not world.may_meet(first, second):
        message = f"no edges with poses can join '{first}' and '{second}', so {name.name} is never known"
        way_out = "declare edges with 'label: RT' that lead from one to the other, or from something else to both"
        yield finding("unconnected-nodes", f"{message} ({_where(posed)})", place, path=path, way_out=way_out)


def _posed(scope: Scope) -> Iterator[Posed]:
    yield from (each.posed for each in scope.spec.context if each.posed is not None)


def _typed(scope: Scope, posed: Posed) -> tuple[Typed, tuple[Problem, ...]]:
    types = {name.name: scope.world.read_type(name.name) for name in names_in(posed.tree)}
    return infer_condition(posed.tree, types, known=True)


def _where(posed: Posed) -> str:
    section, name, key = posed.owner
    return f"'{key}' of {user_of(section, name)}"
