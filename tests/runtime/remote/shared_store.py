"""The generated package of a store with a knowledge graph, as the programs of these tests import it."""

from __future__ import annotations

from dataclasses import replace

from codra_dsl.runtime import Clock, ContextManager, EventLog
from codra_dsl.runtime.knowledge import RuleModel, path
from codra_dsl.runtime.knowledge.declarations import AgentModel, KnowledgeModel
from tests.runtime.knowledge.manager import KNOWLEDGE as STORE
from tests.runtime.knowledge.manager import MODEL

LIFT = RuleModel(
    name="lift",
    before=(path("robot", "wants", "lifting"),),
    during=(path("robot", "is", "lifting"),),
    after=(path("robot", "finished", "lifting"),),
)

KNOWLEDGE: KnowledgeModel = replace(
    STORE,
    tasks=tuple(replace(task, acknowledge_s=60.0) for task in STORE.tasks),
    agents=(*STORE.agents, AgentModel(name="fork", wakes=(path("robot", "wants", "lifting"),), rules=(LIFT,))),
)

__all__ = ["KNOWLEDGE", "MODEL", "manager"]


def manager(clock: Clock, record: EventLog | None = None) -> ContextManager[str, str]:
    """Return the context manager of the store."""
    return ContextManager[str, str](MODEL, clock=clock, resources={}, record=record, knowledge=KNOWLEDGE)
