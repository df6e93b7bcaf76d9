"""`codra import`: draft a spec from a main execution that a team already has."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import Colour, ExitCode, existing, say, say_findings, write_result
from codra_dsl.cli.options import ColourOption

if TYPE_CHECKING:
    from codra_dsl.tooling.main_execution.model import MainExecution

SourceArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SOURCE",
        help="A Python file, a file or folder of behavior trees, or the folder of a RAFCON state machine.",
        show_default=False,
    ),
]
ModelsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--models",
        metavar="FILE",
        help="Read declarations of nodes of trees from this file. The option may be repeated.",
        show_default=False,
    ),
]


def import_command(
    source: SourceArgument,
    *,
    name: Annotated[str, typer.Option("--as", metavar="NAME", help="The name of the spec.", show_default=False)],
    models: ModelsOption = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            metavar="FILE",
            help="Write the spec to this new file.  [default: specs/NAME.yaml; - is standard output]",
            show_default=False,
            allow_dash=True,
        ),
    ] = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Draft a spec from the decisions of a main execution. Nothing of it is imported or run."""
    from codra_dsl.tooling.main_execution.draft import TO_DO, draft
    from codra_dsl.tooling.scaffold import ImproperNameError, conflicts, require_name, write_new_files

    try:
        require_name(name)
    except ImproperNameError as error:
        raise typer.BadParameter(str(error), param_hint="--as") from error
    main_execution = read_decisions(source, models or (), color)
    file = output or Path("specs", f"{name}.yaml")
    text = draft(main_execution, name, str(source))
    _check_draft(text, file, color)
    if file == Path("-"):
        write_result(text.encode())
    elif conflicts([file.name], file.parent):
        say(f"codra: '{file}' exists already, so nothing was written: name another file with --output")
        raise typer.Exit(ExitCode.FAILED)
    else:
        try:
            write_new_files({file.name: text}, file.parent)
        except OSError as error:
            say(f"codra: cannot write '{file}': {error.strerror}")
            raise typer.Exit(ExitCode.FAILED) from error
    variables, skills = len(main_execution.by_variable()), len(main_execution.skill_places)
    say(
        f"{name}: {_count_text(variables, 'variable')}, {_count_text(skills, 'skill')}, "
        f"{_count_text(text.count(f'# {TO_DO}:'), 'comment')} '{TO_DO}'"
    )


def read_decisions(source: Path, models: Sequence[Path], colour: Colour, root: Path | None = None) -> MainExecution:
    """Return the decisions of a source. Errors, and a source without decisions, are shown and end the command.

    Places are relative to `root`, or else to the root of the source's project.
    """
    from codra_dsl.language.project import root_of
    from codra_dsl.tooling.main_execution.sources import read_source

    (source,), models = existing([source]), existing(models)
    root = root or root_of(source)
    main_execution, findings = read_source(source, models, root)
    say_findings(findings, root, colour)
    if main_execution is None:
        raise typer.Exit(ExitCode.FAILED)
    if not main_execution.decisions:
        kinds = "no branch on the result of a call, no condition of a tree, and no state that decides"
        say(f"'{source}' has no decision: {kinds}")
        raise typer.Exit(ExitCode.FAILED)
    return main_execution


def _check_draft(text: str, file: Path, colour: Colour) -> None:
    """Lint a draft, as it will be linted in its place. A draft with errors is not written."""
    from codra_dsl.compiler import plan_text
    from codra_dsl.language.diagnostics import has_errors
    from codra_dsl.language.project import relative_path, root_of

    root = root_of(file.absolute().parent)
    findings = plan_text(text, relative_path(file, root), root).diagnostics
    if has_errors(findings):
        say_findings(findings, root, colour)
        raise typer.Exit(ExitCode.FAILED)


def _count_text(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
