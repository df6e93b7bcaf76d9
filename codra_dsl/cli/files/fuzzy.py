"""`codra fuzzy`: check and draw fuzzy engines in the language of FuzzyLite, without a spec."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.arguments import QuickCommand
from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    choose_by_ending,
    existing,
    missing_package_text,
    say,
    say_findings,
    write_result,
)
from codra_dsl.cli.files.checking import Report, command_group, count_text, root_of_files
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, OutputOption
from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.language.fuzzy.model import Engine, Variable

MAX_DRAWN_VARIABLES = 30
"""The maximum number of variables in a picture."""

MAX_DRAWN_TERMS = 1_000
"""The maximum number of terms in a picture."""

EngineFiles = Annotated[list[Path], typer.Argument(metavar="FILE", help="Files of engines in FLL.", show_default=False)]
VariableOption = Annotated[
    list[str] | None,
    typer.Option(
        "--variable",
        metavar="NAME",
        help="Draw only this variable. The option may be repeated.",
        show_default=False,
    ),
]


class EnginePictureFormat(StrEnum):
    """The formats of pictures of engines."""

    SVG = "svg"
    PNG = "png"


EnginePictureOption = Annotated[
    EnginePictureFormat | None,
    typer.Option(
        "--format",
        help="The format of the picture.  [default: chosen by the ending of FILE, else svg]",
        show_default=False,
    ),
]
_FORMAT_BY_ENDING = {
    "": EnginePictureFormat.SVG,
    ".svg": EnginePictureFormat.SVG,
    ".png": EnginePictureFormat.PNG,
}

fuzzy_commands = command_group()


@fuzzy_commands.callback()
def _fuzzy() -> None:
    """Check and draw fuzzy engines in the language of FuzzyLite 6 and 5, without a spec."""


@fuzzy_commands.command("check", cls=QuickCommand)
def check_command(
    files: EngineFiles,
    *,
    format_: FindingsFormat = None,
    output: OutputOption = None,
    fail_on: FailOnOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Check files of fuzzy engines."""
    checked = _read_engines(files)
    report = Report(
        command="codra fuzzy",
        paths=files,
        root=checked.root,
        format=format_,
        output=output,
        fail_on=fail_on,
        colour=color,
    )
    report.finish(checked.diagnostics, checked.files, count_text(len(checked.engines), "engine"))


@fuzzy_commands.command("draw", cls=QuickCommand)
def draw_command(
    files: EngineFiles,
    *,
    variable: VariableOption = None,
    format_: EnginePictureOption = None,
    output: OutputOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Draw the terms of the variables of engines; findings go to standard error."""
    picture_format = format_ or choose_by_ending(output, _FORMAT_BY_ENDING, "picture")
    try:
        from codra_dsl.integrations.inspection.fuzzy_pictures import memberships_picture
    except ModuleNotFoundError as error:
        from codra_dsl.tooling.installation import DSL

        say(missing_package_text("codra fuzzy draw", error, DSL, "viz"))
        raise typer.Exit(ExitCode.FAILED) from error
    checked = _read_engines(files)
    say_findings(checked.diagnostics, checked.root, color)
    variables = _drawable_variables(checked.engines, variable or ())
    if not variables:
        say("codra: there is no variable to draw")
        raise typer.Exit(ExitCode.FAILED)
    write_result(memberships_picture(variables, picture_format.value), output)


@dataclass(frozen=True, slots=True, kw_only=True)
class _CheckedEngines:
    """Engines that were read, and the findings.

    Attributes:
        root: the folder to which the files are relative.
    """

    root: Path
    files: tuple[str, ...]
    engines: tuple[Engine, ...]
    diagnostics: tuple[Diagnostic, ...]


def _read_engines(paths: Sequence[Path]) -> _CheckedEngines:
    from codra_dsl.language.fuzzy import read_fll
    from codra_dsl.language.load.yaml.findings import Findings
    from codra_dsl.language.load.yaml.source import read
    from codra_dsl.language.project import relative_path, root_of

    paths = list(dict.fromkeys(existing(paths)))
    root = root_of_files(paths)
    findings = Findings()
    diagnostics: list[Diagnostic] = []
    engines: list[Engine] = []
    names = [relative_path(path, root) for path in paths]
    for path, name in zip(paths, names, strict=True):
        source = read(path, name, root_of(path), findings, texts=None)
        if source is not None:
            result = read_fll(source.text.encode(), name)
            diagnostics += result.findings
            engines += [] if result.engine is None else [result.engine]
    return _CheckedEngines(
        root=root, files=tuple(sorted(names)), engines=tuple(engines), diagnostics=(*findings.all(), *diagnostics)
    )


def _drawable_variables(engines: Sequence[Engine], names: Sequence[str]) -> list[Variable]:
    """Return the variables with these names, or all variables. Report variables that cannot be drawn.

    An unknown name, or too many variables, is a usage error.
    """
    all_variables = [variable for engine in engines for variable in engine.variables]
    unknown_name = next((name for name in names if name not in {variable.name for variable in all_variables}), None)
    if unknown_name is not None:
        raise typer.BadParameter(f"there is no variable '{unknown_name}'", param_hint="--variable")
    variables = []
    for variable in all_variables:
        if names and variable.name not in names:
            continue
        if 0.0 < variable.maximum - variable.minimum < float("inf"):
            variables.append(variable)
        else:
            say(f"codra: '{variable.name}' is not drawn: its range must be finite and not empty")
    if len(variables) > MAX_DRAWN_VARIABLES or sum(len(variable.terms) for variable in variables) > MAX_DRAWN_TERMS:
        message = f"a picture has at most {MAX_DRAWN_VARIABLES} variables and {MAX_DRAWN_TERMS:,} terms: choose some"
        raise typer.BadParameter(message, param_hint="--variable")
    return variables
