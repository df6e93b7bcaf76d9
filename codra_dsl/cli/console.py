"""Functions and types that all commands share: output, colours, exit codes, and the root of the specs."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import typer

from codra_dsl.language.frozen import dataclass
from codra_dsl.regular_files import real_path
from codra_dsl.tooling.installation import missing_package_text, pip_install

if TYPE_CHECKING:
    from codra_dsl.generation.build_plan import BuildPlan
    from codra_dsl.language.diagnostics import Diagnostic, Severity
    from codra_dsl.workspace.timings import Timings

__all__ = [
    "Colour",
    "ExitCode",
    "common_root",
    "existing",
    "made_folder",
    "missing_package_text",
    "one_plan",
    "pip_install",
    "say",
    "writable_journal",
    "write_result",
]


class ExitCode(IntEnum):
    """The exit codes of commands."""

    CLEAN = 0
    FAILED = 1
    USAGE = 2
    INTERNAL = 70
    INTERRUPTED = 130


class Format(StrEnum):
    """The formats of findings."""

    FULL = "full"
    CONCISE = "concise"
    JSON = "json"
    SARIF = "sarif"
    GITHUB = "github"
    JUNIT = "junit"


class Colour(StrEnum):
    """When text is coloured. `auto` means: on a terminal, unless `NO_COLOR` is set or `TERM` is `dumb`."""

    AUTO = "auto"
    ALWAYS = "always"
    NEVER = "never"


class FailOn(StrEnum):
    """The least severity of a finding that makes the command fail."""

    ERROR = "error"
    WARNING = "warning"


STANDARD_INPUT = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The way in which a command shows its findings.

    Attributes:
        root: the folder to which the files in findings are relative.
        text: the text of the spec, if it comes from standard input.
        fail_on: the least severity with which a finding fails a test in a test report.
        title: the command that reports the findings.
    """

    root: Path
    format: Format
    colour: Colour
    text: str | None = None
    fail_on: FailOn = FailOn.ERROR
    title: str = "codra"

    def show(self, diagnostics: Sequence[Diagnostic], files: Iterable[str] = (), output: Path | None = None) -> None:
        """Write all findings of a command to standard output or to a file.

        In the format `github`, also add them to the summary of the step.

        Args:
            diagnostics: the findings, in file order.
            files: the files that were examined, with or without findings.
            output: the file to write; None for standard output.
        """
        write_result(self.render(diagnostics, sys.stdout, files), output)
        if self.format is Format.GITHUB:
            from codra_dsl.tooling.report.github import render_summary

            append_to_summary(render_summary(diagnostics, f"{self.title}: {counts_text(diagnostics)}"))

    def render(self, diagnostics: Sequence[Diagnostic], stream: TextIO, files: Iterable[str] = ()) -> str:
        """Return findings in the requested format. Text has colours if `is_coloured` is true for the stream."""
        match self.format:
            case Format.JSON:
                from codra_dsl.tooling.report.findings import render_json

                return render_json(diagnostics)
            case Format.SARIF:
                from codra_dsl.tooling.report.sarif import render_sarif

                return render_sarif(diagnostics, folder_in_repository(self.root))
            case Format.GITHUB:
                from codra_dsl.tooling.report.github import render_github

                return render_github(diagnostics, folder_in_repository(self.root))
            case Format.JUNIT:
                return self._render_junit(diagnostics, files)
            case _:
                return self._render_text(diagnostics, stream)

    def suggest_explain_command(self, diagnostics: Sequence[Diagnostic]) -> None:
        """Show the command that explains the first error, or the first finding if there are no errors.

        This is shown only in the format `full`, if standard error is a terminal.
        """
        from codra_dsl.language.diagnostics import has_errors

        if diagnostics and self.format is Format.FULL and sys.stderr.isatty():
            first_finding = next((diagnostic for diagnostic in diagnostics if has_errors([diagnostic])), diagnostics[0])
            say(f"to learn more: codra explain {first_finding.code}")

    def _render_text(self, diagnostics: Sequence[Diagnostic], stream: TextIO) -> str:
        from codra_dsl.tooling.report import findings

        palette = findings.COLOURED if is_coloured(self.colour, stream) else findings.PLAIN
        if self.format is Format.CONCISE:
            return text_for_log(findings.render_concise(diagnostics, palette))
        return text_for_log(findings.render_full(diagnostics, self._text_of_file, palette))

    def _render_junit(self, diagnostics: Sequence[Diagnostic], files: Iterable[str]) -> str:
        from codra_dsl.tooling.report.junit import render_junit

        return render_junit(
            diagnostics,
            files,
            self._text_of_file,
            is_failure=lambda diagnostic: is_failure([diagnostic], self.fail_on),
            suite_name=self.title.replace(" ", "."),
        )

    def _text_of_file(self, file: str) -> str | None:
        if file == STANDARD_INPUT:
            return self.text
        from codra_dsl.language.load.yaml.source import MAX_BYTES
        from codra_dsl.regular_files import read_regular_file

        try:
            return read_regular_file(self.root / file, MAX_BYTES, within=self.root).decode("utf-8", errors="replace")
        except OSError:
            return None


