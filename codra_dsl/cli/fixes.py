"""What `codra lint --fix` and `--diff` do: fix specs as far as a tool may, in their files or on standard output."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from codra_dsl.cli.console import STANDARD_INPUT, common_root, existing

if TYPE_CHECKING:
    from codra_dsl.compiler import Planned
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.workspace.timings import Timings


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """The specs to lint.

    Attributes:
        asked: the files and folders that were named, relative to the root.
        plan: returns what is found, with some files changed.
        data: of standard input; None where the specs stand in files.
    """

    root: Path
    asked: tuple[str, ...]
    plan: Callable[[Mapping[str, bytes]], Planned]
    data: bytes | None = None

    def texts(self, planned: Planned) -> dict[str, bytes]:
        """Return what the files hold that may be changed."""
        from codra_dsl.workspace.suppression import rewritable

        files = filter(self.may_change, planned.files)
        return rewritable(files, self.root) if self.data is None else {STANDARD_INPUT: self.data}

    def may_change(self, file: str) -> bool:
        """Return whether fixes may change a file: one that was named, or stands in a folder that was."""
        from codra_dsl.language.project import covers

        return covers(self.asked, file)

    def fixable(self, found: Sequence[Diagnostic]) -> tuple[int, str]:
        """Return how many findings can be fixed, and what must be named so that more can be."""
        from codra_dsl.language.diagnostics import is_safe

        fixes = [each.fix for each in found if each.fix is not None and is_safe(each)]
        files = [{edit.span.file for edit in fix.edits} for fix in fixes]
        elsewhere = [each for each in files if not all(map(self.may_change, each))]
        if not elsewhere:
            return len(files), ""
        folder = os.path.relpath(self.root / os.path.commonpath([*self.asked, *chain.from_iterable(elsewhere)]))
        return len(files) - len(elsewhere), f"; {len(elsewhere)} more can be fixed if '{folder}' is named"


def work_on_files(paths: list[Path], timings: Timings) -> Work:
    """Return the specs at or below some paths as work."""
    from codra_dsl.language.project import relative

    paths = existing(paths)
    root = common_root(paths)

    def plan(texts: Mapping[str, bytes]) -> Planned:
        from codra_dsl.compiler import plan_paths

        return plan_paths(paths, root, texts, timings)

    return Work(root=root, asked=tuple(relative(path, root) for path in paths), plan=plan)


def work_on_standard_input(timings: Timings) -> Work:
    """Return the spec that comes by standard input as work."""
    from codra_dsl.compiler import plan_text
    from codra_dsl.language.load.yaml.source import MAX_BYTES

    root = common_root([Path.cwd()])
    data = sys.stdin.buffer.read(MAX_BYTES + 1)
    return Work(
        root=root,
        asked=(STANDARD_INPUT,),
        plan=lambda texts: plan_text(texts.get(STANDARD_INPUT, data), STANDARD_INPUT, root, timings),
        data=data,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What fixing came to.

    Attributes:
        planned: what is found afterwards.
        diagnostics: the same, with findings about files that could not be written.
        number: of findings that were fixed.
        before: what the files held that change; `after`, what they hold then.
    """

    planned: Planned
    diagnostics: tuple[Diagnostic, ...]
    number: int
    before: Mapping[str, bytes]
    after: Mapping[str, bytes]

    def diff(self) -> str:
        """Return the difference between the files as they were and as they are."""
        from codra_dsl.workspace.suppression import unified

        return "".join(unified(self.before[file], after, file) for file, after in sorted(self.after.items()))


def fix(work: Work, *, write: bool) -> Outcome:
    """Fix specs, in their files where `write` says so and they stand in files.

    What is linted is what was read once: a file that somebody saves meanwhile is neither edited amiss nor replaced.
    """
    from codra_dsl.language.load.yaml.source import MAX_BYTES
    from codra_dsl.workspace.suppression import fix_all, rewrite

    if work.data is not None and len(work.data) > MAX_BYTES:
        raise typer.BadParameter(f"the text has more than {MAX_BYTES >> 20} MiB: it is not repeated", param_hint="-")
    before = work.texts(work.plan({}))
    fixed = fix_all(lambda texts: work.plan({**before, **texts}).diagnostics, before)
    to_disk = fixed.texts if write and work.data is None else {}
    written = {file: rewrite(file, work.root, before[file], after) for file, after in sorted(to_disk.items())}
    refused = {file: found for file, found in written.items() if found is not None}
    left = work.plan({}) if refused else work.plan({**before, **fixed.texts})
    return Outcome(
        planned=left,
        diagnostics=(*left.diagnostics, *refused.values()),
        number=sum(not _touches(found, refused) for found in fixed.applied),
        before=before,
        after=fixed.texts,
    )


def _touches(found: Diagnostic, files: Container[str]) -> bool:
    return found.fix is not None and any(edit.span.file in files for edit in found.fix.edits)
