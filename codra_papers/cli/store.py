"""The world `store` of `codra run`: a knowledge graph in the simulated shop, and optionally a page for pickers."""

from __future__ import annotations

import math
import os
import tempfile
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, made_folder, missing_package_text, say, writable_journal, write_result
from codra_dsl.cli.worlds import RunRequest

if TYPE_CHECKING:
    from codra_dsl.language.model import Spec
    from codra_papers.experiments.store.run import CompiledSpec, StoreRun, StoreRunSettings

DEFAULT_DURATION_S = 600.0
"""The duration of a run without `--for` and without a page."""


class SituationName(StrEnum):
    """The situations, with their names on the command line."""

    ORDINARY = "ordinary"
    SECOND_ORDER = "second-order"
    PEOPLE_CLOSE = "people-close"
    HIDDEN = "hidden"
    ABSENT = "absent"
    QUIET = "quiet"


SituationOption = Annotated[
    SituationName | None,
    typer.Option(
        "--situation", help="The events of the run.  [default: ordinary; with --page: quiet]", show_default=False
    ),
]
PageOption = Annotated[bool, typer.Option("--page", help="Serve the picker's page, on this machine only.")]
ProcessesOption = Annotated[
    bool, typer.Option("--processes", help="Run each agent of the robot's body as a process, in real time.")
]
PortOption = Annotated[
    int | None,
    typer.Option("--port", min=1, max=65535, help="The port of the page.  [default: a free port]"),
]


def store(
    request: RunRequest,
    *,
    situation: SituationOption = None,
    page: PageOption = False,
    port: PortOption = None,
    processes: ProcessesOption = False,
) -> None:
    """A shop in which a pallet truck moves roll containers among people (P2).

    Without --for, the run lasts 10 min, or with --page until Ctrl-C. With --out, metrics and weights are drawn.
    """
    from codra_papers.experiments.interrupts import interrupts_held_back

    if port is not None and not page:
        raise typer.BadParameter("this is the port of the page; add --page", param_hint="--port")
    try:
        with interrupts_held_back():  # some extension modules lose an interrupt while they are loaded
            settings = _settings(request, situation, (port or 0) if page else None, has_processes=processes)
    except ModuleNotFoundError as error:
        say(missing_package_text("run --page", error, "codra-papers", "store"))
        raise typer.Exit(ExitCode.FAILED) from error
    from codra_dsl.integrations.inspection import compile_and_load
    from codra_papers.experiments.store.run import CompiledSpec, store_text

    spec, out_folder = request.spec, None if request.out is None else made_folder(request.out)
    with tempfile.TemporaryDirectory(prefix="codra-") as code_folder:
        run = _run_spec(CompiledSpec.of(compile_and_load(request.plan, Path(code_folder)).package), settings, spec.name)
    request.progress.clear()
    write_result(store_text(run))
    if out_folder is not None and not spec.metrics:
        say(f"nothing was drawn: '{spec.name}' has no metrics")
    elif out_folder is not None:
        say(f"drawn: {_draw_curves(run, spec, out_folder)}")


def _draw_curves(run: StoreRun, spec: Spec, folder: Path) -> Path:
    """Draw the metrics and the weights of actions of a run over time, and return the path of the picture."""
    from codra_papers.experiments.store.curves import draw_adaptation

    path = folder / "metrics-and-weights.svg"
    weights = [f"weight_of_{action.name}" for action in spec.actions]
    draw_adaptation(path, run.record, [metric.name for metric in spec.metrics], weights)
    return path


def _settings(
    request: RunRequest, name: SituationName | None, port: int | None, *, has_processes: bool
) -> StoreRunSettings:
    """Return the settings of a run; `port` is None for no page and 0 for a free port."""
    from codra_papers.experiments.pacing import Pace
    from codra_papers.experiments.store.run import PageSettings, ProcessSettings, StoreRunSettings
    from codra_papers.store.simulator.situations import Situation, StoreSettings

    if port is not None:
        import codra_papers.store.page.server  # noqa: F401 - a missing module is reported before the run
    default_s = DEFAULT_DURATION_S if port is None else math.inf
    default_situation = Situation.ORDINARY if port is None else Situation.QUIET
    situation = default_situation if name is None else Situation(name.value.replace("-", " "))
    return StoreRunSettings(
        shop=StoreSettings(seed=request.seed, situation=situation),
        duration_s=default_s if request.duration_s is None else request.duration_s,
        pace=Pace(request.pace.value),
        progress=request.progress,
        journal=None if request.journal is None else writable_journal(request.journal),
        processes=ProcessSettings(report=say) if has_processes else None,
        page=None if port is None else PageSettings(port=port, on_opened=_report_address),
    )


def _report_address(url: str) -> None:
    say(f"the picker's page is at {url}")


def _run_spec(compiled: CompiledSpec, settings: StoreRunSettings, name: str) -> StoreRun:
    from codra_dsl.runtime import NotASourceError
    from codra_dsl.runtime.behavior_trees import TreeError
    from codra_papers.experiments.store.run import run_store
    from codra_papers.store.processes.supervisor import AgentStartError

    try:
        return run_store(compiled, settings)
    except (LookupError, NotASourceError, TreeError, AgentStartError) as error:
        say(f"codra: '{name}' does not run in the store: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    except OSError as error:
        if settings.page is None:
            raise
        say(f"codra: the page cannot be served at port {settings.page.port}: {os.strerror(error.errno or 0)}")
        raise typer.Exit(ExitCode.FAILED) from error
