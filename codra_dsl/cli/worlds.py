"""Worlds: `codra run SPEC --world NAME` runs a spec in one of them.

A world is a function. Its first argument is a `RunRequest` with the arguments of the command. Its other parameters are
additional options of the command, declared as for a typer command::

    def arena(request: RunRequest, *, wind: Annotated[float, typer.Option("--wind", help="In m/s.")] = 0.0) -> None:
        \"\"\"An arena with wind.\"\"\"
        with tempfile.TemporaryDirectory() as folder:
            compiled = compile_and_load(request.plan, Path(folder))
            ...

A distribution registers a world in the entry-point group `codra.worlds`::

    [project.entry-points."codra.worlds"]
    arena = "my_robot.worlds:arena"

The world prints its results with `write_result` of `codra_dsl.cli.console`. If a run fails, it raises
`typer.Exit(ExitCode.FAILED)`. `codra run --world NAME --help` shows the docstring of the function. Import simulators
inside the function: then the help is shown quickly, even if the simulators are not installed.

A world passes one clock to everything that it runs. In simulated time, all events are in one heap and have one order,
so runs with the same seed write the same journal.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Concatenate

from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.generation.build_plan import BuildPlan
    from codra_dsl.language.model import Spec

__all__ = ["Pace", "Progress", "RunRequest", "World"]

_PROGRESS_INTERVAL_S = 10.0


class Pace(StrEnum):
    """How time passes: as fast as it can be computed, or in real time."""

    FAST = "fast"
    REAL = "real"


class Progress:
    """Shows the simulated time of a run on a terminal; elsewhere it shows nothing."""

    def __init__(self, *, is_shown: bool = True) -> None:
        """Show nothing yet; if `is_shown` is false, show nothing at all."""
        self._is_terminal = is_shown and sys.stderr.isatty()
        self._last_shown_instant_s = 0.0

    def __call__(self, now_s: float) -> None:
        """Show an instant, unless the last shown instant is less than 10 s of simulated time earlier."""
        if self._is_terminal and now_s - self._last_shown_instant_s >= _PROGRESS_INTERVAL_S:
            self._last_shown_instant_s = now_s
            print(f"\r{now_s:8.0f} s", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Move the cursor to the start of the line, so that the results overwrite the instant."""
        if self._is_terminal:
            print("\r", end="", file=sys.stderr)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRequest:
    """A run that the command line requests.

    Attributes:
        plan: the build plan of the spec, which has no errors. Pass it to
            `codra_dsl.integrations.inspection.compile_and_load`.
        root: the folder of the project; it is on `sys.path`.
        seed: the seed of all random choices.
        duration_s: how long the run lasts; None if the world decides.
        pace: how time passes.
        out: the folder for pictures and records; None if the world decides.
        journal: the file for the run's journal; None for no journal.
        progress: the world calls this object from time to time with the present instant.
    """

    plan: BuildPlan
    root: Path
    seed: int = 1
    duration_s: float | None = None
    pace: Pace = Pace.FAST
    out: Path | None = None
    journal: Path | None = None
    progress: Progress = field(default_factory=Progress)

    @property
    def spec(self) -> Spec:
        """Return the spec, with its templates expanded."""
        return self.plan.checked.spec


World = Callable[Concatenate[RunRequest, ...], None]
