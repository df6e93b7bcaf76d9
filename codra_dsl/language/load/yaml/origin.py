"""The origin of an element, and the name of the element in findings."""

from __future__ import annotations

from collections.abc import Sequence

from codra_dsl.language.diagnostics import Place, Span, lazy_place
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.nodes import ScalarNode, YamlNode, visible_range
from codra_dsl.language.load.yaml.source import Source

NOUNS = {
    "context": "context-variable",
    "perception": "perception algorithm",
    "skills": "skill",
    "observers": "observer",
    "resources": "resource",
    "agents": "agent",
    "types": "type",
    "nodes": "node",
    "edges": "edge",
    "tasks": "task",
    "metrics": "metric",
    "actions": "action",
    "adaptation": "adaptation",
    "trees": "tree",
    "loops": "loop",
    "templates": "template",
    "use": "use",
}
"""The noun for an entry of each section."""


_UNDER_KNOWLEDGE = frozenset({"types", "nodes", "edges", "tasks"})
_SEPARATE_KEYS = frozenset({"returns", "identifies", "attributes", "rules"})


def damaged_key(steps: Sequence[str | int]) -> str:
    """Return how `Spec.damaged_keys` lists the part of an element with the path `steps`: as KEY or as KEY.NAME.

    KEY.NAME is used for the entries of `returns`, `identifies`, `attributes` and `rules`: a damaged entry does not
    affect the other entries.
    """
    is_separate = len(steps) > 1 and steps[0] in _SEPARATE_KEYS and isinstance(steps[1], str)
    return ".".join(map(str, steps[:2] if is_separate else steps[:1]))


@dataclass(frozen=True, slots=True)
class Origin:
    """A file, or one use of a template in it.

    Attributes:
        use: the span of the name of the use; None outside templates.
        template: the template's name; empty outside templates.
        module: the name of the generated module of the elements.
    """

    source: Source
    use: Span | None = None
    template: str = ""
    module: str = ""

    def place(self, start: int, end: int) -> Place:
        """Return the place of a range of the file's text."""
        return lazy_place(self.source, start, end, self.use)

    def of(self, node: YamlNode) -> Place:
        """Return the place of a node."""
        return lazy_place(self.source, node.start, node.end, self.use)

    def of_value(self, key: ScalarNode, value: YamlNode) -> Place:
        """Return the place of a value if it is a scalar or in brackets, otherwise the place of its key."""
        return self.place(*visible_range(key, value))

    def written(self, node: YamlNode) -> str:
        """Return a node as written in the file."""
        return self.source.text[node.start : node.end]


@dataclass(frozen=True, slots=True)
class Subject:
    """The element that a finding is about.

    Attributes:
        section: the element's section, or `spec`, `part` or `site` for a complete file.
        key: the element's name in the file. Findings about missing keys have the place of this name.
        origin: the element's file or use.
    """

    section: str
    key: ScalarNode
    origin: Origin

    @property
    def name(self) -> str:
        """Return the name, with parameters substituted."""
        return self.key.text

    @property
    def place(self) -> Place:
        """Return the place of the element's name."""
        return self.origin.of(self.key)

    @property
    def path(self) -> str:
        """Return the element's path in the spec: sections and names joined by dots."""
        if self.section in ("spec", "part", "site"):
            return ""
        prefix = f"templates.{self.origin.template}." if self.origin.template else ""
        group = "knowledge." if self.section in _UNDER_KNOWLEDGE else ""
        return f"{prefix}{group}{self.section}.{self.key.written}"

    def part(self, *steps: str | int) -> str:
        """Return the path of a part of the element."""
        return ".".join([*filter(None, [self.path]), *map(str, steps)])

    def __str__(self) -> str:
        """Return noun and name for messages, e.g. `skill 'open_door'`; a name in a template has its parameters."""
        if self.section in ("part", "site"):
            return f"this {self.section}"
        return f"{NOUNS.get(self.section, self.section)} {shown(self.key.written)}"
