"""What a new project is called: its spec, its generated package and the modules beside it have this name."""

from __future__ import annotations

import keyword
import re

from codra_dsl.language.expression import FUNCTIONS
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.names import MAX_NAME, is_identifier

_OUTSIDE = re.compile(r"[^A-Za-z0-9]+")


class ImproperNameError(ValueError):
    """A name that no spec may have; the message says why, and the way out."""


def require_name(name: str) -> str:
    """Return a name that a spec may have as it is.

    Raises:
        ImproperNameError: for any other.
    """
    if not is_identifier(name):
        better = _near(name)
        help = f"write {better}" if better else f"for example {_EXAMPLE}"
        raise ImproperNameError(f"{shown(name)} {_reason(name)}: {help}")
    return name


def name_from_folder(folder: str) -> str:
    """Return the name that the name of a folder gives: `my-robot` gives `my_robot`.

    Raises:
        ImproperNameError: if it gives none.
    """
    name = _near(folder)
    if name is None:
        raise ImproperNameError(f"the folder's name {shown(folder)} gives no name: add --name, for example {_EXAMPLE}")
    return name


_EXAMPLE = "--name gripper"


def _near(name: str) -> str | None:
    """Return the name that a spec may have and that looks like this one, or None."""
    near = _OUTSIDE.sub("_", name).strip("_") if name.isascii() else ""
    return next((each for each in (near, f"{near}_robot") if near and is_identifier(each)), None)


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
        else ("is no name: names hold only letters A to Z, digits and '_', and begin with a letter")
    )
