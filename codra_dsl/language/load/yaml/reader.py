"""Read the keys of one element as far as they are valid, and record the keys that could not be read."""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import StrEnum
from functools import lru_cache
from typing import NamedTuple, TypeVar

from codra_dsl.language.diagnostics import Fix, Place
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode, visible_range
from codra_dsl.language.load.yaml.origin import Subject, damaged_key
from codra_dsl.language.model import Places, Reference
from codra_dsl.language.units import duration_help, parse_duration

_parse_duration = lru_cache(maxsize=1024)(parse_duration)

KEYS_OF_MAPPINGS = ("with", "uses", "returns", "identifies", "attributes", "rules", "terms", "course", "leaves")
"""The keys of elements whose values are mappings with names of their own."""

Choice = TypeVar("Choice", bound=StrEnum)


class Suspect(NamedTuple):
    """A condition with a comment after it. The comment reads like a condition, and may belong to the condition."""

    place: Place
    written: str
    names: frozenset[str]
    path: str


class Reader:
    """Reads one element.

    Attributes:
        damaged: the keys that could not be read and have their default, as `Spec.damaged_keys` lists them.
        suspects: comments that may be parts of conditions.
    """

    def __init__(
        self,
        subject: Subject,
        node: MappingNode,
        findings: Findings,
        damaged: frozenset[str] = frozenset(),
        within: tuple[str, ...] = (),
    ) -> None:
        """Initialize; `damaged` has the keys that are already known to be unreadable.

        `within` is the path from the element to `node`, if `node` is a part of the element.
        """
        self.subject = subject
        self.node = node
        self.findings = findings
        self.origin = subject.origin
        self.place_of = subject.origin.place
        self.damaged = set(damaged)
        self.suspects: list[Suspect] = []
        self._within = within
        if not within:
            self.damaged.update(key for key in KEYS_OF_MAPPINGS if key in node.entries and is_unread(node.value(key)))

    def inner(self, node: MappingNode, *steps: str) -> Reader:
        """Return a reader of the part of the element at `steps`; both readers share the damaged keys."""
        reader = Reader(self.subject, node, self.findings, within=(*self._within, *steps))
        reader.damaged, reader.suspects = self.damaged, self.suspects
        return reader

    @property
    def place(self) -> Place:
        """The place of the element's name."""
        return self.origin.of(self.subject.key)

    def part(self, *steps: str | int) -> str:
        """Return the path of a part of the element, for findings."""
        return self.subject.part(*self._within, *steps)

    def damage(self, *steps: str) -> None:
        """Record that the part at `steps` could not be read."""
        self.damaged.add(damaged_key((*self._within, *steps)))

    def fail(
        self, rule: str, message: str, location: YamlNode | Place, help_text: str, *steps: str, fix: Fix | None = None
    ) -> None:
        """Report a mistake in the part of the element at `steps`, which counts as unreadable."""
        self.damage(*steps)
        path = self.part(*steps)
        if isinstance(location, Place):
            self.findings.add(rule, message, location, help=help_text, path=path, fix=fix)
        elif not location.reported:
            place = self.origin.of(location)
            self.findings.add(rule, message, place, help=help_text, path=path, fix=fix)

    def scalar(self, key: str) -> ScalarNode | None:
        """Return the scalar of a key, or None if it is absent or unreadable."""
        entry = self.node.entries.get(key)
        if entry is None:
            return None
        node = entry[1]
        if node.reported or not isinstance(node, ScalarNode):
            self.damage(key)
            return None
        return node

    def text(self, key: str, default: str) -> str:
        """Return the text of a key."""
        node = self.scalar(key)
        return default if node is None else node.text

    def number(self, key: str, default: int) -> int:
        """Return the integer of a key."""
        node = self.scalar(key)
        return int(node.data) if node is not None and isinstance(node.data, (int, float)) else default

    def choice(self, key: str, default: Choice) -> Choice:
        """Return the member of an enumeration that is the value of a key."""
        node = self.scalar(key)
        is_known_member = node is not None and node.text in type(default).__members__.values()
        return type(default)(node.text) if node is not None and is_known_member else default

    def duration_s(self, key: str, default: float, *, least: str = "positive", most: str = "finite") -> float:
        """Return the duration of a key, in seconds.

        `least` is the least allowed duration ("zero" or "positive"), `most` the greatest ("finite" or "forever").
        """
        node = self.scalar(key)
        if node is None:
            return default
        duration = _parse_duration(node.text)
        if duration is None or (duration == math.inf and most == "finite"):
            message = f"{shown(key)} in {self.subject} must be a duration, not {shown(node.text)}"
            help_text = duration_help(node.text, most) if duration is None else "give a number with ms, s, min or h"
        elif duration < 0 or (duration == 0 and least == "positive"):
            message = f"{shown(key)} in {self.subject} is too short"
            help_text = "write a duration above 0 s" if least == "positive" else "write 0 s or more"
        else:
            return duration
        self.fail("duration", message, node, help_text, key)
        return default

    def references(self, key: str) -> tuple[Reference, ...]:
        """Return references to the names in a list, or to the single name that is written instead of a list."""
        if key not in self.node.entries:
            return ()
        node = self.node.value(key)
        names = node.items if isinstance(node, SequenceNode) else [] if node is None else [node]
        scalars = (name for name in names if isinstance(name, ScalarNode) and not name.reported)
        readable_names = [name for name in scalars if isinstance(name.data, str)]
        if len(readable_names) < len(names):
            self.damage(key)
        return tuple(self.reference(name) for name in readable_names)

    def reference(self, node: ScalarNode) -> Reference:
        """Return a reference to another element by its name."""
        return Reference(name=node.text, place=self.origin.of(node))

    def places(self, more_ranges: Iterable[tuple[str, tuple[int, int]]] = ()) -> Places:
        """Return the places of the element's name and entries, and of additional ranges."""
        ranges = {key: visible_range(key_node, value) for key, (key_node, value) in self.node.entries.items()}
        ranges["name"] = (self.subject.key.start, self.subject.key.end)
        ranges.update(more_ranges)
        return Places(self.place_of, ranges)


def is_unread(node: YamlNode | None) -> bool:
    """Return whether a mapping has an entry with an unreadable key."""
    return isinstance(node, MappingNode) and node.unread


def entries(node: YamlNode | None) -> Iterable[tuple[ScalarNode, YamlNode]]:
    """Return the entries of a mapping, or no entries for any other node."""
    return node.entries.values() if isinstance(node, MappingNode) else ()
