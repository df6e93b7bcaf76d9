"""`codra experiment`: many runs in a simulated world, and a report of what they come to."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from codra_dsl.cli.console import Colour, ExitCode, common_root, existing, made_folder, one_plan, say, write_result
from codra_dsl.cli.options import ColourOption
from codra_papers.cli.lab import require_lab_spec

if TYPE_CHECKING:
    from codra_papers.experiments.campaign.campaign import Progress
    from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial, Experiment, Settings
    from codra_papers.experiments.campaign.workers import TrialError

Name = Annotated[
    str | None,
    typer.Argument(
        metavar="NAME",
        help="Which; 'module:CONSTANT' for one of your own. Without it, all are listed.",
        show_default=False,
    ),
]
SpecOption = Annotated[
    Path | None,
    typer.Option(
        "--spec",
        metavar="FILE",
        help="The spec under test.  [default: specs/lab.yaml, or what the world of the experiment is called]",
        show_default=False,
    ),
]
Seeds = Annotated[
    int | None,
    typer.Option(
        "--seeds",
        min=0,
        help="How many further seeds intervals are drawn from.  [default: the experiment's own]",
        show_default=False,
    ),
]
Processes = Annotated[
    int | None,
    typer.Option("--processes", min=1, help="How many trials run at once.  [default: one a core]", show_default=False),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Where it all goes.  [default: runs/NAME]", show_default=False),
]
OneTrial = Annotated[
    str | None,
    typer.Option("--trial", metavar="TRIAL", help="Run this trial alone, and judge nothing.", show_default=False),
]


@dataclass(slots=True)
class _Reached:
    """How far the trials are, for whoever asks when they end early."""

    progress: Progress | None = None
    before_s: float = field(default_factory=time.perf_counter)  # noqa: TID251  it is only shown

    def told(self) -> str:
        """Return what is kept, and what goes on with it."""
        kept = "" if self.progress is None else f"{self.progress.done} of {self.progress.total} trials are kept: "
        return f"{kept}the same command goes on from there"

    def found(self) -> int:
        """Return how many trials there were before."""
        return 0 if self.progress is None else self.progress.found

    def elapsed_s(self) -> float:
        """Return for how long this has been going on."""
        return time.perf_counter() - self.before_s  # noqa: TID251  it is only shown


def experiment_command(
    name: Name = None,
    *,
    spec: SpecOption = None,
    seeds: Seeds = None,
    processes: Processes = None,
    out: Out = None,
    trial: OneTrial = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run an experiment and report what was found. A run that was stopped goes on where it was."""
    known = _known()
    if name is None:
        write_result(_listed(known))
        return
    if ":" not in name and name not in known:
        _refuse_name(name, known)
    found = known.get(name)
    (spec,) = existing([spec or Path("specs") / f"{found.world if found else 'lab'}.yaml"])
    root = common_root([spec])
    sys.path.append(str(root))  # the robot's own perception functions may stand beside its specs
    found = found or _own(name)
    _check_spec(found, spec, root, color)
    folder = made_folder(out if out is not None else Path("runs") / found.name)
    settings = _settings(found, spec, seeds, folder)
    if trial is None:
        _report(found, settings, root, processes)
    else:
        _run_alone(_named(trial, found, settings, processes), settings)


def _check_spec(experiment: Experiment, spec: Path, root: Path, color: Colour) -> None:
    """Show what is found about a spec, and end the command if it cannot be what the experiment is about."""
    from codra_papers.experiments.campaign.experiment import World

    plan = one_plan(spec, root, color)
    if experiment.world is World.LAB:
        require_lab_spec(plan.checked.spec)


def _known() -> Mapping[str, Experiment]:
    """Return the experiments by name, once all is there that any of them, or a report, needs."""
    from codra_papers.experiments.campaign.interrupts import interrupts_held_back

    try:
        with interrupts_held_back():  # some libraries take one for an error of their own while they are loaded
            from codra_papers.experiments.campaign import provenance, results  # noqa: F401
            from codra_papers.experiments.campaign.registry import experiments

            return experiments()
    except ModuleNotFoundError as error:
        say(f"codra: 'experiment' needs {error.name}: pip install 'codra-papers[lab]'")
        raise typer.Exit(ExitCode.FAILED) from error


def _listed(known: Mapping[str, Experiment]) -> str:
    width = max(map(len, known), default=0)
    return "".join(f"{name.ljust(width)}  {each.question}\n" for name, each in known.items())


def _refuse_name(name: str, known: Mapping[str, Experiment]) -> NoReturn:
    from codra_dsl.language.diagnostics import suggest

    near = suggest(name, known)
    help = f"did you mean '{near}'?" if near else f"known are {', '.join(known)}" if known else "none is known"
    raise typer.BadParameter(f"there is no experiment '{name}': {help}", param_hint="NAME")


def _own(place: str) -> Experiment:
    """Return an experiment of the project's own."""
    from codra_papers.experiments.campaign.registry import NoExperimentError, experiment_in

    try:
        return experiment_in(place)
    except NoExperimentError as error:
        raise typer.BadParameter(str(error), param_hint="NAME") from error


def _settings(experiment: Experiment, spec: Path, seeds: int | None, folder: Path) -> Settings:
    from codra_papers.experiments.campaign.experiment import Settings

    return Settings(spec=spec, seeds=experiment.seeds if seeds is None else seeds, folder=folder)


