"""Arguments that are converted without pydantic have the values that typer gives them."""

from __future__ import annotations

from enum import Enum, StrEnum
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer._click import Command, Context
from typer.core import TyperCommand
from typer.main import get_command

from codra_dsl.cli.app import app
from codra_dsl.cli.arguments import Parameter
from codra_dsl.cli.plugins import command_of

COMMANDS = (
    "compile",
    "lint",
    "explain",
    "graph",
    "run",
    "sweep",
    "diff",
    "init",
    "shadow",
    "why",
    "replay",
    "override",
)


def parameters_of(command: Command) -> list[Parameter]:
    parameters = command.get_params(Context(command))
    return [parameter for parameter in parameters if isinstance(parameter, Parameter) and parameter.name != "help"]


def values_for(parameter: Parameter, folder: Path) -> list[Any]:
    """Return values that the parser, the environment or the declaration can give to a parameter."""
    words = ["", "-", "x", "json", "FULL", "auto", "1", "true", "a\0b", str(folder), str(folder / "missing/file")]
    if parameter.multiple or parameter.nargs == -1:
        return [None, (), *((word,) for word in words), tuple(words[3:5]), "not a tuple"]
    return [None, True, False, *words, parameter.default]


def outcome(process: Any, value: Any) -> tuple[type, Any]:
    try:
        result = process(Context(TyperCommand("x")), value)
    except typer.TyperException as error:
        return type(error), str(error)
    return type(result), [(type(item), item) for item in result] if isinstance(result, list | tuple) else result


@pytest.mark.parametrize("name", COMMANDS)
def test_a_value_is_converted_or_refused_as_typer_does(name: str, tmp_path: Path) -> None:
    group = get_command(app)
    command = group.get_command(Context(group), name)  # type: ignore[attr-defined]  # of groups
    for parameter in parameters_of(command):
        for value in values_for(parameter, tmp_path):
            expected = outcome(type(parameter).process_value.__get__(parameter), value)

            assert outcome(parameter.process_value, value) == expected


class Size(StrEnum):
    SMALL = "small"
    LARGE = "large"

    @classmethod
    def _missing_(cls, _: object) -> Size:
        return cls.LARGE


def plugin_command(  # noqa: PLR0917 - what typer offers to the commands of other distributions
    word: Annotated[str, typer.Option(parser=lambda value: f"<{value}>")] = "a",
    words: Annotated[list[str] | None, typer.Option(parser=lambda value: f"<{value}>")] = None,
    folder: Annotated[Path, typer.Option(parser=lambda value: Path(f"<{value}>"))] = Path(),
    existing: Annotated[Path, typer.Option(exists=True, allow_dash=True)] = Path(),
    size: Size = Size.SMALL,
    sizes: list[Size] | None = None,
    pair: tuple[str, str] = ("a", "b"),
) -> None:
    """Do nothing."""


def test_a_value_of_another_distributions_command_is_converted_or_refused_as_typer_does(tmp_path: Path) -> None:
    for parameter in parameters_of(command_of(plugin_command, "plugin")):
        for value in [*values_for(parameter, tmp_path), ("x", "small")]:
            expected = outcome(type(parameter).process_value.__get__(parameter), value)

            assert outcome(parameter.process_value, value) == expected


def test_every_choice_of_a_command_is_converted_to_its_member() -> None:
    group = get_command(app)
    command = group.get_command(Context(group), "lint")  # type: ignore[attr-defined]  # of groups
    choices = [parameter for parameter in parameters_of(command) if parameter.type_descriptor.is_choice]
    assert {parameter.name for parameter in choices} == {"format_", "fail_on", "color"}
    for parameter in choices:
        for member in parameter.type_descriptor.choices or ():
            assert isinstance(member, Enum)
            assert parameter.process_value(Context(command), member.value) is member
