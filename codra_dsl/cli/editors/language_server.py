"""`codra language-server`: serve an editor over standard input and output."""

from __future__ import annotations

import typer

from codra_dsl.cli.console import ExitCode, missing_package_text, say
from codra_dsl.tooling.installation import DSL


def language_server_command() -> None:
    """Serve an editor over standard input and output, with the Language Server Protocol. Editors start this command."""
    try:
        from codra_dsl.tooling.language_server.methods import serve
    except ModuleNotFoundError as error:
        say(missing_package_text("codra language-server", error, DSL, "editor"))
        raise typer.Exit(ExitCode.FAILED) from error
    raise typer.Exit(ExitCode.CLEAN if serve() else ExitCode.FAILED)
