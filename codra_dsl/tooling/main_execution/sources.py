"""Sources of `codra import`: which kind a path is, and its decisions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from codra_dsl.language.diagnostics import Diagnostic, Place, Severity, Span
from codra_dsl.language.project import relative_path, root_of
from codra_dsl.tooling.main_execution.model import MainExecution, SourceError
from codra_dsl.tooling.main_execution.python_source import read_python
from codra_dsl.tooling.main_execution.rafcon import MACHINE_FILE, read_rafcon
from codra_dsl.tooling.main_execution.trees import read_trees

_ENDING_OF_PYTHON = ".py"
_ENDING_OF_TREES = ".xml"
_HELP = "name a Python file (.py), behavior trees (.xml, or a folder of them), or the folder of a RAFCON state machine"


def read_source(path: Path, models: Sequence[Path], root: Path) -> tuple[MainExecution | None, tuple[Diagnostic, ...]]:
    """Return the decisions of a main execution, or None with the errors that prevent reading it. Nothing is run.

    Args:
        path: a Python file; a file of trees, or a folder with such files; the folder of a RAFCON state machine.
        models: files whose `TreeNodesModel` declares nodes of the trees.
        root: the folder to which paths in places are relative.
    """
    try:
        if path.suffix == _ENDING_OF_PYTHON:
            return read_python(path, root, root_of(path)), ()
        if (path / MACHINE_FILE).is_file():
            return read_rafcon(path, root, root_of(path)), ()
        if path.is_dir() or path.suffix == _ENDING_OF_TREES:
            main_execution, findings = read_trees([path], models, root)
            errors = tuple(finding for finding in findings if finding.severity is Severity.ERROR)
            return (None if errors else main_execution), errors
        message = f"'{relative_path(path, root)}' is no source of decisions that codra reads"
        place = Place(Span(relative_path(path, root), 1, 1, 1, 1))
        raise SourceError(message, place, help=_HELP)
    except SourceError as error:
        return None, (error.finding,)
