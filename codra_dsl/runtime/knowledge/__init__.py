"""Knowledge: P2's Deep State Representation, typed, owned and geometric (P2, sections 3.1 to 3.3)."""

from __future__ import annotations

from codra_dsl.runtime.agents import AgentTakenError
from codra_dsl.runtime.knowledge.acting import Acting, Became, RuleError
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel
from codra_dsl.runtime.knowledge.draft import AbsentError, PresentError
from codra_dsl.runtime.knowledge.elements import Edge, Node
from codra_dsl.runtime.knowledge.handshake import ConflictError
from codra_dsl.runtime.knowledge.knowledge import Knowledge
from codra_dsl.runtime.knowledge.matching import Match
from codra_dsl.runtime.knowledge.rights import OutrankedError, Refusal
from codra_dsl.runtime.knowledge.sharing import Sharing
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import Handover, Request
from codra_dsl.runtime.knowledge.watching import Change
from codra_dsl.runtime.knowledge.words import Stage, nodes_of_variables
from codra_dsl.runtime.knowledge.writing import AgentHandle, Transaction

__all__ = [
    "AbsentError",
    "Acting",
    "AgentHandle",
    "AgentTakenError",
    "Became",
    "Change",
    "ConflictError",
    "Edge",
    "Handover",
    "Knowledge",
    "KnowledgeModel",
    "Match",
    "Node",
    "OutrankedError",
    "PresentError",
    "Refusal",
    "Request",
    "RuleError",
    "Sharing",
    "Snapshot",
    "Stage",
    "Transaction",
    "nodes_of_variables",
]
