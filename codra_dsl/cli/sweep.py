"""`codra sweep`: show the outputs of a spec's rules over the range of an input, and the rule behind each switch."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    choose_by_ending,
    common_root,
    existing,
    missing_package_text,
    one_plan,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, OutputOption
from codra_dsl.tooling.installation import DSL

if TYPE_CHECKING:
    from codra_dsl.integrations.inspection.sweep_pictures import Axis
    from codra_dsl.integrations.inspection.sweeps import Subject
    from codra_dsl.language.model import Variable
    from codra_dsl.runtime.loops.sweep import Sweep
    from codra_dsl.runtime.values.conditions import Value


class SweepFormat(StrEnum):
    """The formats of a sweep."""

    TEXT = "text"
    JSON = "json"
    SVG = "svg"


SpecFile = Annotated[Path, typer.Argument(metavar="SPEC", help="The spec with the rules.", show_default=False)]
VaryOption = Annotated[
    list[str] | None,
    typer.Option(
        "--vary",
        metavar="NAME[=VALUES]",
        help="The input that is varied: 'x=0.3..6', 'x=0.3 m..600 cm', 'x=1,2,5', or 'x' for its complete range; "
        "with two of these options, surfaces are drawn, as svg.  [default: list the inputs]",
        show_default=False,
    ),
]
WithOption = Annotated[
    list[str] | None,
    typer.Option(
        "--with", metavar="NAME=VALUE", help="The value of another input.  [default: unknown]", show_default=False
    ),
]
StepsOption = Annotated[int, typer.Option("--steps", min=1, max=1000, help="The number of steps in a range.")]
CourseOption = Annotated[
    str | None,
    typer.Option(
        "--course",
        metavar="NAME",
        help="The course whose actions are weighed, if the spec has several courses.",
        show_default=False,
    ),
]
FormatOption = Annotated[
    SweepFormat | None,
    typer.Option("--format", help="The format.  [default: from the ending of FILE, else text]", show_default=False),
]
_FORMAT_BY_ENDING = {
    "": SweepFormat.TEXT,
    ".txt": SweepFormat.TEXT,
    ".json": SweepFormat.JSON,
    ".svg": SweepFormat.SVG,
}
_MAX_VARIED_INPUTS = 2


def sweep_command(
    spec: SpecFile,
    *,
    vary: VaryOption = None,
    with_: WithOption = None,
    steps: StepsOption = 24,
    course: CourseOption = None,
    format_: FormatOption = None,
    output: OutputOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Vary inputs of fuzzy rules: show where and by which rule the course switches, and if each metric is monotone."""
    chosen_format = format_ or choose_by_ending(output, _FORMAT_BY_ENDING, "sweep format")
    (spec,) = existing([spec])
    if len(vary or ()) > _MAX_VARIED_INPUTS:
        raise typer.BadParameter(f"at most {_MAX_VARIED_INPUTS} inputs can be varied at once", param_hint="--vary")
    if len(vary or ()) == _MAX_VARIED_INPUTS and chosen_format is not SweepFormat.SVG:
        raise typer.BadParameter(
            "two inputs can only be drawn: add --format svg, or vary only one", param_hint="--vary"
        )
    root = common_root([spec])
    plan = one_plan(spec, root, color)
    from codra_dsl.integrations.inspection.sweeps import SweepError, subject

    sys.path.append(str(root))
    with tempfile.TemporaryDirectory(prefix="codra-") as temporary_folder:
        try:
            sweep_subject = subject(plan, Path(temporary_folder), course)
        except SweepError as error:
            raise typer.BadParameter(str(error), param_hint="SPEC" if course is None else "--course") from error
        write_result(_render(sweep_subject, vary or (), with_ or (), steps, chosen_format), output)


