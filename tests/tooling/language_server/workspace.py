"""A small project in a folder, with a spec, a part, a template, a site and a timeline, and positions in its texts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from codra_dsl.tooling.language_server.documents import Document, Texts
from codra_dsl.tooling.language_server.index import Cursor, Index, Range
from codra_dsl.tooling.language_server.projects import Project

SPEC = """\
codra: 1
name: hall
include: [parts/lights.yaml]
context:
  near: {type: bool, source: main_execution, valid_for: 20 s}
  place: {type: enum, values: [door, window], source: main_execution, valid_for: forever}
  both: {type: bool, derived: near and lamp}
  open: {type: bool, valid_for: 1 min, when_unobservable: forget}
resources:
  camera: {}
templates:
  shutter:
    parameters: {gap: {type: quantity, default: 5 cm}}
    context:
      $(instance)_down: {type: bool, valid_for: 1 min}
    perception:
      see_$(instance):
        call: robot.eyes:see
        uses: {camera: read}
        returns: {height: {type: float, unit: m, range: [0, 3]}}
        observable_when: [lamp]
        identifies: {$(instance)_down: height < $(gap)}
use:
  front: {template: shutter}
  back: {template: shutter, gap: 9 cm}
perception:
  find_door:
    call: robot.eyes:find_door
    uses: {camera: read}
    timeout: 3 s
    returns: {angle: {type: float, unit: rad, range: [0, 2]}}
    observable_when:
      - near and place == "door"
      - lamp
    identifies:
      open: angle > 0.2 rad
skills:
  enter:
    preview: [open == true, front_down, back_down, both]
    monitor: [open stays true]
    changes: [near]
"""

LIGHTS = """\
codra: 1
context:
  lamp: {type: bool, source: main_execution, valid_for: 1 h}
"""

SITE = """\
codra: 1
overlays: hall
context:
  open: {valid_for: 2 min}
use:
  front: {gap: 7 cm}
"""

TIMELINE = """\
codra: 1
timeline: hall
stories:
  the door is seen:
    0 s:
      main_execution: {set: {near: true, lamp: true, place: door}, declare: [open]}
    5 s:
      running: [find_door]
      believes: {open: {is: true, source: find_door}, front_down: {unknown: any}}
"""

FILES = {
    "pyproject.toml": "[tool.codra]\n",
    "hall.yaml": SPEC,
    "parts/lights.yaml": LIGHTS,
    "sites/north.yaml": SITE,
    "hall.timeline.yaml": TIMELINE,
}


class Workspace:
    """A project whose files an editor has open; the index is that of the last lint."""

    def __init__(self, folder: Path, files: Mapping[str, str] = FILES) -> None:
        self.folder = folder
        self.texts = dict(files)
        for file, text in files.items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text, "utf-8")
        self.project = Project(folder)
        self.documents: dict[str, Document] = {}
        self.lint()

    def edit(self, file: str, text: str) -> None:
        """Change the text of a document, without saving or linting it."""
        self.texts[file] = text
        self.documents[file] = Document(text)

    def lint(self) -> list[str]:
        """Lint the newest texts and return the codes of the findings."""
        self.project.checked = self.project.lint(dict(self.documents))
        return [finding.code for finding in self.project.checked.diagnostics]

    def index(self) -> Index:
        return Index(self.project.checked.specs, Texts(self.folder, self.documents))

    def cursor(self, file: str, before: str, after: str = "") -> Cursor:
        """Return the cursor between two texts that follow each other in a file."""
        return Cursor(self.index(), file, self.texts[file].index(before + after) + len(before))

    def words(self, ranges: list[Range]) -> list[str]:
        """Return ranges as `FILE:LINE TEXT`."""
        return [f"{one.file}:{self._line(one)} {self.texts[one.file][one.start : one.end]}" for one in ranges]

    def _line(self, name_range: Range) -> int:
        return self.texts[name_range.file].count("\n", 0, name_range.start) + 1
