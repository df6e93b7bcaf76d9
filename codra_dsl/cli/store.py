"""`codra run --world store`: a spec's knowledge in the simulated shop, with the picker's page if it is wanted."""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from codra_dsl.cli.console import Colour, ExitCode, common_root, say, write_result
from codra_dsl.cli.lab import one_plan

if TYPE_CHECKING:
    from codra_dsl.experiments.store_run import Compiled, StoreRun, StoreRunSettings
    from codra_dsl.model import Spec

LONG_S = 600.0
"""How long a run lasts of which nobody said how long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PageOptions:
    """That the page is wanted.

    Attributes:
        port: 0 for one that is free.
    """

    port: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreOptions:
    """What the command was told, in its words.

    Attributes:
        out: the folder for pictures; None if none are wanted.
    """

    seed: int
    duration_s: float | None
    pace: str
    situation: str | None
    page: PageOptions | None
    progress: Callable[[float], None]
    journal: Path | None
    out: Path | None


def run_in_store(spec: Path, options: StoreOptions, color: Colour) -> None:
    """Compile a spec, let the shop open with it, and print what came of the run."""
    from codra_dsl.experiments.interrupts import interrupts_held_back

    try:
        with interrupts_held_back():  # some extension modules lose one that comes while they are loaded
            settings = _settings(options)
            from codra_dsl.experiments.loading import load_emitted
    except ModuleNotFoundError as error:
        say(f"codra: 'run --page' needs {error.name}: pip install 'codra-dsl[store]'")
        raise typer.Exit(ExitCode.FAILED) from error
    from codra_dsl.emit import emit
    from codra_dsl.experiments.store_run import Compiled, store_text

    root = common_root([spec])
    plan = one_plan(spec, root, color)
    name = plan.checked.spec.name
    sys.path.append(str(root))  # perception functions of the robot's own may stand beside its specs
    with tempfile.TemporaryDirectory(prefix="codra-") as made:
        run = _run(Compiled.of(load_emitted(emit(plan), name, Path(made))), settings, name)
    if sys.stderr.isatty():
        print("\r", end="", file=sys.stderr)
    write_result(store_text(run))
    if options.out is not None and not plan.checked.spec.metrics:
        say(f"nothing was drawn: '{name}' has no metrics")
    elif options.out is not None:
        say(f"drawn: {_drawn(run, plan.checked.spec, options.out)}")


def _drawn(run: StoreRun, spec: Spec, folder: Path) -> Path:
    """Draw the metrics of a run and the weights of its actions over time; return where."""
    from codra_dsl.worlds.store.curves import draw_adaptation

    path = folder / "metrics-and-weights.svg"
    weights = [f"weight_of_{each.name}" for each in spec.actions]
    draw_adaptation(path, run.record, [each.name for each in spec.metrics], weights)
    return path


def _settings(options: StoreOptions) -> StoreRunSettings:
    from codra_dsl.experiments.pacing import Pace
    from codra_dsl.experiments.store_run import PageSettings, StoreRunSettings
    from codra_dsl.worlds.store.situations import Situation, StoreSettings

    page = options.page
    if page is not None:
        import codra_dsl.worlds.store.page.server  # noqa: F401 - known before the run whether it can be served
    default_s = LONG_S if page is None else math.inf
    situation = options.situation or (Situation.ORDINARY if page is None else Situation.QUIET)
    return StoreRunSettings(
        shop=StoreSettings(seed=options.seed, situation=Situation(situation.replace("-", " "))),
        duration_s=default_s if options.duration_s is None else options.duration_s,
        pace=Pace(options.pace),
        progress=options.progress,
        journal=options.journal,
        page=None if page is None else PageSettings(port=page.port, opened=_opened),
    )


def _opened(url: str) -> None:
    say(f"the picker's page is at {url}")


def _run(compiled: Compiled, settings: StoreRunSettings, name: str) -> StoreRun:
    from codra_dsl.experiments.store_run import run_store
    from codra_dsl.runtime import NotASourceError
    from codra_dsl.runtime.trees import TreeError

    try:
        return run_store(compiled, settings)
    except (LookupError, NotASourceError, TreeError) as error:
        say(f"codra: '{name}' does not run in the store: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except OSError as error:
        if settings.page is None:
            raise
        say(f"codra: the page cannot be served at port {settings.page.port}: {os.strerror(error.errno or 0)}")
        raise typer.Exit(ExitCode.FAILED) from error
