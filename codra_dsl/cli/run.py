"""`codra run`: run the observers of a spec in a world that another distribution provides."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand

from codra_dsl.cli.console import Colour, ExitCode, common_root, existing, one_plan, say
from codra_dsl.cli.options import ColourOption
from codra_dsl.cli.plugins import PAPERS, WORLDS, command_of, load_plugin, plugins
from codra_dsl.cli.worlds import Pace, RunRequest, World

if TYPE_CHECKING:
    from typer._click import Context

SpecFile = Annotated[Path, typer.Argument(metavar="SPEC", help="The spec to run.", show_default=False)]
WorldOption = Annotated[
    str | None,
    typer.Option(
        "--world",
        metavar="NAME",
        help="The world in which the spec runs; `codra run --world NAME --help` shows the options of that world.  "
        "[default: lab, or the only world that is installed]",
        show_default=False,
        autocompletion=lambda: list(plugins(WORLDS)),
    ),
]
Seed = Annotated[int, typer.Option("--seed", help="The seed of all random choices.")]
Duration = Annotated[
    str | None,
    typer.Option("--for", metavar="DURATION", help="The duration, e.g. '10 min'.  [default: the world decides]"),
]
PaceOption = Annotated[Pace, typer.Option("--pace", help="How time passes: fast in simulated time, or in real time.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="The folder for pictures and records.  [default: the world decides]"),
]
JournalOption = Annotated[
    Path | None,
    typer.Option("--journal", metavar="FILE", help="Write the run's journal, an MCAP file.", show_default=False),
]

_DEFAULT_WORLD = "lab"


class RunCommand(TyperCommand):
    """The command `run`, with the options of the world that its arguments name."""

    def make_context(self, info_name: str | None, args: list[str], parent: Context | None = None, **extra: Any) -> Any:
        """Parse the arguments with the options of the world. Without a world, parse only the options of all worlds."""
        name = _world_in(args)
        entry_point = plugins(WORLDS).get(name or "")
        if name is None or entry_point is None:
            return super().make_context(info_name, args, parent, **extra)
        command = command_of(_with_options_of(load_plugin(entry_point), name), self.name or "run")
        try:
            return command.make_context(info_name, args, parent, **extra)
        except typer.TyperException as error:
            if not hasattr(error, "possibilities"):  # only the error for an unknown option has this attribute
                raise
            option, near = getattr(error, "option_name", ""), getattr(error, "possibilities", None)
            help_ = f": did you mean {' or '.join(sorted(near))}?" if near else ""
            message = f"the world '{name}' has no such option{help_}"
            raise typer.BadParameter(message, ctx=getattr(error, "ctx", None), param_hint=option) from error


def run_command(
    spec: SpecFile,
    *,
    world: WorldOption = None,
    seed: Seed = 1,
    for_: Duration = None,
    pace: PaceOption = Pace.FAST,
    out: Out = None,
    journal: JournalOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Run a spec in a simulated world and print the results, compared with the ground truth."""
    del spec, seed, for_, pace, out, journal, color  # without a world, the arguments are not used
    _refuse(world)


def _refuse(world: str | None) -> NoReturn:
    """Exit with an error: no world is installed, no world was chosen, or the chosen world is not installed."""
    known = list(plugins(WORLDS))
    if not known:
        say(f"codra: 'run' needs a world, but no world is installed: pip install '{PAPERS}[lab,store]' adds two")
        raise typer.Exit(ExitCode.FAILED)
    if world is None:
        raise typer.BadParameter(f"several worlds exist: choose one of {', '.join(known)}", param_hint="--world")
    from codra_dsl.language.diagnostics import suggest

    near = suggest(world, known)
    help_ = f"did you mean '{near}'?" if near else f"the installed worlds are {', '.join(known)}"
    raise typer.BadParameter(f"the world '{world}' is not installed: {help_}", param_hint="--world")


def _world_in(args: Sequence[str]) -> str | None:
    """Return the name of the world in the arguments, or else of the default world; None if there is no default."""
    options = list(args[: args.index("--")] if "--" in args else args)
    for index, option in reversed(list(enumerate(options))):
        if option == "--world" and index + 1 < len(options):
            return options[index + 1]
        if option.startswith("--world="):
            return option.removeprefix("--world=")
    known = plugins(WORLDS)
    return _DEFAULT_WORLD if _DEFAULT_WORLD in known else next(iter(known)) if len(known) == 1 else None


def _with_options_of(world: World, name: str) -> Callable[..., None]:
    """Return the command function for a world. It has the options of all worlds, and those of this world."""
    _, *own = inspect.signature(world, eval_str=True).parameters.values()
    shared = inspect.signature(run_command, eval_str=True).parameters
    if taken := [parameter.name for parameter in own if parameter.name in shared]:
        say(f"codra: the world '{name}' declares options that all worlds already have: {', '.join(taken)}")
        raise typer.Exit(ExitCode.FAILED)

    def command(**given: Any) -> None:
        options = {parameter.name: given.pop(parameter.name) for parameter in own}
        del given["world"]
        world(_request(**given), **options)

    parameters = [*shared.values(), *(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in own)]
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # typer reads it
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    worlds = f"Installed worlds: {', '.join(plugins(WORLDS))}."
    command.__doc__ = f"{inspect.getdoc(run_command)}\n\nThe world '{name}': {inspect.getdoc(world) or ''}\n\n{worlds}"
    return command


def _request(
    *,
    spec: Path,
    seed: int,
    for_: str | None,
    pace: Pace,
    out: Path | None,
    journal: Path | None,
    color: Colour,
) -> RunRequest:
    """Return the run that the command line requests, with the build plan of the spec."""
    duration_s = None if for_ is None else _duration_s(for_)
    (spec,) = existing([spec])
    root = common_root([spec])
    plan = one_plan(spec, root, color)
    sys.path.append(str(root))  # the robot's own perception functions may be beside its specs
    return RunRequest(plan=plan, root=root, seed=seed, duration_s=duration_s, pace=pace, out=out, journal=journal)


def _duration_s(text: str) -> float:
    from codra_dsl.language.units import parse_duration

    duration_s = parse_duration(text)
    if not isinstance(duration_s, float) or not 0 < duration_s < float("inf"):
        raise typer.BadParameter(f"'{text}' is not a duration such as '90 s' or '10 min'", param_hint="--for")
    return duration_s
