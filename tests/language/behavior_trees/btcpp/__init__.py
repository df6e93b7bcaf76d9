"""BehaviorTree.CPP v4 in plain Python, from its documentation, source and unit tests, without any code of ours.

Facts come from https://www.behaviortree.dev (nodes library, pre and post conditions, scripting, XML format), or from
the behaviour of https://github.com/BehaviorTree/BehaviorTree.CPP if the documentation is silent. If the source
contradicts the documentation or does something undesirable, that is a `Quirk`, which is off unless a test enables it.
"""

from tests.language.behavior_trees.btcpp.core import Quirk, Status, UndefinedError, World
from tests.language.behavior_trees.btcpp.scripts import ScriptError
from tests.language.behavior_trees.btcpp.tree import Tree

__all__ = ["Quirk", "ScriptError", "Status", "Tree", "UndefinedError", "World"]
