"""Commands and worlds of other distributions, found by their entry points.

A command is a function that typer accepts, or a `typer.Typer`, in the entry-point group `codra.commands`. A world is a
function in the group `codra.worlds`. Listing plug-ins does not import them.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from codra_dsl.cli.arguments import QuickCommand, QuickConversion
from codra_dsl.cli.console import ExitCode, say
from codra_dsl.isolation.error_text import described

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from typer._click import Command, Context, HelpFormatter

COMMANDS_GROUP = "codra.commands"
WORLDS_GROUP = "codra.worlds"

_MAX_SUMMARY = 1_000
"""The maximum length of a command's summary in the help. No summary is that long, so none is cut."""


def find_plugins(group: str) -> Mapping[str, EntryPoint]:
    """Return a mapping from the names of a group's entry points to the entry points, sorted by name.

    If several distributions declare the same name, the first of them on the import path is used.
    """
    from importlib.metadata import entry_points  # slow, and most runs need no plug-in

    entry_points_by_name: dict[str, EntryPoint] = {}
    for entry_point in entry_points(group=group):
        entry_points_by_name.setdefault(entry_point.name, entry_point)
    return dict(sorted(entry_points_by_name.items()))


def load_plugin(entry_point: EntryPoint) -> Any:
    """Import a plug-in and return the object that its entry point names. If that fails, print one line and exit."""
    plugin_kind = "command" if entry_point.group == COMMANDS_GROUP else "world"
    try:
        return entry_point.load()
    except Exception as error:
        reason = " ".join(described(error).split())
        say(f"codra: the {plugin_kind} '{entry_point.name}'{_origin_text(entry_point)} cannot be loaded: {reason}")
        raise typer.Exit(ExitCode.FAILED) from error


def _origin_text(entry_point: EntryPoint) -> str:
    return f" from {entry_point.dist.name}" if entry_point.dist is not None else ""


class PluginGroup(QuickConversion, TyperGroup):
    """The commands of `codra` itself, and commands of other distributions, which must have other names."""

    def list_commands(self, ctx: Context) -> list[str]:  # noqa: ARG002  the signature is typer's
        """Return the names of all commands. The commands of `codra` itself are first."""
        own_command_names = list(self.commands)
        return [*own_command_names, *(name for name in find_plugins(COMMANDS_GROUP) if name not in own_command_names)]

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write all commands with their complete summaries, on several lines if necessary."""
        names = self.list_commands(ctx)
        commands = [(name, command) for name in names if (command := self.get_command(ctx, name)) is not None]
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.get_short_help_str(limit=_MAX_SUMMARY)) for name, command in commands])

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        """Return the command with a name. A command of another distribution is imported only when it is run."""
        own_command = super().get_command(ctx, cmd_name)
        if own_command is not None:
            return own_command
        entry_point = find_plugins(COMMANDS_GROUP).get(cmd_name)
        return None if entry_point is None else _PluginCommand(entry_point)


class LazyCommands(UserDict[str, Any]):
    """Commands by name, given by name as `module:object`. A module is imported when its command is looked up."""

    def __getitem__(self, name: str) -> Command:
        """Return a command."""
        module_name, _, object_name = self.data[name].partition(":")
        return command_of(getattr(import_module(module_name), object_name), name)


class _PluginCommand(TyperCommand):
    """A command of another distribution. It is imported when its arguments are parsed."""

    def __init__(self, entry_point: EntryPoint) -> None:
        super().__init__(entry_point.name, help=f"A command{_origin_text(entry_point)}.", rich_markup_mode=None)
        self._entry_point = entry_point

    def make_context(self, info_name: str | None, args: list[str], parent: Context | None = None, **extra: Any) -> Any:
        """Return the context of the imported command."""
        command = command_of(load_plugin(self._entry_point), self._entry_point.name)
        return command.make_context(info_name, args, parent, **extra)


def command_of(plugin: Any, name: str, cls: type[TyperCommand] = QuickCommand) -> Command:
    """Return the command that a function, or a `typer.Typer`, declares."""
    if isinstance(plugin, typer.Typer):
        return get_command(plugin)
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    app.command(name, cls=cls)(plugin)
    return get_command(app)
