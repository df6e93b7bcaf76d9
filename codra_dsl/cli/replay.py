"""`codra replay`: derive the variables and decisions of a run again from the evidence in its journal."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import ExitCode, common_root, existing, harmless_text, say, write_result
from codra_dsl.cli.journals import (
    FromOption,
    JournalFile,
    ResultFormat,
    ToOption,
    json_of,
    open_journal,
    range_of,
    report_damage,
)
from codra_dsl.isolation.error_text import described
from codra_dsl.regular_files import real_path

if TYPE_CHECKING:
    from codra_dsl.runtime import Journal
    from codra_dsl.runtime.journal import Event
    from codra_dsl.runtime.journal.run_header import RunHeader
    from codra_dsl.runtime.journal.spec_summary import Place, SpecSummary
    from codra_dsl.runtime.knowledge import KnowledgeModel
    from codra_dsl.runtime.replay import Build, DecisionCounts, Difference, Replayed
    from codra_dsl.runtime.replay.recording import Recording


PackageOption = Annotated[
    Path | None,
    typer.Option(
        "--package",
        metavar="DIR",
        help="The compiled package.  [default: generated/NAME in the project root, for a spec named NAME]",
        show_default=False,
    ),
]
SpecOption = Annotated[
    Path | None,
    typer.Option("--spec", metavar="SPEC", help="Compile this spec and use its package.", show_default=False),
]
SiteOption = Annotated[
    Path | None,
    typer.Option("--site", metavar="SITE", help="Compile --spec with the values of this site.", show_default=False),
]
DsrOption = Annotated[
    Path | None,
    typer.Option("--dsr", metavar="FILE", help="The DSR graph with which the run began, as JSON.", show_default=False),
]
DsrUnitOption = Annotated[
    float,
    typer.Option(
        "--dsr-unit-m", metavar="METRES", help="The unit of translations in the DSR file, in metres.", min=0.0
    ),
]
JournalOption = Annotated[
    Path | None,
    typer.Option("--journal", metavar="FILE", help="Write the derived events as a journal.", show_default=False),
]

_MAX_SHOWN_CHANGES = 5
_MAX_EVENT_TEXT_LENGTH = 2000
_DECISION_CHANGES: Mapping[str, str] = {
    "gained": "answered instead of a look",
    "lost": "replaced by a look",
    "other_value": "answered with another value",
    "unknown": "unknown",
    "assumed": "assumed",
}
_PREVIEW_CHANGES: Mapping[str, str] = {
    **_DECISION_CHANGES,
    "gained": "answered only in the replay",
    "lost": "answered only in the run",
    "other_value": "with another outcome",
}
"""Texts for the counts of decisions and of previews whose answers differ from the run."""
_REPLAY_ERRORS = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, AssertionError)
"""The errors of journals that no run has written, and of packages that cannot follow a journal."""


def replay_command(
    file: JournalFile,
    *,
    package: PackageOption = None,
    spec: SpecOption = None,
    site: SiteOption = None,
    dsr: DsrOption = None,
    dsr_unit_m: DsrUnitOption = 0.001,
    journal: JournalOption = None,
    from_: FromOption = None,
    to: ToOption = None,
    format_: Annotated[ResultFormat, typer.Option("--format", help="The format of the result.")] = ResultFormat.TEXT,
) -> None:
    """Derive the variables and decisions of a run again from its evidence, and compare them with the journal."""
    from codra_dsl.runtime.journal.events_in_file import EventsInFile
    from codra_dsl.runtime.replay.recording import Recording

    existing([path for path in (file, package, spec, site, dsr) if path is not None])
    if package is not None and spec is not None:
        raise typer.BadParameter("give either --package or --spec, not both", param_hint="--spec")
    if site is not None and spec is None:
        raise typer.BadParameter("give --spec as well: the spec of this site", param_hint="--site")
    if journal is not None and real_path(journal) == real_path(file):
        raise typer.BadParameter(f"'{journal}' is the journal itself", param_hint="--journal")
    with open_journal(file) as index_reader, open_journal(file) as reader:
        header = index_reader.header()
        end_s = EventsInFile(index_reader, header.summary).end_s
        is_torn = index_reader.damage.is_torn
        if is_torn:  # then the whole file was read, because it has no index; a program may still be writing it
            report_damage(index_reader, header.start_s if end_s is None else end_s)
        max_messages = index_reader.message_count if is_torn else None
        from_s, to_s = range_of(from_, to, header)
        if end_s is not None and end_s < from_s:
            raise typer.BadParameter(f"'{from_}' is after the end of the run", param_hint="--from")
        recording = Recording.of_file(reader, index_reader.kinds(), to_s, max_messages)
        with _loaded_package(header, package, spec, site) as module:
            make_knowledge = partial(_initial_knowledge, module, dsr, dsr_unit_m)
            replay_result, is_journal_complete = _replay(header, recording, from_s, module, make_knowledge, journal)
        if not is_torn and to is None:
            report_damage(reader, header.start_s if recording.end_s is None else recording.end_s)
    is_text = format_ is ResultFormat.TEXT
    text = harmless_text(_replay_result_text(replay_result, header)) if is_text else json_of(replay_result)
    write_result(text)
    is_clean = replay_result.difference is None and is_journal_complete
    raise typer.Exit(ExitCode.CLEAN if is_clean else ExitCode.FAILED)


def _create_journal(path: Path | None) -> Journal | None:
    from codra_dsl.runtime import Journal

    try:
        return None if path is None else Journal(path)
    except OSError as error:
        raise typer.BadParameter(f"cannot write '{path}': {error.strerror}", param_hint="--journal") from error


def _initial_knowledge(module: ModuleType, dsr: Path | None, unit_m: float) -> KnowledgeModel | None:
    """Return the knowledge that a spec declares, with the initial graph from a DSR file if there is one."""
    knowledge: KnowledgeModel | None = getattr(module, "KNOWLEDGE", None)
    if dsr is None:
        return knowledge
    if knowledge is None:
        raise typer.BadParameter("the spec declares no knowledge", param_hint="--dsr")
    from codra_dsl.runtime.knowledge.exchange import ExchangeError, import_dsr, read_dsr

    try:
        return import_dsr(knowledge, read_dsr(dsr), unit_m=unit_m).model
    except (ExchangeError, OSError) as error:
        raise typer.BadParameter(str(error), param_hint="--dsr") from error


@contextmanager
def _loaded_package(
    header: RunHeader, package: Path | None, spec: Path | None, site: Path | None
) -> Iterator[ModuleType]:
    """Load the package that the options or the journal name, and report how it differs from the one that ran."""
    import tempfile

    from codra_dsl.runtime.context.package_files import load_package

    with tempfile.TemporaryDirectory(prefix="codra-") as temporary_folder:
        if spec is None:
            folder = package or _default_package(header)
            package_text = f"'{os.path.relpath(folder)}'"
        else:
            folder = _compile_into(spec, site, Path(temporary_folder))
            package_text = f"of '{spec}'" if site is None else f"of '{spec}' with '{site}'"
        say(f"codra: the replay runs the package {package_text}")
        try:
            module = load_package(folder)
            module.MODEL  # noqa: B018 - every package has a `MODEL`
        except Exception as error:
            say(f"codra: '{folder}' is not a package of codra that can be loaded: {described(error)}")
            raise typer.Exit(ExitCode.FAILED) from error
        _report_version_differences(header, folder, is_default=spec is None and package is None)
        yield module


def _manager_class(module: ModuleType) -> Build:
    """Return the class of a package's context manager."""
    from codra_dsl.runtime import ContextManager

    classes = [cls for cls in vars(module).values() if isinstance(cls, type) and issubclass(cls, ContextManager)]
    return next((cls for cls in classes if cls is not ContextManager), ContextManager)


