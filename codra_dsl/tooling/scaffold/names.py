"""The name of a new project. The spec, the generated package and the project's own modules get this name."""

from __future__ import annotations

import keyword
import re

from codra_dsl.language.expression import FUNCTIONS, MAX_NAME, is_identifier
from codra_dsl.language.expression.tokens import shown

_NON_ALPHANUMERICS = re.compile(r"[^A-Za-z0-9]+")


class ImproperNameError(ValueError):
    """Raised for a name that no spec may have. The message states the reason and how to fix it."""


def require_name(name: str) -> str:
    """Return a name unchanged if a spec may have this name.

    Raises:
        ImproperNameError: if no spec may have this name.
    """
    if not is_identifier(name):
        similar_name = _similar_name(name)
        hint = f"write {similar_name}" if similar_name else f"for example {_OPTION_EXAMPLE}"
        raise ImproperNameError(f"{shown(name)} {_reason(name)}: {hint}")
    return name


def name_from_folder(folder: str) -> str:
    """Return the name of a spec for a folder: `my-robot` gives `my_robot`.

    Raises:
        ImproperNameError: if the folder's name gives no valid name.
    """
    name = _similar_name(folder)
    if name is None:
        raise ImproperNameError(
            f"the folder's name {shown(folder)} gives no name: add --name, for example {_OPTION_EXAMPLE}"
        )
    return name


_OPTION_EXAMPLE = "--name gripper"


def _similar_name(name: str) -> str | None:
    """Return a similar name that a spec may have, or None."""
    similar_name = _NON_ALPHANUMERICS.sub("_", name).strip("_") if name.isascii() else ""
    return next(
        (
            candidate
            for candidate in (similar_name, f"{similar_name}_robot")
            if similar_name and is_identifier(candidate)
        ),
        None,
    )


def _reason(name: str) -> str:
    if keyword.iskeyword(name):
        return "is a keyword of Python"
    if name in FUNCTIONS:
        return "is a function of the condition language"
    if len(name) > MAX_NAME:
        return f"is longer than {MAX_NAME} letters"
    return (
        "is a literal"
        if name in ("true", "false", "null")
        else ("is not a name: a name has only letters A to Z, digits and '_', and begins with a letter")
    )
