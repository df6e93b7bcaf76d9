"""The decisions of Algorithm 2 as values; the names, modules and edges that follow from them; the verification."""

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
