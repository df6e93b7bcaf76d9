"""The commands, and the behaviour that all of them share: exit codes, interruption, broken pipes, and no tracebacks.

A module of a command imports libraries inside the command's function, so that `codra --help` is fast.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
from pathlib import Path
from typing import Annotated, Any

import typer

from codra_dsl.cli.console import ExitCode, say
from codra_dsl.cli.plugins import LazyCommands, PluginGroup
from codra_dsl.isolation.error_text import described

_MAX_SHOWN_NAME = 200

_COMMANDS = {
    "compile": "codra_dsl.cli.compile:compile_command",
    "lint": "codra_dsl.cli.lint:lint_command",
    "explain": "codra_dsl.cli.explain:explain_command",
    "graph": "codra_dsl.cli.graph:graph_command",
    "run": "codra_dsl.cli.run:run_commands",
    "sweep": "codra_dsl.cli.sweep:sweep_command",
    "import": "codra_dsl.cli.files.imports:import_command",
    "coverage": "codra_dsl.cli.files.coverage:coverage_command",
    "diff": "codra_dsl.cli.diff:diff_command",
    "init": "codra_dsl.cli.init:init_command",
    "shadow": "codra_dsl.cli.shadow:shadow_command",
    "why": "codra_dsl.cli.why:why_command",
    "replay": "codra_dsl.cli.replay:replay_command",
    "serve": "codra_dsl.cli.running.serve:serve_command",
    "host": "codra_dsl.cli.running.serve:host_command",
    "get": "codra_dsl.cli.running.get:get_command",
    "watch": "codra_dsl.cli.running.get:watch_command",
    "override": "codra_dsl.cli.running.override:override_command",
    "journal": "codra_dsl.cli.journal:journal_commands",
    "trees": "codra_dsl.cli.files.trees:trees_commands",
    "fuzzy": "codra_dsl.cli.files.fuzzy:fuzzy_commands",
    "knowledge": "codra_dsl.cli.files.knowledge:knowledge_commands",
    "language-server": "codra_dsl.cli.editors.language_server:language_server_command",
}
"""The commands in the order in which the help lists them."""


class _Codra(PluginGroup):
    """All commands. Only the module of the command that runs is imported."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = LazyCommands(_COMMANDS)


app = typer.Typer(
    name="codra",
    cls=_Codra,
    help="Declare what context a robot's decisions need; compile it to observers; check it.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(is_requested: bool) -> None:
    if is_requested:
        from codra_dsl import __version__

        typer.echo(f"codra {__version__}")
        raise typer.Exit


@app.callback()
def _codra(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Declare what context a robot's decisions need; compile it to observers; check it."""


def command_line() -> int:
    """Run the command line and return its exit code. A closed pipe gives no error message."""
    # Where it is installed, jsonschema imports it for a format that our schema does not have; that takes seconds.
    sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]
    _replace_closed_streams()
    _escape_unencodable_characters()
    try:
        code = _run_app()
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes standard output at exit
        if not isinstance(error, BrokenPipeError):
            print(f"codra: cannot write: {error.strerror}", file=sys.stderr)
        code = ExitCode.FAILED
    return code


def _run_app() -> int:
    try:
        app(prog_name="codra")
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else ExitCode.FAILED if error.code else ExitCode.CLEAN
    except BrokenPipeError:
        raise
    except OSError as error:
        if isinstance(error, FileNotFoundError) and not _current_folder_exists():
            say("codra: the current folder does not exist any more: change to another folder")
            return ExitCode.USAGE
        if error.errno == errno.ENOSPC:
            raise
        say(f"codra: {_system_error_text(error)}")
        return ExitCode.FAILED
    except MemoryError:
        say("codra: there is not enough memory")
        return ExitCode.FAILED
    except Exception as error:  # noqa: BLE001 - reported as a bug of codra
        say(f"codra: internal error: {described(error)} ({_last_place(error)})")
        say("This is a bug of codra, not of your spec. Please report it with the spec that shows it.")
        return ExitCode.INTERNAL
    return ExitCode.CLEAN


def _system_error_text(error: OSError) -> str:
    """Return one line about an error of the operating system: the file, if there is one, and the reason."""
    reason = error.strerror or str(error) or type(error).__name__
    if error.filename is None:
        return f"the system refuses an operation: {reason}"
    name = ascii(os.fsdecode(error.filename))[1:-1] if isinstance(error.filename, str | bytes) else str(error.filename)
    shown_name = name if len(name) <= _MAX_SHOWN_NAME else f"...{name[-_MAX_SHOWN_NAME:]}"
    return f"cannot access '{shown_name}': {reason}"


def _current_folder_exists() -> bool:
    try:
        return Path.cwd().exists()
    except FileNotFoundError:
        return False


def _last_place(error: Exception) -> str:
    """Return the file and line within codra where an error occurred."""
    package = Path(__file__).parents[1]
    frames = traceback.extract_tb(error.__traceback__)
    own_frames = [frame for frame in frames if Path(frame.filename).is_relative_to(package)]
    if not own_frames:
        return "outside codra"
    return f"{Path(own_frames[-1].filename).relative_to(package.parent).as_posix()}:{own_frames[-1].lineno}"


def _replace_closed_streams() -> None:
    """Replace each closed stream by an empty one, or one that discards everything. In Python, it would be None."""
    if sys.stdin is None:
        sys.stdin = Path(os.devnull).open(encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:
        sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115


def _escape_unencodable_characters() -> None:
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")
