"""The handles of the two agents in whose names loops write: the analyst and the adapter."""

from __future__ import annotations

import math
from collections.abc import MutableMapping
from typing import Any
from weakref import WeakValueDictionary

from codra_dsl.runtime.context.agents import Agent
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.errors import AgentTakenError
from codra_dsl.runtime.loops.declarations import MapeModel
from codra_dsl.runtime.loops.planning import VariableWrite
from codra_dsl.runtime.values.cell import BEFORE_ALL_S

Manager = ContextManager[Any, Any]


class AgentWriters:
    """The agents that write for the loops; only the handles that the loops need are opened.

    Only one object opens an agent of a context manager. With a knowledge graph, no other handle of this agent is open.
    """

    def __init__(self, codra: Manager, model: MapeModel) -> None:
        """Open the handles.

        Raises:
            AgentTakenError: if one of the handles is already taken.
        """
        self._codra = codra
        self._agents: dict[str, Agent[Any, Any]] = {}
        self._stamps_s: dict[str, float] = {}
        self._unknown_since_s: dict[str, float] = {}
        stages = [stage for stage in (model.metrics, model.actions) if stage is not None]
        if model.rates or any(stage.outputs for stage in stages):
            self._open(model.analyst)
        if model.parameters or any(course.variable for course in model.courses):
            self._open(model.adapter)

    def _open(self, agent: str) -> None:
        try:
            if _OPEN_WRITERS.setdefault((id(self._codra), agent), self) is not self:
                raise AgentTakenError(agent)
            self._agents[agent] = self._codra.agent(agent)
        except AgentTakenError:
            self.close()
            raise AgentTakenError(
                f"the loops cannot write as agent {agent!r}: it has an open handle (perhaps of other loops): close it. "
                "In a story, run the loops either by 'loops' of the story or by the program"
            ) from None

    def write(self, agent: str, variable_write: VariableWrite, now_s: float) -> None:
        """Write a variable. A variable that stays unknown keeps the instant since which it is unknown.

        The stamp of a variable never goes back, even if an input with older evidence arrives. Otherwise the variable
        would keep its present value, because the evidence of this value is newer.
        """
        name, evidence_s = variable_write.variable, variable_write.evidence_s
        since_s = now_s
        if variable_write.value is None:
            since_s = self._unknown_since_s.setdefault(name, now_s)
        else:
            self._unknown_since_s.pop(name, None)
        evidence_s = since_s if evidence_s == BEFORE_ALL_S else evidence_s
        stamp_s = min(now_s, max(evidence_s, self._stamps_s.get(name, -math.inf)))
        self._stamps_s[name] = stamp_s
        if variable_write.value is None:
            self._codra.commands.write(name, None, agent, stamp_s)
        else:
            self._agents[agent].set(name, variable_write.value, evidence_s=stamp_s)

    def close(self) -> None:
        """Close the handles."""
        for agent in self._agents.values():
            agent.close()
        for key in [key for key, writers in _OPEN_WRITERS.items() if writers is self]:
            del _OPEN_WRITERS[key]


_OPEN_WRITERS: MutableMapping[tuple[int, str], AgentWriters] = WeakValueDictionary()
"""The open writers, by the `id` of their context manager, which lives as long as they do, and the name of the agent."""
