"""A context manager with the store's graph: context-variables that are attributes of its nodes."""

from __future__ import annotations

from dataclasses import replace

from codra_dsl.runtime import Clock, ContextManager, ContextModel, EventLog
from codra_dsl.runtime.knowledge import KnowledgeModel
from codra_dsl.runtime.knowledge.declarations import AttributeModel, by
from codra_dsl.runtime.values.model import VariableModel, boolean, real
from tests.runtime.knowledge.store import STORE

MODEL = ContextModel(
    name="store",
    variables=(
        VariableModel(
            name="charge", type=real(0, 100, unit="percent"), sources=("navigation",), valid_for_s=60.0, history=5
        ),
        VariableModel(name="docked", type=boolean(), sources=("navigation", "fork")),
        VariableModel(name="light", type=boolean(), sources=("main_execution",)),
    ),
    observers=(),
)
"""`charge` and `docked` belong to the battery and the robot; `light` belongs to no declared node."""

_OWN = {
    "battery": AttributeModel(
        name="charge", type=real(0, 100, unit="percent"), sources=by("navigation"), valid_for_s=60.0, history=5
    ),
    "robot": AttributeModel(name="docked", type=boolean(), sources=by("navigation", "fork")),
}

KNOWLEDGE: KnowledgeModel = replace(
    STORE,
    nodes=tuple(replace(node, attributes=(_OWN[node.name],)) if node.name in _OWN else node for node in STORE.nodes),
)


def manager(clock: Clock, record: EventLog | None = None) -> ContextManager[str, str]:
    """Return a context manager with the initial graph of the store."""
    return ContextManager[str, str](MODEL, clock=clock, resources={}, record=record, knowledge=KNOWLEDGE)
