"""The decisions of a RAFCON state machine: states whose outcomes lead to different states.

The files of the state machine are read as data; RAFCON is not needed, and no script is run.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import relative_path
from codra_dsl.regular_files import read_regular_file
from codra_dsl.tooling.main_execution.model import (
    Decision,
    DecisionCollector,
    MainExecution,
    Names,
    Role,
    SourceError,
    ValueType,
)

MACHINE_FILE = "statemachine.json"
MAX_STATES = 2_000
MAX_DEPTH = 30
MAX_BYTES = 8 * 1024 * 1024
"""The maximum size of all files together."""

_STATE_FILE = "core_data.json"
_ANNOTATION_FILE = "semantic_data.json"
_SCRIPT_FILE = "script.py"
_STATE_KEY = re.compile(r'"state_id"\s*:')
_TRUTH = frozenset({"true", "false"})
_TRANSITION_KEYS = ("from_state", "from_outcome", "to_state", "to_outcome")

Data = Mapping[str, Any]


def read_rafcon(folder: Path, root: Path, within: Path) -> MainExecution:
    """Return the decisions of a state machine.

    Args:
        folder: the folder of the state machine, with `statemachine.json`.
        root: the folder to which paths in places are relative.
        within: the folder of the project. Links that lead out of it are not followed.

    Raises:
        SourceError: if a file cannot be read, is not a file of RAFCON, or there are too many states.
    """
    reader = _Reader(root, within)
    storage = reader.json_file(folder / MACHINE_FILE).get("root_state_storage_id")
    is_inside = (
        isinstance(storage, str) and not (folder / _STATE_FILE).exists() and storage == Path(storage).name != ".."
    )
    reader.read(reader.state(folder / str(storage) if is_inside else folder, depth=0), None)
    return reader.collector.main_execution()


@dataclass(frozen=True, slots=True, kw_only=True)
class _State:
    """A state with the states inside it, by their ids."""

    folder: Path
    data: Data
    annotation: Data
    place: Place
    children: Mapping[str, _State]

    @property
    def name(self) -> str:
        return _text(self.data.get("name")) or "state"

    @property
    def texts(self) -> tuple[str, ...]:
        """The texts that the state gets as inputs."""
        ports = (port.get("default_value") for port in _objects(self.data.get("input_data_ports")))
        values = _mapping(self.data.get("input_data_port_runtime_values")).values()
        return tuple(value for value in (*ports, *values) if isinstance(value, str) and value)

    @property
    def outcomes(self) -> Mapping[str, str]:
        """The names of the outcomes by their ids, without `aborted` and `preempted`."""
        outcomes = {
            _text(item.get("outcome_id")): _text(item.get("name")) for item in _objects(self.data.get("outcomes"))
        }
        return {number: name for number, name in outcomes.items() if not number.startswith("-")}


class _Reader:
    """Reads the states of one state machine."""

    def __init__(self, root: Path, within: Path) -> None:
        self.collector = DecisionCollector()
        self._root = root
        self._within = within
        self._variables = Names("decision")
        self._skills = Names("skill")
        self._state_count = 0
        self._bytes_left = MAX_BYTES

    def state(self, folder: Path, depth: int) -> _State:
        """Return the state in a folder, with the states inside it."""
        file = folder / _STATE_FILE
        text = self._text(file)
        match = _STATE_KEY.search(text)
        line = text.count("\n", 0, match.start()) + 1 if match else 1
        column = match.start() - text.rfind("\n", 0, match.start()) if match else 1
        place = Place(Span(relative_path(file, self._root), line, column, line, column + len('"state_id"')))
        self._state_count += 1
        if self._state_count > MAX_STATES or depth > MAX_DEPTH:
            message = f"more than {MAX_STATES:,} states, or states more than {MAX_DEPTH} deep"
            raise SourceError(message, place, help="import its parts one after the other")
        annotation_file = folder / _ANNOTATION_FILE
        annotations = self.json_file(annotation_file) if annotation_file.is_file() else {}
        children = (self.state(inner_folder, depth + 1) for inner_folder in _state_folders(folder))
        return _State(
            folder=folder,
            data=self._object(text, file),
            annotation=_mapping(annotations.get("codra")),
            place=place,
            children={_text(child.data.get("state_id")): child for child in children},
        )

    def read(self, state: _State, skill: _State | None) -> None:
        """Add the decisions inside a state.

        They belong to the innermost state around them that is annotated as a skill, or else to the innermost state.
        """
        skill = state if skill is None or "skill" in state.annotation or "skill" not in skill.annotation else skill
        targets: dict[str, dict[str, tuple[str, str]]] = {}
        sources: dict[str, str] = {}
        for transition in _objects(state.data.get("transitions")):
            source, outcome, *target = (_text(transition.get(key)) for key in _TRANSITION_KEYS)
            targets.setdefault(source, {})[outcome] = (target[0], target[1])
            sources[target[0]] = source
        for name, child in state.children.items():
            leads_to = {targets.get(name, {}).get(outcome) for outcome in child.outcomes}
            if child.children:
                self.read(child, skill)
            elif len(leads_to) > 1 and not child.annotation.get("acting"):
                before = state.children.get(sources.get(name, ""))
                self._add(child, skill, Role.EFFECT if _acts(before) else Role.PRECONDITION)

    def _add(self, state: _State, skill: _State, role: Role) -> None:
        variable = state.annotation.get("decide")
        script = state.folder / _SCRIPT_FILE
        library = _text(state.data.get("library_name"))
        algorithm = library or (self._text(script) if script.is_file() else state.name)
        key = ("variable", variable) if isinstance(variable, str) else (algorithm, *state.texts)
        skill_name = _text(skill.annotation.get("skill")) or skill.name
        names = set(state.outcomes.values())
        decision = Decision(
            name=self._variables.name(key, key[1:] if isinstance(variable, str) else (state.name, *state.texts)),
            text=f"{state.name}: {', '.join(state.outcomes.values())}"[:80],
            skill=self._skills.name((skill_name,), (skill_name,)),
            role=role,
            place=state.place,
            type=ValueType.BOOL if names >= _TRUTH or len(names) == 2 else ValueType.STR,
            call=f"state '{state.name}'",
            other_names=state.texts,
        )
        self.collector.add(decision, skill.place)

    def json_file(self, file: Path) -> Data:
        """Return the object in a file."""
        return self._object(self._text(file), file)

    def _object(self, text: str, file: Path) -> Data:
        try:
            value = json.loads(text)
        except (ValueError, RecursionError) as error:
            line, column = getattr(error, "lineno", 1), getattr(error, "colno", 1)
            place = Place(Span(relative_path(file, self._root), line, column, line, column + 1))
            raise SourceError("this is not valid JSON", place, help="save the state machine again") from error
        if not isinstance(value, dict):
            raise SourceError("this is not a file of RAFCON: it has no JSON object", self._beginning(file), _HELP)
        return value

    def _text(self, file: Path) -> str:
        try:
            data = read_regular_file(file, self._bytes_left, within=self._within)
            self._bytes_left -= len(data)
            return data.decode("utf-8", "replace")
        except OSError as error:
            message = f"cannot read '{relative_path(file, self._root)}': {error.strerror}"
            raise SourceError(message, self._beginning(file), _HELP) from error

    def _beginning(self, file: Path) -> Place:
        return Place(Span(relative_path(file, self._root), 1, 1, 1, 1))


_HELP = "name the folder of a state machine that RAFCON has saved"


def _state_folders(folder: Path) -> list[Path]:
    """Return the folders of the states directly inside a state. Links are not followed."""
    with os.scandir(folder) as entries:
        names = sorted(entry.name for entry in entries if entry.is_dir(follow_symlinks=False))
    return [folder / name for name in names if (folder / name / _STATE_FILE).is_file()]


def _acts(state: _State | None) -> bool:
    """Return whether a state acts: it is annotated so, or it has one outcome and neither states inside nor context."""
    if state is None or state.children or state.data.get("library_path") == "codra":
        return False
    return bool(state.annotation.get("acting")) or len(state.outcomes) == 1


def _mapping(value: object) -> Data:
    return value if isinstance(value, dict) else {}


def _objects(value: object) -> list[Data]:
    """Return the objects in a mapping, in its order."""
    return [item for item in _mapping(value).values() if isinstance(item, dict)]


def _text(value: object) -> str:
    return str(value) if isinstance(value, str | int) else ""
