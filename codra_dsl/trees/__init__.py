"""Behaviour trees of BehaviorTree.CPP version 4: XML in, values, findings with places, XML out (P2, section 5.2).

It reads and judges; `emit` makes Python of what it found to be right.
"""

from codra_dsl.trees.checks import check
from codra_dsl.trees.reader import read, read_text
from codra_dsl.trees.rules import RULES
from codra_dsl.trees.values import (
    Attribute,
    BehaviorTree,
    CheckedForest,
    Direction,
    Forest,
    Include,
    NodeKind,
    NodeModel,
    Port,
    TreeFile,
    TreeNode,
)
from codra_dsl.trees.writer import write

__all__ = [
    "RULES",
    "Attribute",
    "BehaviorTree",
    "CheckedForest",
    "Direction",
    "Forest",
    "Include",
    "NodeKind",
    "NodeModel",
    "Port",
    "TreeFile",
    "TreeNode",
    "check",
    "read",
    "read_text",
    "write",
]
