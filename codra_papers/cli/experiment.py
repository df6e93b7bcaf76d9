"""`codra experiment`: many runs in a simulated world, and a report of their results."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    common_root,
    existing,
    made_folder,
    missing_package_text,
    one_plan,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption
from codra_papers.cli.lab import require_lab_spec

if TYPE_CHECKING:
    from codra_papers.experiments.campaign.campaign import Progress, Runner
    from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial, Experiment, Settings
    from codra_papers.experiments.campaign.workers import TrialError

NameArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="NAME",
        help="The experiment, 'module:CONSTANT' for your own experiment, or 'all'. Without NAME, all experiments are "
        "listed.",
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
    typer.Option(
        "--out",
        metavar="DIR",
        help="The folder of the results; for 'all', of the folders NAME.  [default: runs/NAME]",
        show_default=False,
    ),
]
TrialOption = Annotated[
    str | None,
    typer.Option("--trial", metavar="TRIAL", help="Run only this trial, and write no report.", show_default=False),
]


ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Run the trials on the workers of a Dask cluster: the address of its scheduler, e.g. tcp://HOST:8786.",
        show_default=False,
    ),
]
QuickOption = Annotated[
    bool,
    typer.Option("--quick", help="Run few trials, which show each effect with wide intervals, into runs/quick/NAME."),
]
_ALL = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Options:
    """The options of a call.

    Attributes:
        seeds: the number of further seeds; None for the default of the experiment.
        processes: how many trials run at once on this machine; None for one per core.
        out: the folder of the results; None for the default.
        cluster: the address of the scheduler of a cluster; None to run trials on this machine.
        is_quick: whether only few trials run.
    """

    seeds: int | None
    processes: int | None
    out: Path | None
    cluster: str | None
    is_quick: bool

    def settings(self, experiment: Experiment, spec: Path) -> Settings:
        """Return the settings of an experiment, after making its folder."""
        from codra_papers.experiments.campaign.experiment import Settings

        folder = self.out or Path("runs", "quick" if self.is_quick else "", experiment.name)
        default_seeds = experiment.quick_seeds if self.is_quick else experiment.seeds
        return Settings(
            spec=spec,
            seeds=default_seeds if self.seeds is None else self.seeds,
            folder=made_folder(folder),
            is_quick=self.is_quick,
        )

    def runner(self) -> Runner:
        """Return the function that runs trials."""
        from codra_papers.experiments.campaign.campaign import cores, local_processes

        if self.cluster is None:
            return local_processes(self.processes or cores())
        try:
            from codra_papers.experiments.campaign.cluster import run_on_cluster
        except ModuleNotFoundError as error:
            say(missing_package_text("--cluster", error, "codra-papers", "cluster"))
            raise typer.Exit(ExitCode.FAILED) from error
        return partial(run_on_cluster, address=self.cluster, notify=lambda sentence: say(f"codra: {sentence}"))


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
    cluster: ClusterOption = None,
    quick: QuickOption = False,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run an experiment and report its results. To continue a stopped run, run the same command again."""
    known_experiments = _known_experiments()
    if name is None:
        write_result(_experiment_list(known_experiments))
        return
    if name not in (_ALL, *known_experiments) and ":" not in name:
        _refuse_name(name, known_experiments)
    if cluster is not None and processes is not None:
        raise typer.BadParameter("the workers of a cluster have their own numbers of threads", param_hint="--processes")
    options = _Options(seeds=seeds, processes=processes, out=out, cluster=cluster, is_quick=quick)
    if name == _ALL:
        if trial is not None or spec is not None:
            raise typer.BadParameter("'all' takes neither --trial nor --spec: name one experiment", param_hint="NAME")
        _run_all(known_experiments, options, color)
        return
    experiment = known_experiments.get(name)
    spec, root = _spec_and_root(spec, experiment.world if experiment else "lab")
    experiment = experiment or _project_experiment(name)
    _check_spec(experiment, spec, root, color)
    settings, command = options.settings(experiment, spec), ("codra", *sys.argv[1:])
    if trial is None:
        _report(experiment, settings, root, options, command)
    else:
        runner = options.runner()
        _run_alone(_trial_named(trial, experiment, settings, runner, command), settings, runner, command)


def _run_all(known_experiments: Mapping[str, Experiment], options: _Options, color: Colour) -> None:
    """Run all experiments, one after the other. Specs are checked before the first trial."""
    specs = {name: _spec_and_root(None, experiment.world) for name, experiment in known_experiments.items()}
    for name, experiment in known_experiments.items():
        _check_spec(experiment, *specs[name], color)
    for number, (name, experiment) in enumerate(known_experiments.items(), 1):
        say(f"{number} of {len(known_experiments)}: {name}")
        spec, root = specs[name]
        own_options = replace(options, out=options.out and options.out / name)
        command = ["codra", *(name if argument == _ALL else argument for argument in sys.argv[1:])]
        if own_options.out is not None:
            command += ["--out", str(own_options.out)]  # the last `--out` counts
        _report(experiment, own_options.settings(experiment, spec), root, own_options, command)


def _spec_and_root(spec: Path | None, world: str) -> tuple[Path, Path]:
    """Return the spec under test and its project, from which the robot's own perception functions are imported."""
    (spec,) = existing([spec or Path("specs") / f"{world}.yaml"])
    root = common_root([spec])
    if str(root) not in sys.path:
        sys.path.append(str(root))
    return spec, root


def _check_spec(experiment: Experiment, spec: Path, root: Path, color: Colour) -> None:
    """Print the findings about a spec, and end the command if the experiment cannot use the spec."""
    from codra_papers.experiments.campaign.experiment import World

    plan = one_plan(spec, root, color)
    if experiment.world is World.LAB:
        require_lab_spec(plan.checked.spec)


