"""The project that a campaign edits: valid cases, a part, a template, behaviour trees, Python modules, and sites."""

from __future__ import annotations

from pathlib import Path

CASES = Path(__file__).parents[2] / "cases/valid"

GATE = """\
codra: 1
name: gate
include: [parts/light.yaml]
context:
  gate_open: {type: bool, valid_for: 20 s}
  gate_width: {type: float, unit: m, range: [0, 3], source: main_execution}
perception:
  measure_gate:
    call: robot.gates:measure
    with: {level: 3}
    returns: {gap: {type: float, unit: m}}
    observable_when: [lit]
    identifies: {gate_open: gap > 40 cm}
skills:
  pass_gate: {preview: [gate_open, gate_width]}
"""
HATCH = """\
codra: 1
name: hatch
include: [parts/light.yaml, parts/hatches.yaml]
use:
  north: {template: hatch, most: 60 cm}
  south: {template: hatch, most: 70 cm}
"""
LIGHT = """\
codra: 1
context:
  lit: {type: bool, source: main_execution, valid_for: 1 min}
"""
HATCHES = """\
codra: 1
templates:
  hatch:
    parameters: {most: quantity}
    context:
      $(instance)_hatch_open: {type: bool, valid_for: 20 s}
    perception:
      find_$(instance)_hatch:
        call: robot.hatches:find
        returns: {gap: {type: float, unit: m}}
        observable_when: [lit]
        identifies: {$(instance)_hatch_open: gap > $(most)}
    skills:
      use_$(instance)_hatch: {preview: [$(instance)_hatch_open]}
"""
DOCK = """\
codra: 1
overlays: gate
context:
  gate_width: {range: [0, 2]}
perception:
  measure_gate:
    with: {level: 4}
    observable_when: [not lit]
skills:
  pass_gate: {preview: [gate_open]}
"""
YARD = """\
codra: 1
overlays: hatch
context:
  north_hatch_open: {valid_for: 5 s}
use:
  south: {most: 80 cm}
"""

SETTINGS = (
    "[tool.codra]\n",
    '[tool.codra.lint]\nignore = ["CDR7"]\n',
    '[tool.codra.lint]\nignore = ["CDR7102"]\nfail-on = "warning"\n',
    '[tool.codra.lint.severity]\nCDR7 = "error"\n',
    '[tool.codra.lint]\nselect = ["CDR1", "CDR3"]\n',
    "[tool.codra.lint]\nignore = 1\n",
)
"""The contents that `pyproject.toml` can have; each of them marks the root of a project."""


def small_project() -> dict[str, str]:
    """Return the files of a project with two specs before any edit, by path; `specs` has the specs."""
    return {
        "pyproject.toml": SETTINGS[0],
        "specs/gate.yaml": GATE,
        "specs/hatch.yaml": HATCH,
        "specs/parts/light.yaml": LIGHT,
        "specs/parts/hatches.yaml": HATCHES,
        "sites/dock.yaml": DOCK,
        "sites/yard.yaml": YARD,
        "robot/gates.py": "def measure(job, level): ...\n",
        "robot/hatches.py": "def find(job): ...\n",
    }


def large_project() -> dict[str, str]:
    """Return the files of the small project, and of some valid cases."""
    files = small_project()
    cases = [CASES / name for name in ("knowledge.yaml", "many-forms.yaml", "with-parts", "loops-everything")]
    for case in cases:
        for file in [case] if case.is_file() else sorted(path for path in case.rglob("*") if path.is_file()):
            files[f"specs/{file.relative_to(CASES).as_posix()}"] = file.read_text("utf-8")
    return files
