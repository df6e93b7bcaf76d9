"""`codra run`: run the observers of a spec in a world that another distribution provides."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from codra_dsl.cli.arguments import QuickCommand
from codra_dsl.cli.console import Colour, ExitCode, common_root, existing, one_plan, pip_install, say
from codra_dsl.cli.options import ColourOption
from codra_dsl.cli.plugins import WORLDS_GROUP, command_of, find_plugins, load_plugin
from codra_dsl.cli.worlds import Pace, RunRequest, World
from codra_dsl.tooling.installation import PAPERS

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
        autocompletion=lambda: list(find_plugins(WORLDS_GROUP)),
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


class _RunCommand(QuickCommand):
    """The command `run`, with the options of the world that its arguments name."""

    def make_context(self, info_name: str | None, args: list[str], parent: Context | None = None, **extra: Any) -> Any:
        """Parse the arguments with the options of the world, or else with the options that all worlds have."""
        world_name = _world_name_in(args)
        entry_point = find_plugins(WORLDS_GROUP).get(world_name or "")
        if world_name is None or entry_point is None:
            return super().make_context(info_name, args, parent, **extra)
        command = command_of(_make_command_function(load_plugin(entry_point), world_name), self.name or "run")
        try:
            return command.make_context(info_name, args, parent, **extra)
        except typer.TyperException as error:
            if not hasattr(error, "possibilities"):  # only the error for an unknown option has this attribute
                raise
            option, similar_options = getattr(error, "option_name", ""), getattr(error, "possibilities", None)
            hint = f": did you mean {' or '.join(sorted(similar_options))}?" if similar_options else ""
            message = f"the world '{world_name}' has no such option{hint}"
            raise typer.BadParameter(message, ctx=getattr(error, "ctx", None), param_hint=option) from error


run_commands = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)


@run_commands.command("run", cls=_RunCommand)
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
    _refuse_world(world)


def _refuse_world(world: str | None) -> NoReturn:
    """Exit with an error: no world is installed, no world was chosen, or the chosen world is not installed."""
    world_names = list(find_plugins(WORLDS_GROUP))
    if not world_names:
        say(f"codra: 'run' needs a world, but no world is installed: {pip_install(PAPERS, 'lab,store')} adds two")
        raise typer.Exit(ExitCode.FAILED)
    if world is None:
        raise typer.BadParameter(f"several worlds exist: choose one of {', '.join(world_names)}", param_hint="--world")
    from codra_dsl.language.diagnostics import suggest

    similar_name = suggest(world, world_names)
    hint = f"did you mean '{similar_name}'?" if similar_name else f"the installed worlds are {', '.join(world_names)}"
    raise typer.BadParameter(f"the world '{world}' is not installed: {hint}", param_hint="--world")


def _world_name_in(args: Sequence[str]) -> str | None:
    """Return the name of the world in the arguments, or else of the default world; None if there is no default."""
    arguments = list(args[: args.index("--")] if "--" in args else args)
    for index, argument in reversed(list(enumerate(arguments))):
        if argument == "--world" and index + 1 < len(arguments):
            return arguments[index + 1]
        if argument.startswith("--world="):
            return argument.removeprefix("--world=")
    installed_worlds = find_plugins(WORLDS_GROUP)
    return (
        _DEFAULT_WORLD
        if _DEFAULT_WORLD in installed_worlds
        else next(iter(installed_worlds))
        if len(installed_worlds) == 1
        else None
    )


def _make_command_function(world: World, world_name: str) -> Callable[..., None]:
    """Return the command function for a world. It has the options of every world and those of this world only."""
    _, *world_parameters = inspect.signature(world, eval_str=True).parameters.values()
    shared_parameters = inspect.signature(run_command, eval_str=True).parameters
    if duplicates := [parameter.name for parameter in world_parameters if parameter.name in shared_parameters]:
        say(f"codra: the world '{world_name}' declares options that all worlds already have: {', '.join(duplicates)}")
        raise typer.Exit(ExitCode.FAILED)

    def run_in_world(**arguments: Any) -> None:
        options = {parameter.name: arguments.pop(parameter.name) for parameter in world_parameters}
        del arguments["world"]
        world(_make_request(**arguments), **options)

    parameters = [
        *shared_parameters.values(),
        *(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in world_parameters),
    ]
    run_in_world.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # typer reads it
    run_in_world.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    worlds_text = f"Installed worlds: {', '.join(find_plugins(WORLDS_GROUP))}."
    run_in_world.__doc__ = (
        f"{inspect.getdoc(run_command)}\n\nThe world '{world_name}': {inspect.getdoc(world) or ''}\n\n{worlds_text}"
    )
    return run_in_world


def _make_request(
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
