"""The stages of compiling: find, load, check, plan, triage, emit.

Each stage is one function. It takes the frozen values of the previous stage and adds its own results and findings.
One spec passes load, check and plan before the next spec is read, so the YAML nodes of only one spec are in memory at a
time. If no input of a spec has changed since an earlier run, the earlier result is used instead of these stages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from pathlib import Path

from codra_dsl.collector import paused_collector
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import taken_class_name
from codra_dsl.generation.output import RULES, digests, holds
from codra_dsl.language.behavior_trees.named import named_tree_files, read_trees
from codra_dsl.language.check import CheckedSpec, check
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, has_binding_errors, has_errors
from codra_dsl.language.file_queries import Answers, PresentAnswers, merged_answers, recorded_queries
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load import Files, Loaded, find_files, load_spec, load_text
from codra_dsl.language.load.site.both_files import name_both_files
from codra_dsl.language.load.site.site_file import RequestedSites, find_sites, sites_without_spec
from codra_dsl.language.load.yaml.rules import RULES as LANGUAGE_RULES
from codra_dsl.language.load.yaml.source import AS_ON_DISK
from codra_dsl.language.model import Spec
from codra_dsl.language.project import relative_path
from codra_dsl.workspace.cache import Run, SpecResult, SpecResults, result_key
from codra_dsl.workspace.suppression import Settings, read_sources, settings_of, triage
from codra_dsl.workspace.timings import UNTIMED, Timings

__all__ = [
    "Compilation",
    "Planned",
    "compile_paths",
    "lint_paths",
    "plan_paths",
    "plan_text",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """Specs that were loaded, checked and planned.

    Attributes:
        root: the folder to which all paths in findings are relative.
        plans: a plan for each spec without an error that prevents planning, sorted by name. A spec whose earlier result
            is used has no plan, and `lint_paths` makes no plans.
        diagnostics: the findings after triage, in file order, without duplicates.
        files: the files of the specs and their parts, relative to the root; `specs` has the files of the specs alone.
        modules: files of Python modules and of trees that were read or were missing, relative to the root.
        answers: the queries about files on which the results of the specs depend, with their answers.
    """

    root: Path
    plans: tuple[BuildPlan, ...]
    diagnostics: tuple[Diagnostic, ...]
    settings: Settings
    files: tuple[str, ...]
    specs: tuple[str, ...]
    modules: tuple[str, ...] = ()
    answers: Answers = field(default_factory=dict)

    def as_run(self) -> Run:
        """Return the data that a command shows and the cache keeps."""
        return Run(diagnostics=self.diagnostics, specs=self.specs, answers=self.answers, fail_on=self.settings.fail_on)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compilation:
    """Specs that were compiled.

    Attributes:
        files: the generated text by path, relative to the output folder. It lacks the files of specs whose earlier
            results are used, because the output folder has them already. It is empty if there is an error.
        output_digests: the digest of each generated file, including those that `files` lacks.
        covered: the files and folders that were compiled, relative to the root.
    """

    planned: Planned
    files: Mapping[str, str] = field(default_factory=dict)
    output_digests: Mapping[str, str] = field(default_factory=dict)
    covered: tuple[str, ...] = ()

    def as_run(self) -> Run:
        """Return the data that a command shows and the cache keeps."""
        return replace(self.planned.as_run(), output_digests=self.output_digests, covered_paths=self.covered)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Request:
    """The specs that one call requests.

    Attributes:
        root: the folder of the project.
        files: the specs and parts at or below the requested paths.
        specs: the files of the specs, relative to the root.
        paths: the requested files and folders, relative to the root.
        texts: contents of files that are not read from disk.
        sites: the sites, by the name of the spec that they change.
        applies_sites: whether the sites replace their specs. Otherwise they are only checked.
        diagnostics: the findings about sites that cannot be read.
    """

    root: Path
    files: Files
    specs: Sequence[str]
    paths: Sequence[str]
    texts: Mapping[str, bytes]
    sites: RequestedSites = field(default_factory=dict)
    applies_sites: bool = False
    diagnostics: Sequence[Diagnostic] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spec:
    """One spec after the stage `check` or `plan`.

    Attributes:
        key: the key of the result in `SpecResults`.
        spec: None if `result` is an earlier result, if the spec cannot be read, or after `plan`.
        checked: None if there is no `spec`, if an error prevents planning, or after `plan`.
        build_plan: None before `plan`, or if there was no `checked`.
    """

    key: str
    result: SpecResult
    spec: Spec | None = None
    checked: CheckedSpec | None = None
    build_plan: BuildPlan | None = None


Inspection = Callable[[str, Spec, CheckedSpec | None], None]
"""A function that gets each spec that `lint_paths` loads: its key in `SpecResults`, the spec, and the checked spec."""


def _always(_: SpecResult) -> bool:
    return True


@paused_collector()
def compile_paths(
    paths: Sequence[Path],
    root: Path,
    timings: Timings = UNTIMED,
    results: SpecResults | None = None,
    out: Path | None = None,
    *,
    sites: Sequence[Path] = (),
) -> Compilation:
    """Compile all specs at or below some paths; if any of them has an error, nothing is emitted.

    Args:
        paths: the files and folders.
        root: the folder of the project.
        timings: measures the stages.
        results: earlier results of specs. Those that are out of date are replaced. None if there are none.
        out: the output folder. An earlier result is used only if the folder has the files that belong to it.
        sites: the sites for which the specs are compiled. Without them, the sites at or below the paths are checked.
    """
    request = _find(paths, root, AS_ON_DISK, timings, sites)
    results = {} if results is None or out is None else results
    checked_specs = _check(request, results, timings, lambda result: out is not None and _needs_no_output(result, out))
    specs = tuple(_plan(checked_specs, timings))
    planned = _triage(request, specs, timings)
    if has_errors(planned.diagnostics):
        return Compilation(planned=planned)
    files, output_digests = _emit(specs, results, timings)
    covered = sorted(path.absolute().relative_to(root).as_posix() for path in paths)
    return Compilation(planned=planned, files=files, output_digests=output_digests, covered=tuple(covered))


@paused_collector()
def plan_paths(
    paths: Sequence[Path],
    root: Path,
    texts: Mapping[str, bytes] = AS_ON_DISK,
    timings: Timings = UNTIMED,
    *,
    sites: Sequence[Path] = (),
) -> Planned:
    """Load, check and plan all specs at or below some paths; `texts` has contents that are not read from disk.

    With `sites`, the specs have the values of these sites.
    """
    request = _find(paths, root, texts, timings, sites)
    return _triage(request, tuple(_plan(_check(request, {}, timings), timings)), timings)


@paused_collector()
def lint_paths(
    paths: Sequence[Path],
    root: Path,
    texts: Mapping[str, bytes] = AS_ON_DISK,
    timings: Timings = UNTIMED,
    results: SpecResults | None = None,
    *,
    sites: Sequence[Path] = (),
    inspect: Inspection | None = None,
) -> Planned:
    """Load and check all specs at or below some paths. Nothing is planned, because this causes no findings.

    `texts` has contents that are not read from disk. `results` has earlier results of specs; those that are out of date
    are replaced. With `sites`, the specs have the values of these sites; without them, the sites at or below the paths
    are checked as well. `inspect` gets the specs whose earlier results are not used.
    """
    request = _find(paths, root, texts, timings, sites)
    specs: list[_Spec] = []
    for spec in _check(request, {} if results is None else results, timings):
        if inspect is not None and spec.spec is not None:
            inspect(spec.key, spec.spec, spec.checked)
        specs.append(replace(spec, spec=None, checked=None))
    return _triage(request, specs, timings)


@paused_collector()
def plan_text(text: str | bytes, file: str, root: Path, timings: Timings = UNTIMED) -> Planned:
    """Load, check and plan one spec that is given as text; `file` is its name in findings."""
    data = text.encode(errors="surrogatepass") if isinstance(text, str) else text
    request = _Request(root=root, files=Files(), specs=[file], paths=[file], texts={file: data})
    with recorded_queries() as answers:
        checked_spec = _load_and_check(file, lambda: load_text(text, file, root), root, answers, timings)
    return _triage(request, tuple(_plan([checked_spec], timings)), timings)


def _find(
    paths: Sequence[Path], root: Path, texts: Mapping[str, bytes], timings: Timings, sites: Sequence[Path]
) -> _Request:
    """Return the specs and parts at or below some paths; without `sites`, with the sites at or below the paths."""
    with timings.stage("find"):
        files = find_files(paths, root, texts)
        requested_sites, site_findings = find_sites(sites or files.sites, root, texts, one_for_each_spec=bool(sites))
    return _Request(
        root=root,
        files=files,
        specs=[relative_path(file, root) for file in files.specs],
        paths=[relative_path(path, root) for path in (*paths, *sites)],
        texts=texts,
        sites=requested_sites,
        applies_sites=bool(sites),
        diagnostics=site_findings,
    )


def _check(
    request: _Request, results: SpecResults, timings: Timings, is_usable: Callable[[SpecResult], bool] = _always
) -> Iterator[_Spec]:
    """Yield each spec after the stages `load` and `check`, or with its earlier result, if nothing has changed since.

    `is_usable` returns whether an earlier result that is up to date can be used.
    """
    checks = _Checks(request, results, timings)
    for file in request.files.specs:
        yield from checks.check(file, is_usable)


class _Checks:
    """The stages `load` and `check` for the specs of one request."""

    def __init__(self, request: _Request, results: SpecResults, timings: Timings) -> None:
        self._request, self._results, self._timings = request, results, timings
        self._present_answers = PresentAnswers(request.texts)

    def check(self, file: Path, is_usable: Callable[[SpecResult], bool]) -> Iterator[_Spec]:
        """Yield the spec in a file, and the spec with the values of each of its sites.

        If the sites are applied, the spec alone is left out; otherwise the spec with a site is not planned.
        """
        sites, applies_sites = self._request.sites, self._request.applies_sites
        spec = self._spec(file, lambda result: (applies_sites and result.name in sites) or is_usable(result))
        sites_of_spec = sites.get(spec.result.name or "", ())
        if not (applies_sites and sites_of_spec):
            yield spec
        for site in sites_of_spec:
            spec_at_site = self._spec(file, is_usable if applies_sites else _always, site.path, spec.result)
            if applies_sites:
                yield spec_at_site
            else:
                yield replace(spec_at_site, checked=None, result=replace(spec_at_site.result, output_digests={}))

    def _spec(
        self,
        file: Path,
        is_usable: Callable[[SpecResult], bool],
        site: Path | None = None,
        without_site: SpecResult | None = None,
    ) -> _Spec:
        request = self._request
        key = result_key(file, request.root, site)
        earlier_result = self._results.get(key)
        if (
            earlier_result is not None
            and self._present_answers.agree_with(earlier_result.answers)
            and is_usable(earlier_result)
        ):
            return _Spec(key=key, result=earlier_result)
        load = partial(load_spec, file, request.root, request.texts, site)
        with recorded_queries() as answers:
            checked_spec = _load_and_check(key, load, request.root, answers, self._timings, without_site=without_site)
        self._results[key] = checked_spec.result
        return checked_spec


def _load_and_check(
    key: str,
    load: Callable[[], Loaded],
    root: Path,
    answers: Answers,
    timings: Timings,
    *,
    without_site: SpecResult | None = None,
) -> _Spec:
    """Return a spec with the findings of reading it, of its checks, and of the behaviour trees that it names.

    `without_site` is the result of the spec alone, if the spec is loaded with a site.
    """
    with timings.stage("load"):
        spec, load_findings = load()
    if spec is None:
        return _Spec(key=key, result=SpecResult(diagnostics=load_findings, answers=answers))
    with timings.stage("check"):
        forests_by_tree_name = read_trees(spec, root)
        checked, check_findings = check(spec, forests_by_tree_name)
    findings = (*load_findings, *_taken_class_name(spec))
    diagnostics = (*findings, *check_findings)
    if spec.site is not None and without_site is not None:
        diagnostics = tuple(name_both_files(diagnostics, without_site.diagnostics, spec))
        answers = merged_answers((answers, without_site.answers))
    result = SpecResult(
        diagnostics=diagnostics,
        answers=answers,
        name=spec.name,
        place=spec.place,
        file=spec.file,
        files=spec.files,
        modules=spec.modules,
        tree_files=tuple(named_tree_files(spec, forests_by_tree_name)),
    )
    return _Spec(key=key, result=result, spec=spec, checked=None if has_errors(findings) else checked)


def _needs_no_output(result: SpecResult, out: Path) -> bool:
    """Return whether the output of a spec need not be generated: it is in the output folder, or nothing is emitted."""
    return has_binding_errors(result.diagnostics) or bool(result.output_digests and holds(result.output_digests, out))


def _plan(checked_specs: Iterable[_Spec], timings: Timings) -> Iterator[_Spec]:
    """Yield each spec with its build plan."""
    for spec in checked_specs:
        with timings.stage("plan"):
            build_plan = plan(spec.checked) if spec.checked is not None else None
        yield replace(spec, spec=None, checked=None, build_plan=build_plan)


def _triage(request: _Request, specs: Sequence[_Spec], timings: Timings) -> Planned:
    """Return the plans of specs, with all findings after triage."""
    settings, settings_findings = settings_of(request.root)
    results = [spec.result for spec in specs]
    diagnostics = [*settings_findings, *request.files.diagnostics, *request.diagnostics]
    diagnostics += (diagnostic for result in results for diagnostic in result.diagnostics)
    diagnostics += _same_names(results)
    diagnostics += sites_without_spec(request.sites, (result.name for result in results))
    files = tuple(sorted({*request.specs, *(file for result in results for file in result.files)}))
    if not has_errors(diagnostics):
        diagnostics += request.files.unincluded(files, request.root)

    tree_files = {file for result in results for file in result.tree_files}
    with timings.stage("triage"):
        files_with_comments = (*files, *_part_files(request.files), *tree_files)
        sources = read_sources(files_with_comments, request.paths, request.root, request.texts)
        # A comment may silence a finding that only the spec without the site has.
        has_all_findings = not request.applies_sites
        triaged_diagnostics = triage(diagnostics, settings, sources, has_all_findings=has_all_findings)

    plans = [spec.build_plan for spec in specs if spec.build_plan is not None]
    return Planned(
        root=request.root,
        plans=tuple(sorted(plans, key=lambda build_plan: build_plan.name)),
        diagnostics=triaged_diagnostics,
        settings=settings,
        files=files,
        specs=tuple(request.specs),
        modules=tuple(sorted({file for result in results for file in result.modules} | tree_files)),
        answers=merged_answers(result.answers for result in results),
    )


def _emit(
    specs: Iterable[_Spec], results: SpecResults, timings: Timings
) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return the generated files of all plans, and the digests of all generated files of all specs.

    The files include the `__init__.py` of the package that contains the packages of the specs.
    """
    from codra_dsl.generation.emit import emit, package_text  # noqa: PLC0415  slow, and `codra lint` never needs it

    with timings.stage("emit"):
        files = {"__init__.py": package_text()}
        output_digests = dict(digests(files))
        for spec in specs:
            result = spec.result
            if spec.build_plan is not None:
                texts = emit(spec.build_plan)
                files |= texts
                results[spec.key] = result = replace(result, output_digests=digests(texts))
            output_digests |= result.output_digests
    return files, output_digests


def _part_files(files: Files) -> Iterator[str]:
    """Return the files of all parts, including parts that no spec includes."""
    return (place.span.file for place in files.parts.values())


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


def _same_names(results: Iterable[SpecResult]) -> Iterator[Diagnostic]:
    """Yield a finding for each spec that has the name of another spec: their packages would overwrite each other."""
    first_names: dict[str, tuple[str, Place]] = {}
    named = ((result.file, result.name, result.place) for result in results if result.name is not None and result.place)
    for file, name, place in sorted(named, key=lambda spec: spec[0]):
        other_file, other_place = first_names.setdefault(name.casefold(), (file, place))
        if other_file != file:
            yield Diagnostic(
                rule=RULES["same-spec-name"],
                message=f"the name '{name}' is taken by {other_file}",
                place=place,
                path="name",
                help="give each spec a name of its own: it names the generated package",
                related=(Related("the other spec", other_place),),
            )
