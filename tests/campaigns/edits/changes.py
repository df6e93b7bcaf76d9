"""Random edits of a project: each returns the files that change, with their new texts, or None for a deleted file."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from random import Random

from tests.campaigns.edits.project import SETTINGS
from tests.campaigns.mutants.mutation import mutate, tokens

Files = Mapping[str, str]
Edit = Mapping[str, str | None]

MAX_DAMAGE = 4
"""The number of edited files beyond which files get their initial texts again. Many errors would hide each other."""

_SUPPRESSION = "  # codra: ignore[CDR7102, CDR7105] the campaign"
_COMMENT = "# the campaign"
_WORD = re.compile(r"[a-z]\w{2,}")


def random_edit(files: Files, initial_files: Files, chance: Random) -> tuple[str, Edit]:
    """Return the name of a random edit, and the edit."""
    damaged_files = sorted(file for file in {*files, *initial_files} if files.get(file) != initial_files.get(file))
    if len(damaged_files) > MAX_DAMAGE:
        return "restore", {file: initial_files.get(file) for file in damaged_files[chance.randrange(MAX_DAMAGE) :]}
    edit = chance.choice(_EDITS)
    return edit.__name__.removeprefix("_"), edit(files, chance)


def _specs(files: Files) -> list[str]:
    return sorted(file for file in files if file.endswith(".yaml"))


def _any_text(files: Files, chance: Random) -> str:
    return chance.choice(sorted(file for file in files if file != "pyproject.toml"))


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def _insert_line(files: Files, chance: Random) -> Edit:
    source, target = chance.choice(_specs(files)), chance.choice(_specs(files))
    lines, new_lines = _lines(files[target]), _lines(files[source]) or ["\n"]
    lines.insert(chance.randint(0, len(lines)), chance.choice(new_lines))
    return {target: "".join(lines)}


def _delete_lines(files: Files, chance: Random) -> Edit:
    file = _any_text(files, chance)
    lines = _lines(files[file])
    first = chance.randrange(len(lines) + 1)
    del lines[first : first + chance.randint(1, 3)]
    return {file: "".join(lines)}


def _move_lines(files: Files, chance: Random) -> Edit:
    """Move neighbouring lines to a line of the same indentation in another file."""
    source, target = chance.choice(_specs(files)), chance.choice(_specs(files))
    lines, target_lines = _lines(files[source]), _lines(files[target])
    starts = [number for number, line in enumerate(lines) if line.startswith("  ") and line[2:3].strip()]
    places = [number for number, line in enumerate(target_lines) if line.startswith("  ") and line[2:3].strip()]
    if source == target or not starts or not places:
        return {}
    start, place = chance.choice(starts), chance.choice(places)
    end = next((n for n in range(start + 1, len(lines)) if not lines[n].startswith("   ")), len(lines))
    target_lines[place:place] = lines[start:end]
    return {source: "".join(lines[:start] + lines[end:]), target: "".join(target_lines)}


def _change_token(files: Files, chance: Random) -> Edit:
    file = chance.choice(_specs(files))
    choices = tokens({file: files[file]})
    return dict(mutate({file: files[file]}, chance.choice(choices), chance).files) if choices else {}


def _rename_everywhere(files: Files, chance: Random) -> Edit:
    words = sorted(set(_WORD.findall(files[_any_text(files, chance)])))
    if not words:
        return {}
    word = chance.choice(words)
    texts = {file: re.sub(rf"\b{word}\b", f"{word}_two", text) for file, text in files.items() if file in _specs(files)}
    return {file: text for file, text in texts.items() if text != files[file]}


def _delete_file(files: Files, chance: Random) -> Edit:
    return {_any_text(files, chance): None}


def _rename_file(files: Files, chance: Random) -> Edit:
    file = _any_text(files, chance)
    path = PurePosixPath(file)
    return {file: None, path.with_stem(f"{path.stem}s").as_posix(): files[file]}


def _copy_file(files: Files, chance: Random) -> Edit:
    """Copy a file; a copied spec has the name of the other spec."""
    file = _any_text(files, chance)
    path = PurePosixPath(file)
    return {path.with_stem(f"{path.stem}_copy").as_posix(): files[file]}


def _add_module(_: Files, chance: Random) -> Edit:
    """Add a module on which the search for another module, or a suggestion, can depend."""
    name = chance.choice(["robot/__init__.py", "src/robot/gates.py", "robots.py", "robot/gate.py", "robot/gates.so"])
    return {name: chance.choice(["", "def measure(job): ...\n", "__path__ = []\n"])}


def _change_signature(files: Files, chance: Random) -> Edit:
    modules = sorted(file for file in files if file.endswith(".py"))
    if not modules:
        return {}
    texts = ["def measure(job, level, more): ...\n", "def find(job, **rest): ...\n", "(", "from x import *\n"]
    return {chance.choice(modules): chance.choice(texts)}


def _change_include(files: Files, chance: Random) -> Edit:
    file = chance.choice(_specs(files))
    name = chance.choice(["parts/light.yaml", "parts/lights.yaml", "gate.yaml", "../knowledge.yaml", "parts/jar.yaml"])
    text = re.sub(r"^include: .*\n", "", files[file], flags=re.MULTILINE)
    return {file: text.replace("codra: 1\n", f"codra: 1\ninclude: [{name}]\n", 1)}


def _add_comment(files: Files, chance: Random) -> Edit:
    file = chance.choice(_specs(files))
    lines = _lines(files[file]) or ["\n"]
    number = chance.randrange(len(lines))
    lines[number] = lines[number].rstrip("\n") + chance.choice([_SUPPRESSION, f"  {_COMMENT}"]) + "\n"
    return {file: "".join(lines)}


def _change_template(files: Files, chance: Random) -> Edit:
    """Change a parameter, a text or a use of a template."""
    changes = {
        "specs/parts/hatches.yaml": [("most: quantity", "least: quantity"), ("valid_for: 20 s", "valid_for: $(most)")],
        "specs/hatch.yaml": [
            ("most: 60 cm", "most: 60 s"),
            ("north:", "south:"),
            ("te: hatch", "te: hach"),
        ],
    }
    file = chance.choice(sorted(changes))
    return {file: files[file].replace(*chance.choice(changes[file]), 1)} if file in files else {}


def _change_settings(_: Files, chance: Random) -> Edit:
    return {"pyproject.toml": chance.choice(SETTINGS)}


_EDITS: tuple[Callable[[Files, Random], Edit], ...] = (
    _insert_line,
    _delete_lines,
    _move_lines,
    _change_token,
    _change_token,
    _rename_everywhere,
    _delete_file,
    _rename_file,
    _copy_file,
    _add_module,
    _change_signature,
    _change_include,
    _add_comment,
    _change_template,
    _change_settings,
)
