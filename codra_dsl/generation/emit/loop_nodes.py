"""The nodes of loops in the dependency graph, and the places of loops, for the files beside the code."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.generation.build_plan import BuildPlan, Node, NodeKind
from codra_dsl.generation.emit.graph_nodes import variable_entry
from codra_dsl.language.check.checked.loops import CheckedMape
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.model import Course


def loop_nodes(plan: BuildPlan, mape: CheckedMape) -> Iterator[tuple[Node, dict[str, object]]]:
    """Yield the nodes of loops in the dependency graph with their entries, kind by kind in file order.

    The first nodes are context-variables that loops read or write, and to which no other element has an edge.
    """
    yield from _variable_nodes(plan)
    spec = plan.checked.spec
    for kind, outputs in ((NodeKind.METRIC, spec.metrics), (NodeKind.ACTION, spec.actions)):
        for output in outputs:
            yield Node(kind, output.name), {"label": output.label or output.name}
    for adaptation in spec.adaptation:
        is_course = isinstance(adaptation.does, Course)
        entry = {"label": adaptation.label or adaptation.name, "does": "choose" if is_course else "set"}
        yield Node(NodeKind.ADAPTATION, adaptation.name), dict[str, object](entry)
    for tree in mape.trees:
        file = tree.forest.forest.files[0].file
        yield Node(NodeKind.TREE, tree.name), {"label": tree.element.label or tree.name, "tree_file": file}
    for loop in spec.loops:
        yield Node(NodeKind.LOOP, loop.name), {"label": loop.label or loop.name, "period_s": loop.period_s}


def _variable_nodes(plan: BuildPlan) -> Iterator[tuple[Node, dict[str, object]]]:
    loop_kinds = {NodeKind.METRIC, NodeKind.ACTION, NodeKind.ADAPTATION, NodeKind.LOOP}
    target_names = {edge.target.name for edge in plan.edges if edge.target.kind is NodeKind.CONTEXT}
    targets_outside_loops = {
        edge.target.name
        for edge in plan.edges
        if edge.target.kind is NodeKind.CONTEXT and edge.source.kind not in loop_kinds
    }
    for variable in plan.checked.variables.values():
        if variable.name in target_names - targets_outside_loops and variable.name not in plan.in_force:
            yield Node(NodeKind.CONTEXT, variable.name), variable_entry(variable)


def loop_places(plan: BuildPlan, mape: CheckedMape) -> Iterator[tuple[str, Place]]:
    """Yield, for each element of loops and each of its rules and conditions, its name in files and its place."""
    name, spec = plan.name, plan.checked.spec
    for kind, outputs in (("metric", spec.metrics), ("action", spec.actions)):
        for output in outputs:
            yield f"{name}/{kind}/{output.name}", output.place
            for number, rule in enumerate(output.rules):
                yield f"{name}/{kind}/{output.name}/rules/{number}", rule.place
    for checked in mape.adaptation:
        adaptation_path, does = f"{name}/adaptation/{checked.name}", checked.adaptation.does
        yield adaptation_path, checked.adaptation.place
        for number, hard_rule in enumerate(does.always if isinstance(does, Course) else ()):
            yield f"{adaptation_path}/always/{number}", hard_rule.condition.place
    yield from ((f"{name}/tree/{tree.name}", tree.element.place) for tree in mape.trees)
    yield from ((f"{name}/loop/{loop.name}", loop.place) for loop in spec.loops)
