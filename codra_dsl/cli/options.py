"""The arguments and options that commands share, declared for typer."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from codra_dsl.cli.console import Colour, FailOn, Format
from codra_dsl.language.project import project_of
from codra_dsl.regular_files import leads_into, real_path

__all__ = [
    "ColourOption",
]

Specs = Annotated[
    list[Path],
    typer.Argument(metavar="PATH", help="Spec files, or folders with specs.", show_default=False),
]
SpecsOrText = Annotated[
    list[Path],
    typer.Argument(
        metavar="PATH",
        help="Spec files, or folders with specs; - reads one spec from standard input.",
        show_default=False,
        allow_dash=True,
    ),
]
SitesOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--site",
        metavar="FILE",
        help="Use the values of this site. The option may be repeated for sites of other specs.",
        show_default=False,
    ),
]
FindingsFormat = Annotated[
    Format | None,
    typer.Option(
        "--format",
        help="How findings are shown.  [default: full; github if GITHUB_ACTIONS is true and there is no --output]",
        show_default=False,
    ),
]
FailOnOption = Annotated[
    FailOn | None,
    typer.Option(
        "--fail-on",
        help="The least severity that makes the command fail.  [default: fail-on in pyproject.toml, else error]",
        show_default=False,
    ),
]
NoCacheOption = Annotated[
    bool, typer.Option("--no-cache", help="Do not use stored results, and do not store the result (.codra_cache).")
]
TimingsOption = Annotated[
    bool, typer.Option("--timings", help="Show on standard error how long each stage took. The cache is not used.")
]
ColourOption = Annotated[Colour, typer.Option("--color", help="When to colour; NO_COLOR is respected.")]


def check_writable(output: Path | None) -> Path | None:
    """Refuse a path that cannot be written, before any work is done.

    An existing YAML file is refused as well, because it may be a spec, which would be overwritten. A link that leads
    out of the project is refused, because it may be part of the change that is checked.
    """
    if output is None:
        return None
    if {output.suffix, real_path(output).suffix} & {".yaml", ".yml"} and output.exists():
        raise typer.BadParameter(f"'{output}' exists and may be a spec: choose a name with another ending")
    project = project_of(output.parent) if output.is_symlink() else None
    if project is not None and not leads_into(output, project):
        raise typer.BadParameter(f"'{output}' is a link that leads out of the project: choose another name")
    if output.is_dir():
        raise typer.BadParameter(f"'{output}' is a folder: name a file")
    if not output.parent.is_dir():
        raise typer.BadParameter(f"the folder '{output.parent}' does not exist")
    if not os.access(output if output.exists() else output.parent, os.W_OK):
        raise typer.BadParameter(f"'{output}' cannot be written: check its permissions")
    return output


OutputOption = Annotated[
    Path | None,
    typer.Option(
        "--output", metavar="FILE", help="Write the result to this file.", show_default=False, callback=check_writable
    ),
]
