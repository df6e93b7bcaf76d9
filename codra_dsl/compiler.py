"""Load, check, plan, emit: each stage takes the values of the one before and adds its findings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from codra_dsl.build_plan import BuildPlan
from codra_dsl.check import check
from codra_dsl.diagnostics import Diagnostic, Related, has_errors, in_file_order
from codra_dsl.emit import emit, package_text
from codra_dsl.load import load_spec, load_text, spec_files
from codra_dsl.model import Spec
from codra_dsl.output import RULES
from codra_dsl.plan import plan


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """Specs that were loaded, checked and planned.

    Attributes:
        root: the folder that all paths in findings are relative to.
        plans: of the specs without errors, by name.
        diagnostics: in file order, each once.
    """

    root: Path
    plans: tuple[BuildPlan, ...]
    diagnostics: tuple[Diagnostic, ...]


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


def compile_paths(paths: Sequence[Path], root: Path) -> Compilation:
    """Compile all specs at or below some paths; with an error in any of them nothing is emitted."""
    planned = plan_paths(paths, root)
    if has_errors(planned.diagnostics):
        return Compilation(planned=planned)
    files = {"__init__.py": package_text()}
    for each in planned.plans:
        files |= emit(each)
    covered = sorted(path.absolute().relative_to(root).as_posix() for path in paths)
    return Compilation(planned=planned, files=files, covered=tuple(covered))


def plan_paths(paths: Sequence[Path], root: Path) -> Planned:
    """Load, check and plan all specs at or below some paths."""
    files, found = spec_files(paths, root)
    return _planned(root, found, (load_spec(file, root) for file in files))


def plan_text(text: str | bytes, file: str, root: Path) -> Planned:
    """Load, check and plan one spec that stands in no file."""
    return _planned(root, (), [load_text(text, file, root)])


def _planned(
    root: Path, found: Iterable[Diagnostic], loaded: Iterable[tuple[Spec | None, tuple[Diagnostic, ...]]]
) -> Planned:
    diagnostics = [*found]
    specs: list[Spec] = []
    plans: list[BuildPlan] = []
    for spec, read in loaded:
        checked, judged = check(spec) if spec is not None else (None, ())
        diagnostics += (*read, *judged)
        specs += [spec] if spec is not None else []
        plans += [plan(checked)] if checked is not None and not has_errors(read) else []
    diagnostics += _same_names(specs)
    return Planned(
        root=root,
        plans=tuple(sorted(plans, key=lambda each: each.name)),
        diagnostics=in_file_order(diagnostics),
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
