"""`codra diff`: report what a change of specs means for a robot and its programs."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    append_to_summary,
    folder_in_repository,
    is_coloured,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, Output

if TYPE_CHECKING:
    from codra_dsl.language.diagnostics import Diagnostic, Span
    from codra_dsl.language.model import Spec
    from codra_dsl.tooling.diff import BrokenSpec, Change, Review, Verdict, Version
    from codra_dsl.tooling.report.changes import Versions

_SPECS = "specs"


class DiffFormat(StrEnum):
    """The forms in which a review is shown."""

    FULL = "full"
    CONCISE = "concise"
    MARKDOWN = "markdown"
    GITHUB = "github"
    JSON = "json"


class FailOnVerdict(StrEnum):
    """The mildest verdict that makes the command fail."""

    BREAKING = "breaking"
    CAUTION = "caution"
    NEVER = "never"


Before = Annotated[
    str, typer.Argument(metavar="A", help="The version before: a path, or else a git revision.", show_default=False)
]
After = Annotated[
    str, typer.Argument(metavar="B", help="The version after: a path, or else a git revision.", show_default=False)
]
Paths = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="PATH",
        help="A path below both versions.  [default: the path given as A or B; for two revisions, 'specs' or all]",
        show_default=False,
    ),
]
FormatOption = Annotated[
    DiffFormat | None,
    typer.Option(
        "--format",
        help="How changes are shown.  [default: full; github if GITHUB_ACTIONS is true and there is no --output]",
        show_default=False,
    ),
]
FailOnOption = Annotated[
    FailOnVerdict, typer.Option("--fail-on", help="The mildest verdict that makes the command fail.")
]
Allow = Annotated[
    list[str] | None,
    typer.Option(
        "--allow",
        metavar="CATEGORY[:ELEMENT]",
        help="Accept these changes: they do not count for the verdict. The option may be repeated.",
        show_default=False,
    ),
]


def diff_command(
    before: Before,
    after: After,
    paths: Paths = None,
    *,
    format_: FormatOption = None,
    output: Output = None,
    fail_on: FailOnOption = FailOnVerdict.BREAKING,
    allow: Allow = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Report what a change of specs means for a robot.

    The report lists each change, such as a variable that is unobservable, slower or of another type in B, a cycle, or a
    weaker guard. It ends with a verdict.
    """
    from codra_dsl.tooling.diff import review
    from codra_dsl.tooling.revisions import RevisionError

    allowed = tuple(_allowed(option) for option in allow or ())
    wanted = [_relative(path) for path in paths or ()]
    with ExitStack() as stack:
        try:
            sides = _sides((before, after), wanted, stack)
        except RevisionError as error:
            raise typer.BadParameter(str(error), param_hint="A, B") from error
        versions = [_version(side) for side in sides]
        _report_errors(sides[0], versions[0], color)
        result = review(versions[0], versions[1])
    result = replace(result, changes=tuple(_judged(change, allowed) for change in result.changes))
    _report_unused(allowed, result)
    form, shown_versions = _form(format_, output), _shown_versions(sides)
    if form is DiffFormat.GITHUB:
        _annotate(result, shown_versions, sides[1].folder, output)
    else:
        coloured = output is None and is_coloured(color, sys.stdout)
        write_result(_rendered(result, shown_versions, form, coloured), output)
    raise typer.Exit(ExitCode.FAILED if _fails(result.verdict, fail_on) else ExitCode.CLEAN)


# The compared versions


@dataclass(frozen=True, slots=True, kw_only=True)
class _Side:
    """One of the two versions.

    Attributes:
        name: the version as given on the command line.
        paths: the compared paths that exist in this version.
        root: the folder to which the files of this version are relative.
        shown: the text before each file name of this version in the output.
        folder: the path of the root within the repository, for annotations on GitHub.
    """

    name: str
    paths: tuple[Path, ...]
    root: Path
    shown: str
    folder: str

    def file(self, name: str) -> str:
        """Return the name under which a file is shown."""
        return f"{self.shown}{name}"


def _relative(path: str) -> PurePosixPath:
    relative = PurePosixPath(path)
    if relative.is_absolute() or not path:
        raise typer.BadParameter(f"'{path}' must be relative: it is looked up below A and B", param_hint="PATH")
    return relative


def _sides(names: tuple[str, str], wanted: Sequence[PurePosixPath], stack: ExitStack) -> tuple[_Side, _Side]:
    disk = [Path(name) if os.path.lexists(name) else None for name in names]
    base = next((path for path in disk if path is not None), None)
    if base is None and not wanted:
        base, wanted = _default(names)
    here = Path.cwd() if base is None else base
    first, second = (
        _on_disk(name, path, wanted) if path is not None else _in_revision(name, here, wanted, stack)
        for name, path in zip(names, disk, strict=True)
    )
    if not first.paths and not second.paths and wanted:
        named = ", ".join(f"'{path}'" for path in wanted)
        raise typer.BadParameter(f"neither version has {named}", param_hint="PATH")
    if None not in disk and first.root != second.root:
        first = replace(first, shown=f"{os.path.relpath(first.root)}/")
        second = replace(second, shown=f"{os.path.relpath(second.root)}/")
    return first, second


