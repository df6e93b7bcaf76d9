"""`codra experiment`: many runs in a simulated world, and a report of their results."""

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

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    common_root,
    existing,
    made_folder,
    one_plan,
    pip_install,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption
from codra_papers.cli.lab import require_lab_spec

if TYPE_CHECKING:
    from codra_papers.experiments.campaign.campaign import Progress
    from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial, Experiment, Settings
    from codra_papers.experiments.campaign.workers import TrialError

NameArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="NAME",
        help="The experiment, or 'module:CONSTANT' for your own experiment. Without NAME, all experiments are listed.",
        show_default=False,
    ),
]
SpecOption = Annotated[
    Path | None,
    typer.Option(
        "--spec",
        metavar="FILE",
        help="The spec under test.  [default: specs/lab.yaml; specs/store.yaml for an experiment in the store]",
        show_default=False,
    ),
]
SeedsOption = Annotated[
    int | None,
    typer.Option(
        "--seeds",
        min=0,
        help="The number of further seeds for confidence intervals.  [default: the experiment's own]",
        show_default=False,
    ),
]
ProcessesOption = Annotated[
    int | None,
    typer.Option(
        "--processes", min=1, help="How many trials run at once.  [default: one per core]", show_default=False
    ),
]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="The folder of the results.  [default: runs/NAME]", show_default=False),
]
TrialOption = Annotated[
    str | None,
    typer.Option("--trial", metavar="TRIAL", help="Run only this trial, and write no report.", show_default=False),
]


@dataclass(slots=True)
class _TrialProgress:
    """The progress of the trials. It is reported if the trials end early."""

    progress: Progress | None = None
    start_s: float = field(default_factory=time.perf_counter)  # noqa: TID251  only for display

    def kept_text(self) -> str:
        """Return how many trials are kept, and how to continue."""
        if self.progress is None:
            return "run the same command again to continue"
        return f"{self.progress.done} of {self.progress.total} trials are kept: run the same command again to continue"

    def reused_trial_count(self) -> int:
        """Return how many trials already had records."""
        return 0 if self.progress is None else self.progress.reused_trial_count

    def elapsed_s(self) -> float:
        """Return the time since the start."""
        return time.perf_counter() - self.start_s  # noqa: TID251  only for display


