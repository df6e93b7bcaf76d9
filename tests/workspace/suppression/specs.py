"""Specs with findings that may be silenced, for the tests of this folder."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.compiler import Planned, plan_paths, plan_text
from codra_dsl.language.diagnostics import Diagnostic

KITCHEN = """\
codra: 1
name: kitchen
context:
  pot_full: {type: bool, source: main_execution, valid_for: 5 s}
  unused: {type: bool, source: main_execution}
skills:
  pour:
    preview: [pot_full]
"""
"""A spec with one finding: CDR7102 about `unused` on line 5."""

JARS = """\
codra: 1
name: jars
templates:
  jar:
    context:
      $(instance)_full: {type: bool, source: main_execution}
use:
  sugar: {template: jar}
  salt: {template: jar}
  rice: {template: jar}
context:
  lid: {type: bool, source: main_execution}
skills:
  close: {preview: [lid]}
"""
"""A spec with one finding of a template: CDR7102 on line 6, in the uses of lines 8 to 10."""

UNUSED = "  unused: {type: bool, source: main_execution}\n"


def lint(text: str, root: Path, settings: str = "") -> tuple[Diagnostic, ...]:
    """Return the triaged findings about a text, in a project with some settings."""
    (root / "pyproject.toml").write_text(f"[tool.codra.lint]\n{settings}\n", "utf-8")
    return plan_text(text, "-", root).diagnostics


def lint_files(root: Path, *paths: str, **files: str) -> Planned:
    """Write files, and return the findings about some paths. A `__` in the name of a file stands for `/`."""
    for name, text in files.items():
        path = root / f"{name.replace('__', '/')}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode())
    return plan_paths([root / path for path in paths], root)


def codes(findings: tuple[Diagnostic, ...]) -> list[str]:
    return [finding.code for finding in findings]