def _replay(  # noqa: PLR0917 - the arguments of the command
    header: RunHeader,
    recording: Recording,
    from_s: float,
    module: ModuleType,
    make_knowledge: Callable[[], KnowledgeModel | None],
    journal: Path | None,
) -> tuple[Replayed, bool]:
    """Return the result of the replay, and whether the journal of derived events is complete, if there is one."""
    from codra_dsl.cli.worlds import Progress
    from codra_dsl.runtime.replay import replay

    progress = Progress()
    try:
        knowledge, copy, build = make_knowledge(), _create_journal(journal), _manager_class(module)
        replay_result = replay(header, recording, module.MODEL, build, copy, knowledge, progress, from_s)
    except _REPLAY_ERRORS as error:
        say(f"codra: the journal cannot be replayed: {described(error)}")
        raise typer.Exit(ExitCode.FAILED) from error
    finally:
        progress.clear()
    if copy is not None and copy.failure is not None:
        say(f"codra: '{copy.path}' is incomplete: {copy.failure}")
    return replay_result, copy is None or copy.failure is None


def _default_package(header: RunHeader) -> Path:
    """Return the package that `codra compile` wrote for the spec that a journal names.

    A replay runs the package, and the journal may come from anybody. Therefore the journal must give the name of its
    spec as an identifier, and the package must be inside the project. A path in the journal, or a link that leads out
    of the project, is refused.
    """
    from codra_dsl.language.expression import is_identifier
    from codra_dsl.language.project import root_of

    if not is_identifier(header.spec):
        message = f"the journal names its spec {header.spec[:60]!r}, which is not a name: use --package or --spec"
        raise typer.BadParameter(message, param_hint="FILE")
    root = real_path(root_of(Path.cwd()))
    folder = root / "generated" / header.spec
    if not real_path(folder).is_relative_to(root):
        message = f"the package '{folder}' is a link that leads out of the project: use --package to run this package"
        raise typer.BadParameter(message, param_hint="FILE")
    if not (folder / "manifest.json").is_file():
        other_text = _text_of_package_that_ran(header) or "use --package or --spec"
        message = f"there is no package '{folder}' of '{header.spec}': {other_text}"
        raise typer.BadParameter(message, param_hint="FILE")
    return folder


