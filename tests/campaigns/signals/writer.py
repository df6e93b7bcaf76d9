"""A robot that writes its journal at full speed while signals arrive at random instants.

Run it with `python -m tests.campaigns.signals.writer JOURNAL CLOCK ATTACK SEED`.

At its end, the robot prints the numbers whose `set` returned, the failure of the journal, and how many signals arrived.
"""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from codra_dsl.runtime import ContextManager, Journal, SimClock, WallClock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.values.model import integer
from tests.runtime.forests import World, forest, given


class AlarmError(TimeoutError):
    """An error that a signal handler raises. It is an `OSError`, like the errors of files."""


FIRST_OF_HANDLER = 1_000_000
"""The first number that the handler writes."""

SIGNALS = {"interrupt": signal.SIGINT, "terminate": signal.SIGTERM, "set": signal.SIGUSR1, "raise": signal.SIGUSR1}
"""The signal of each attack."""

ERRORS = {"interrupt": KeyboardInterrupt, "terminate": SystemExit, "raise": AlarmError}
"""What the handler raises."""

WRITES = 2500
MOST_SIGNALS = 60
LONGEST_PAUSE_S = 0.01


def model() -> ContextModel:
    return forest([given("count", type=integer())])


class Robot:
    """Writes numbers, and notes each number whose write was acknowledged."""

    def __init__(self, manager: ContextManager[str, str], attack: str, chance: Random) -> None:
        self.manager, self.attack, self.chance = manager, attack, chance
        self.acknowledged: list[int] = []
        self.may_raise = False
        self.is_closing = False
        self.signal_count = 0

    def set(self, number: int) -> None:
        """Write a number. While the journal ends, a write is no longer a part of the run, so it is not counted."""
        self.manager.set("count", number)
        if not self.is_closing:
            self.acknowledged.append(number)

    def attempt(self, call: Callable[[], None]) -> bool:
        """Call a function during which the handler may raise; return whether the function returned."""
        try:
            self.may_raise = True
            call()
            self.may_raise = False
        except (KeyboardInterrupt, SystemExit, AlarmError):
            return False
        return True

    def handle(self, *_: object) -> None:
        """Handle a signal, as the attack demands, and order the next signal."""
        self.signal_count += 1
        number, may_raise = self.signal_count, self.may_raise
        self.order_signal()
        if self.attack in ("set", "raise"):
            self.set(FIRST_OF_HANDLER + number)
        self.may_raise = False
        if may_raise and self.attack != "set":
            raise ERRORS[self.attack]
        self.may_raise = may_raise

    def order_signal(self) -> None:
        """Let the next signal come after a random pause."""
        if self.signal_count < MOST_SIGNALS:
            signal.setitimer(signal.ITIMER_REAL, self.chance.uniform(1e-5, LONGEST_PAUSE_S))

    def work(self) -> None:
        """Write all numbers, in spite of all signals."""
        for number in range(1, WRITES + 1):
            self.attempt(lambda number=number: self.set(number))  # type: ignore[misc]


def run(path: Path, clock: str, attack: str, seed: int) -> dict[str, Any]:
    """Write a journal while signals arrive; return what was acknowledged, and the failure of the journal."""
    journal = Journal(path)
    clocks = {"sim": SimClock, "wall": WallClock}
    manager = ContextManager[str, str](model(), clock=clocks[clock](), resources={"world": World()}, record=journal)
    robot = Robot(manager, attack, Random(seed))
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(SIGNALS[attack]))
    signal.signal(SIGNALS[attack], robot.handle)
    robot.order_signal()
    robot.work()
    robot.is_closing = True
    while not robot.attempt(manager.close):
        pass
    signal.signal(signal.SIGALRM, signal.SIG_IGN)
    journal.end()  # if `close` was interrupted, the journal was not finished
    return {"acknowledged": robot.acknowledged, "failure": journal.failure, "signals": robot.signal_count}


if __name__ == "__main__":
    print(json.dumps(run(Path(sys.argv[1]), sys.argv[2], sys.argv[3], int(sys.argv[4]))))
