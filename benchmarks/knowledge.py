"""The rows about the knowledge graph: the operations of the original DSR's benchmark, beside Spark-DSG's graph in C++.

Spark-DSG has no owners, value types, histories, snapshots and time. So a row shows what these features cost. The peers
of transforms are numpy's matrices, which are multiplied and inverted by hand along the same chain.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import spark_dsg
from calls import in_turns
from rows import Row

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.knowledge.declarations import AttributeModel, EdgeTypeModel, KnowledgeModel, NodeTypeModel, by
from codra_dsl.runtime.values.model import integer

NODE_COUNT = 500
READ_COUNT = 1_000
EDGE_COUNT = 200
CHAIN_LENGTH = 6

MODEL = KnowledgeModel(
    name="bench",
    node_types=(
        NodeTypeModel(
            name="testtype",
            sources=by("bench"),
            attributes=(AttributeModel(name="level", type=integer(), sources=by("bench")),),
        ),
    ),
    edge_types=(
        EdgeTypeModel(name="testtype_e", origins=("testtype",), targets=("testtype",), sources=by("bench")),
        EdgeTypeModel(
            name="stands", origins=("testtype",), targets=("testtype",), sources=by("bench"), motion=Motion()
        ),
    ),
)


def rows(_: Path) -> Iterator[Row]:
    """Measure operations on a graph of some thousand nodes, and transforms along six edges."""
    yield from _graph_rows()
    yield from _transform_rows()


def _graph_rows() -> Iterator[Row]:
    knowledge, their_graph = Knowledge(MODEL, clock=SimClock()), spark_dsg.DynamicSceneGraph()
    agent, numbers, their_numbers = knowledge.as_agent("bench"), itertools.count(), itertools.count()

    def insert() -> None:
        agent.insert_node(f"bench_node_{next(numbers)}", "testtype")

    def insert_theirs() -> None:
        their_graph.add_node(spark_dsg.DsgLayers.OBJECTS, _id(next(their_numbers)), spark_dsg.ObjectNodeAttributes())

    yield _row("knowledge_insert_node", insert, insert_theirs, calls=NODE_COUNT, target=1.0)

    pairs, their_pairs = (itertools.combinations(range(NODE_COUNT), 2) for _ in range(2))

    def connect() -> None:
        origin, target = next(pairs)
        agent.insert_edge(f"bench_node_{origin}", "testtype_e", f"bench_node_{target}")

    def connect_theirs() -> None:
        origin, target = next(their_pairs)
        their_graph.insert_edge(_id(origin), _id(target))

    yield _row("knowledge_insert_edge", connect, connect_theirs, calls=EDGE_COUNT, target=1.0)

    levels = itertools.count()

    def write() -> None:
        agent.set("bench_node_7", "level", next(levels))

    def write_theirs() -> None:
        their_graph.get_node(_id(7)).attributes.semantic_label = next(levels)

    yield _row("knowledge_write", write, write_theirs, calls=READ_COUNT, target=1.0)

    def read_theirs() -> object:
        return their_graph.get_node(_id(7)).attributes.semantic_label

    yield _row(
        "knowledge_read", lambda: knowledge.get("bench_node_7", "level"), read_theirs, calls=READ_COUNT, target=1.0
    )


def _transform_rows() -> Iterator[Row]:
    """Measure a repeated transform, and a transform at an instant between two poses of every edge."""
    clock = SimClock(100.0)
    knowledge = Knowledge(MODEL, clock=clock)
    agent = knowledge.as_agent("bench")
    steps = [Pose.about((0.1, 0.2, 1.0), 0.1 * number, (1.0, 0.5, 0.0)) for number in range(CHAIN_LENGTH)]
    for number in range(CHAIN_LENGTH + 1):
        agent.insert_node(f"part_{number}", "testtype")
    for stamp_s in (99.0, 100.0):
        for number, pose in enumerate(steps):
            agent.place(f"part_{number}", "stands", f"part_{number + 1}", pose, stamp_s=stamp_s)
    target, source = f"part_{CHAIN_LENGTH}", "part_0"
    matrices = [np.array(pose.matrix()) for pose in steps]
    instants_s = (99.0 + offset_us / 1e6 for offset_us in itertools.count(1))

    def multiply_matrices() -> object:
        product = matrices[0]
        for matrix in matrices[1:]:
            product = product @ matrix
        return np.linalg.inv(product)

    np.testing.assert_allclose(
        np.array(knowledge.transform(target, source).pose.matrix()), multiply_matrices(), atol=1e-9
    )
    transform_at_same_instant = partial(knowledge.transform, target, source, 99.5)
    yield _row("transform_cached", transform_at_same_instant, multiply_matrices, calls=READ_COUNT, target=0.5)
    transform_at_new_instant = lambda: knowledge.transform(target, source, next(instants_s))  # noqa: E731 - as short as its peer
    yield _row("transform_at", transform_at_new_instant, multiply_matrices, calls=READ_COUNT, target=4.0)


def _row(name: str, ours: Callable[[], object], peer: Callable[[], object], *, calls: int, target: float) -> Row:
    ours_s, peer_s = in_turns([ours, peer], [calls, calls])
    return Row(name=name, ours=ours_s, peer=peer_s, target=target)


def _id(number: int) -> int:
    identifier: int = spark_dsg.NodeSymbol("O", number).value
    return identifier
