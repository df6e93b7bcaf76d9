"""`codra run`: a spec's observers in a simulated world, scored against its ground truth."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import Colour, ExitCode, common_root, existing, say, write_result
from codra_dsl.cli.lab import lab_spec, made_folder
from codra_dsl.cli.options import ColourOption
from codra_dsl.cli.store import PageOptions, StoreOptions, run_in_store

if TYPE_CHECKING:
    from codra_dsl.experiments.lab import LabRun, LabSettings
    from codra_dsl.model import Spec


class World(StrEnum):
    """The worlds that a spec can be run in."""

    LAB = "lab"
    STORE = "store"


class Pace(StrEnum):
    """How time passes: as fast as it can be computed, or as it really does."""

    FAST = "fast"
    REAL = "real"


class Happening(StrEnum):
    """What happens in the store, besides what somebody at its page asks for; a situation's name."""

    ORDINARY = "ordinary"
    SECOND_ORDER = "second-order"
    PEOPLE_CLOSE = "people-close"
    HIDDEN = "hidden"
    ABSENT = "absent"
    QUIET = "quiet"


SpecFile = Annotated[Path, typer.Argument(metavar="SPEC", help="The spec to run.", show_default=False)]
WorldOption = Annotated[World, typer.Option("--world", help="Where to run it.")]
Seed = Annotated[int, typer.Option("--seed", help="Of everything that chance decides.")]
Duration = Annotated[
    str | None,
    typer.Option(
        "--for",
        metavar="DURATION",
        help="How long, e.g. '10 min'.  [default: one whole loop; store: 10 min, with --page until Ctrl-C]",
    ),
]
PaceOption = Annotated[Pace, typer.Option("--pace", help="Whether simulated or real time passes.")]
Naive = Annotated[bool, typer.Option("--naive", help="Add an arm without conditions that looks again at once.")]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Where pictures and records go.  [default: runs/NAME-seed-SEED; store: nowhere]"
    ),
]
JournalOption = Annotated[
    Path | None,
    typer.Option(
        "--journal",
        metavar="FILE",
        help="Write the run's journal, an MCAP file; with --naive also FILE's name with .naive in it.",
        show_default=False,
    ),
]

SituationOption = Annotated[
    Happening | None,
    typer.Option(
        "--situation", help="Store: what happens.  [default: ordinary, with --page quiet]", show_default=False
    ),
]
PageOption = Annotated[bool, typer.Option("--page", help="Store: serve the picker's page, on this machine only.")]
Port = Annotated[
    int | None,
    typer.Option("--port", min=1, max=65535, help="Store: of the page.  [default: one that is free]"),
]

_PROGRESS_EVERY_S = 10.0

CONTEXT_DRIVEN = "context-driven"
"""The arm that answers the main execution."""


