"""Behaviour trees of BehaviorTree.CPP version 4 (P2, section 5.2).

This package reads trees from XML to values, checks them, reports findings with places, and writes trees as XML. `emit`
compiles valid trees to Python.
"""

from codra_dsl.language.behavior_trees.checks import check
from codra_dsl.language.behavior_trees.reader import read, read_text
from codra_dsl.language.behavior_trees.rules import RULES
from codra_dsl.language.behavior_trees.values import (
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
from codra_dsl.language.behavior_trees.writer import write

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