def _render(
    subject: Subject, vary: Sequence[str], value_options: Sequence[str], steps: int, sweep_format: SweepFormat
) -> str | bytes:
    from codra_dsl.integrations.inspection.sweeps import SweepError, check_given, held, needed, varied

    try:
        input_values = held(subject, value_options)
        given_names = [name for name, value in input_values.items() if value is not None]
        check_given(subject, given_names)
    except SweepError as error:
        raise typer.BadParameter(str(error), param_hint="--with") from error
    try:
        varied_inputs = [varied(subject, vary_option, steps) for vary_option in vary]
        given_names += [variable.name for variable, _ in varied_inputs]
        check_given(subject, given_names)
    except SweepError as error:
        raise typer.BadParameter(str(error), param_hint="--vary") from error
    for variable, _ in varied_inputs:
        if (
            input_values[variable.name] is not None
            or [other_variable.name for other_variable, _ in varied_inputs].count(variable.name) > 1
        ):
            message = f"'{variable.name}' is varied: give it only once, and not with --with"
            raise typer.BadParameter(message, param_hint="--vary")
    input_values = needed(subject, input_values, given_names)
    return (
        _draw(subject, input_values, varied_inputs, steps)
        if sweep_format is SweepFormat.SVG
        else _render_text(subject, input_values, varied_inputs, sweep_format)
    )


def _render_text(
    subject: Subject,
    input_values: dict[str, Value | None],
    varied_inputs: Sequence[tuple[Variable, Sequence[Value]]],
    sweep_format: SweepFormat,
) -> str:
    from codra_dsl.integrations.inspection.sweeps import inputs_json, inputs_text, sweep_json

    if not varied_inputs:
        return inputs_json(subject) if sweep_format is SweepFormat.JSON else inputs_text(subject)
    sweep_result = _sweep(subject, input_values, *varied_inputs[0])
    return sweep_json(sweep_result) if sweep_format is SweepFormat.JSON else f"{sweep_result}\n"


def _sweep(
    subject: Subject, input_values: dict[str, Value | None], variable: Variable, values: Sequence[Value]
) -> Sweep:
    from codra_dsl.runtime.loops.sweep import sweep

    unit = variable.type.unit or ""
    arguments = (subject.model, subject.course, input_values, variable.name, values)
    return sweep(*arguments, unit=unit, variables=subject.variables)


def _draw(
    subject: Subject,
    input_values: dict[str, Value | None],
    varied_inputs: Sequence[tuple[Variable, Sequence[Value]]],
    steps: int,
) -> bytes:
    try:
        from codra_dsl.integrations.inspection.sweep_pictures import memberships_svg, surfaces_svg, sweep_svg
    except ModuleNotFoundError as error:
        say(missing_package_text("--format svg", error, DSL, "viz"))
        raise typer.Exit(ExitCode.FAILED) from error
    from codra_dsl.integrations.inspection.sweeps import varied
    from codra_dsl.runtime.loops.sweep import surface

    axes = [_axis(subject, variable, values) for variable, values in varied_inputs]
    if len(varied_inputs) == _MAX_VARIED_INPUTS:
        horizontal_input, vertical_input = ((variable.name, values) for variable, values in varied_inputs)
        inputs = (input_values, horizontal_input, vertical_input)
        rows = surface(subject.model, subject.course, *inputs, variables=subject.variables)
        return surfaces_svg(rows, *axes)
    if varied_inputs:
        return sweep_svg(_sweep(subject, input_values, *varied_inputs[0]), axes[0])
    input_names = [name for name in subject.inputs if (terms := subject.terms(name)) is not None and not terms.members]
    if not input_names:
        say(f"codra: no input of '{subject.name}' has terms of its own: use --vary to draw something")
        raise typer.Exit(ExitCode.FAILED)
    return memberships_svg([_axis(subject, *varied(subject, name, steps)) for name in input_names])


def _axis(subject: Subject, variable: Variable, values: Sequence[Value]) -> Axis:
    from codra_dsl.integrations.inspection.sweep_pictures import Axis

    terms = subject.terms(variable.name)
    return Axis(variable=variable.name, unit=variable.type.unit or "", values=values, terms=terms)
