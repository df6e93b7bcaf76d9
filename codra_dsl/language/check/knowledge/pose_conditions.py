"""Checks of poses in conditions over context (phase 3).

Operands fit, cameras have views, and edges can connect the nodes.
"""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.conditions.lowering import python_text, to_python
from codra_dsl.language.check.conditions.types import Problem, Typed, infer, infer_condition
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.index.mentions import user_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.construction import python_over_knowledge
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.expression import Count, Name, names_in, reads_of
from codra_dsl.language.model import PoseCondition
from codra_dsl.language.units import ONE


def wrong_pose_comparisons(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """A distance is compared with lengths, and `in_view` is true or false."""
    for pose_condition in spec_index.spec.pose_conditions:
        for problem in _infer_pose_condition(spec_index, pose_condition)[1]:
            place = pose_condition.condition.place_of(problem.node)
            message = f"{problem.message} ({_location_text(pose_condition)})"
            yield finding(problem.rule, message, place, path=".".join(pose_condition.owner), help=problem.help)


def wrong_pose_operands(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Cameras have views, and edges with poses can connect the two nodes; otherwise the result is never known.

    The nodes are declared, but the edges that lead to these nodes may change while a program runs.
    """
    if not is_knowledge_checkable(spec_index, faults):
        return
    for pose_condition in spec_index.spec.pose_conditions:
        if faults.is_sound(pose_condition.owner[0], pose_condition.owner[1]):
            for name in dict.fromkeys(names_in(pose_condition.tree)):
                yield from _operand_findings(spec_index.declared_graph, pose_condition, name)


POSE_CONDITION_CHECKS = (wrong_pose_comparisons, wrong_pose_operands)
"""The checks of this module."""


def pose_condition_texts(spec_index: SpecIndex) -> dict[str, str]:
    """Return a mapping from variables that the graph determines to their values as Python text.

    The spec must have no errors.
    """
    return {
        variable.name: _python(spec_index, variable.pose_condition)
        for variable in spec_index.spec.context
        if variable.pose_condition is not None
    }


def _python(spec_index: SpecIndex, pose_condition: PoseCondition) -> str:
    tree = pose_condition.tree
    if isinstance(tree, Count):
        count = f"value({python_text(f'count({tree.path})')})"
        return count if tree.function == "count" else f"{count} > 0"
    typed, _ = _infer_pose_condition(spec_index, pose_condition)
    unit = ONE if typed.type is None else typed.type.unit
    return python_over_knowledge(spec_index.declared_graph, to_python(typed, unit))


def _operand_findings(declared_graph: DeclaredGraph, pose_condition: PoseCondition, name: Name) -> Iterator[Diagnostic]:
    function, first, second = reads_of(name.name)
    place, path = pose_condition.condition.place_of(name), ".".join(pose_condition.owner)
    node_type = declared_graph.types.get(declared_graph.type_of(second))
    if function == "in_view" and (node_type is None or node_type.view is None):
        message = f"'{second}' has no view ({_location_text(pose_condition)})"
        yield finding(
            "wrong-ends", message, place, path=path, help=f"give type '{declared_graph.type_of(second)}' a 'view'"
        )
    elif not declared_graph.may_have_relative_pose(first, second):
        message = f"no edges with poses can connect '{first}' and '{second}', so {name.name} is never known"
        help = "declare edges with 'label: RT' that lead from one node to the other, or from a third node to both"
        yield finding("unconnected-nodes", f"{message} ({_location_text(pose_condition)})", place, path=path, help=help)


def _infer_pose_condition(spec_index: SpecIndex, pose_condition: PoseCondition) -> tuple[Typed, tuple[Problem, ...]]:
    if isinstance(pose_condition.tree, Count):  # checked like the paths of patterns
        return Typed(pose_condition.tree, None), ()
    types = {name.name: spec_index.declared_graph.name_type(name.name) for name in names_in(pose_condition.tree)}
    is_number = isinstance(pose_condition.tree, Name)
    return (infer if is_number else infer_condition)(pose_condition.tree, types, reads_context=True)


def _location_text(pose_condition: PoseCondition) -> str:
    section, name, key = pose_condition.owner
    return f"'{key}' of {user_of(section, name)}"
