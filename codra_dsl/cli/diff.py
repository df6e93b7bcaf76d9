"""`codra diff`: what it means for a robot and its programs that one version of some specs becomes another."""

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
    from codra_dsl.tooling.diff import Broken, Change, Review, Verdict, Version
    from codra_dsl.tooling.report.changes import Versions

_SPECS = "specs"


class DiffFormat(StrEnum):
    """How a review is shown."""

    FULL = "full"
    CONCISE = "concise"
    MARKDOWN = "markdown"
    GITHUB = "github"
    JSON = "json"


class FailOnVerdict(StrEnum):
    """The least verdict that makes the command fail."""

    BREAKING = "breaking"
    CAUTION = "caution"
    NEVER = "never"


Before = Annotated[
    str, typer.Argument(metavar="A", help="The version before: a path, else a git revision.", show_default=False)
]
After = Annotated[
    str, typer.Argument(metavar="B", help="The version after: a path, else a git revision.", show_default=False)
]
Paths = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="PATH",
        help="What to compare below both.  [default: the path that A or B is; of two revisions, 'specs' or everything]",
        show_default=False,
    ),
]
FormatOption = Annotated[
    DiffFormat | None,
    typer.Option(
        "--format",
        help="How changes are shown.  [default: full; github where GITHUB_ACTIONS is true and there is no --output]",
        show_default=False,
    ),
]
FailOnOption = Annotated[
    FailOnVerdict, typer.Option("--fail-on", help="The least verdict that makes the command fail.")
]
Allow = Annotated[
    list[str] | None,
    typer.Option(
        "--allow",
        metavar="CATEGORY[:ELEMENT]",
        help="Changes that are accepted and do not count; can be given several times.",
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
    """Say what a change means for a robot.

    What became unobservable, slower, cyclic, typed otherwise or weaker guarded from A to B, with a verdict.
    """
    from codra_dsl.tooling.diff import review
    from codra_dsl.tooling.revisions import RevisionError

    allowed = tuple(_allowed(each) for each in allow or ())
    wanted = [_relative(path) for path in paths or ()]
    with ExitStack() as stack:
        try:
            sides = _sides((before, after), wanted, stack)
        except RevisionError as error:
            raise typer.BadParameter(str(error), param_hint="A, B") from error
        versions = [_version(side) for side in sides]
        _tell_about(sides[0], versions[0], color)
        found = review(versions[0], versions[1])
    found = replace(found, changes=tuple(_judged(change, allowed) for change in found.changes))
    _tell_unused(allowed, found)
    how, versions_named = _asked(format_, output), _named(sides)
    if how is DiffFormat.GITHUB:
        _annotate(found, versions_named, sides[1].folder, output)
    else:
        write_result(_rendered(found, versions_named, how, output is None and is_coloured(color, sys.stdout)), output)
    raise typer.Exit(ExitCode.FAILED if _fails(found.verdict, fail_on) else ExitCode.CLEAN)


# What is compared


@dataclass(frozen=True, slots=True, kw_only=True)
class _Side:
    """One version.

    Attributes:
        name: as the command line has it.
        paths: that are compared, of those that exist.
        root: the project's folder.
        shown: what stands before the paths of its files.
        folder: of the root within the repository, for annotations on GitHub.
    """

    name: str
    paths: tuple[Path, ...]
    root: Path
    shown: str
    folder: str

    def file(self, name: str) -> str:
        """Return a file's name as it is shown."""
        return f"{self.shown}{name}"


def _relative(path: str) -> PurePosixPath:
    found = PurePosixPath(path)
    if found.is_absolute() or not path:
        raise typer.BadParameter(f"'{path}' must be relative: it is looked for below A and B", param_hint="PATH")
    return found


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
        raise typer.BadParameter(f"there is no {named} in either version", param_hint="PATH")
    if None not in disk and first.root != second.root:
        first = replace(first, shown=f"{os.path.relpath(first.root)}/")
        second = replace(second, shown=f"{os.path.relpath(second.root)}/")
    return first, second


def _default(names: tuple[str, str]) -> tuple[Path, Sequence[PurePosixPath]]:
    """Return what two revisions are compared in: the project's specs, else all of it."""
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
        raise typer.BadParameter(f"'{name}' is no folder: there is nothing below it", param_hint="PATH")
    paths = [path / each for each in wanted] or [path]
    present = tuple(straight(each) for each in paths if each.exists())
    root = _root(present or (path,), Path("/"))
    return _Side(name=name, paths=present, root=root, shown="", folder=folder_in_repository(root))


def _in_revision(name: str, here: Path, wanted: Sequence[PurePosixPath], stack: ExitStack) -> _Side:
    """Return a revision, whose spec files are written to a folder that is removed when the stack is closed."""
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
    paths = [place / each for each in wanted] or [place]
    there = [folder / _within(Path(os.path.normpath(path)), top) for path in paths]
    for path, what in unread.items():
        if any((folder / path).is_relative_to(each) for each in there):
            say(f"codra: {name}:{path} is {what}: not read")
    present = tuple(path for path in there if path.exists())
    root = _root(present, folder) if present else folder
    prefix = root.relative_to(folder).as_posix()
    shown = f"{name}:" if prefix == "." or kept == top / prefix else f"{name}:{prefix}/"
    return _Side(name=name, paths=present, root=root, shown=shown, folder="" if prefix == "." else prefix)


def _folder(place: Path) -> Path:
    """Return the folder that specs are in, where there is no project: a path that is gone may have been either."""
    return place if place.is_dir() else place.parent


def _within(path: Path, top: Path) -> Path:
    if not path.is_relative_to(top):
        raise typer.BadParameter(f"'{path}' is outside of the repository '{top.name}'", param_hint="PATH")
    return path.relative_to(top)


def _root(paths: Sequence[Path], top: Path) -> Path:
    """Return the folder that the files of a version are named from: their project's below a folder, else their own."""
    from codra_dsl.language.project import project_of

    found = {project if project and project.is_relative_to(top) else None for project in map(project_of, paths)}
    if len(found) > 1:
        raise typer.BadParameter("these belong to several projects: take one at a time", param_hint="PATH")
    own = os.path.commonpath([_folder(path.absolute()) for path in paths])
    return found.pop() or Path(own)


# Both versions


def _version(side: _Side) -> Version:
    from codra_dsl.compiler import plan_paths
    from codra_dsl.language.diagnostics import has_errors
    from codra_dsl.tooling.diff import Broken, Version

    if not side.paths:
        return Version()
    planned = plan_paths(side.paths, side.root)
    errors = [found for found in planned.diagnostics if has_errors([found]) and found.rule.name != "no-spec"]
    taken = {found.place.span.file for found in errors if found.rule.name == "same-spec-name"}
    plans = tuple(plan for plan in planned.plans if plan.checked.spec.file not in taken)
    sound = {plan.checked.spec.file for plan in plans}
    broken = list(_broken(side, [file for file in planned.specs if file not in sound], errors))
    broken += [
        Broken(name=plan.name, file=plan.checked.spec.file, errors=own)
        for plan in plans
        if (own := _about(plan.checked.spec, errors))
    ]
    told = {id(found) for each in broken for found in each.errors}
    rest = [found for found in errors if id(found) not in told]
    return Version(plans=plans, broken=(*broken, *(Broken(name=None, file=f, errors=e) for f, e in _by_file(rest))))


def _broken(side: _Side, files: Sequence[str], errors: Sequence[Diagnostic]) -> Iterator[Broken]:
    from codra_dsl.language.load import load_spec
    from codra_dsl.tooling.diff import Broken

    for file in files:
        spec, _ = load_spec(side.root / file, side.root)
        found = tuple(each for each in errors if each.place.span.file == file) if spec is None else _about(spec, errors)
        yield Broken(name=None if spec is None else spec.name, file=file, errors=found)


def _about(spec: Spec, errors: Sequence[Diagnostic]) -> tuple[Diagnostic, ...]:
    return tuple(found for found in errors if found.place.span.file in spec.files)


def _by_file(errors: Sequence[Diagnostic]) -> Iterator[tuple[str, tuple[Diagnostic, ...]]]:
    for file in dict.fromkeys(found.place.span.file for found in errors):
        yield file, tuple(found for found in errors if found.place.span.file == file)


def _tell_about(side: _Side, version: Version, colour: Colour) -> None:
    """Tell the errors of A, which has no other way to be told of them."""
    from codra_dsl.language.diagnostics import in_file_order
    from codra_dsl.tooling.report import findings

    errors = in_file_order(found for broken in version.broken for found in broken.errors)
    if errors:
        palette = findings.COLOURED if is_coloured(colour, sys.stderr) else findings.PLAIN
        named = [replace(each, place=replace(each.place, span=_shown(side, each))) for each in errors]
        say(f"{findings.render_concise(named, palette)}{side.name} has errors: what cannot be read is not compared")


def _shown(side: _Side, found: Diagnostic) -> Span:
    return replace(found.place.span, file=side.file(found.place.span.file))


# The verdict


def _allowed(text: str) -> tuple[str, str]:
    from codra_dsl.tooling.diff import Category

    category, _, element = text.partition(":")
    if category not in list(Category):
        names = ", ".join(Category)
        raise typer.BadParameter(f"'{category}' is no category; these are {names}", param_hint="--allow")
    return category, element


def _judged(change: Change, allowed: Sequence[tuple[str, str]]) -> Change:
    return replace(change, allowed=True) if any(_accepts(each, change) for each in allowed) else change


def _accepts(allowed: tuple[str, str], change: Change) -> bool:
    category, element = allowed
    return category == change.category and element in ("", change.element)


def _tell_unused(allowed: Sequence[tuple[str, str]], found: Review) -> None:
    for each in allowed:
        if not any(_accepts(each, change) for change in found.changes):
            say(f"codra: there is no change that --allow {':'.join(filter(None, each))} accepts")


def _fails(verdict: Verdict, fail_on: FailOnVerdict) -> bool:
    from codra_dsl.tooling.diff import Verdict

    if fail_on is FailOnVerdict.NEVER:
        return False
    return verdict is Verdict.BREAKING or (fail_on is FailOnVerdict.CAUTION and verdict is Verdict.CAUTION)


def _named(sides: tuple[_Side, _Side]) -> Versions:
    from codra_dsl.tooling.report.changes import Versions

    before, after = sides
    return Versions(before=before.name, after=after.name, file_before=before.file, file_after=after.file)


def _asked(wanted: DiffFormat | None, output: Path | None) -> DiffFormat:
    if wanted is not None:
        return wanted
    on_github = output is None and os.environ.get("GITHUB_ACTIONS") == "true"
    return DiffFormat.GITHUB if on_github else DiffFormat.FULL


def _annotate(found: Review, versions: Versions, folder: str, output: Path | None) -> None:
    """Write annotations, and the review as Markdown to the summary of the step."""
    from codra_dsl.tooling.report.changes import render_annotations, render_markdown

    write_result(render_annotations(found, folder), output)
    append_to_summary(render_markdown(found, versions))


def _rendered(found: Review, versions: Versions, how: DiffFormat, coloured: bool) -> str:
    from codra_dsl.tooling.report import changes, findings

    palette = findings.COLOURED if coloured else findings.PLAIN
    if how is DiffFormat.JSON:
        return changes.render_json(found, versions)
    if how is DiffFormat.MARKDOWN:
        return changes.render_markdown(found, versions)
    render = changes.render_concise if how is DiffFormat.CONCISE else changes.render_full
    return render(found, versions, palette)
