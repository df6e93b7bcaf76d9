"""Ticking a behaviour tree: the same steps as py_trees, without visitors and debugging texts.

py_trees passes each node that it ticks to visitors, and writes texts for a debugger. This takes most of the time of a
tick, and an observer's tree has neither visitors nor a debugger.
"""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite, Selector, Sequence

FAILURE, INVALID, RUNNING, SUCCESS = Status.FAILURE, Status.INVALID, Status.RUNNING, Status.SUCCESS
"""Every tick needs these several times, and looking up a member of an enum takes longer than calling a function."""


def tick(node: Behaviour) -> None:
    """Tick a tree once, in the same way as its method `tick_once`."""
    if type(node).tick is leaf_tick:
        _tick_leaf(node)
    elif type(node) is Sequence and not node.memory:
        _tick_sequence(node)
    elif type(node) is Selector and not node.memory:
        _tick_selector(node)
    else:
        node.tick_once()


def leaf_tick(node: Behaviour) -> Iterator[Behaviour]:
    """Tick a leaf. Classes of leaves use this function as their method `tick`."""
    _tick_leaf(node)
    yield node


def leaf_stop(node: Behaviour, new_status: Status) -> None:
    """Stop a leaf. Classes of leaves use this function as their method `stop`."""
    node.terminate(new_status)
    node.status = new_status


def _tick_leaf(leaf: Behaviour) -> None:
    if leaf.status is not RUNNING:
        leaf.initialise()
    status = leaf.update()
    if status is not RUNNING:
        leaf.stop(status)
    leaf.status = status


def _tick_sequence(sequence: Sequence) -> None:
    """Tick a sequence without memory: its children in order, up to the first one that does not succeed."""
    children, child = sequence.children, None
    if sequence.status is not RUNNING:
        _invalidate(children)
        sequence.initialise()
    status = SUCCESS
    for position, child in enumerate(children, start=1):
        if type(child).tick is leaf_tick:  # most children: the steps of `_tick_leaf`, without a call
            if child.status is not RUNNING:
                child.initialise()
            status = child.update()
            if status is not RUNNING:
                child.terminate(status)
            child.status = status
        else:
            tick(child)
            status = child.status
        if status is not SUCCESS:
            _invalidate(children[position:])
            break
    sequence.current_child = child
    if status is not RUNNING:
        sequence.terminate(status)
    sequence.status = status


def _tick_selector(selector: Selector) -> None:
    """Tick a selector without memory: its children in order, up to the first one that does not fail."""
    children = selector.children
    if selector.status is not RUNNING:
        selector.current_child = children[0] if children else None
        selector.initialise()
    previous_child, status = selector.current_child, FAILURE
    selector.current_child = children[-1] if children else None
    for position, child in enumerate(children, start=1):
        tick(child)
        status = child.status
        if status is not FAILURE:
            selector.current_child = child
            if child is not previous_child:
                _invalidate(children[position:])
            break
    if status is not RUNNING:
        selector.terminate(status)
    selector.status = status


def _invalidate(children: list[Behaviour]) -> None:
    for child in children:
        if child.status is INVALID:
            continue
        if type(child) is Sequence or type(child) is Selector:
            _stop(child)
        else:
            child.stop(INVALID)


def _stop(composite: Composite) -> None:
    """Interrupt a composite and its children."""
    composite.current_child = None
    _invalidate(composite.children)
    composite.terminate(INVALID)
    composite.status = INVALID
