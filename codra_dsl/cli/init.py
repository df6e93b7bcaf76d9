"""`codra init`: a new project, beside what is there already."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from codra_dsl.cli.console import ExitCode, say, write_result

Folder = Annotated[
    Path,
    typer.Argument(metavar="DIR", help="Where the project goes; made if missing.  [default: here]", show_default=False),
]
Name = Annotated[
    str | None, typer.Option("--name", metavar="NAME", help="Of the spec.  [default: the folder's]", show_default=False)
]


def init_command(folder: Folder = Path(), *, name: Name = None) -> None:
    """Start a project which lints, compiles and runs its tests at once. Nothing that is there is touched."""
    from codra_dsl.tooling.scaffold import conflicts, installed_requirement, starter_texts, write_new

    chosen = _chosen(folder, name)
    if folder.exists() and not folder.is_dir():
        raise typer.BadParameter(f"'{folder}' is no folder", param_hint="DIR")
    texts = starter_texts(chosen, installed_requirement())
    taken = conflicts(texts, folder)
    if taken:
        _refuse(taken, folder, chosen)
    try:
        write_new(texts, folder)
    except OSError as error:
        say(f"codra: cannot write '{error.filename}': {error.strerror}; nothing was written")
        raise typer.Exit(ExitCode.FAILED) from error
    say(f"{chosen}: {len(texts)} files written")
    write_result(_next_commands(folder, chosen))
    _warn_of_repository(folder)


def _chosen(folder: Path, name: str | None) -> str:
    from codra_dsl.tooling.scaffold import ImproperNameError, name_from_folder, require_name

    try:
        return name_from_folder(folder.resolve().name) if name is None else require_name(name)
    except ImproperNameError as error:
        raise typer.BadParameter(str(error), param_hint="DIR" if name is None else "--name") from error


def _refuse(taken: tuple[str, ...], folder: Path, name: str) -> None:
    say("codra: nothing was written, because these are there already:")
    for path in taken:
        say(f"  {path}")
    say(f"help: move them away, or start in a folder of its own, such as: codra init {shlex.quote(str(folder / name))}")
    raise typer.Exit(ExitCode.FAILED)


def _next_commands(folder: Path, name: str) -> str:
    there = [f"cd {shlex.quote(str(folder))}"] if folder.resolve() != Path.cwd() else []
    commands = [
        *there,
        "pip install -r requirements.txt",
        "codra lint specs --fail-on warning",
        "codra compile specs",
        "mypy && pytest",
        f"python {name}_program.py",
    ]
    return "".join(f"{line}\n" for line in ("Next:", *(f"  {command}" for command in commands)))


def _warn_of_repository(folder: Path) -> None:
    """Say what is read only at the root of a git repository, where the project lies deeper."""
    start = folder.resolve()
    if (start / ".git").exists() or not any((above / ".git").exists() for above in start.parents):
        return
    say("The repository begins further up: it is there that .github/ and .pre-commit-config.yaml are read.")
