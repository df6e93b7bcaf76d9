"""What the commands for single files share: the root of the files, and the report of a check."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    FailOn,
    Format,
    View,
    choose_failure_threshold,
    choose_format,
    counts_text,
    is_failure,
    say,
)
from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.language.diagnostics import Diagnostic


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """How a check of single files reports its findings.

    Attributes:
        command: the command, such as `codra trees`.
        paths: the requested files and folders.
        root: the folder to which the files in findings are relative.
        fail_on: the requested severity; None for that of the settings.
    """

    command: str
    paths: Sequence[Path]
    root: Path
    format: Format | None
    output: Path | None
    fail_on: FailOn | None
    colour: Colour

    def finish(
        self, diagnostics: Iterable[Diagnostic], files: Sequence[str], content: str, further_files: Iterable[str] = ()
    ) -> NoReturn:
        """Show findings, with the settings of the project and the comments in the files, and exit.

        Args:
            diagnostics: the findings.
            files: the checked files.
            content: what the files contain, such as "2 trees".
            further_files: other files that were read.
        """
        from codra_dsl.language.project import relative_path
        from codra_dsl.workspace.suppression.settings import settings_of
        from codra_dsl.workspace.suppression.suppressions import read_sources, triage

        settings, settings_findings = settings_of(self.root)
        requested = [relative_path(path, self.root) for path in self.paths]
        sources = read_sources([*files, *further_files], requested, self.root)
        findings = triage([*settings_findings, *diagnostics], settings, sources, has_all_findings=False)
        threshold = choose_failure_threshold(self.fail_on, settings.fail_on)
        view = View(
            root=self.root,
            format=choose_format(self.format, self.output),
            colour=self.colour,
            fail_on=threshold,
            title=self.command,
        )
        view.show(findings, files, self.output)
        say(f"{content} in {count_text(len(files), 'file')}: {counts_text(findings)}")
        view.suggest_explain_command(findings)
        raise typer.Exit(ExitCode.FAILED if is_failure(findings, threshold) else ExitCode.CLEAN)


def command_group() -> typer.Typer:
    """Return an empty group of commands; without a command, it shows its help."""
    return typer.Typer(
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )


def root_of_files(paths: Sequence[Path]) -> Path:
    """Return the folder to which the paths of files are relative in findings. The files may be in several projects."""
    from codra_dsl.language.project import root_of

    return Path(os.path.commonpath([root_of(path) for path in paths]))


def count_text(count: int, noun: str) -> str:
    """Return a number with its noun, in the singular or plural."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
