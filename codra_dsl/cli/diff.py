"""`codra diff`: report the effects of a change of specs on a robot and its programs."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    append_to_summary,
    common_root,
    existing,
    folder_in_repository,
    is_coloured,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, OutputOption
from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.language.model import Spec
    from codra_dsl.tooling.diff import BrokenSpec, Change, Review, Verdict, Version
    from codra_dsl.tooling.report.changes import Versions

_SPECS_FOLDER = "specs"


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


BeforeArgument = Annotated[
    str, typer.Argument(metavar="A", help="The version before: a path, or else a git revision.", show_default=False)
]
AfterArgument = Annotated[
    str | None,
    typer.Argument(
        metavar="B", help="The version after: a path, or else a git revision. Omit it with --site.", show_default=False
    ),
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
SitesOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--site",
        metavar="FILE",
        help="Compare A with A at this site; given twice, compare A at the two sites.",
        show_default=False,
    ),
]
AllowOption = Annotated[
    list[str] | None,
    typer.Option(
        "--allow",
        metavar="CATEGORY[:ELEMENT]",
        help="Accept these changes: they do not affect the verdict. The option may be repeated.",
        show_default=False,
    ),
]


def diff_command(
    before: BeforeArgument,
    after: AfterArgument = None,
    paths: Paths = None,
    *,
    site: SitesOption = None,
    format_: FormatOption = None,
    output: OutputOption = None,
    fail_on: FailOnOption = FailOnVerdict.BREAKING,
    allow: AllowOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Report the effects of a change of specs on a robot.

    The report lists each change, such as a variable that is unobservable, slower or of another type in B, a cycle, or a
    weaker guard. It ends with a verdict.
    """
    from codra_dsl.tooling.diff import review
    from codra_dsl.tooling.revisions import RevisionError

    allow_options = tuple(_parse_allow_option(option) for option in allow or ())
    relative_paths = [_relative_path(path) for path in paths or ()]
    with ExitStack() as stack:
        try:
            if site:
                sides = _sides_at_sites(before, after, existing(site))
            else:
                sides = _sides((before, _required(after)), relative_paths, stack)
        except RevisionError as error:
            raise typer.BadParameter(str(error), param_hint="A, B") from error
        versions = [_version(side) for side in sides]
        _report_errors(sides[0], versions[0], color)
        diff_review = review(versions[0], versions[1])
    diff_review = replace(
        diff_review, changes=tuple(_apply_allow_options(change, allow_options) for change in diff_review.changes)
    )
    _report_unused_allow_options(allow_options, diff_review)
    diff_format, versions_in_report = _choose_format(format_, output), _versions_of(sides)
    if diff_format is DiffFormat.GITHUB:
        _annotate(diff_review, versions_in_report, sides[1].folder, output)
    else:
        has_colours = output is None and is_coloured(color, sys.stdout)
        write_result(_render(diff_review, versions_in_report, diff_format, has_colours), output)
    raise typer.Exit(ExitCode.FAILED if _fails(diff_review.verdict, fail_on) else ExitCode.CLEAN)


# The compared versions


@dataclass(frozen=True, slots=True, kw_only=True)
class _Side:
    """One of the two versions.

    Attributes:
        name: the version as given on the command line.
        paths: the compared paths that exist in this version.
        root: the folder to which the files of this version are relative.
        file_prefix: the text before each file name of this version in the output.
        site: the site whose values the specs have; None for the specs alone.
        folder: the path of the root within the repository, for annotations on GitHub.
    """

    name: str
    paths: tuple[Path, ...]
    root: Path
    file_prefix: str
    folder: str
    site: Path | None = None

    @property
    def sites(self) -> tuple[Path, ...]:
        """The site as an argument of the compiler."""
        return () if self.site is None else (self.site,)

    def file(self, name: str) -> str:
        """Return the name under which a file is shown."""
        return f"{self.file_prefix}{name}"


def _relative_path(path: str) -> PurePosixPath:
    relative_path = PurePosixPath(path)
    if relative_path.is_absolute() or not path:
        raise typer.BadParameter(f"'{path}' must be relative: it is looked up below A and B", param_hint="PATH")
    return relative_path


def _required(after: str | None) -> str:
    if after is None:
        raise typer.BadParameter("give the version after, or --site to compare sites", param_hint="B")
    return after


