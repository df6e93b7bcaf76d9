"""The peer at run time: an observer's tree in plain py_trees, as its documentation shows."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Access, Status
from py_trees.composites import Sequence
from py_trees.trees import BehaviourTree


class Check(Behaviour):
    """A leaf that reads the blackboard."""

    def __init__(self, key: str, otherwise: Status = Status.FAILURE) -> None:
        super().__init__(key)
        self._key, self._otherwise = key, otherwise
        self.blackboard = self.attach_blackboard_client(name=key)
        self.blackboard.register_key(key=key, access=Access.READ)

    def update(self) -> Status:
        """Succeed if the value is true."""
        return Status.SUCCESS if self.blackboard.get(self._key) else self._otherwise


def tree(name: str, needs: tuple[str, ...], due: str) -> BehaviourTree:
    """Return a tree with control flag, preconditions, due or running, and a look that ends at once."""
    leaves = [Check("wanted"), *map(Check, needs), Check(due, Status.RUNNING), Check("wanted")]
    return BehaviourTree(Sequence(name, memory=False, children=leaves))
