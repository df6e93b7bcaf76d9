"""`codra init`: create a new project. Existing files are kept."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from codra_dsl.cli.console import ExitCode, say, write_result
from codra_dsl.regular_files import real_path

Folder = Annotated[
    Path,
    typer.Argument(metavar="DIR", help="The project's folder, created if missing.  [default: .]", show_default=False),
]
Name = Annotated[
    str | None,
    typer.Option("--name", metavar="NAME", help="The spec's name.  [default: from the folder]", show_default=False),
]


def init_command(folder: Folder = Path(), *, name: Name = None) -> None:
    """Start a project that passes lint, compiles and runs its tests. Existing files are not changed."""
    from codra_dsl.tooling.installation import requirement
    from codra_dsl.tooling.scaffold import conflicts, starter_texts, write_new_files

    project_name = _choose_project_name(folder, name)
    if folder.exists() and not folder.is_dir():
        raise typer.BadParameter(f"'{folder}' is not a folder", param_hint="DIR")
    texts = starter_texts(project_name, requirement())
    existing_paths = conflicts(texts, folder)
    if existing_paths:
        _refuse(existing_paths, folder, project_name)
    try:
        write_new_files(texts, folder)
    except OSError as error:
        say(f"codra: cannot write '{error.filename}': {error.strerror}; nothing was written")
        raise typer.Exit(ExitCode.FAILED) from error
    say(f"{project_name}: {len(texts)} files written")
    write_result(_next_commands(folder, project_name))
    _warn_of_repository(folder)


def _choose_project_name(folder: Path, name: str | None) -> str:
    from codra_dsl.tooling.scaffold import ImproperNameError, name_from_folder, require_name

    try:
        return name_from_folder(real_path(folder).name) if name is None else require_name(name)
    except ImproperNameError as error:
        raise typer.BadParameter(str(error), param_hint="DIR" if name is None else "--name") from error


def _refuse(existing_paths: tuple[str, ...], folder: Path, name: str) -> None:
    say("codra: nothing was written, because these files exist already:")
    for path in existing_paths:
        say(f"  {path}")
    say(f"help: move these files away, or start in another folder, e.g.: codra init {shlex.quote(str(folder / name))}")
    raise typer.Exit(ExitCode.FAILED)


def _next_commands(folder: Path, name: str) -> str:
    cd_commands = [f"cd {shlex.quote(str(folder))}"] if real_path(folder) != Path.cwd() else []
    commands = [
        *cd_commands,
        "pip install -r requirements.txt",
        "codra lint specs --fail-on warning",
        "codra compile specs",
        "mypy && pytest",
        f"python {name}_program.py",
    ]
    return "".join(f"{line}\n" for line in ("Next:", *(f"  {command}" for command in commands)))


def _warn_of_repository(folder: Path) -> None:
    """Warn if the project is not at the root of its repository. Other tools find some of its files only at the root."""
    start = real_path(folder)
    if (start / ".git").exists() or not any((above / ".git").exists() for above in start.parents):
        return
    say("The root of the repository is further up: .github/ and .pre-commit-config.yaml have an effect only there.")