def _sides_at_sites(before: str, after: str | None, sites: Sequence[Path]) -> tuple[_Side, _Side]:
    """Return the specs at a path alone and at a site, or at two sites."""
    if after is not None or not os.path.lexists(before):
        raise typer.BadParameter("with --site, give one path: both versions have its specs", param_hint="A, B")
    if len(sites) > 2:
        raise typer.BadParameter("two versions are compared: give at most two sites", param_hint="--site")
    side = _side_on_disk(before, Path(before), ())
    common_root([*side.paths, *sites])
    first, second = (_at_site(side, site) for site in (*((None,) if len(sites) == 1 else ()), *sites))
    return first, second


def _at_site(side: _Side, site: Path | None) -> _Side:
    return side if site is None else replace(side, name=f"{side.name} at {site.as_posix()}", site=site)


def _sides(names: tuple[str, str], relative_paths: Sequence[PurePosixPath], stack: ExitStack) -> tuple[_Side, _Side]:
    disk_paths = [Path(name) if os.path.lexists(name) else None for name in names]
    disk_path = next((path for path in disk_paths if path is not None), None)
    if disk_path is None and not relative_paths:
        disk_path, relative_paths = _default_project_and_paths(names)
    base_path = Path.cwd() if disk_path is None else disk_path
    first, second = (
        _side_on_disk(name, path, relative_paths)
        if path is not None
        else _side_in_revision(name, base_path, relative_paths, stack)
        for name, path in zip(names, disk_paths, strict=True)
    )
    if not first.paths and not second.paths and relative_paths:
        paths_text = ", ".join(f"'{path}'" for path in relative_paths)
        raise typer.BadParameter(f"neither version has {paths_text}", param_hint="PATH")
    if None not in disk_paths and first.root != second.root:
        first = replace(first, file_prefix=f"{os.path.relpath(first.root)}/")
        second = replace(second, file_prefix=f"{os.path.relpath(second.root)}/")
    return first, second


def _default_project_and_paths(names: tuple[str, str]) -> tuple[Path, Sequence[PurePosixPath]]:
    """Return the project's folder, and the paths below it that are compared if both versions are revisions.

    The only path is `specs` if one of the revisions has that folder. Otherwise there are no paths, and the entire
    project is compared.
    """
    from codra_dsl.language.project import project_of
    from codra_dsl.tooling.revisions import Repository

    project = Path(os.path.realpath(project_of(Path.cwd()) or Path.cwd()))
    repository = Repository.around(project)
    specs_path = _path_in_repository(project / _SPECS_FOLDER, Path(os.path.realpath(repository.top)))
    has_specs = any(repository.holds(repository.commit(name), specs_path) for name in names)
    return project, [PurePosixPath(_SPECS_FOLDER)] if has_specs else ()


def _side_on_disk(name: str, path: Path, relative_paths: Sequence[PurePosixPath]) -> _Side:
    from codra_dsl.language.project import without_parent_steps

    if relative_paths and not path.is_dir():
        raise typer.BadParameter(f"'{name}' is not a folder: remove the paths below it", param_hint="PATH")
    paths = [path / relative_path for relative_path in relative_paths] or [path]
    existing_paths = tuple(without_parent_steps(candidate) for candidate in paths if candidate.exists())
    root = _root_of(existing_paths or (path,), Path("/"))
    return _Side(name=name, paths=existing_paths, root=root, file_prefix="", folder=folder_in_repository(root))