def choose_format(requested_format: Format | None, output: Path | None = None) -> Format:
    """Return the requested format of findings, or else the default format.

    The default is `github` in GitHub Actions, if there is no output file; otherwise it is `full`.
    """
    if requested_format is not None:
        return requested_format
    return Format.GITHUB if output is None and _in_github_actions() else Format.FULL


def text_for_log(text: str) -> str:
    """Return a text for standard output. In GitHub Actions, replace texts that the runner would read as commands."""
    if not _in_github_actions():
        return text
    from codra_dsl.tooling.report.github import escape_commands

    return escape_commands(text)


def _in_github_actions() -> bool:
    return os.environ.get("GITHUB_ACTIONS") == "true"


def folder_in_repository(root: Path) -> str:
    """Return the path of a root within the repository that GitHub checked out.

    The path is empty if the root is the folder of the repository or outside of it, or outside of GitHub Actions.
    """
    workspace = os.environ.get("GITHUB_WORKSPACE")
    if not workspace:
        return ""
    try:
        folder = real_path(root).relative_to(real_path(workspace)).as_posix()
    except (OSError, ValueError):
        return ""
    return "" if folder == "." else folder


def append_to_summary(text: str) -> None:
    """Add Markdown to the summary of the current step of GitHub Actions. If that fails, only show a message."""
    path = os.environ.get("GITHUB_STEP_SUMMARY")
    if not path or not text:
        return
    try:
        with Path(path).open("a", encoding="utf-8") as summary:
            summary.write(text)
    except OSError as error:
        say(f"codra: cannot write the summary of the step: {error.strerror}")


def is_coloured(colour: Colour, stream: TextIO) -> bool:
    """Return whether text for a stream is coloured."""
    if colour is not Colour.AUTO:
        return colour is Colour.ALWAYS
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def is_failure(diagnostics: Sequence[Diagnostic], fail_on: FailOn) -> bool:
    """Return whether findings make a command fail."""
    from codra_dsl.language.diagnostics import has_errors

    return has_errors(diagnostics) or (fail_on is FailOn.WARNING and bool(diagnostics))


def choose_failure_threshold(requested_threshold: FailOn | None, configured_severity: Severity) -> FailOn:
    """Return the least severity that makes a command fail: the requested one, or else the one in the settings."""
    return FailOn(configured_severity.value) if requested_threshold is None else requested_threshold


def make_timings(is_enabled: bool) -> Timings:
    """Return the timings of a command. If `is_enabled` is false, they measure nothing."""
    import time

    from codra_dsl.workspace.timings import UNTIMED, Timings

    return Timings(time.perf_counter) if is_enabled else UNTIMED  # noqa: TID251  passed on as an argument


def counts_text(diagnostics: Sequence[Diagnostic]) -> str:
    """Return the numbers of errors and warnings as text."""
    from codra_dsl.language.diagnostics import has_errors

    error_count = sum(has_errors([diagnostic]) for diagnostic in diagnostics)
    counts_and_nouns = ((error_count, "error"), (len(diagnostics) - error_count, "warning"))
    count_texts = [f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in counts_and_nouns if count]
    return ", ".join(count_texts) or "no findings"


def say(text: str, *, is_rendered: bool = False) -> None:
    """Write a message to standard error, after flushing standard output.

    Args:
        text: the message. It may contain names from files of strangers.
        is_rendered: whether the text is the result of `View.render` or of a similar function, and may have colours.
    """
    sys.stdout.flush()
    print(text_for_log(text) if is_rendered else harmless_text(text), file=sys.stderr)