def _known_experiments() -> Mapping[str, Experiment]:
    """Return a mapping from names to experiments, after importing everything that experiments and reports need."""
    from codra_papers.experiments.interrupts import interrupts_held_back

    try:
        with interrupts_held_back():  # some libraries, while they are loaded, turn an interrupt into another error
            from codra_papers.experiments.campaign import provenance, results  # noqa: F401
            from codra_papers.experiments.campaign.registry import experiments

            return experiments()
    except ModuleNotFoundError as error:
        say(missing_package_text("experiment", error, "codra-papers", "lab"))
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


def _trial_named(
    name: str, experiment: Experiment, settings: Settings, runner: Runner, command: Sequence[str]
) -> AnyTrial:
    """Return a trial by its name.

    If no first trial has this name, the first trials are run, because further trials depend on their outcomes.
    """
    from codra_dsl.language.diagnostics import suggest

    trials_by_name = {trial.name: trial for trial in _trials(experiment, settings)}
    if name not in trials_by_name and experiment.then is not None:
        outcomes = _outcomes([*trials_by_name.values()], settings.folder, runner, _TrialProgress(), command)
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


def _run_alone(trial: AnyTrial, settings: Settings, runner: Runner, command: Sequence[str]) -> None:
    outcome = _outcomes([trial], settings.folder, runner, _TrialProgress(), command)[trial.name]
    end_text = f", ended by: {outcome.error}" if outcome.error else ""
    write_result(
        f"trial '{trial.name}' (seed {trial.seed}): {outcome.duration_s:.1f} s, {outcome.loops} loops{end_text}\n"
    )


def _report(experiment: Experiment, settings: Settings, root: Path, options: _Options, command: Sequence[str]) -> None:
    """Run the trials that have no record, judge all outcomes, and write the report."""
    from codra_papers.experiments.campaign.campaign import cores
    from codra_papers.experiments.campaign.provenance import Provenance, revision_of, versions
    from codra_papers.experiments.campaign.results import write_results
    from codra_papers.experiments.campaign.trial_records import code_digest

    revision = revision_of(root, settings.folder)
    trials = _trials(experiment, settings)
    trial_progress = _TrialProgress()
    runner = options.runner()
    outcomes = _outcomes(trials, settings.folder, runner, trial_progress, command)
    reused_trial_count = trial_progress.reused_trial_count()
    if further_trials := _further_trials(experiment, settings, outcomes):
        trials = [*trials, *further_trials]
        outcomes = {**outcomes, **_outcomes(further_trials, settings.folder, runner, trial_progress, command)}
        reused_trial_count += trial_progress.reused_trial_count()
    provenance = Provenance(
        command=shlex.join(command),
        spec=settings.spec.absolute().relative_to(root).as_posix(),
        versions=versions(),
        code=code_digest(),
        revision=revision,
        seeds=sorted({trial.seed for trial in trials}),
        cores=cores(),
        processes=options.processes or cores(),
        cluster=options.cluster,
        elapsed_s=trial_progress.elapsed_s(),
        reused_trial_count=reused_trial_count,
    )
    with _reporting_errors(settings.folder, trial_progress):
        document = experiment.judge(settings, outcomes)
        if settings.is_quick:
            document = replace(document, summary=(_quick_note(experiment, outcomes), *document.summary))
        paths = write_results(settings.folder, experiment, document, outcomes, provenance)
    write_result("".join(f"{sentence}\n" for sentence in document.summary))
    say("\n".join(path.as_posix() for path in paths))


def _quick_note(experiment: Experiment, outcomes: Mapping[str, AnyOutcome]) -> str:
    return (
        f"This is a quick report with few trials ({len(outcomes)}). It shows effects with wide intervals or none; "
        f"'codra experiment {experiment.name}' makes the complete report."
    )


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
    trials: Sequence[AnyTrial],
    folder: Path,
    runner: Runner,
    trial_progress: _TrialProgress,
    command: Sequence[str],
) -> Mapping[str, AnyOutcome]:
    from codra_papers.experiments.campaign.campaign import run_campaign

    with _reporting_errors(folder, trial_progress, command), _progress_bar(trial_progress) as show:
        return run_campaign(trials, folder, run=runner, progress=show)


@contextmanager
def _reporting_errors(folder: Path, trial_progress: _TrialProgress, command: Sequence[str] = ()) -> Iterator[None]:
    """End the command with a message if an error or an interrupt ends the block that runs trials or writes results."""
    from codra_dsl.integrations.inspection import SpecError
    from codra_papers.experiments.campaign.campaign import CampaignBusyError
    from codra_papers.experiments.campaign.workers import ClusterError, TrialError

    code = ExitCode.FAILED
    try:
        yield
        return
    except KeyboardInterrupt:
        code, message = ExitCode.INTERRUPTED, f"interrupted; {trial_progress.kept_text()}"
    except TrialError as error:
        message = f"{error}{_help_text(error, command)}"
    except ClusterError as error:
        message = f"{error}; {trial_progress.kept_text()}"
    except (CampaignBusyError, SpecError) as error:
        message = str(error)
    except BrokenPipeError:
        raise
    except OSError as error:
        message = f"cannot write to '{folder}': {error.strerror or error}; {trial_progress.kept_text()}"
    say(f"codra: {message}")
    raise typer.Exit(code)


def _help_text(error: TrialError, command: Sequence[str]) -> str:
    details_text = f"; the traceback is in '{error.details}'" if error.details else ""
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
