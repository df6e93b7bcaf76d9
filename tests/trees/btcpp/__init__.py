"""BehaviorTree.CPP v4 in plain Python, from its documentation, its source and its unit tests, and from nothing of ours.

Facts come from https://www.behaviortree.dev (nodes library, pre and post conditions, scripting, XML format), and, where
the pages are silent, from what https://github.com/BehaviorTree/BehaviorTree.CPP does. Where the source contradicts its
pages or does what nobody can want, that is a `Quirk`, which is off unless a test asks for it.
"""

from tests.trees.btcpp.core import Quirk, Status, UndefinedError, World
from tests.trees.btcpp.scripts import ScriptError
from tests.trees.btcpp.tree import Tree

__all__ = ["Quirk", "ScriptError", "Status", "Tree", "UndefinedError", "World"]
