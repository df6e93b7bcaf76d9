"""`codra sweep`: what the rules of a spec make of an input over its range, and which rule is behind each switch."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import Colour, ExitCode, common_root, existing, one_plan, say, write_result
from codra_dsl.cli.options import ColourOption, Output

if TYPE_CHECKING:
    from codra_dsl.integrations.inspection.sweep_pictures import Axis
    from codra_dsl.integrations.inspection.sweeps import Subject
    from codra_dsl.language.model import Variable
    from codra_dsl.runtime.values.conditions import Value


class SweepFormat(StrEnum):
    """How a sweep is shown."""

    TEXT = "text"
    JSON = "json"
    SVG = "svg"


SpecFile = Annotated[Path, typer.Argument(metavar="SPEC", help="The spec whose rules are asked.", show_default=False)]
Vary = Annotated[
    list[str] | None,
    typer.Option(
        "--vary",
        metavar="NAME[=VALUES]",
        help="The input that is varied: 'x=0.3..6', 'x=0.3 m..600 cm', 'x=1,2,5', or 'x' for all that it can be; "
        "two of them give surfaces, as svg.  [default: the inputs are listed]",
        show_default=False,
    ),
]
With = Annotated[
    list[str] | None,
    typer.Option(
        "--with", metavar="NAME=VALUE", help="What another input is; without it, unknown.", show_default=False
    ),
]
Steps = Annotated[int, typer.Option("--steps", min=1, max=1000, help="Between both ends of a range.")]
Course = Annotated[
    str | None,
    typer.Option(
        "--course",
        metavar="NAME",
        help="The course whose actions are weighed, of several.",
        show_default=False,
    ),
]
FormatOption = Annotated[
    SweepFormat | None,
    typer.Option(
        "--format", help="How it is shown.  [default: what the ending of FILE says, else text]", show_default=False
    ),
]
_MOST_VARIED = 2


def sweep_command(
    spec: SpecFile,
    *,
    vary: Vary = None,
    with_: With = None,
    steps: Steps = 24,
    course: Course = None,
    format_: FormatOption = None,
    output: Output = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Vary what fuzzy rules read: where the course switches, by which rule, and whether each metric is monotone."""
    how = format_ or _asked_by(output)
    (spec,) = existing([spec])
    if len(vary or ()) > _MOST_VARIED:
        raise typer.BadParameter(f"at most {_MOST_VARIED} inputs are varied at once", param_hint="--vary")
    if len(vary or ()) == _MOST_VARIED and how is not SweepFormat.SVG:
        raise typer.BadParameter("two inputs are drawn: add --format svg, or vary one", param_hint="--vary")
    root = common_root([spec])
    plan = one_plan(spec, root, color)
    from codra_dsl.integrations.inspection.sweeps import SweepError, subject

    sys.path.append(str(root))
    with tempfile.TemporaryDirectory(prefix="codra-") as made:
        try:
            asked = subject(plan, Path(made), course)
        except SweepError as error:
            raise typer.BadParameter(str(error), param_hint="SPEC" if course is None else "--course") from error
        write_result(_shown(asked, vary or (), with_ or (), steps, how), output)


def _asked_by(output: Path | None) -> SweepFormat:
    """Return the form that the name of a file asks for."""
    endings = {"": SweepFormat.TEXT, ".txt": SweepFormat.TEXT, ".json": SweepFormat.JSON, ".svg": SweepFormat.SVG}
    ending = "" if output is None else output.suffix.lower()
    if ending not in endings:
        message = f"no form of a sweep ends in '{ending}': say --format, or take one of .txt, .json, .svg"
        raise typer.BadParameter(message, param_hint="--output")
    return endings[ending]


def _shown(subject: Subject, vary: Sequence[str], said: Sequence[str], steps: int, how: SweepFormat) -> str | bytes:
    from codra_dsl.integrations.inspection.sweeps import SweepError, held, varied

    try:
        known = held(subject, said)
    except SweepError as error:
        raise typer.BadParameter(str(error), param_hint="--with") from error
    try:
        inputs = [varied(subject, each, steps) for each in vary]
    except SweepError as error:
        raise typer.BadParameter(str(error), param_hint="--vary") from error
    for variable, _ in inputs:
        if known[variable.name] is not None or [each.name for each, _ in inputs].count(variable.name) > 1:
            message = f"'{variable.name}' is varied: say nothing else of it"
            raise typer.BadParameter(message, param_hint="--vary")
    return _drawn(subject, known, inputs, steps) if how is SweepFormat.SVG else _told(subject, known, inputs, how)


def _told(
    subject: Subject,
    known: dict[str, Value | None],
    inputs: Sequence[tuple[Variable, Sequence[Value]]],
    how: SweepFormat,
) -> str:
    from codra_dsl.integrations.inspection.sweeps import inputs_json, inputs_text, sweep_json
    from codra_dsl.runtime.loops.sweep import sweep

    if not inputs:
        return inputs_json(subject) if how is SweepFormat.JSON else inputs_text(subject)
    ((variable, values),) = inputs
    found = sweep(subject.model, subject.course, known, variable.name, values, unit=variable.type.unit or "")
    return sweep_json(found) if how is SweepFormat.JSON else f"{found}\n"


def _drawn(
    subject: Subject,
    known: dict[str, Value | None],
    inputs: Sequence[tuple[Variable, Sequence[Value]]],
    steps: int,
) -> bytes:
    try:
        from codra_dsl.integrations.inspection.sweep_pictures import memberships_svg, surfaces_svg, sweep_svg
    except ModuleNotFoundError as error:
        say(f"codra: '--format svg' needs {error.name}: pip install 'codra-dsl[viz]'")
        raise typer.Exit(ExitCode.FAILED) from error
    from codra_dsl.integrations.inspection.sweeps import varied
    from codra_dsl.runtime.loops.sweep import surface, sweep

    axes = [_axis(subject, variable, values) for variable, values in inputs]
    if len(inputs) == _MOST_VARIED:
        across, up = ((variable.name, values) for variable, values in inputs)
        return surfaces_svg(surface(subject.model, subject.course, known, across, up), *axes)
    if inputs:
        ((variable, values),) = inputs
        found = sweep(subject.model, subject.course, known, variable.name, values, unit=variable.type.unit or "")
        return sweep_svg(found, axes[0])
    worded = [name for name in subject.inputs if (terms := subject.terms(name)) is not None and not terms.members]
    if not worded:
        say(f"codra: no input of '{subject.name}' has terms of its own: there is nothing to draw without --vary")
        raise typer.Exit(ExitCode.FAILED)
    return memberships_svg([_axis(subject, *varied(subject, name, steps)) for name in worded])


def _axis(subject: Subject, variable: Variable, values: Sequence[Value]) -> Axis:
    from codra_dsl.integrations.inspection.sweep_pictures import Axis

    terms = subject.terms(variable.name)
    return Axis(variable=variable.name, unit=variable.type.unit or "", values=values, terms=terms)