def _default(names: tuple[str, str]) -> tuple[Path, Sequence[PurePosixPath]]:
    """Return the project's folder, and the paths below it that are compared if both versions are revisions.

    The only path is `specs` if one of the revisions has that folder. Otherwise there are no paths, and the entire
    project is compared.
    """
    from codra_dsl.language.project import project_of
    from codra_dsl.tooling.revisions import Repository

    project = Path(os.path.realpath(project_of(Path.cwd()) or Path.cwd()))
    repository = Repository.around(project)
    specs = _within(project / _SPECS, Path(os.path.realpath(repository.top)))
    has_specs = any(repository.holds(repository.commit(name), specs) for name in names)
    return project, [PurePosixPath(_SPECS)] if has_specs else ()


def _on_disk(name: str, path: Path, wanted: Sequence[PurePosixPath]) -> _Side:
    from codra_dsl.language.project import straight

    if wanted and not path.is_dir():
        raise typer.BadParameter(f"'{name}' is not a folder: remove the paths below it", param_hint="PATH")
    paths = [path / below for below in wanted] or [path]
    present = tuple(straight(candidate) for candidate in paths if candidate.exists())
    root = _root(present or (path,), Path("/"))
    return _Side(name=name, paths=present, root=root, shown="", folder=folder_in_repository(root))


def _in_revision(name: str, here: Path, wanted: Sequence[PurePosixPath], stack: ExitStack) -> _Side:
    """Return a revision as a side. Its spec files are in a folder, which is removed when the stack is closed."""
    from codra_dsl.language.project import project_of
    from codra_dsl.tooling.revisions import Repository

    place = Path(os.path.realpath(here))
    repository = Repository.around(place)
    commit = repository.commit(name)
    top = Path(os.path.realpath(repository.top))
    project = project_of(place)
    kept = project if project is not None and project.is_relative_to(top) else _folder(place)
    folder = Path(os.path.realpath(stack.enter_context(tempfile.TemporaryDirectory(prefix="codra-"))))
    unread = repository.extract(commit, PurePosixPath(kept.relative_to(top)), folder)
    paths = [place / below for below in wanted] or [place]
    extracted = [folder / _within(Path(os.path.normpath(path)), top) for path in paths]
    for path, kind in unread.items():
        if any((folder / path).is_relative_to(compared) for compared in extracted):
            say(f"codra: {name}:{path} is not read, because it is {kind}")
    present = tuple(path for path in extracted if path.exists())
    root = _root(present, folder) if present else folder
    prefix = root.relative_to(folder).as_posix()
    shown = f"{name}:" if prefix == "." or kept == top / prefix else f"{name}:{prefix}/"
    return _Side(name=name, paths=present, root=root, shown=shown, folder="" if prefix == "." else prefix)


def _folder(place: Path) -> Path:
    """Return a folder itself, or the folder of a file. A path that does not exist counts as a file."""
    return place if place.is_dir() else place.parent


def _within(path: Path, top: Path) -> Path:
    if not path.is_relative_to(top):
        raise typer.BadParameter(f"'{path}' is outside of the repository '{top.name}'", param_hint="PATH")
    return path.relative_to(top)


def _root(paths: Sequence[Path], top: Path) -> Path:
    """Return the folder to which the files of a version are relative.

    This is the folder of the project, or, without a project, the common folder of the compared paths.

    Args:
        paths: the compared paths.
        top: a project outside of this folder does not count.
    """
    from codra_dsl.language.project import project_of

    projects = {project if project and project.is_relative_to(top) else None for project in map(project_of, paths)}
    if len(projects) > 1:
        raise typer.BadParameter("the paths belong to several projects: compare one at a time", param_hint="PATH")
    own = os.path.commonpath([_folder(path.absolute()) for path in paths])
    return projects.pop() or Path(own)


# Plans and errors


def _version(side: _Side) -> Version:
    from codra_dsl.compiler import plan_paths
    from codra_dsl.language.diagnostics import has_errors
    from codra_dsl.tooling.diff import BrokenSpec, Version

    if not side.paths:
        return Version()
    planned = plan_paths(side.paths, side.root)
    errors = [finding for finding in planned.diagnostics if has_errors([finding]) and finding.rule.name != "no-spec"]
    taken = {error.place.span.file for error in errors if error.rule.name == "same-spec-name"}
    plans = tuple(plan for plan in planned.plans if plan.checked.spec.file not in taken)
    sound = {plan.checked.spec.file for plan in plans}
    broken = list(_broken(side, [file for file in planned.specs if file not in sound], errors))
    broken += [
        BrokenSpec(name=plan.name, file=plan.checked.spec.file, errors=own)
        for plan in plans
        if (own := _about(plan.checked.spec, errors))
    ]
    assigned = {id(error) for spec in broken for error in spec.errors}
    rest = [error for error in errors if id(error) not in assigned]
    return Version(plans=plans, broken=(*broken, *(BrokenSpec(name=None, file=f, errors=e) for f, e in _by_file(rest))))


