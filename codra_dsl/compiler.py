"""Load, check, plan, emit: each stage takes the values of the one before and adds its findings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from codra_dsl.build_plan import BuildPlan
from codra_dsl.cache import Run
from codra_dsl.check import check
from codra_dsl.collector import paused_collector
from codra_dsl.diagnostics import Diagnostic, Related, has_errors
from codra_dsl.emit import emit, package_text
from codra_dsl.load import Files, Loaded, find_files, load_spec, load_text
from codra_dsl.load.source import AS_ON_DISK
from codra_dsl.model import Spec
from codra_dsl.output import RULES, digests
from codra_dsl.plan import plan
from codra_dsl.project import relative
from codra_dsl.timings import UNTIMED, Timings
from codra_dsl.trees.named import files_read, read_trees
from codra_dsl.triage import Settings, read_sources, settings_of, triaged


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """Specs that were loaded, checked and planned.

    Attributes:
        root: the folder that all paths in findings are relative to.
        plans: of the specs without errors that keep them from being planned, by name.
        diagnostics: as the project's settings and comments in the specs want them, in file order, each once.
        files: of the specs, with their parts, relative to the root; `specs` has those of the specs alone.
        modules: files of Python modules and of trees that were read, or looked for in vain, relative to the root.
    """

    root: Path
    plans: tuple[BuildPlan, ...]
    diagnostics: tuple[Diagnostic, ...]
    settings: Settings
    files: tuple[str, ...]
    specs: tuple[str, ...]
    modules: tuple[str, ...] = ()

    def as_run(self) -> Run:
        """Return what a command shows of them."""
        files = (*self.files, *self.modules)
        return Run(diagnostics=self.diagnostics, specs=self.specs, files=files, fail_on=self.settings.fail_on)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compilation:
    """Specs that were compiled.

    Attributes:
        files: the output by path, relative to the output folder; empty where there are errors.
        covered: the files and folders that were compiled, relative to the root.
    """

    planned: Planned
    files: Mapping[str, str] = field(default_factory=dict)
    covered: tuple[str, ...] = ()

    def as_run(self) -> Run:
        """Return what a command shows of them."""
        return replace(self.planned.as_run(), outputs=digests(self.files), covered=self.covered)


@paused_collector()
def compile_paths(paths: Sequence[Path], root: Path, timings: Timings = UNTIMED) -> Compilation:
    """Compile all specs at or below some paths; with an error in any of them nothing is emitted."""
    planned = plan_paths(paths, root, timings=timings)
    if has_errors(planned.diagnostics):
        return Compilation(planned=planned)
    with timings.stage("emit"):
        files = {"__init__.py": package_text()}
        for each in planned.plans:
            files |= emit(each)
    covered = sorted(path.absolute().relative_to(root).as_posix() for path in paths)
    return Compilation(planned=planned, files=files, covered=tuple(covered))


@paused_collector()
def plan_paths(
    paths: Sequence[Path], root: Path, texts: Mapping[str, bytes] = AS_ON_DISK, timings: Timings = UNTIMED
) -> Planned:
    """Load, check and plan all specs at or below some paths; `texts` has files that are not read from disk."""
    with timings.stage("find"):
        found = find_files(paths, root)
    names = [relative(file, root) for file in found.specs]
    asked = [relative(path, root) for path in paths]
    loaded = _loaded(found.specs, root, texts, timings)
    return _planned(root, found, loaded, names=names, asked=asked, texts=texts, timings=timings)


@paused_collector()
def plan_text(text: str | bytes, file: str, root: Path, timings: Timings = UNTIMED) -> Planned:
    """Load, check and plan one spec that stands in no file."""
    data = text.encode(errors="surrogatepass") if isinstance(text, str) else text
    with timings.stage("load"):
        loaded = [load_text(text, file, root)]
    return _planned(root, Files(), loaded, names=[file], asked=[file], texts={file: data}, timings=timings)


def _loaded(files: Iterable[Path], root: Path, texts: Mapping[str, bytes], timings: Timings) -> Iterator[Loaded]:
    """Yield one spec after the other, so that there are never the nodes of several."""
    for file in files:
        with timings.stage("load"):
            loaded = load_spec(file, root, texts)
        yield loaded


def _planned(
    root: Path,
    found: Files,
    loaded: Iterable[Loaded],
    *,
    names: Sequence[str],
    asked: Sequence[str],
    texts: Mapping[str, bytes],
    timings: Timings,
) -> Planned:
    settings, about_settings = settings_of(root)
    diagnostics = [*about_settings, *found.diagnostics]
    specs: list[Spec] = []
    plans: list[BuildPlan] = []
    read_too: set[str] = set()
    trees_read: set[str] = set()
    for spec, read in loaded:
        with timings.stage("check"):
            trees = read_trees(spec, root) if spec is not None else {}
            checked, judged = check(spec, trees) if spec is not None else (None, ())
        trees_read |= set(files_read(spec, trees)) if spec is not None else set()
        read_too |= {*spec.modules} if spec is not None else set()
        diagnostics += (*read, *judged)
        specs += [spec] if spec is not None else []
        with timings.stage("plan"):
            plans += [plan(checked)] if checked is not None and not has_errors(read) else []
    diagnostics += _same_names(specs)
    files = tuple(sorted({*names, *(file for spec in specs for file in spec.files)}))
    diagnostics += () if has_errors(diagnostics) else found.unincluded(files, root)
    commented = (*files, *(place.span.file for place in found.parts.values()), *trees_read)
    with timings.stage("triage"):
        wanted = triaged(diagnostics, settings, read_sources(commented, asked, root, texts))
    return Planned(
        root=root,
        plans=tuple(sorted(plans, key=lambda each: each.name)),
        diagnostics=wanted,
        settings=settings,
        files=files,
        specs=tuple(names),
        modules=tuple(sorted(read_too | trees_read)),
    )


def _same_names(specs: Iterable[Spec]) -> Iterator[Diagnostic]:
    """Yield a finding for each spec whose name another has taken: their packages would overwrite each other."""
    first: dict[str, Spec] = {}
    for spec in sorted(specs, key=lambda each: each.file):
        other = first.setdefault(spec.name.casefold(), spec)
        if other is not spec:
            yield Diagnostic(
                rule=RULES["same-spec-name"],
                message=f"the name '{spec.name}' is taken by {other.file}",
                place=spec.place,
                path="name",
                help="give each spec a name of its own: it names the generated package",
                related=(Related("the other spec", other.place),),
            )
