"""A tree is ticked as by py_trees: the same calls in the same order, and the same state afterwards."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite, Selector, Sequence

from codra_dsl.runtime.observers.ticking import leaf_stop, leaf_tick, tick

Shape = tuple[str, list["Shape"]] | list[Status]
"""A composite with its children, or the statuses that a leaf returns, tick by tick."""

STATUSES = st.sampled_from((Status.SUCCESS, Status.RUNNING, Status.FAILURE))
LEAVES: st.SearchStrategy[Shape] = st.lists(STATUSES, min_size=1, max_size=4)
SHAPES: st.SearchStrategy[Shape] = st.recursive(
    LEAVES,
    lambda children: st.tuples(
        st.sampled_from(("sequence", "remembering", "selector")), st.lists(children, max_size=4)
    ),
    max_leaves=8,
)


class Leaf(Behaviour):
    """Returns one status after the other, and records the calls of its methods."""

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, name: str, statuses: list[Status], calls: list[str]) -> None:
        super().__init__(name)
        self._statuses = statuses
        self._calls = calls
        self._updates = 0

    def initialise(self) -> None:
        """Record the call."""
        self._calls.append(f"{self.name} begins")

    def update(self) -> Status:
        """Record the call, and return the next status."""
        self._calls.append(f"{self.name} at work")
        self._updates += 1
        return self._statuses[self._updates % len(self._statuses)]

    def terminate(self, new_status: Status) -> None:
        """Record the call."""
        self._calls.append(f"{self.name} ends {self.status} with {new_status}")


def build_tree(shape: Shape, name: str, calls: list[str]) -> Behaviour:
    if isinstance(shape, list):
        return Leaf(name, shape, calls)
    kind, shapes = shape
    children = [build_tree(child, f"{name}.{index}", calls) for index, child in enumerate(shapes)]
    if kind == "selector":
        return Selector(name, memory=False, children=children)
    return Sequence(name, memory=kind == "remembering", children=children)


def state(tree: Behaviour) -> list[tuple[str, Status, str | None]]:
    """Return the status of each node and, for a composite, its current child."""
    node_states = []
    for node in tree.iterate():
        current = node.current_child if isinstance(node, Composite) else None
        node_states.append((node.name, node.status, None if current is None else current.name))
    return node_states


@given(SHAPES, st.lists(st.sampled_from(("tick", "interrupt")), min_size=1, max_size=8))
def test_a_tick_calls_the_same_methods_of_the_same_nodes_as_py_trees(shape: Shape, steps: list[str]) -> None:
    calls: list[str] = []
    calls_by_py_trees: list[str] = []
    ours, theirs = build_tree(shape, "root", calls), build_tree(shape, "root", calls_by_py_trees)

    for step in steps:
        if step == "tick":
            tick(ours)
            theirs.tick_once()
        else:
            ours.stop(Status.INVALID)
            theirs.stop(Status.INVALID)
        assert calls == calls_by_py_trees
        assert state(ours) == state(theirs)
