"""The stages of compiling: find, load, check, plan, triage, emit.

Each stage is one function. It takes the frozen values of the previous stage and adds its own results and findings.
Load, check and plan are generators: one spec passes all three before the next spec is read, so the YAML nodes of only
one spec are in memory at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from codra_dsl.collector import paused_collector
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import taken_class_name
from codra_dsl.generation.output import RULES, digests
from codra_dsl.language.behavior_trees.named import named_tree_files, read_trees
from codra_dsl.language.check import CheckedSpec, check
from codra_dsl.language.diagnostics import Diagnostic, Related, has_errors
from codra_dsl.language.load import Files, Loaded, find_files, load_spec, load_text
from codra_dsl.language.load.yaml.rules import RULES as LANGUAGE_RULES
from codra_dsl.language.load.yaml.source import AS_ON_DISK
from codra_dsl.language.model import Spec
from codra_dsl.language.project import relative_path
from codra_dsl.workspace.cache import Run
from codra_dsl.workspace.suppression import Settings, read_sources, settings_of, triage
from codra_dsl.workspace.timings import UNTIMED, Timings

__all__ = [
    "Compilation",
    "Planned",
    "compile_paths",
    "plan_paths",
    "plan_text",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """Specs that were loaded, checked and planned.

    Attributes:
        root: the folder to which all paths in findings are relative.
        plans: a plan for each spec without an error that prevents planning, sorted by name.
        diagnostics: the findings after triage, in file order, without duplicates.
        files: the files of the specs and their parts, relative to the root; `specs` has the files of the specs alone.
        modules: files of Python modules and of trees that were read or were missing, relative to the root.
    """

    root: Path
    plans: tuple[BuildPlan, ...]
    diagnostics: tuple[Diagnostic, ...]
    settings: Settings
    files: tuple[str, ...]
    specs: tuple[str, ...]
    modules: tuple[str, ...] = ()

    def as_run(self) -> Run:
        """Return the data that a command shows and the cache keeps."""
        files = (*self.files, *self.modules)
        return Run(diagnostics=self.diagnostics, specs=self.specs, files=files, fail_on=self.settings.fail_on)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compilation:
    """Specs that were compiled.

    Attributes:
        files: the generated text by path, relative to the output folder; empty if there is an error.
        covered: the files and folders that were compiled, relative to the root.
    """

    planned: Planned
    files: Mapping[str, str] = field(default_factory=dict)
    covered: tuple[str, ...] = ()

    def as_run(self) -> Run:
        """Return the data that a command shows and the cache keeps."""
        return replace(self.planned.as_run(), output_digests=digests(self.files), covered_paths=self.covered)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Request:
    """The specs that one call requests.

    Attributes:
        root: the folder of the project.
        files: the specs and parts at or below the requested paths.
        specs: the files of the specs, relative to the root.
        paths: the requested files and folders, relative to the root.
        texts: contents of files that are not read from disk.
    """

    root: Path
    files: Files
    specs: Sequence[str]
    paths: Sequence[str]
    texts: Mapping[str, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class _SpecAfterCheck:
    """One spec after the stage `check`.

    Attributes:
        spec: None if the file could not be read as a spec.
        checked: None if an error prevents planning.
        tree_files: files of behaviour trees that were read or were missing, relative to the root.
        diagnostics: the findings of load, then those of check.
    """

    spec: Spec | None
    checked: CheckedSpec | None
    tree_files: tuple[str, ...]
    diagnostics: tuple[Diagnostic, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _SpecAfterPlan:
    """One spec after the stage `plan`; `build_plan` is None if an error prevents planning."""

    spec: Spec | None
    build_plan: BuildPlan | None
    tree_files: tuple[str, ...]
    diagnostics: tuple[Diagnostic, ...]


@paused_collector()
def compile_paths(paths: Sequence[Path], root: Path, timings: Timings = UNTIMED) -> Compilation:
    """Compile all specs at or below some paths; if any of them has an error, nothing is emitted."""
    planned = plan_paths(paths, root, timings=timings)
    if has_errors(planned.diagnostics):
        return Compilation(planned=planned)
    files = _emit(planned.plans, timings)
    covered = sorted(path.absolute().relative_to(root).as_posix() for path in paths)
    return Compilation(planned=planned, files=files, covered=tuple(covered))


@paused_collector()
def plan_paths(
    paths: Sequence[Path], root: Path, texts: Mapping[str, bytes] = AS_ON_DISK, timings: Timings = UNTIMED
) -> Planned:
    """Load, check and plan all specs at or below some paths; `texts` has contents that are not read from disk."""
    with timings.stage("find"):
        files = find_files(paths, root)
    request = _Request(
        root=root,
        files=files,
        specs=[relative_path(file, root) for file in files.specs],
        paths=[relative_path(path, root) for path in paths],
        texts=texts,
    )
    return _plan_request(request, _load(files.specs, root, texts, timings), timings)


@paused_collector()
def plan_text(text: str | bytes, file: str, root: Path, timings: Timings = UNTIMED) -> Planned:
    """Load, check and plan one spec that is given as text; `file` is its name in findings."""
    data = text.encode(errors="surrogatepass") if isinstance(text, str) else text
    with timings.stage("load"):
        loaded_spec = load_text(text, file, root)
    request = _Request(root=root, files=Files(), specs=[file], paths=[file], texts={file: data})
    return _plan_request(request, [loaded_spec], timings)


def _plan_request(request: _Request, loaded_specs: Iterable[Loaded], timings: Timings) -> Planned:
    """Return the plans of the loaded specs, with all findings after triage."""
    settings, settings_findings = settings_of(request.root)

    checked_specs = _check(loaded_specs, request.root, timings)
    specs = tuple(_plan(checked_specs, timings))

    diagnostics = [*settings_findings, *request.files.diagnostics]
    diagnostics += (diagnostic for spec in specs for diagnostic in spec.diagnostics)
    diagnostics += _same_names(spec.spec for spec in specs if spec.spec is not None)
    files = _spec_files(request, specs)
    if not has_errors(diagnostics):
        diagnostics += request.files.unincluded(files, request.root)

    with timings.stage("triage"):
        files_with_comments = (*files, *_part_files(request.files), *_tree_files(specs))
        sources = read_sources(files_with_comments, request.paths, request.root, request.texts)
        triaged_diagnostics = triage(diagnostics, settings, sources)

    plans = [spec.build_plan for spec in specs if spec.build_plan is not None]
    return Planned(
        root=request.root,
        plans=tuple(sorted(plans, key=lambda build_plan: build_plan.name)),
        diagnostics=triaged_diagnostics,
        settings=settings,
        files=files,
        specs=tuple(request.specs),
        modules=tuple(sorted(_module_files(specs) | _tree_files(specs))),
    )


def _load(files: Iterable[Path], root: Path, texts: Mapping[str, bytes], timings: Timings) -> Iterator[Loaded]:
    """Yield each spec as it was read, with the findings of reading it."""
    for file in files:
        with timings.stage("load"):
            loaded_spec = load_spec(file, root, texts)
        yield loaded_spec


def _check(loaded_specs: Iterable[Loaded], root: Path, timings: Timings) -> Iterator[_SpecAfterCheck]:
    """Yield each spec with the results of its checks, and of the checks of the behaviour trees that the spec names."""
    for spec, load_findings in loaded_specs:
        with timings.stage("check"):
            checked_spec = _check_spec(spec, load_findings, root)
        yield checked_spec


def _check_spec(spec: Spec | None, load_findings: tuple[Diagnostic, ...], root: Path) -> _SpecAfterCheck:
    if spec is None:
        return _SpecAfterCheck(spec=None, checked=None, tree_files=(), diagnostics=load_findings)
    forests_by_tree_name = read_trees(spec, root)
    checked, check_findings = check(spec, forests_by_tree_name)
    findings = (*load_findings, *_taken_class_name(spec))
    return _SpecAfterCheck(
        spec=spec,
        checked=None if has_errors(findings) else checked,
        tree_files=tuple(named_tree_files(spec, forests_by_tree_name)),
        diagnostics=(*findings, *check_findings),
    )


def _taken_class_name(spec: Spec) -> Iterator[Diagnostic]:
    """Yield a finding if the name of a spec's class already has another meaning in the generated package."""
    name = taken_class_name(spec)
    if name is not None:
        yield Diagnostic(
            rule=LANGUAGE_RULES["reserved-name"],
            message=f"the generated class would be '{name}', which has another meaning in the generated package",
            place=spec.place,
            path="name",
            help=f"choose another name, such as '{spec.name.rstrip('_')}_context'",
        )


