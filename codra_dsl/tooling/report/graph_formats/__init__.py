"""The formats of `codra graph`: each module of this package declares one format as `FORMAT`.

A new module needs no registration: the choices of `--format`, the endings of `--output` and the error messages come
from `FORMATS`. Importing these modules must be fast, because the command line reads the choices at every start.
Therefore each module imports its renderer inside its `render` function.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING

from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph

ShowMessage = Callable[[str], None]
"""Shows one line to the user. The line is not part of the result."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphFormat:
    """One format of a dependency graph.

    Attributes:
        name: the choice of `--format`.
        endings: endings of file names that choose this format, in lower case.
        render: returns the text of a graph, given the complete graph and the picture of it, in which elements may be
            folded. It may show messages, and raises `codra_dsl.tooling.report.dot.DrawingError` if the picture cannot
            be drawn on this machine.
        is_picture: whether people look at the format, so that large graphs are folded.
    """

    name: str
    endings: tuple[str, ...]
    render: Callable[[Graph, Graph, ShowMessage], str]
    is_picture: bool = True


def _find_formats() -> Mapping[str, GraphFormat]:
    """Return the format of each module of this package by its name, in alphabetical order."""
    modules = [import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    formats: list[GraphFormat] = [module.FORMAT for module in modules]
    return {
        graph_format.name: graph_format for graph_format in sorted(formats, key=lambda graph_format: graph_format.name)
    }


FORMATS = _find_formats()
"""All formats by name."""

DEFAULT_FORMAT = FORMATS["dot"]
"""The format if neither `--format` nor the ending of a file chooses one."""


def format_by_ending() -> Mapping[str, GraphFormat]:
    """Return all formats by the endings of file names."""
    return {ending: graph_format for graph_format in FORMATS.values() for ending in graph_format.endings}