def _broken(side: _Side, files: Sequence[str], errors: Sequence[Diagnostic]) -> Iterator[BrokenSpec]:
    from codra_dsl.language.load import load_spec
    from codra_dsl.tooling.diff import BrokenSpec

    for file in files:
        spec, _ = load_spec(side.root / file, side.root)
        own = (
            tuple(error for error in errors if error.place.span.file == file) if spec is None else _about(spec, errors)
        )
        yield BrokenSpec(name=None if spec is None else spec.name, file=file, errors=own)


def _about(spec: Spec, errors: Sequence[Diagnostic]) -> tuple[Diagnostic, ...]:
    return tuple(error for error in errors if error.place.span.file in spec.files)


def _by_file(errors: Sequence[Diagnostic]) -> Iterator[tuple[str, tuple[Diagnostic, ...]]]:
    for file in dict.fromkeys(error.place.span.file for error in errors):
        yield file, tuple(error for error in errors if error.place.span.file == file)


def _report_errors(side: _Side, version: Version, colour: Colour) -> None:
    """Write the errors of A to standard error. The review contains only the errors of B."""
    from codra_dsl.language.diagnostics import in_file_order
    from codra_dsl.tooling.report import findings

    errors = in_file_order(error for broken in version.broken for error in broken.errors)
    if errors:
        palette = findings.COLOURED if is_coloured(colour, sys.stderr) else findings.PLAIN
        shown = [replace(error, place=replace(error.place, span=_shown(side, error))) for error in errors]
        say(f"{findings.render_concise(shown, palette)}{side.name} has errors: unreadable parts are not compared")


def _shown(side: _Side, error: Diagnostic) -> Span:
    return replace(error.place.span, file=side.file(error.place.span.file))


# The verdict


def _allowed(text: str) -> tuple[str, str]:
    from codra_dsl.tooling.diff import Category

    category, _, element = text.partition(":")
    if category not in list(Category):
        names = ", ".join(Category)
        raise typer.BadParameter(f"unknown category '{category}': choose one of {names}", param_hint="--allow")
    return category, element


def _judged(change: Change, allowed: Sequence[tuple[str, str]]) -> Change:
    return replace(change, allowed=True) if any(_accepts(option, change) for option in allowed) else change


def _accepts(allowed: tuple[str, str], change: Change) -> bool:
    category, element = allowed
    return category == change.category and element in ("", change.element)


def _report_unused(allowed: Sequence[tuple[str, str]], review: Review) -> None:
    for option in allowed:
        if not any(_accepts(option, change) for change in review.changes):
            say(f"codra: --allow {':'.join(filter(None, option))} accepts no change: remove it")


def _fails(verdict: Verdict, fail_on: FailOnVerdict) -> bool:
    from codra_dsl.tooling.diff import Verdict

    if fail_on is FailOnVerdict.NEVER:
        return False
    return verdict is Verdict.BREAKING or (fail_on is FailOnVerdict.CAUTION and verdict is Verdict.CAUTION)


def _shown_versions(sides: tuple[_Side, _Side]) -> Versions:
    from codra_dsl.tooling.report.changes import Versions

    before, after = sides
    return Versions(before=before.name, after=after.name, file_before=before.file, file_after=after.file)


def _form(wanted: DiffFormat | None, output: Path | None) -> DiffFormat:
    if wanted is not None:
        return wanted
    on_github = output is None and os.environ.get("GITHUB_ACTIONS") == "true"
    return DiffFormat.GITHUB if on_github else DiffFormat.FULL


def _annotate(review: Review, versions: Versions, folder: str, output: Path | None) -> None:
    """Write the review as annotations, and add it as Markdown to the summary of the step."""
    from codra_dsl.tooling.report.changes import render_annotations, render_markdown

    write_result(render_annotations(review, folder), output)
    append_to_summary(render_markdown(review, versions))


def _rendered(review: Review, versions: Versions, form: DiffFormat, coloured: bool) -> str:
    from codra_dsl.tooling.report import changes, findings

    palette = findings.COLOURED if coloured else findings.PLAIN
    if form is DiffFormat.JSON:
        return changes.render_json(review, versions)
    if form is DiffFormat.MARKDOWN:
        return changes.render_markdown(review, versions)
    render = changes.render_concise if form is DiffFormat.CONCISE else changes.render_full
    return render(review, versions, palette)