def _side_in_revision(name: str, base_path: Path, relative_paths: Sequence[PurePosixPath], stack: ExitStack) -> _Side:
    """Extract a revision to a temporary folder, and return it as a side. Closing the stack removes this folder."""
    from codra_dsl.language.project import project_of
    from codra_dsl.tooling.report.findings import visible_text
    from codra_dsl.tooling.revisions import Repository

    real_path = Path(os.path.realpath(base_path))
    repository = Repository.around(real_path)
    commit = repository.commit(name)
    top = Path(os.path.realpath(repository.top))
    project = project_of(real_path)
    spec_folder = project if project is not None and project.is_relative_to(top) else _folder_of(real_path)
    folder = Path(os.path.realpath(stack.enter_context(tempfile.TemporaryDirectory(prefix="codra-"))))
    kind_by_unread_path = repository.extract(commit, PurePosixPath(_path_in_repository(spec_folder, top)), folder)
    paths = [real_path / relative_path for relative_path in relative_paths] or [real_path]
    extracted_paths = [folder / _path_in_repository(Path(os.path.normpath(path)), top) for path in paths]
    for path, file_kind in kind_by_unread_path.items():
        if any((folder / path).is_relative_to(compared_path) for compared_path in extracted_paths):
            say(f"codra: {name}:{visible_text(str(path))} is not read, because it is {file_kind}")
    existing_paths = tuple(path for path in extracted_paths if path.exists())
    root = _root_of(existing_paths, folder) if existing_paths else folder
    root_in_repository = root.relative_to(folder).as_posix()
    file_prefix = (
        f"{name}:"
        if root_in_repository == "." or spec_folder == top / root_in_repository
        else f"{name}:{root_in_repository}/"
    )
    return _Side(
        name=name,
        paths=existing_paths,
        root=root,
        file_prefix=file_prefix,
        folder="" if root_in_repository == "." else root_in_repository,
    )


def _folder_of(path: Path) -> Path:
    """Return a folder itself, or the folder of a file. A path that does not exist is treated as a file."""
    return path if path.is_dir() else path.parent


def _path_in_repository(path: Path, top: Path) -> Path:
    if not path.is_relative_to(top):
        raise typer.BadParameter(f"'{path}' is outside of the repository '{top.name}'", param_hint="PATH")
    return path.relative_to(top)


def _root_of(paths: Sequence[Path], top: Path) -> Path:
    """Return the folder to which the files of a version are relative.

    This is the folder of the project, or, without a project, the common folder of the compared paths.

    Args:
        paths: the compared paths.
        top: a project outside of this folder is ignored.
    """
    from codra_dsl.language.project import project_of

    projects = {project if project and project.is_relative_to(top) else None for project in map(project_of, paths)}
    if len(projects) > 1:
        raise typer.BadParameter(
            "the paths belong to several projects: compare one project at a time", param_hint="PATH"
        )
    common_folder = os.path.commonpath([_folder_of(path.absolute()) for path in paths])
    return projects.pop() or Path(common_folder)


# Plans and errors


def _version(side: _Side) -> Version:
    from codra_dsl.compiler import plan_paths
    from codra_dsl.language.diagnostics import has_errors
    from codra_dsl.tooling.diff import BrokenSpec, Version

    if not side.paths:
        return Version()
    planning_result = plan_paths(side.paths, side.root, sites=side.sites)
    errors = [
        finding for finding in planning_result.diagnostics if has_errors([finding]) and finding.rule.name != "no-spec"
    ]
    duplicate_name_files = {error.place.span.file for error in errors if error.rule.name == "same-spec-name"}
    plans = tuple(plan for plan in planning_result.plans if plan.checked.spec.file not in duplicate_name_files)
    planned_files = {plan.checked.spec.file for plan in plans}
    broken_specs = list(
        _broken_specs(side, [file for file in planning_result.specs if file not in planned_files], errors)
    )
    broken_specs += [
        BrokenSpec(name=plan.name, file=plan.checked.spec.file, errors=spec_errors)
        for plan in plans
        if (spec_errors := _errors_in_spec(plan.checked.spec, errors))
    ]
    assigned_error_ids = {id(error) for spec in broken_specs for error in spec.errors}
    unassigned_errors = [error for error in errors if id(error) not in assigned_error_ids]
    return Version(
        plans=plans,
        broken_specs=(
            *broken_specs,
            *(
                BrokenSpec(name=None, file=file, errors=file_errors)
                for file, file_errors in _errors_by_file(unassigned_errors)
            ),
        ),
    )


def _broken_specs(side: _Side, files: Sequence[str], errors: Sequence[Diagnostic]) -> Iterator[BrokenSpec]:
    from codra_dsl.language.load import load_spec
    from codra_dsl.tooling.diff import BrokenSpec

    for file in files:
        spec, _ = load_spec(side.root / file, side.root, site=side.site)
        spec_errors = (
            tuple(error for error in errors if error.place.span.file == file)
            if spec is None
            else _errors_in_spec(spec, errors)
        )
        yield BrokenSpec(name=None if spec is None else spec.name, file=file, errors=spec_errors)