def _named(name: str, experiment: Experiment, settings: Settings, processes: int | None) -> AnyTrial:
    """Return a trial by its name; if it is none of the first ones, they are run, since they say which others follow."""
    from codra_dsl.language.diagnostics import suggest

    by_name = {trial.name: trial for trial in _trials(experiment, settings)}
    if name not in by_name and experiment.then is not None:
        came = _outcomes([*by_name.values()], settings.folder, processes, _Reached())
        by_name |= {trial.name: trial for trial in _more_trials(experiment, settings, came)}
    if name not in by_name:
        near = suggest(name, by_name)
        help = f"did you mean '{near}'?" if near else f"there are {len(by_name)}, such as '{next(iter(by_name))}'"
        raise typer.BadParameter(f"there is no trial '{name}': {help}", param_hint="--trial")
    return by_name[name]


def _run_alone(trial: AnyTrial, settings: Settings) -> None:
    outcome = _outcomes([trial], settings.folder, 1, _Reached())[trial.name]
    ended = f", ended by: {outcome.error}" if outcome.error else ""
    write_result(
        f"trial '{trial.name}' (seed {trial.seed}): {outcome.duration_s:.1f} s, {outcome.loops} loops{ended}\n"
    )


def _report(experiment: Experiment, settings: Settings, root: Path, processes: int | None) -> None:
    """Run what has not been run, judge it all, and write what was found."""
    from codra_papers.experiments.campaign.campaign import cores
    from codra_papers.experiments.campaign.provenance import Provenance, revision_of, versions
    from codra_papers.experiments.campaign.records import code_digest
    from codra_papers.experiments.campaign.results import write_results

    revision = revision_of(root, settings.folder)
    trials = _trials(experiment, settings)
    reached = _Reached()
    used = processes or cores()
    outcomes = _outcomes(trials, settings.folder, used, reached)
    found = reached.found()
    if more := _more_trials(experiment, settings, outcomes):
        trials, outcomes = [*trials, *more], {**outcomes, **_outcomes(more, settings.folder, used, reached)}
        found += reached.found()
    provenance = Provenance(
        command=shlex.join(("codra", *sys.argv[1:])),
        spec=settings.spec.absolute().relative_to(root).as_posix(),
        versions=versions(),
        code=code_digest(),
        revision=revision,
        seeds=sorted({trial.seed for trial in trials}),
        cores=cores(),
        processes=used,
        elapsed_s=reached.elapsed_s(),
        found=found,
    )
    with _told(settings.folder, reached):
        document = experiment.judge(settings, outcomes)
        paths = write_results(settings.folder, experiment, document, outcomes, provenance)
    write_result("".join(f"{sentence}\n" for sentence in document.summary))
    say("\n".join(path.as_posix() for path in paths))


def _trials(experiment: Experiment, settings: Settings) -> Sequence[AnyTrial]:
    """Return what an experiment runs; some write specs of their own for it."""
    with _told(settings.folder, _Reached()):
        return experiment.trials(settings)


def _more_trials(experiment: Experiment, settings: Settings, came: Mapping[str, AnyOutcome]) -> Sequence[AnyTrial]:
    """Return what an experiment runs by what came of its first trials."""
    with _told(settings.folder, _Reached()):
        return [] if experiment.then is None else experiment.then(settings, came)


def _outcomes(
    trials: Sequence[AnyTrial], folder: Path, processes: int | None, reached: _Reached
) -> Mapping[str, AnyOutcome]:
    from codra_papers.experiments.campaign.campaign import run_campaign

    with _told(folder, reached), _shown(reached) as show:
        return run_campaign(trials, folder, processes=processes, progress=show)


@contextmanager
def _told(folder: Path, reached: _Reached) -> Iterator[None]:
    """End the command with a line where trials, or writing what came of them, end early."""
    from codra_dsl.integrations.inspection import SpecError
    from codra_papers.experiments.campaign.campaign import CampaignBusyError
    from codra_papers.experiments.campaign.workers import TrialError

    code = ExitCode.FAILED
    try:
        yield
        return
    except KeyboardInterrupt:
        code, told = ExitCode.INTERRUPTED, f"interrupted; {reached.told()}"
    except TrialError as error:
        told = f"{error}{_ways_out(error)}"
    except (CampaignBusyError, SpecError) as error:
        told = str(error)
    except BrokenPipeError:
        raise
    except OSError as error:
        told = f"cannot write to '{folder}': {error.strerror or error}; {reached.told()}"
    say(f"codra: {told}")
    raise typer.Exit(code)


def _ways_out(error: TrialError) -> str:
    details = f"; the whole of it stands in '{error.details}'" if error.details else ""
    command = ["codra", *sys.argv[1:]]
    alone = command if "--trial" in command else [*command, "--trial", error.trial.name]
    return f"{details}; to run it alone: {shlex.join(alone)}"


@contextmanager
def _shown(reached: _Reached) -> Iterator[Callable[[Progress], None]]:
    """Yield what is told of progress: it shows that on a terminal, and nothing elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("trials{task.fields[note]}"), TimeElapsedColumn())
    console = Console(stderr=True)
    with Bar(*columns, console=console, disable=not sys.stderr.isatty(), transient=True) as bar:
        task = bar.add_task("", total=None, note="")

        def show(progress: Progress) -> None:
            reached.progress = progress
            note = _note(progress, reached.elapsed_s())
            bar.update(task, total=progress.total, completed=progress.done, note=note)

        yield show


def _note(progress: Progress, elapsed_s: float) -> str:
    """Return what is to be said of progress: how many trials there were before, and how long it may take yet."""
    before = f", {progress.found} there before" if progress.found else ""
    fresh, left = progress.done - progress.found, progress.total - progress.done
    return f"{before}, about {elapsed_s / fresh * left / 60.0:.0f} min left" if fresh and left else before
