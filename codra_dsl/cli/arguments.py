"""Convert the arguments of commands without pydantic.

typer imports pydantic to convert any argument, which takes a tenth of the time of `codra lint`. So the arguments of
most calls are converted here. typer handles all other arguments and all invalid ones: it gives the same values, and
reports mistakes.
"""

from __future__ import annotations

import os
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from typer.core import TyperArgument, TyperCommand, TyperOption

if TYPE_CHECKING:
    from typer._click import Context
    from typer.models import ParameterInfo

Parameter = TyperArgument | TyperOption


class QuickConversion:
    """Lets a command, or a group of commands, of typer convert usual arguments without pydantic."""

    def get_params(self, ctx: Context) -> list[Any]:
        """Return the parameters of the command, with the option `--help`."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]  # of the command
        for parameter in parameters:
            if isinstance(parameter, Parameter):
                parameter.process_value = partial(_process_value, parameter)  # type: ignore[method-assign]
        return parameters


class QuickCommand(QuickConversion, TyperCommand):
    """A command that converts usual arguments without pydantic."""


def _process_value(parameter: Parameter, context: Context, value: Any) -> Any:
    """Return the value of a parameter for its command."""
    try:
        converted_value = _convert(parameter, value)
    except ValueError:
        return type(parameter).process_value(parameter, context, value)
    return converted_value if parameter.callback is None else parameter.callback(context, parameter, converted_value)


def _convert(parameter: Parameter, value: Any) -> Any:
    """Return a value as typer would convert it.

    Raises:
        ValueError: if typer must convert the value, or report it.
    """
    if parameter.required and parameter.value_is_missing(value):
        raise ValueError
    annotation, info = parameter.type_descriptor.annotation, parameter.type_descriptor.parameter_info
    if info.parser is not None:
        raise ValueError
    if parameter.multiple or parameter.nargs == -1:
        if isinstance(value, str):
            raise ValueError
        item_type = get_args(annotation)[0]
        return () if value is None else [_convert_item(item_type, info, item) for item in value]
    return None if value is None else _convert_item(annotation, info, value)


def _convert_item(item_type: Any, info: ParameterInfo, item: Any) -> Any:
    if item_type in (bool, str, int, float) and type(item) is item_type:  # a number is a default: arguments are texts
        return item
    if isinstance(item_type, type) and issubclass(item_type, StrEnum) and item in list(item_type):
        return item_type(item)
    if item_type is Path and isinstance(item, str) and _is_accepted_path(info, item):
        return Path(item)
    raise ValueError


def _is_accepted_path(info: ParameterInfo, text: str) -> bool:
    """Return whether typer certainly accepts a path. For example, it refuses a file that cannot be read."""
    is_any_path = info.file_okay and info.dir_okay and not (info.writable or info.resolve_path or info.path_type)
    is_dash = info.allow_dash and not info.exists and text == "-"
    return is_any_path and (os.access(text, os.R_OK) or is_dash)