def _errors_in_spec(spec: Spec, errors: Sequence[Diagnostic]) -> tuple[Diagnostic, ...]:
    return tuple(error for error in errors if error.place.span.file in spec.files)


def _errors_by_file(errors: Sequence[Diagnostic]) -> Iterator[tuple[str, tuple[Diagnostic, ...]]]:
    for file in dict.fromkeys(error.place.span.file for error in errors):
        yield file, tuple(error for error in errors if error.place.span.file == file)


def _report_errors(side: _Side, version: Version, colour: Colour) -> None:
    """Write the errors of A to standard error. The review contains only the errors of B."""
    from codra_dsl.language.diagnostics import in_file_order
    from codra_dsl.tooling.report import findings

    errors = in_file_order(error for broken_spec in version.broken_specs for error in broken_spec.errors)
    if errors:
        palette = findings.COLOURED if is_coloured(colour, sys.stderr) else findings.PLAIN
        spans = [replace(error.place.span, file=side.file(error.place.span.file)) for error in errors]
        shown_errors = [
            replace(error, place=replace(error.place, span=span)) for error, span in zip(errors, spans, strict=True)
        ]
        text = findings.render_concise(shown_errors, palette)
        say(f"{text}{side.name} has errors: unreadable parts are not compared", is_rendered=True)


# The verdict


def _parse_allow_option(text: str) -> tuple[str, str]:
    from codra_dsl.tooling.diff import Category

    category, _, element = text.partition(":")
    if category not in list(Category):
        category_names = ", ".join(Category)
        raise typer.BadParameter(f"unknown category '{category}': choose one of {category_names}", param_hint="--allow")
    return category, element


def _apply_allow_options(change: Change, allow_options: Sequence[tuple[str, str]]) -> Change:
    return (
        replace(change, is_allowed=True)
        if any(_accepts(allow_option, change) for allow_option in allow_options)
        else change
    )


def _accepts(allow_option: tuple[str, str], change: Change) -> bool:
    category, element = allow_option
    return category == change.category and element in ("", change.element)


def _report_unused_allow_options(allow_options: Sequence[tuple[str, str]], review: Review) -> None:
    for allow_option in allow_options:
        if not any(_accepts(allow_option, change) for change in review.changes):
            say(f"codra: --allow {':'.join(filter(None, allow_option))} accepts no change: remove it")


def _fails(verdict: Verdict, fail_on: FailOnVerdict) -> bool:
    from codra_dsl.tooling.diff import Verdict

    if fail_on is FailOnVerdict.NEVER:
        return False
    return verdict is Verdict.BREAKING or (fail_on is FailOnVerdict.CAUTION and verdict is Verdict.CAUTION)


def _versions_of(sides: tuple[_Side, _Side]) -> Versions:
    from codra_dsl.tooling.report.changes import Versions

    before, after = sides
    return Versions(before=before.name, after=after.name, show_file_before=before.file, show_file_after=after.file)


def _choose_format(requested_format: DiffFormat | None, output: Path | None) -> DiffFormat:
    if requested_format is not None:
        return requested_format
    is_on_github = output is None and os.environ.get("GITHUB_ACTIONS") == "true"
    return DiffFormat.GITHUB if is_on_github else DiffFormat.FULL


def _annotate(review: Review, versions: Versions, folder: str, output: Path | None) -> None:
    """Write the review as annotations, and add it as Markdown to the summary of the step."""
    from codra_dsl.tooling.report.changes import render_annotations, render_markdown

    write_result(render_annotations(review, folder), output)
    append_to_summary(render_markdown(review, versions))


def _render(review: Review, versions: Versions, diff_format: DiffFormat, has_colours: bool) -> str:
    from codra_dsl.tooling.report import changes, findings

    palette = findings.COLOURED if has_colours else findings.PLAIN
    if diff_format is DiffFormat.JSON:
        return changes.render_json(review, versions)
    if diff_format is DiffFormat.MARKDOWN:
        return changes.render_markdown(review, versions)
    render = changes.render_concise if diff_format is DiffFormat.CONCISE else changes.render_full
    return render(review, versions, palette)
