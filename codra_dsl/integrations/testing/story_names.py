"""The names of the stories in a file, read without the compiler, for the collection of tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import yaml

from codra_dsl.regular_files import read_regular_file

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MAX_BYTES = 200_000
"""The maximum size of a file that is read here. Only the compiler's own reader reads larger files."""


def read_story_lines(path: Path) -> Mapping[str, int]:
    """Return a mapping from the names of the stories to their lines; empty if the names cannot be read in this way."""
    lines: dict[str, int] = {}
    keys: list[str | None] = []  # per open collection: the key whose value comes next, or None if a key comes next
    try:
        for event in yaml.parse(read_regular_file(path, _MAX_BYTES), Loader=_Loader):
            if isinstance(event, yaml.CollectionStartEvent):
                keys.append(None)
            elif isinstance(event, yaml.CollectionEndEvent):
                keys.pop()
                keys[-1:] = [None] * len(keys[-1:])
            elif isinstance(event, yaml.NodeEvent) and keys:
                keys[-1] = getattr(event, "value", "") if keys[-1] is None else None
                if len(keys) == 2 and keys[0] == "stories" and keys[1] is not None and event.start_mark is not None:
                    lines[keys[1]] = event.start_mark.line + 1
    except (OSError, ValueError, yaml.YAMLError):
        return {}
    return lines
