"""Main executions that end a trial abnormally, in a module that the processes of trials can import."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

from codra_papers.lab.mission import Mission


@dataclass(frozen=True, slots=True)
class Raises:
    """Raise an unexpected exception."""

    def __call__(self, mission: Mission) -> None:
        raise ZeroDivisionError(f"no robot\nat {type(mission).__name__}")


@dataclass(frozen=True, slots=True)
class Dies:
    """Kill the process, as the operating system does if memory is short."""

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
    """Do nothing. Because this is a function, its `repr` contains an address that differs between processes."""
    del mission


@dataclass(frozen=True, slots=True)
class HoldsOnce:
    """Write the number of the process to a file and wait until somebody ends the process. Do nothing the second time.

    Attributes:
        file: the file.
    """

    file: Path

    def __call__(self, mission: Mission) -> None:
        """Wait, or do nothing."""
        del mission
        if not self.file.exists():
            staging = self.file.with_suffix(".tmp")
            staging.write_text(str(os.getpid()))
            staging.replace(self.file)
            signal.pause()