def say_findings(diagnostics: Sequence[Diagnostic], root: Path, colour: Colour) -> None:
    """Write findings with their counts to standard error, if there are any, for a command with another result."""
    if diagnostics:
        text = View(root=root, format=Format.FULL, colour=colour).render(diagnostics, sys.stderr)
        say(f"{text}{counts_text(diagnostics)}", is_rendered=True)


def harmless_text(text: str) -> str:
    """Return a text with names from files of strangers, such as journals, for a terminal or the log of a CI system.

    Characters that a terminal would obey are replaced, and lines that GitHub Actions would obey are changed.
    """
    from codra_dsl.tooling.report.findings import visible_lines

    return text_for_log(visible_lines(text))


def write_result(result: str | bytes, output: Path | None = None) -> None:
    """Write a result to standard output, or to the file `output`. Bytes are written unchanged."""
    encoding = sys.stdout.encoding if output is None else "utf-8"
    data = result.encode(encoding, errors="backslashreplace") if isinstance(result, str) else result
    try:
        if output is not None:
            output.write_bytes(data)
            return
        sys.stdout.flush()
        # With PYTHONUNBUFFERED, a write to a pipe that is closed meanwhile writes only a part, without an error.
        unwritten_data = memoryview(data)
        while unwritten_data:
            unwritten_data = unwritten_data[sys.stdout.buffer.write(unwritten_data) :]
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        if output is not None:
            raise typer.BadParameter(f"cannot write '{output}': {error.strerror}", param_hint="--output") from error
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes standard output at exit
        print(f"codra: cannot write to standard output: {error.strerror}", file=sys.stderr)
        raise typer.Exit(ExitCode.FAILED) from error


def existing(paths: Iterable[Path]) -> list[Path]:
    """Return paths without `..`. A path that does not exist or cannot be reached is a usage error."""
    from codra_dsl.language.project import without_parent_steps

    checked_paths: list[Path] = []
    for path in paths:
        try:
            path.stat()
            checked_paths.append(without_parent_steps(path))
        except FileNotFoundError as error:
            hint = ": standard input cannot be combined with other paths" if path == Path(STANDARD_INPUT) else ""
            raise typer.BadParameter(f"'{path}' does not exist{hint}", param_hint="PATH") from error
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "the path is not valid"
            raise typer.BadParameter(f"'{path}' cannot be reached: {reason}", param_hint="PATH") from error
    return checked_paths


def common_root(paths: Sequence[Path]) -> Path:
    """Return the folder to which all paths in the output are relative. Specs in several projects are a usage error."""
    from codra_dsl.language.project import root_of

    roots = sorted({root_of(path) for path in paths})
    if len(roots) > 1:
        roots_text = ", ".join(map(str, roots))
        message = f"the specs belong to several projects ({roots_text}): run the command for one project at a time"
        raise typer.BadParameter(message, param_hint="PATH")
    return roots[0]


def one_plan(path: Path, root: Path, colour: Colour, *, sites: Sequence[Path] = ()) -> BuildPlan:
    """Return the build plan of the only spec at a path, and write the findings about this spec to standard output.

    Several specs are a usage error. If there is no plan because of errors, exit.
    """
    from codra_dsl.compiler import plan_paths
    from codra_dsl.language.diagnostics import has_errors

    planning_result = plan_paths([path], root, sites=sites)
    if planning_result.diagnostics:
        write_result(View(root=root, format=Format.FULL, colour=colour).render(planning_result.diagnostics, sys.stdout))
        say(counts_text(planning_result.diagnostics))
    if len(planning_result.plans) > 1:
        raise typer.BadParameter(
            f"'{path}' has {len(planning_result.plans)} specs: choose one of them", param_hint="SPEC"
        )
    if not planning_result.plans or has_errors(planning_result.diagnostics):
        raise typer.Exit(ExitCode.FAILED)
    return planning_result.plans[0]


def made_folder(folder: Path) -> Path:
    """Create the output folder of a run and return the path. A folder that is not writable is a usage error."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(f"cannot write to '{folder}': {error.strerror}", param_hint="--out") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise typer.BadParameter(f"cannot write to '{folder}'", param_hint="--out")
    return folder


def writable_journal(journal: Path) -> Path:
    """Return the path of a journal. Before the run, report a journal that cannot be written as a usage error."""
    from codra_dsl.runtime.journal.file_creation import create_locked_file

    try:
        create_locked_file(journal).close()
    except OSError as error:
        raise typer.BadParameter(f"cannot write '{journal}': {error.strerror}", param_hint="--journal") from error
    return journal
