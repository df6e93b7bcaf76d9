"""The types of ROS 2 messages: those of the distributions, and those whose definitions are in the project.

The definitions are read with rosbags, so no ROS need be installed, and nothing differs where it is. Without rosbags
nothing is known about any type.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from codra_dsl.language.file_queries import read_file
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import MAX_SETTINGS_BYTES, SETTINGS, parse_settings

MAX_DEFINITION_BYTES = 32 * 1024
DEFAULT_FOLDERS = (".", "src")
"""The folders of a project in which packages of messages are looked for, if its settings name no others."""

_STEP = re.compile(r"(\w+)(?:\[(\d+)\])?")

_Node = tuple[int, Any]
"""A type of rosbags: the kind of the node, and its content."""


@dataclass(frozen=True, slots=True)
class MissingField:
    """Why a path of a field leads to no value.

    Attributes:
        part: the part of the path that is wrong.
        type: the type in which the part is missing.
        problem: what is wrong, if the part exists; otherwise empty.
        names: the fields that the type has.
    """

    part: str
    type: str
    problem: str
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class UnreadableType:
    """A type without definition, or with a definition that cannot be read.

    Attributes:
        name: the type, which may be that of a field.
        file: the file with an invalid definition; empty if there is no definition.
        reason: why the file cannot be read; empty if its text is no definition.
    """

    name: str
    file: str = ""
    reason: str = ""


class MessageTypes:
    """The types of messages that a project can use.

    Attributes:
        consulted_files: the files on which the results depend, relative to the root, including files that do not exist.
        folders: the folders with packages of messages, relative to the root.
    """

    def __init__(self, root: Path) -> None:
        """Initialize.

        Raises:
            ModuleNotFoundError: if rosbags is not installed.
        """
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 - it is an extra, and slow to import

        self.consulted_files: dict[str, None] = {}
        self.folders = _message_folders(root)
        self._root = root
        self._fields: dict[str, Mapping[str, _Node] | UnreadableType] = {
            name: dict(definition[1]) for name, definition in get_typestore(Stores.ROS2_JAZZY).fielddefs.items()
        }
        self._standard_names = tuple(self._fields)

    def names(self) -> Iterable[str]:
        """Return the names of the types that come with ROS 2."""
        return self._standard_names

    def find(self, type_name: str) -> Mapping[str, _Node] | UnreadableType:
        """Return the fields of a type."""
        if type_name not in self._fields:
            self._fields[type_name] = self._read(type_name)
        return self._fields[type_name]

    def type_of_field(self, type_name: str, path: str) -> str | MissingField | UnreadableType:
        """Return the basic type of a field, such as `float32`, `bool` or `string`.

        Args:
            type_name: the type of the message.
            path: the field, such as `pose.position.x` or `ranges[0]`.
        """
        steps = path.split(".")
        for index, step in enumerate(steps):
            fields = self.find(type_name)
            if isinstance(fields, UnreadableType):
                return fields
            match = _STEP.fullmatch(step)
            if match is None or match[1] not in fields:
                return MissingField(step if match is None else match[1], type_name, "", tuple(fields))
            node = _item(fields[match[1]], match[2])
            if isinstance(node, str):
                return MissingField(step, type_name, node)
            is_message, content = node[0] == _NAME, node[1]
            if is_message and index == len(steps) - 1:
                inner = self.find(content)
                names = () if isinstance(inner, UnreadableType) else tuple(inner)
                return MissingField(step, type_name, f"is a {content}, not a single value", names)
            if not is_message:
                if index < len(steps) - 1:
                    return MissingField(step, type_name, f"is a {content[0]}, which has no fields")
                return str(content[0])
            type_name = content
        raise AssertionError("a path has at least one step")

    def _read(self, type_name: str) -> Mapping[str, _Node] | UnreadableType:
        from rosbags.typesys import TypesysError, get_types_from_msg  # noqa: PLC0415 - as above

        for folder in self.folders:
            file = (Path(folder) / f"{type_name}.msg").as_posix()
            self.consulted_files[file] = None
            try:
                data = read_file(self._root / file, MAX_DEFINITION_BYTES, within=self._root, file=file)
                text = data.decode().replace("\r\n", "\n")  # rosbags knows no other ends of lines
                return dict(get_types_from_msg(text, type_name)[type_name][1])
            except FileNotFoundError:
                continue
            except OSError as error:
                return UnreadableType(type_name, file, error.strerror or "")
            except (ValueError, KeyError, RecursionError, TypesysError):
                return UnreadableType(type_name, file)
        return UnreadableType(type_name)


_NAME, _ARRAY, _SEQUENCE = 2, 3, 4
"""The kinds of nodes in rosbags that are not basic types: messages, lists of a fixed length, and other lists."""


def _item(node: _Node, index_text: str | None) -> _Node | str:
    """Return the type of a field or of an item of it, or what is wrong with the index."""
    kind, content = node
    if kind not in (_ARRAY, _SEQUENCE):
        return node if index_text is None else "is not a list"
    if index_text is None:
        return "is a list: add the index of an item, such as [0]"
    item, length = content
    is_bounded = kind == _ARRAY or length > 0  # the length of a sequence is its upper bound; 0 means no bound
    if is_bounded and int(index_text) >= length:
        return f"has at most {length} items, and the first is [0]"
    return int(item[0]), item[1]


def _message_folders(root: Path) -> tuple[str, ...]:
    """Return the folders that `[tool.codra.ros]` names; a table with mistakes is reported with the other settings."""
    try:
        settings = parse_settings(read_file(root / SETTINGS, MAX_SETTINGS_BYTES, Path(root.anchor)).decode())
        table: Any = settings
        for key in ("tool", "codra", "ros", "messages"):
            table = table[key]
    except (OSError, ValueError, RecursionError, LookupError, TypeError):
        return DEFAULT_FOLDERS
    return tuple(folder for folder in table if isinstance(folder, str)) if isinstance(table, list) else DEFAULT_FOLDERS
