"""`codra lint`: all findings about some specs."""

from __future__ import annotations

import sys
from pathlib import Path

import typer

from codra_dsl.cli.console import (
    STANDARD_INPUT,
    Colour,
    ExitCode,
    FailOn,
    Format,
    View,
    common_root,
    counted,
    existing,
    fails,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, Output, SpecsOrText


def lint_command(
    paths: SpecsOrText,
    *,
    format_: FindingsFormat = Format.FULL,
    output: Output = None,
    fail_on: FailOnOption = FailOn.ERROR,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Check specs; nothing that they name is imported or run, and nothing is written but FILE."""
    from codra_dsl.compiler import plan_paths, plan_text
    from codra_dsl.load.source import MAX_BYTES

    if paths == [Path(STANDARD_INPUT)]:
        root = common_root([Path.cwd()])
        data = sys.stdin.buffer.read(MAX_BYTES + 1)
        text = data.decode("utf-8", errors="replace")
        planned = plan_text(data, STANDARD_INPUT, root)
    else:
        existing(paths)
        root, text = common_root(paths), None
        planned = plan_paths(paths, root)
    view = View(root=root, format=format_, colour=color, text=text)
    write_result(view.rendered(planned.diagnostics, sys.stdout), output)
    say(counted(planned.diagnostics))
    raise typer.Exit(ExitCode.FAILED if fails(planned.diagnostics, fail_on) else ExitCode.CLEAN)
