"""`codra trees`: check, draw and convert files of BehaviorTree.CPP, without a spec."""

from __future__ import annotations

import os
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.arguments import QuickCommand
from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    View,
    choose_failure_threshold,
    choose_format,
    counts_text,
    existing,
    is_failure,
    say,
    say_findings,
    write_result,
)
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, OutputOption

if TYPE_CHECKING:
    from codra_dsl.language.behavior_trees.folders import CheckedFiles
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.workspace.suppression.settings import Settings

TreePaths = Annotated[
    list[Path],
    typer.Argument(
        metavar="PATH",
        help="Files of trees; or folders, whose files may use the trees of each other without include.",
        show_default=False,
    ),
]
ModelsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--models",
        metavar="FILE",
        help="Read declarations of nodes from the TreeNodesModel of this file. The option may be repeated.",
        show_default=False,
    ),
]
TreeOption = Annotated[
    list[str] | None,
    typer.Option("--tree", metavar="ID", help="Draw only this tree. The option may be repeated.", show_default=False),
]


class PictureFormat(StrEnum):
    """The formats of pictures of trees."""

    DOT = "dot"
    MERMAID = "mermaid"
    SVG = "svg"


PictureFormatOption = Annotated[
    PictureFormat | None,
    typer.Option(
        "--format",
        help="The format of the picture.  [default: chosen by the ending of FILE, else dot]",
        show_default=False,
    ),
]
_FORMAT_BY_ENDING = {
    "": PictureFormat.DOT,
    ".dot": PictureFormat.DOT,
    ".mmd": PictureFormat.MERMAID,
    ".svg": PictureFormat.SVG,
}

trees_commands = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@trees_commands.callback()
def _trees() -> None:
    """Check, draw and convert behavior trees of BehaviorTree.CPP, without a spec."""


@trees_commands.command("check", cls=QuickCommand)
def check_command(
    paths: TreePaths,
    *,
    models: ModelsOption = None,
    format_: FindingsFormat = None,
    output: OutputOption = None,
    fail_on: FailOnOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Check files of trees. Nothing that they name is run."""
    from codra_dsl.workspace.suppression.settings import settings_of

    root, checked_files = _check(paths, models or ())
    settings, settings_findings = settings_of(root)
    diagnostics = _triage([*settings_findings, *checked_files.diagnostics], settings, checked_files, paths, root)
    threshold = choose_failure_threshold(fail_on, settings.fail_on)
    files = sorted({file.file for forest in checked_files.forests for file in forest.files[:1]})
    view = View(root=root, format=choose_format(format_, output), colour=color, fail_on=threshold, title="codra trees")
    view.show(diagnostics, files, output)
    tree_count = sum(len(forest.files[0].trees) for forest in checked_files.forests)
    say(f"{_count_text(tree_count, 'tree')} in {_count_text(len(files), 'file')}: {counts_text(diagnostics)}")
    view.suggest_explain_command(diagnostics)
    raise typer.Exit(ExitCode.FAILED if is_failure(diagnostics, threshold) else ExitCode.CLEAN)


@trees_commands.command("graph", cls=QuickCommand)
def graph_command(
    paths: TreePaths,
    *,
    models: ModelsOption = None,
    tree: TreeOption = None,
    format_: PictureFormatOption = None,
    output: OutputOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Draw trees. Trees with errors are drawn as far as they can be read; findings go to standard error."""
    from codra_dsl.tooling.report.dot import DrawingError
    from codra_dsl.tooling.report.tree_pictures import picture_of

    picture_format = _picture_format(output) if format_ is None else format_
    root, checked_files = _check(paths, models or ())
    say_findings(checked_files.diagnostics, root, color)
    ids = [tree.id for forest in checked_files.forests for tree in forest.trees]
    unknown_id = next((name for name in tree or () if name not in ids), None)
    if unknown_id is not None:
        raise typer.BadParameter(f"there is no tree '{unknown_id}'", param_hint="--tree")
    if not ids:
        raise typer.Exit(ExitCode.FAILED)
    picture = picture_of(checked_files.forests, tree or ())
    try:
        match picture_format:
            case PictureFormat.DOT:
                text = picture.dot()
            case PictureFormat.MERMAID:
                text = picture.mermaid()
            case PictureFormat.SVG:
                text = picture.svg()
    except DrawingError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
    write_result(text, output)


@trees_commands.command("convert", cls=QuickCommand)
def convert_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of trees.", show_default=False)],
    *,
    output: OutputOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Write a file of trees as version 4: converted from version 3, escaped, and in the layout of codra."""
    from codra_dsl.language.behavior_trees import read, write
    from codra_dsl.language.behavior_trees.version3 import ONLY_IN_VERSION_3
    from codra_dsl.language.diagnostics import has_errors
    from codra_dsl.language.project import root_of

    (file,) = existing([file])
    root = root_of(file)
    forest, diagnostics = read(file, root)
    say_findings(diagnostics, root, color)
    if forest is None or has_errors(diagnostics):
        say(f"'{file}' is not converted: correct its errors first")
        raise typer.Exit(ExitCode.FAILED)
    nodes = {node.id for tree in forest.files[0].trees for node in tree.root.walk()}
    if old_nodes := sorted(nodes & ONLY_IN_VERSION_3):
        say(f"'{file}' is not converted: version 4 has no {', '.join(old_nodes)}; write Precondition with a script")
        raise typer.Exit(ExitCode.FAILED)
    write_result(write(forest.files[0]).encode(), output)


def _check(paths: Sequence[Path], models: Sequence[Path]) -> tuple[Path, CheckedFiles]:
    """Return the folder to which paths in findings are relative, and the checked files."""
    from codra_dsl.language.behavior_trees.folders import check_files
    from codra_dsl.language.project import root_of

    paths, models = existing(paths), existing(models)
    root = Path(os.path.commonpath([root_of(path) for path in paths]))
    checked_files = check_files(paths, models, root)
    if not (checked_files.forests or checked_files.diagnostics):
        raise typer.BadParameter(f"there is no file of trees in '{paths[0]}' or below", param_hint="PATH")
    return root, checked_files


def _triage(
    diagnostics: Sequence[Diagnostic],
    settings: Settings,
    checked_files: CheckedFiles,
    paths: Sequence[Path],
    root: Path,
) -> tuple[Diagnostic, ...]:
    """Apply the project's settings and the comments in the files to findings."""
    from codra_dsl.language.project import relative_path
    from codra_dsl.workspace.suppression.suppressions import read_sources, triage

    files = {file.file for forest in checked_files.forests for file in forest.files}
    sources = read_sources(files, [relative_path(path, root) for path in paths], root)
    return triage(diagnostics, settings, sources, has_all_findings=False)


def _picture_format(output: Path | None) -> PictureFormat:
    ending = "" if output is None else output.suffix.lower()
    if ending not in _FORMAT_BY_ENDING:
        endings_text = ", ".join(filter(None, _FORMAT_BY_ENDING))
        message = f"no picture has the ending '{ending}': use --format, or one of {endings_text}"
        raise typer.BadParameter(message, param_hint="--output")
    return _FORMAT_BY_ENDING[ending]


def _count_text(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