def _text_of_package_that_ran(header: RunHeader) -> str:
    """Return which package of the project has the model of a run, e.g. that of a site; empty if none is known."""
    from codra_dsl.language.expression import is_identifier
    from codra_dsl.language.project import root_of
    from codra_dsl.runtime.context.package_files import manifest_of

    root = real_path(root_of(Path.cwd()))
    folders = sorted(root.glob(f"generated*/{header.spec}")) if is_identifier(header.spec) else []
    folder = next((folder for folder in folders if manifest_of(folder).get("model") == header.model), None)
    return "" if folder is None else f"the package that ran is '{os.path.relpath(folder)}': select it with --package"


def _compile_into(spec: Path, site: Path | None, folder: Path) -> Path:
    """Compile a spec into a temporary folder and return the package."""
    from codra_dsl.compiler import plan_paths
    from codra_dsl.generation.emit import emit

    paths, sites = [spec], [] if site is None else [site]
    planning_result = plan_paths(paths, common_root([*paths, *sites]), sites=sites)
    if len(planning_result.plans) != 1:
        arguments = spec if site is None else f"{spec} --site {site}"
        say(f"codra: '{spec}' does not compile to one package: see codra lint {arguments}")
        raise typer.Exit(ExitCode.FAILED)
    for path, text in emit(planning_result.plans[0]).items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    return folder / planning_result.plans[0].name


def _report_version_differences(header: RunHeader, folder: Path, *, is_default: bool) -> None:
    from codra_dsl import __version__
    from codra_dsl.runtime.context.package_files import manifest_of

    manifest = manifest_of(folder)
    if manifest.get("name") != header.spec:
        say(f"codra: the journal is about '{header.spec}', but the package is '{manifest.get('name')}'")
    elif manifest.get("model") != header.model:
        say(f"codra: the package differs from the one that ran (model {header.model[:19]}...): results may differ")
        if is_default and (package_text := _text_of_package_that_ran(header)):
            say(f"codra: {package_text}")
    if header.codra != __version__:
        say(f"codra: the run used codra {header.codra}, but this is codra {__version__}")


def _replay_result_text(replay_result: Replayed, header: RunHeader) -> str:
    derived_counts_text = ", ".join(f"{count} of kind {kind}" for kind, count in sorted(replay_result.derived.items()))
    absent_kinds_text = "".join(
        f"not compared, because the journal has no such events: {kind}\n" for kind in replay_result.absent
    )
    if replay_result.difference is None:
        return f"equal: {replay_result.compared} events\nderived: {derived_counts_text}\n{absent_kinds_text}"
    return _difference_text(replay_result.difference, header) + absent_kinds_text + _decisions_text(replay_result)