def run_command(
    spec: SpecFile,
    *,
    world: WorldOption = World.LAB,
    seed: Seed = 1,
    for_: Duration = None,
    pace: PaceOption = Pace.FAST,
    naive: Naive = False,
    out: Out = None,
    journal: JournalOption = None,
    situation: SituationOption = None,
    page: PageOption = False,
    port: Port = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run a spec in a simulated world. It prints what came of it, against what was true."""
    duration_s = None if for_ is None else _duration_s(for_)
    (spec,) = existing([spec])
    if world is World.STORE:
        _refuse_options("the store has no", {"--naive": naive})
        if port is not None and not page:
            raise typer.BadParameter("it is the port of --page", param_hint="--port")
        settings = StoreOptions(
            seed=seed,
            duration_s=duration_s,
            pace=pace.value,
            situation=None if situation is None else situation.value,
            page=PageOptions(port=port or 0) if page else None,
            progress=_progress(),
            journal=None if journal is None else _writable(journal),
            out=None if out is None else made_folder(out),
        )
        run_in_store(spec, settings, color)
    else:
        _refuse_options(
            "the lab has no", {"--situation": situation is not None, "--page": page, "--port": port is not None}
        )
        _run_in_lab(
            spec, seed=seed, duration_s=duration_s, pace=pace, naive=naive, out=out, journal=journal, color=color
        )


def _refuse_options(why: str, given: Mapping[str, bool]) -> None:
    for option, is_given in given.items():
        if is_given:
            raise typer.BadParameter(f"{why} such option", param_hint=option)


def _run_in_lab(
    spec: Path,
    *,
    seed: int,
    duration_s: float | None,
    pace: Pace,
    naive: bool,
    out: Path | None,
    journal: Path | None,
    color: Colour,
) -> None:
    from codra_dsl.experiments.interrupts import interrupts_held_back

    try:
        with interrupts_held_back():  # some extension modules lose one that comes while they are loaded
            from codra_dsl.experiments import lab, pacing
            from codra_dsl.experiments.arms import NAIVE
    except ModuleNotFoundError as error:
        say(f"codra: 'run' needs {error.name}: pip install 'codra-dsl[lab,viz]'")
        raise typer.Exit(ExitCode.FAILED) from error

    root = common_root([spec])
    loaded = lab_spec(spec, root, color)
    settings = lab.LabSettings(
        seed=seed,
        duration_s=duration_s,
        work=lab.OneLoop() if duration_s is None else lab.Loops(),
        answering=CONTEXT_DRIVEN,
        pace=pacing.Pace(pace.value),
        progress=_progress(),
        journal=None if journal is None else _writable(journal),
    )
    if journal is not None and naive:
        _writable(lab.beside(journal, NAIVE.name))
    folder = made_folder(out if out is not None else Path("runs") / f"{loaded.name}-seed-{seed}")
    sys.path.append(str(root))  # the robot's own perception functions may stand beside its specs
    _show(_run(loaded, settings, naive), folder, {variable.name: variable.label for variable in loaded.context})


def _run(spec: Spec, settings: LabSettings, naive: bool) -> LabRun:
    from codra_dsl.experiments.arms import NAIVE, Arm, Need, observers
    from codra_dsl.experiments.lab import run_lab
    from codra_dsl.runtime import CallError, NotDeclaredError, UnknownNameError
    from codra_dsl.worlds.lab.gl import GraphicsUnavailableError

    with tempfile.TemporaryDirectory(prefix="codra-") as made:
        arms = (Arm(name=CONTEXT_DRIVEN, need=Need.ANNOUNCED), *((NAIVE,) if naive else ()))
        ready = [observers(arm, spec, Path(made) / str(number)) for number, arm in enumerate(arms)]
        try:
            return run_lab(ready, settings)
        except GraphicsUnavailableError as error:
            say(f"codra: {error}")
            raise typer.Exit(ExitCode.FAILED) from error
        except (CallError, NotDeclaredError, UnknownNameError) as error:
            say(f"codra: '{spec.name}' does not run in the lab: {error}")
            raise typer.Exit(ExitCode.FAILED) from error


def _duration_s(text: str) -> float:
    from codra_dsl.units import parse_duration

    duration_s = parse_duration(text)
    if not isinstance(duration_s, float) or not 0 < duration_s < float("inf"):
        raise typer.BadParameter(f"'{text}' is no duration such as '90 s' or '10 min'", param_hint="--for")
    return duration_s


def _writable(journal: Path) -> Path:
    """Return the path of a journal that can be made, known before the run lest it be in vain."""
    from codra_dsl.runtime.journal.opening import opened

    try:
        opened(journal).close()
    except OSError as error:
        raise typer.BadParameter(f"cannot write '{journal}': {error.strerror}", param_hint="--journal") from error
    return journal


def _progress() -> Callable[[float], None]:
    """Return what shows the reached instant on a terminal, and nothing elsewhere."""
    if not sys.stderr.isatty():
        return lambda _: None
    shown_s = 0.0

    def show(now_s: float) -> None:
        nonlocal shown_s
        if now_s - shown_s >= _PROGRESS_EVERY_S:
            shown_s = now_s
            print(f"\r{now_s:8.0f} s", end="", file=sys.stderr, flush=True)

    return show


def _show(run: LabRun, folder: Path, labels: Mapping[str, str]) -> None:
    from codra_dsl.experiments.report import run_text, write_pictures

    if sys.stderr.isatty():
        print("\r", end="", file=sys.stderr)
    write_result(run_text(run))
    try:
        paths = list(write_pictures(run, folder, labels))
    except OSError as error:
        say(f"codra: cannot write to '{folder}': {error.strerror or error}")
        raise typer.Exit(ExitCode.FAILED) from error
    say("\n".join(path.as_posix() for path in paths))
    raise typer.Exit(ExitCode.FAILED if run.error else ExitCode.CLEAN)
