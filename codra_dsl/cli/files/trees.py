"""`codra trees`: check, draw and convert files of BehaviorTree.CPP, without a spec."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.arguments import QuickCommand
from codra_dsl.cli.console import Colour, ExitCode, choose_by_ending, existing, say, say_findings, write_result
from codra_dsl.cli.files.checking import Report, command_group, count_text, root_of_files
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, OutputOption

if TYPE_CHECKING:
    from codra_dsl.language.behavior_trees.folders import CheckedFiles

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

trees_commands = command_group()


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
    root, checked_files = _check(paths, models or ())
    files = sorted({forest.files[0].file for forest in checked_files.forests})
    other_files = {file.file for forest in checked_files.forests for file in forest.files[1:]}
    tree_count = sum(len(forest.files[0].trees) for forest in checked_files.forests)
    report = Report(
        command="codra trees",
        paths=paths,
        root=root,
        format=format_,
        output=output,
        fail_on=fail_on,
        colour=color,
    )
    report.finish(checked_files.diagnostics, files, count_text(tree_count, "tree"), other_files)


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

    picture_format = format_ or choose_by_ending(output, _FORMAT_BY_ENDING, "picture")
    root, checked_files = _check(paths, models or ())
    say_findings(checked_files.diagnostics, root, color)
    ids = [tree.id for forest in checked_files.forests for tree in forest.trees]
    unknown_id = next((name for name in tree or () if name not in ids), None)
    if unknown_id is not None:
        raise typer.BadParameter(f"there is no tree '{unknown_id}'", param_hint="--tree")
    if not ids:
        say("codra: there is no tree to draw")
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

    paths, models = existing(paths), existing(models)
    root = root_of_files(paths)
    checked_files = check_files(paths, models, root)
    if not (checked_files.forests or checked_files.diagnostics):
        raise typer.BadParameter(f"there is no file of trees in '{paths[0]}' or below", param_hint="PATH")
    return root, checked_files
