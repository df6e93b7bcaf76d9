"""The knowledge graph: P2's Deep State Representation, with types, writers and poses (P2, sections 3.1 to 3.3)."""

from __future__ import annotations

from codra_dsl.runtime.errors import AgentTakenError
from codra_dsl.runtime.knowledge.agent_handle import AgentHandle, Transaction
from codra_dsl.runtime.knowledge.change_set import AbsentError, PresentError
from codra_dsl.runtime.knowledge.context_link import ContextLink
from codra_dsl.runtime.knowledge.declarations import (
    AgentModel,
    AttributeModel,
    Direction,
    EdgeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    Path,
    Phase,
    RuleModel,
    TaskModel,
    ViewModel,
    Writer,
    absent,
    anything,
    backward,
    by,
    distance,
    in_view,
    path,
    ranked,
    some,
)
from codra_dsl.runtime.knowledge.elements import Edge, Node
from codra_dsl.runtime.knowledge.graph_schema import Stage, nodes_of_variables
from codra_dsl.runtime.knowledge.handshake import ConflictError
from codra_dsl.runtime.knowledge.knowledge import Knowledge
from codra_dsl.runtime.knowledge.matching import Match
from codra_dsl.runtime.knowledge.permissions import OutrankedError, Refusal
from codra_dsl.runtime.knowledge.rule_execution import RuleError, RuleExecution, RuleState
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import Handover, Request
from codra_dsl.runtime.knowledge.watches import Change

__all__ = [
    "AbsentError",
    "AgentHandle",
    "AgentModel",
    "AgentTakenError",
    "AttributeModel",
    "Change",
    "ConflictError",
    "ContextLink",
    "Direction",
    "Edge",
    "EdgeModel",
    "EdgeTypeModel",
    "Handover",
    "Knowledge",
    "KnowledgeModel",
    "Match",
    "Node",
    "NodeModel",
    "NodeTypeModel",
    "OutrankedError",
    "Path",
    "Phase",
    "PresentError",
    "Refusal",
    "Request",
    "RuleError",
    "RuleExecution",
    "RuleModel",
    "RuleState",
    "Snapshot",
    "Stage",
    "TaskModel",
    "Transaction",
    "ViewModel",
    "Writer",
    "absent",
    "anything",
    "backward",
    "by",
    "distance",
    "in_view",
    "nodes_of_variables",
    "path",
    "ranked",
    "some",
]
