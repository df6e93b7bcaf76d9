"""Write a document in the many forms of YAML, with anchors, aliases, merges, tags, and duplicate and complex keys."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from random import Random
from typing import Any

_TAGS = (
    *("!!str", "!!int", "!!float", "!!bool", "!!null", "!!map", "!!seq", "!!set", "!!omap", "!!binary", "!!timestamp"),
    *(
        "!!python/object/apply:os.system",
        "!!python/name:os.system",
        "!local",
        "!",
        "!<tag:x>",
        "!!merge",
        "!e!x",
        "!%00",
    ),
)
_STARTS = (
    "",
    "",
    "",
    "---\n",
    "%YAML 1.2\n---\n",
    "%YAML 9.9\n---\n",
    "%TAG ! tag:x,2000:\n---\n",
    "# c\n",
    "--- !!map\n",
    "--- &top\n",
)
_ENDS = ("", "", "", "...\n", "---\n", "--- {}\n", "...\n%YAML 1.1\n---\na: 1\n", "\n\n\n", "# end", "\t")


@dataclass
class _Writer:
    """Writes nodes; `wild` is the probability with which a node gets an odd form.

    Attributes:
        anchors: the names of anchors written so far.
    """

    chance: Random
    wild: float
    anchors: list[str] = field(default_factory=list)

    def node(self, value: Any, indent: int) -> str:
        """Return a node, to be written after a key and a space, or on lines of its own."""
        if self.is_wild():
            return self.odd(value, indent)
        if isinstance(value, dict) and value and indent < 12 and self.chance.random() < 0.6:
            return "".join(
                f"\n{'  ' * indent}{self.key(key)}: {self.node(item, indent + 1)}" for key, item in value.items()
            )
        if isinstance(value, list) and value and indent < 12 and self.chance.random() < 0.5:
            return "".join(f"\n{'  ' * indent}- {self.flow(item)}" for item in value)
        return self.flow(value)

    def is_wild(self) -> bool:
        return self.chance.random() < self.wild

    def key(self, key: str) -> str:
        text = json.dumps(key, ensure_ascii=self.chance.random() < 0.5)
        return text if not key.isidentifier() or self.chance.random() < 0.1 else key

    def flow(self, value: Any) -> str:
        if isinstance(value, dict):
            return "{" + ", ".join(f"{self.key(key)}: {self.flow(item)}" for key, item in value.items()) + "}"
        if isinstance(value, list):
            return f"[{', '.join(map(self.flow, value))}]"
        if isinstance(value, str) and self.chance.random() < 0.3:
            return "'" + value.replace("'", "''") + "'"
        return json.dumps(value)

    def odd(self, value: Any, indent: int) -> str:
        """Return a node with an anchor or a tag, an alias, or a node in a form that few people write."""
        chance, space = self.chance, "  " * indent
        plain, kind = self.flow(value), chance.randrange(9)
        if kind == 0:
            self.anchors.append(f"a{len(self.anchors)}")
            return f"&{self.anchors[-1]} {plain}"
        if kind == 1:
            return f"*{chance.choice((*self.anchors, 'top', 'later', 'a0'))}"
        if kind == 2:
            self.anchors.append("loop")
            return chance.choice(("&loop [*loop]", "&loop {a: *loop}", "&loop {<<: *loop}", "&a &b x", "&later {}"))
        if kind == 3:
            return f"{chance.choice(_TAGS)} {plain}"
        if kind == 4:
            name = chance.choice((*self.anchors, "a0", "loop"))
            merge = chance.choice((f"*{name}", f"[*{name}, *{name}]", "{a: 1}", "[[]]", "null", plain))
            return f"\n{space}<<: {merge}\n{space}x: {plain}"
        if kind == 5:
            mark = chance.choice("|>") + chance.choice(("", "-", "+", "2", "9", "1+", "0", "--"))
            return f"{mark}\n{space}  {plain}\n{space} y\n{space}\tz"
        if kind == 6:
            return f"\n{space}? {plain}\n{space}: {plain}\n{space}? [a, {{b: c}}]\n{space}: x"
        if kind == 7 and isinstance(value, dict):
            return "".join(f"\n{space}{self.key(key)}: {self.flow(item)}" for key, item in [*value.items()] * 2)
        return chance.choice(
            ("", "~", "null", "yes", "0o17", "1:30", "2001-01-01", ".nan", "'", '"', "@x", "`x", "%x", "- - - x", "? x")
        )


def yaml_text(chance: Random, document: dict[str, Any]) -> str:
    """Return a document as YAML; the text is often valid, and sometimes has the meaning of the document."""
    writer = _Writer(chance, chance.choice((0.0, 0.02, 0.15)))
    sections = (f"{writer.key(key)}: {writer.node(value, 1)}\n" for key, value in document.items())
    return chance.choice(_STARTS) + "".join(sections) + chance.choice(_ENDS)