def _plan(checked_specs: Iterable[_SpecAfterCheck], timings: Timings) -> Iterator[_SpecAfterPlan]:
    """Yield each spec with its build plan."""
    for spec in checked_specs:
        with timings.stage("plan"):
            build_plan = plan(spec.checked) if spec.checked is not None else None
        yield _SpecAfterPlan(
            spec=spec.spec, build_plan=build_plan, tree_files=spec.tree_files, diagnostics=spec.diagnostics
        )


def _emit(plans: Iterable[BuildPlan], timings: Timings) -> Mapping[str, str]:
    """Return the generated files of all plans, and the `__init__.py` of the package that contains them."""
    from codra_dsl.generation.emit import emit, package_text  # noqa: PLC0415  slow, and `codra lint` never needs it

    with timings.stage("emit"):
        files = {"__init__.py": package_text()}
        for build_plan in plans:
            files |= emit(build_plan)
    return files


def _spec_files(request: _Request, specs: Iterable[_SpecAfterPlan]) -> tuple[str, ...]:
    """Return the files of the specs and of the parts that they include."""
    included_files = (file for spec in specs if spec.spec is not None for file in spec.spec.files)
    return tuple(sorted({*request.specs, *included_files}))


def _part_files(files: Files) -> Iterator[str]:
    """Return the files of all parts, including parts that no spec includes."""
    return (place.span.file for place in files.parts.values())


def _tree_files(specs: Iterable[_SpecAfterPlan]) -> set[str]:
    """Return the files of behaviour trees that specs name."""
    return {file for spec in specs for file in spec.tree_files}


def _module_files(specs: Iterable[_SpecAfterPlan]) -> set[str]:
    """Return the files of Python modules that specs name."""
    return {file for spec in specs if spec.spec is not None for file in spec.spec.modules}


def _same_names(specs: Iterable[Spec]) -> Iterator[Diagnostic]:
    """Yield a finding for each spec that has the name of another spec: their packages would overwrite each other."""
    first_specs: dict[str, Spec] = {}
    for spec in sorted(specs, key=lambda spec: spec.file):
        other = first_specs.setdefault(spec.name.casefold(), spec)
        if other is not spec:
            yield Diagnostic(
                rule=RULES["same-spec-name"],
                message=f"the name '{spec.name}' is taken by {other.file}",
                place=spec.place,
                path="name",
                help="give each spec a name of its own: it names the generated package",
                related=(Related("the other spec", other.place),),
            )
