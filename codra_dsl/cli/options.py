"""The arguments and options that commands share, as typer reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from codra_dsl.cli.console import Colour, FailOn, Format

Specs = Annotated[
    list[Path],
    typer.Argument(metavar="PATH", help="Spec files, or folders whose specs are all taken.", show_default=False),
]
SpecsOrText = Annotated[
    list[Path],
    typer.Argument(
        metavar="PATH",
        help="Spec files, or folders whose specs are all taken; - reads one spec from standard input.",
        show_default=False,
        allow_dash=True,
    ),
]
FindingsFormat = Annotated[Format, typer.Option("--format", help="How findings are shown.")]
FailOnOption = Annotated[FailOn, typer.Option("--fail-on", help="The least severity that makes the command fail.")]
ColourOption = Annotated[Colour, typer.Option("--color", help="When to colour; NO_COLOR is respected.")]
Output = Annotated[
    Path | None, typer.Option("--output", metavar="FILE", help="Write the result to this file.", show_default=False)
]
