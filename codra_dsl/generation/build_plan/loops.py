"""The edges that loops add to the dependency graph, such as the edge from an adaptation to the variable that is set."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.generation.build_plan.values import Edge, EdgeKind, Node, NodeKind
from codra_dsl.language.check.checked.loops import CheckedAdaptation, CheckedMape, CheckedRate, CheckedStage
from codra_dsl.language.fuzzy.model import propositions
from codra_dsl.language.model import Course, Parameter, RateKind, filtered_weight_name


def loop_edges(mape: CheckedMape) -> Iterator[Edge]:
    """Yield the edges of metrics, actions, rates, adaptations, trees and loops."""
    metric_names = (
        frozenset(output.output.name for output in mape.metrics.outputs) if mape.metrics is not None else frozenset()
    )
    for kind, stage in ((NodeKind.METRIC, mape.metrics), (NodeKind.ACTION, mape.actions)):
        if stage is not None:
            yield from _stage_edges(kind, stage, metric_names)
    for rate in mape.rates:
        yield from _rate_edges(rate)
    for adaptation in mape.adaptation:
        yield from _adaptation_edges(adaptation, metric_names)
    for tree in mape.trees:
        yield from _edges(Node(NodeKind.TREE, tree.name), EdgeKind.REQUESTS, NodeKind.TASK, tree.tasks)
    for checked in mape.loops:
        source, loop = Node(NodeKind.LOOP, checked.loop.name), checked.loop
        yield from _edges(source, EdgeKind.ANALYSES, NodeKind.CONTEXT, checked.rates)
        yield from _edges(source, EdgeKind.ANALYSES, NodeKind.METRIC, (reference.name for reference in loop.analyse))
        yield from _edges(source, EdgeKind.ADAPTS, NodeKind.ADAPTATION, (reference.name for reference in loop.adapt))
        yield from _edges(source, EdgeKind.EXECUTES, NodeKind.TREE, (reference.name for reference in loop.execute))


def _edges(source: Node, kind: EdgeKind, target: NodeKind, names: Iterable[str]) -> Iterator[Edge]:
    return (Edge(source, Node(target, name), kind) for name in names)


def _stage_edges(kind: NodeKind, stage: CheckedStage, metric_names: frozenset[str]) -> Iterator[Edge]:
    for output, block in zip(stage.outputs, stage.engine.blocks, strict=True):
        input_names = {proposition.variable for rule in block.rules for proposition in propositions(rule.antecedent)}
        yield from _input_edges(Node(kind, output.output.name), input_names, metric_names)


def _rate_edges(rate: CheckedRate) -> Iterator[Edge]:
    """Yield the edge to the variable from which a share or a held bool is computed.

    A rate has no such edge, so that the packages of specs with rates stay the same.
    """
    if rate.kind is not RateKind.RATE:
        yield from _edges(Node(NodeKind.CONTEXT, rate.variable.name), EdgeKind.READS, NodeKind.CONTEXT, (rate.of,))


def _adaptation_edges(checked: CheckedAdaptation, metric_names: frozenset[str]) -> Iterator[Edge]:
    source, does = Node(NodeKind.ADAPTATION, checked.name), checked.adaptation.does
    yield from _input_edges(source, checked.reads, metric_names)
    if isinstance(does, Parameter):
        yield from _edges(source, EdgeKind.SETS, NodeKind.CONTEXT, (does.variable.name,))
    elif isinstance(does, Course):
        yield from _edges(source, EdgeKind.WEIGHS, NodeKind.ACTION, (action.name for action in does.choose))
        yield from _edges(source, EdgeKind.SWITCHES, NodeKind.TREE, (does.within.name,))
        for action in () if does.node is None else does.choose:
            filtered_weight = Node(NodeKind.CONTEXT, filtered_weight_name(action.name))
            yield from _edges(filtered_weight, EdgeKind.READS, NodeKind.ACTION, (action.name,))


def _input_edges(source: Node, names: Iterable[str], metric_names: frozenset[str]) -> Iterator[Edge]:
    for name in names:
        target = Node(NodeKind.METRIC if name in metric_names else NodeKind.CONTEXT, name)
        yield Edge(source, target, EdgeKind.READS)