def experiment_command(
    name: NameArgument = None,
    *,
    spec: SpecOption = None,
    seeds: SeedsOption = None,
    processes: ProcessesOption = None,
    out: OutOption = None,
    trial: TrialOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run an experiment and report its results. To continue a stopped run, run the same command again."""
    known_experiments = _known_experiments()
    if name is None:
        write_result(_experiment_list(known_experiments))
        return
    if ":" not in name and name not in known_experiments:
        _refuse_name(name, known_experiments)
    experiment = known_experiments.get(name)
    (spec,) = existing([spec or Path("specs") / f"{experiment.world if experiment else 'lab'}.yaml"])
    root = common_root([spec])
    sys.path.append(str(root))  # the robot's own perception functions may be next to its specs
    experiment = experiment or _project_experiment(name)
    _check_spec(experiment, spec, root, color)
    folder = made_folder(out if out is not None else Path("runs") / experiment.name)
    settings = _settings(experiment, spec, seeds, folder)
    if trial is None:
        _report(experiment, settings, root, processes)
    else:
        _run_alone(_trial_named(trial, experiment, settings, processes), settings)


def _check_spec(experiment: Experiment, spec: Path, root: Path, color: Colour) -> None:
    """Print the findings about a spec, and end the command if the experiment cannot use the spec."""
    from codra_papers.experiments.campaign.experiment import World

    plan = one_plan(spec, root, color)
    if experiment.world is World.LAB:
        require_lab_spec(plan.checked.spec)


def _known_experiments() -> Mapping[str, Experiment]:
    """Return a mapping from names to experiments, after importing everything that experiments and reports need."""
    from codra_papers.experiments.campaign.interrupts import interrupts_held_back

    try:
        with interrupts_held_back():  # some libraries, while they are loaded, turn an interrupt into another error
            from codra_papers.experiments.campaign import provenance, results  # noqa: F401
            from codra_papers.experiments.campaign.registry import experiments

            return experiments()
    except ModuleNotFoundError as error:
        say(f"codra: 'experiment' needs {error.name}: {pip_install('codra-papers', 'lab')}")
        raise typer.Exit(ExitCode.FAILED) from error


def _experiment_list(known_experiments: Mapping[str, Experiment]) -> str:
    width = max(map(len, known_experiments), default=0)
    return "".join(f"{name.ljust(width)}  {experiment.question}\n" for name, experiment in known_experiments.items())


def _refuse_name(name: str, known_experiments: Mapping[str, Experiment]) -> NoReturn:
    from codra_dsl.language.diagnostics import suggest

    suggestion = suggest(name, known_experiments)
    help_text = (
        f"did you mean '{suggestion}'?"
        if suggestion
        else f"known are {', '.join(known_experiments)}"
        if known_experiments
        else "none is known"
    )
    raise typer.BadParameter(f"there is no experiment '{name}': {help_text}", param_hint="NAME")


def _project_experiment(reference: str) -> Experiment:
    """Return an experiment in a module of the project."""
    from codra_papers.experiments.campaign.registry import NoExperimentError, experiment_in

    try:
        return experiment_in(reference)
    except NoExperimentError as error:
        raise typer.BadParameter(str(error), param_hint="NAME") from error


def _settings(experiment: Experiment, spec: Path, seeds: int | None, folder: Path) -> Settings:
    from codra_papers.experiments.campaign.experiment import Settings

    return Settings(spec=spec, seeds=experiment.seeds if seeds is None else seeds, folder=folder)


def _trial_named(name: str, experiment: Experiment, settings: Settings, processes: int | None) -> AnyTrial:
    """Return a trial by its name.

    If no first trial has this name, the first trials are run, because further trials depend on their outcomes.
    """
    from codra_dsl.language.diagnostics import suggest

    trials_by_name = {trial.name: trial for trial in _trials(experiment, settings)}
    if name not in trials_by_name and experiment.then is not None:
        outcomes = _outcomes([*trials_by_name.values()], settings.folder, processes, _TrialProgress())
        trials_by_name |= {trial.name: trial for trial in _further_trials(experiment, settings, outcomes)}
    if name not in trials_by_name:
        suggestion = suggest(name, trials_by_name)
        help_text = (
            f"did you mean '{suggestion}'?"
            if suggestion
            else f"there are {len(trials_by_name)}, such as '{next(iter(trials_by_name))}'"
        )
        raise typer.BadParameter(f"there is no trial '{name}': {help_text}", param_hint="--trial")
    return trials_by_name[name]


def _run_alone(trial: AnyTrial, settings: Settings) -> None:
    outcome = _outcomes([trial], settings.folder, 1, _TrialProgress())[trial.name]
    end_text = f", ended by: {outcome.error}" if outcome.error else ""
    write_result(
        f"trial '{trial.name}' (seed {trial.seed}): {outcome.duration_s:.1f} s, {outcome.loops} loops{end_text}\n"
    )


def _report(experiment: Experiment, settings: Settings, root: Path, processes: int | None) -> None:
    """Run the trials that have no record, judge all outcomes, and write the report."""
    from codra_papers.experiments.campaign.campaign import cores
    from codra_papers.experiments.campaign.provenance import Provenance, revision_of, versions
    from codra_papers.experiments.campaign.results import write_results
    from codra_papers.experiments.campaign.trial_records import code_digest

    revision = revision_of(root, settings.folder)
    trials = _trials(experiment, settings)
    trial_progress = _TrialProgress()
    process_count = processes or cores()
    outcomes = _outcomes(trials, settings.folder, process_count, trial_progress)
    reused_trial_count = trial_progress.reused_trial_count()
    if further_trials := _further_trials(experiment, settings, outcomes):
        trials = [*trials, *further_trials]
        outcomes = {**outcomes, **_outcomes(further_trials, settings.folder, process_count, trial_progress)}
        reused_trial_count += trial_progress.reused_trial_count()
    provenance = Provenance(
        command=shlex.join(("codra", *sys.argv[1:])),
        spec=settings.spec.absolute().relative_to(root).as_posix(),
        versions=versions(),
        code=code_digest(),
        revision=revision,
        seeds=sorted({trial.seed for trial in trials}),
        cores=cores(),
        processes=process_count,
        elapsed_s=trial_progress.elapsed_s(),
        reused_trial_count=reused_trial_count,
    )
    with _reporting_errors(settings.folder, trial_progress):
        document = experiment.judge(settings, outcomes)
        paths = write_results(settings.folder, experiment, document, outcomes, provenance)
    write_result("".join(f"{sentence}\n" for sentence in document.summary))
    say("\n".join(path.as_posix() for path in paths))


def _trials(experiment: Experiment, settings: Settings) -> Sequence[AnyTrial]:
    """Return the first trials of an experiment. Some experiments write specs for these trials."""
    with _reporting_errors(settings.folder, _TrialProgress()):
        return experiment.trials(settings)


def _further_trials(
    experiment: Experiment, settings: Settings, outcomes: Mapping[str, AnyOutcome]
) -> Sequence[AnyTrial]:
    """Return the further trials, which depend on the outcomes of the first trials."""
    with _reporting_errors(settings.folder, _TrialProgress()):
        return [] if experiment.then is None else experiment.then(settings, outcomes)


def _outcomes(
    trials: Sequence[AnyTrial], folder: Path, processes: int | None, trial_progress: _TrialProgress
) -> Mapping[str, AnyOutcome]:
    from codra_papers.experiments.campaign.campaign import run_campaign

    with _reporting_errors(folder, trial_progress), _progress_bar(trial_progress) as show:
        return run_campaign(trials, folder, processes=processes, progress=show)


@contextmanager
def _reporting_errors(folder: Path, trial_progress: _TrialProgress) -> Iterator[None]:
    """End the command with a message if an error or an interrupt ends the block that runs trials or writes results."""
    from codra_dsl.integrations.inspection import SpecError
    from codra_papers.experiments.campaign.campaign import CampaignBusyError
    from codra_papers.experiments.campaign.workers import TrialError

    code = ExitCode.FAILED
    try:
        yield
        return
    except KeyboardInterrupt:
        code, message = ExitCode.INTERRUPTED, f"interrupted; {trial_progress.kept_text()}"
    except TrialError as error:
        message = f"{error}{_help_text(error)}"
    except (CampaignBusyError, SpecError) as error:
        message = str(error)
    except BrokenPipeError:
        raise
    except OSError as error:
        message = f"cannot write to '{folder}': {error.strerror or error}; {trial_progress.kept_text()}"
    say(f"codra: {message}")
    raise typer.Exit(code)


def _help_text(error: TrialError) -> str:
    details_text = f"; the traceback is in '{error.details}'" if error.details else ""
    command = ["codra", *sys.argv[1:]]
    trial_command = command if "--trial" in command else [*command, "--trial", error.trial.name]
    return f"{details_text}; to run it alone: {shlex.join(trial_command)}"


@contextmanager
def _progress_bar(trial_progress: _TrialProgress) -> Iterator[Callable[[Progress], None]]:
    """Yield a function that stores progress in `trial_progress` and, on a terminal, shows it in a progress bar."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("trials{task.fields[text]}"), TimeElapsedColumn())
    console = Console(stderr=True)
    with Bar(*columns, console=console, disable=not sys.stderr.isatty(), transient=True) as bar:
        task_id = bar.add_task("", total=None, text="")

        def show(progress: Progress) -> None:
            trial_progress.progress = progress
            text = _bar_text(progress, trial_progress.elapsed_s())
            bar.update(task_id, total=progress.total, completed=progress.done, text=text)

        yield show


def _bar_text(progress: Progress, elapsed_s: float) -> str:
    """Return the text next to the progress bar: how many trials already had records, and the remaining time."""
    reused_text = f", {progress.reused_trial_count} kept from before" if progress.reused_trial_count else ""
    new_trial_count, remaining_trial_count = progress.done - progress.reused_trial_count, progress.total - progress.done
    return (
        f"{reused_text}, about {elapsed_s / new_trial_count * remaining_trial_count / 60.0:.0f} min left"
        if new_trial_count and remaining_trial_count
        else reused_text
    )
