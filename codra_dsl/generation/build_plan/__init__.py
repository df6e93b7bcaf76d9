"""What Algorithm 2 decides, as values; what follows from it (names, modules, edges); and the gate that verifies it."""

from codra_dsl.generation.build_plan.gate import PlanError, verify
from codra_dsl.generation.build_plan.values import Branch, BuildPlan, Edge, EdgeKind, Module, Node, NodeKind, Tree

__all__ = [
    "Branch",
    "BuildPlan",
    "Edge",
    "EdgeKind",
    "Module",
    "Node",
    "NodeKind",
    "PlanError",
    "Tree",
    "verify",
]
