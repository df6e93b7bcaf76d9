"""What main executions of trials do that end otherwise than by themselves, for processes that import it."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import dataclass

from codra_papers.lab.mission import Mission


@dataclass(frozen=True, slots=True)
class Raises:
    """Fail in a way that nobody foresaw."""

    def __call__(self, mission: Mission) -> None:
        raise ZeroDivisionError(f"no robot\nat {type(mission).__name__}")


@dataclass(frozen=True, slots=True)
class Dies:
    """End the process as the operating system does where memory is short."""

    def __call__(self, mission: Mission) -> None:
        del mission
        os.kill(os.getpid(), signal.SIGKILL)


@dataclass(frozen=True, slots=True)
class Exits:
    """End the process by itself."""

    def __call__(self, mission: Mission) -> None:
        del mission
        sys.exit(3)


def wanders(mission: Mission) -> None:
    """Do nothing: a function, which in another process has another address."""
    del mission
