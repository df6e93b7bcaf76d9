"""The world `lab` of `codra run`: a spec's observers in the simulated laboratory, scored against its ground truth."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, made_folder, missing_package_text, say, writable_journal, write_result
from codra_dsl.cli.worlds import RunRequest

if TYPE_CHECKING:
    from codra_dsl.language.model import Spec
    from codra_papers.experiments.lab.run import LabRun, LabSettings

NaiveOption = Annotated[
    bool,
    typer.Option(
        "--naive",
        help="Add an arm without conditions, which looks again at once after each look. With --journal FILE, the arm "
        "writes another journal, which is named like FILE with .naive before the suffix.",
    ),
]

CONTEXT_DRIVEN = "context-driven"
"""The arm that answers the decisions of the main execution."""


def lab(request: RunRequest, *, naive: NaiveOption = False) -> None:
    """A laboratory in which a mobile manipulator tends two machines (P1).

    Without --for, the robot completes one sample-processing loop. Without --out, pictures and records go to
    runs/NAME-seed-SEED.
    """
    from codra_papers.experiments.interrupts import interrupts_held_back

    try:
        with interrupts_held_back():  # some extension modules lose an interrupt while they are loaded
            from codra_papers.experiments import pacing
            from codra_papers.experiments.lab import run
            from codra_papers.experiments.lab.arms import NAIVE
    except ModuleNotFoundError as error:
        say(missing_package_text("run", error, "codra-papers", "lab"))
        raise typer.Exit(ExitCode.FAILED) from error

    spec, journal = request.spec, request.journal
    require_lab_spec(spec)
    settings = run.LabSettings(
        seed=request.seed,
        duration_s=request.duration_s,
        work=run.OneLoop() if request.duration_s is None else run.Loops(),
        answering_arm=CONTEXT_DRIVEN,
        pace=pacing.Pace(request.pace.value),
        progress=request.progress,
        journal=None if journal is None else writable_journal(journal),
    )
    if journal is not None and naive:
        writable_journal(run.arm_journal_path(journal, NAIVE.name))
    folder = made_folder(request.out if request.out is not None else Path("runs") / f"{spec.name}-seed-{request.seed}")
    outcome = _run_arms(spec, settings, naive)
    request.progress.clear()
    _show_run(outcome, spec, folder)


def require_lab_spec(spec: Spec) -> None:
    """End the command if a spec lacks declarations that the laboratory's main execution needs."""
    from codra_papers.experiments.lab.requirements import missing_declarations

    if missing_texts := missing_declarations(spec):
        say("\n  ".join((f"codra: '{spec.name}' does not run in the lab, whose main execution needs:", *missing_texts)))
        raise typer.Exit(ExitCode.FAILED)


def _run_arms(spec: Spec, settings: LabSettings, naive: bool) -> LabRun:
    from codra_dsl.runtime import CallError, NotDeclaredError, UnknownNameError
    from codra_papers.experiments.lab.arms import NAIVE, Arm, Need, observers
    from codra_papers.experiments.lab.run import run_lab
    from codra_papers.lab.simulator.gl import GraphicsUnavailableError

    with tempfile.TemporaryDirectory(prefix="codra-") as code_folder:
        arms = (Arm(name=CONTEXT_DRIVEN, need=Need.ANNOUNCED), *((NAIVE,) if naive else ()))
        compiled_arms = [observers(arm, spec, Path(code_folder) / str(number)) for number, arm in enumerate(arms)]
        try:
            return run_lab(compiled_arms, settings)
        except GraphicsUnavailableError as error:
            say(f"codra: {error}")
            raise typer.Exit(ExitCode.FAILED) from error
        except (CallError, NotDeclaredError, UnknownNameError) as error:
            say(f"codra: '{spec.name}' does not run in the lab: {error}")
            raise typer.Exit(ExitCode.FAILED) from error


def _show_run(run: LabRun, spec: Spec, folder: Path) -> None:
    from codra_papers.experiments.lab.algorithms import vision_algorithms
    from codra_papers.experiments.lab.report import run_text, write_pictures

    labels = {variable.name: variable.label for variable in spec.context}
    write_result(run_text(run, vision_algorithms(spec)))
    try:
        paths = list(write_pictures(run, folder, labels))
    except OSError as error:
        say(f"codra: cannot write to '{folder}': {error.strerror or error}")
        raise typer.Exit(ExitCode.FAILED) from error
    say("\n".join(path.as_posix() for path in paths))
    raise typer.Exit(ExitCode.FAILED if run.error else ExitCode.CLEAN)