def _decisions_text(replay_result: Replayed) -> str:
    """Return how the decisions and previews would have been answered, and what the journal does not show."""
    lines = [
        *_count_lines("decisions", replay_result.decisions, _DECISION_CHANGES),
        *_count_lines("previews", replay_result.previews, _PREVIEW_CHANGES),
    ]
    lines += [
        f"not in the journal: {count} of the looks of {name}, because the run did not look at these times"
        for name, count in replay_result.missing_looks.items()
    ]
    lines += [
        f"not passed on: {count} of the inputs '{what}', which are not possible with this package"
        for what, count in replay_result.skipped_inputs.items()
    ]
    if replay_result.ended_because:
        lines.append(f"the replay ends early: {replay_result.ended_because}")
    return "".join(f"{line}\n" for line in lines)


def _count_lines(kind: str, counts: Mapping[str, DecisionCounts], change_texts: Mapping[str, str]) -> Iterator[str]:
    from codra_dsl.runtime.replay.decision_counts import total

    if not counts:
        return
    sum_ = total(counts)
    yield (
        f"{kind}: context would have answered {sum_.replayed} of {sum_.decisions}; "
        f"in the run, context answered {sum_.recorded}"
    )
    for name, row in counts.items():
        changes = _changes_text(row, change_texts)
        if changes:
            yield f"  {name}: {row.replayed} of {row.decisions}, in the run {row.recorded} ({changes})"
    if sum_.assumed:
        yield f"assumed: for these {kind}, the package looks when the run looked, and with the same values"


def _changes_text(row: DecisionCounts, change_texts: Mapping[str, str]) -> str:
    return ", ".join(f"{count} {text}" for name, text in change_texts.items() if (count := getattr(row, name)))


def _difference_text(difference: Difference, header: RunHeader) -> str:
    from codra_dsl.runtime.why.values import instant_text

    event = difference.recorded or difference.replayed
    if event is None:
        return ""
    place = _event_place(event, header.summary)
    lines = [
        f"differs at event {difference.position}, {instant_text(event.instant_s)}: {event.kind} {event.name}"
        f"{_variables_text(event, header.summary)}{f'  [{place}]' if place else ''}",
        f"  journal: {_event_text(difference.recorded)}",
        f"  replay:  {_event_text(difference.replayed)}",
    ]
    if difference.because:
        lines.append(f"  the comparison ends here: {difference.because}")
    lines.extend(f"  the spec differs: {change}" for change in difference.changes[:_MAX_SHOWN_CHANGES])
    if len(difference.changes) > _MAX_SHOWN_CHANGES:
        lines.append(f"  and {len(difference.changes) - _MAX_SHOWN_CHANGES} more changes, farther from this event")
    return "".join(f"{line}\n" for line in lines)


def _event_text(event: Event | None) -> str:
    from codra_dsl.runtime.journal.encoding import message_of

    if event is None:
        return "no event in its place"
    text = f"{event.kind} {message_of(event).decode()}"
    return text if len(text) <= _MAX_EVENT_TEXT_LENGTH else f"{text[:_MAX_EVENT_TEXT_LENGTH]}..."


def _variables_text(event: Event, spec_summary: SpecSummary) -> str:
    """Return the text about the variables for which a job runs; empty for other events."""
    from codra_dsl.runtime.journal import Kind

    algorithm = spec_summary.algorithms.get(event.name) if event.kind is Kind.JOB else None
    return "" if algorithm is None else f" for {', '.join(algorithm.identifies)}"


def _event_place(event: Event, spec_summary: SpecSummary) -> Place | None:
    """Return the place in the spec that explains an event.

    If a rule of an algorithm gave the value of a variable, this is the place of the rule. Otherwise it is the place of
    the element that the event is about.
    """
    from codra_dsl.runtime.journal.schemas import place_of

    algorithm = spec_summary.algorithms.get(str(event.details.get("source", "")))
    rule = None if algorithm is None else algorithm.identifies.get(event.name)
    return place_of(event.kind, event.name, spec_summary) if rule is None else rule.place
