"""Implementation of `codra lint --fix` and `--diff`: apply safe fixes to files or to a text from standard input."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Container, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from codra_dsl.cli.console import STANDARD_INPUT, common_root, existing
from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.compiler import Planned
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.workspace.cache import SpecResults
    from codra_dsl.workspace.timings import Timings


@dataclass(frozen=True, slots=True, kw_only=True)
class LintInput:
    """The specs to lint.

    Attributes:
        root: the folder to which the files in findings are relative.
        requested_paths: the files and folders on the command line, relative to the root.
        lint: loads and checks the specs. The first argument contains the new contents of files; these replace the
            contents on disk. The second argument has earlier results of specs, which are used and replaced.
        stdin_data: the text from standard input; None if the specs are in files.
    """

    root: Path
    requested_paths: tuple[str, ...]
    lint: Callable[[Mapping[str, bytes], SpecResults], Planned]
    stdin_data: bytes | None = None

    def texts(self, planning_result: Planned) -> dict[str, bytes]:
        """Return the contents of the files that fixes may change."""
        from codra_dsl.workspace.suppression import read_rewritable_files

        files = filter(self.may_change, planning_result.files)
        return read_rewritable_files(files, self.root) if self.stdin_data is None else {STANDARD_INPUT: self.stdin_data}

    def may_change(self, file: str) -> bool:
        """Return whether fixes may change a file: the file, or a folder that contains it, is on the command line."""
        from codra_dsl.language.project import covers

        return covers(self.requested_paths, file)

    def count_fixable(self, diagnostics: Sequence[Diagnostic]) -> tuple[int, str]:
        """Return the number of findings that can be fixed, and a hint.

        If more findings could be fixed by linting a larger folder, the hint names this folder. Otherwise it is empty.
        """
        from codra_dsl.language.diagnostics import is_safe

        fixes = [diagnostic.fix for diagnostic in diagnostics if diagnostic.fix is not None and is_safe(diagnostic)]
        file_sets = [{edit.span.file for edit in fix.edits} for fix in fixes]
        outside_file_sets = [file_set for file_set in file_sets if not all(map(self.may_change, file_set))]
        if not outside_file_sets:
            return len(file_sets), ""
        folder = os.path.relpath(
            self.root / os.path.commonpath([*self.requested_paths, *chain.from_iterable(outside_file_sets)])
        )
        hint = f"; {len(outside_file_sets)} more can be fixed if you lint '{folder}'"
        return len(file_sets) - len(outside_file_sets), hint


def input_from_files(paths: list[Path], timings: Timings, sites: Sequence[Path] = ()) -> LintInput:
    """Return the specs at or below some paths, with the values of some sites, as the input of linting."""
    from codra_dsl.language.project import relative_path

    paths, sites = existing(paths), existing(sites)
    root = common_root([*paths, *sites])

    def lint(texts: Mapping[str, bytes], results: SpecResults) -> Planned:
        from codra_dsl.compiler import lint_paths

        return lint_paths(paths, root, texts, timings, results, sites=sites)

    return LintInput(
        root=root, requested_paths=tuple(relative_path(path, root) for path in (*paths, *sites)), lint=lint
    )


def input_from_standard_input(timings: Timings) -> LintInput:
    """Return the spec from standard input as the input of linting."""
    from codra_dsl.compiler import plan_text
    from codra_dsl.language.load.yaml.source import MAX_BYTES

    root = common_root([Path.cwd()])
    stdin_data = sys.stdin.buffer.read(MAX_BYTES + 1)
    return LintInput(
        root=root,
        requested_paths=(STANDARD_INPUT,),
        lint=lambda texts, _: plan_text(texts.get(STANDARD_INPUT, stdin_data), STANDARD_INPUT, root, timings),
        stdin_data=stdin_data,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FixResult:
    """The result of fixing.

    Attributes:
        planning_result: the plans and findings after fixing.
        diagnostics: the findings after fixing, and findings about files that could not be written.
        fixed_count: the number of findings that were fixed.
        before: the previous contents of the files that fixes may change.
        after: the new contents of the files that have changed.
    """

    planning_result: Planned
    diagnostics: tuple[Diagnostic, ...]
    fixed_count: int
    before: Mapping[str, bytes]
    after: Mapping[str, bytes]

    def diff(self) -> str:
        """Return the difference between the previous and the new contents of the files."""
        from codra_dsl.workspace.suppression import unified_diff

        return "".join(unified_diff(self.before[file], after, file) for file, after in sorted(self.after.items()))


def fix(lint_input: LintInput, *, write: bool) -> FixResult:
    """Fix specs. If `write` is true and the specs are in files, write the changed files.

    The texts to fix are read once. If somebody else changes a file in the meantime, that file is not written.
    """
    from codra_dsl.language.load.yaml.source import MAX_BYTES
    from codra_dsl.workspace.suppression import fix_all, rewrite

    if lint_input.stdin_data is not None and len(lint_input.stdin_data) > MAX_BYTES:
        raise typer.BadParameter(f"the text has more than {MAX_BYTES >> 20} MiB: it is not fixed", param_hint="-")
    results: SpecResults = {}
    before = lint_input.texts(lint_input.lint({}, results))
    fix_result = fix_all(lambda texts: lint_input.lint({**before, **texts}, results).diagnostics, before)
    texts_to_write = fix_result.texts if write and lint_input.stdin_data is None else {}
    findings_by_file = {
        file: rewrite(file, lint_input.root, before[file], after) for file, after in sorted(texts_to_write.items())
    }
    refusals = {file: finding for file, finding in findings_by_file.items() if finding is not None}
    planning_result = lint_input.lint({} if refusals else {**before, **fix_result.texts}, results)
    return FixResult(
        planning_result=planning_result,
        diagnostics=(*planning_result.diagnostics, *refusals.values()),
        fixed_count=sum(not _edits_any_file(finding, refusals) for finding in fix_result.fixed_findings),
        before=before,
        after=fix_result.texts,
    )


def _edits_any_file(diagnostic: Diagnostic, files: Container[str]) -> bool:
    return diagnostic.fix is not None and any(edit.span.file in files for edit in diagnostic.fix.edits)
