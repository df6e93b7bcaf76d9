"""The MAPE-K loops of a story, and the robot that executes the leaves of their trees as the story states."""

from __future__ import annotations

from typing import Any

from codra_dsl.integrations.testing.timeline import LeafBehaviour, LoopSwitch
from codra_dsl.runtime import Clock, ContextManager
from codra_dsl.runtime.behavior_trees import Action, Ports, Result
from codra_dsl.runtime.loops import Mape, MapeModel

_TOLERANCE_S = 1e-9
"""Instants are sums of durations, so a leaf may be due this much later than the tick that is meant."""


class StoryLoops:
    """The loops of a story. They are made when the first of them starts."""

    def __init__(self, codra: ContextManager[Any, Any], model: MapeModel | None, clock: Clock) -> None:
        """Make no loop yet."""
        self._codra = codra
        self._model = model
        self._clock = clock
        self._robot = StatedRobot(clock)
        self._mape: Mape | None = None

    def switch(self, change: LoopSwitch) -> None:
        """Start or stop a loop."""
        if self._mape is None and self._model is not None:
            self._mape = Mape(self._codra, self._model, clock=self._clock, robot=self._robot)
        if self._mape is not None:
            loop = self._mape.loop(change.loop)
            if change.runs:
                loop.start()
            else:
                loop.stop()

    def change_leaf(self, change: LeafBehaviour) -> None:
        """Change the behavior of a leaf."""
        self._robot.behaviours[change.leaf] = change

    def __enter__(self) -> None:
        """Do nothing: loops start when the story starts them."""

    def __exit__(self, *_: object) -> None:
        if self._mape is not None:
            self._mape.close()


class StatedRobot:
    """Provides actions that return what a story states.

    Attributes:
        behaviours: the present behaviors by leaf; every other leaf runs until it is halted.
    """

    def __init__(self, clock: Clock) -> None:
        self.behaviours: dict[str, LeafBehaviour] = {}
        self._clock = clock

    def of(self, name: str) -> Action:
        """Return an action for a leaf."""
        return _StatedAction(name, self)

    def result(self, name: str, since_s: float) -> Result:
        """Return the present result of a leaf that has run since an instant."""
        behaviour = self.behaviours.get(name)
        is_over = behaviour is not None and self._clock.now_s() >= since_s + behaviour.takes_s - _TOLERANCE_S
        return behaviour.result if behaviour is not None and is_over else Result.RUNNING

    def now_s(self) -> float:
        """Return the present instant."""
        return self._clock.now_s()


class _StatedAction(Action):
    """The action of one leaf."""

    def __init__(self, name: str, robot: StatedRobot) -> None:
        self._name = name
        self._robot = robot
        self._since_s = 0.0

    def start(self, ports: Ports) -> Result:
        """Begin; a leaf that takes no time returns its result at once."""
        self._since_s = self._robot.now_s()
        return self.go_on(ports)

    def go_on(self, ports: Ports) -> Result:  # noqa: ARG002
        """Return the result when the stated time is over."""
        return self._robot.result(self._name, self._since_s)

    def halt(self, ports: Ports) -> None:
        """Do nothing, because the action does nothing between its ticks."""
