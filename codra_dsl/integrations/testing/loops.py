"""The MAPE-K loops of a story, and the robot that executes the leaves of their trees as the story states."""

from __future__ import annotations

from typing import Any

from codra_dsl.integrations.testing.timeline import LeafBehaviour, LoopSwitch
from codra_dsl.runtime import Clock, ContextManager
from codra_dsl.runtime.behavior_trees import Action, Kind, Ports, Result, TreeError
from codra_dsl.runtime.loops import Mape, MapeModel

_TOLERANCE_S = 1e-9
"""Instants are sums of durations, so a leaf may be due this much later than the tick that is meant."""


class StoryLoops:
    """The loops of a story. They are made when the first of them starts.

    Attributes:
        robot: executes the leaves of the loops' trees.
    """

    def __init__(self, codra: ContextManager[Any, Any], model: MapeModel | None, clock: Clock) -> None:
        """Make no loop yet."""
        self.robot = StatedRobot(clock)
        self._codra = codra
        self._model = model
        self._clock = clock
        self._mape: Mape | None = None

    def switch(self, change: LoopSwitch) -> None:
        """Start or stop a loop."""
        if self._mape is None and self._model is not None:
            self._mape = Mape(self._codra, self._model, clock=self._clock, robot=self.robot)
        if self._mape is not None:
            loop = self._mape.loop(change.loop)
            (loop.start if change.runs else loop.stop)()

    def close(self) -> None:
        """Stop all loops."""
        if self._mape is not None:
            self._mape.close()


class StatedRobot:
    """Provides actions that return the results that a story states.

    Attributes:
        behaviours: the present behaviors by leaf; every other leaf runs until it is halted.
    """

    def __init__(self, clock: Clock) -> None:
        self.behaviours: dict[str, LeafBehaviour] = {}
        self.clock = clock

    def of(self, name: str) -> Action:
        """Return an action for a leaf."""
        return _StatedAction(name, self)

    def control(self, name: str, ports: Ports) -> Kind:  # noqa: ARG002 - the signature is that of `Leaves`
        """Refuse a control node of the robot, because a timeline states only how leaves end.

        Raises:
            TreeError: always.
        """
        raise TreeError(f"timelines cannot tick the control node {name!r} of the robot: test its tree in Python")


class _StatedAction(Action):
    """The action of one leaf."""

    def __init__(self, name: str, robot: StatedRobot) -> None:
        self._name = name
        self._robot = robot
        self._since_s = 0.0

    def start(self, ports: Ports) -> Result:
        """Begin; a leaf that takes no time returns its result at once."""
        self._since_s = self._robot.clock.now_s()
        return self.go_on(ports)

    def go_on(self, ports: Ports) -> Result:  # noqa: ARG002
        """Return the result when the stated time is over."""
        behaviour = self._robot.behaviours.get(self._name)
        is_over = behaviour and self._robot.clock.now_s() >= self._since_s + behaviour.takes_s - _TOLERANCE_S
        return behaviour.result if behaviour and is_over else Result.RUNNING

    def halt(self, ports: Ports) -> None:
        """Do nothing, because the action does nothing between its ticks."""
