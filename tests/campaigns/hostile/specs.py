"""Hostile specs: half of them are YAML, and many have the right shape. `spec.yaml` is compiled."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.campaigns.hostile.damage import damaged, encoded
from tests.campaigns.hostile.reading import OUT, Answer, Files, Kind, command
from tests.campaigns.hostile.texts import GOOD_NAMES, NAMES, TEXTS
from tests.campaigns.hostile.yaml_forms import yaml_text
from tests.campaigns.mutants.mutation import LETTERS, TOKEN, projects

PROJECT = b"[tool.codra]\n"

CALLS = (
    "os:system",
    "antigravity:fly",
    "turtle:Turtle",
    "hostile_module:run",
    "tests.campaigns.hostile.trap:run",
    "a.b.c:d",
    "a:b:c",
    ":",
    "this:s",
)
TYPES = ("bool", "int", "float", "str", "enum", "list", "object", "Bool", "")
UNITS = ("m", "cm", "rad", "deg", "m/s", "percent", "kg", "N/m", "m/m", "parsec", "s/s/s/s", "1")
DURATIONS = ("1 s", "500 ms", "0 s", "forever", "-1 s", "1e9 h", "5", "s", "1 s 1 s", "99999999999999999999 min")
CONDITIONS = (
    *("{0}", "not {0}", "{0} and {1}", "{0} or {1}", "{0} < 3", '{0} == "open"', '{0} in ("a", "b")', "known({0})"),
    *("age({0}) < 5 s", "not known({0}) or age({0}) > 10 s", "{0} + {1} > 3 m", "abs({0}) < 0.2 rad", "{0} / 0 > 1"),
    *(
        "1 if {0} else 2",
        "{0} < {1} < 3",
        "max({0}, {1}, 3) > min({1})",
        "{0} == {0}",
        "{0} % 2",
        "{0}({1})",
        "{0}.{1}",
    ),
)
SECTIONS = ("context", "resources", "perception", "skills", "observers", "agents", "templates", "use")


def _make(chance: random.Random) -> Files:
    maker: Callable[[random.Random], Files] = chance.choices(MAKERS, WEIGHTS)[0]
    arguments = chance.choices(_COMMANDS, _COMMAND_WEIGHTS)[0]
    return {"pyproject.toml": PROJECT, "command": " ".join(arguments).encode(), **maker(chance)}


def _spliced(chance: random.Random) -> Files:
    """Return a valid spec with several tokens deleted, doubled, swapped, or replaced by other or hostile ones."""
    files = dict(chance.choice(_PROJECTS))
    for _ in range(chance.choice((1, 1, 2, 4, 8))):
        file = chance.choice(sorted(files))
        matches = list(TOKEN.finditer(files[file]))
        if matches:
            one, other = chance.choice(matches), chance.choice(matches)
            text = chance.choice(("", one.group() * 2, other.group(), chance.choice(NAMES), chance.choice(TEXTS)))
            files[file] = files[file][: one.start()] + text + files[file][one.end() :]
    return _encoded(files)


@dataclass(frozen=True)
class _Grower:
    """Generates a spec whose parts are hostile with probability `wild`, and of the right shape otherwise."""

    chance: random.Random
    wild: float

    def spec(self) -> dict[str, object]:
        names = [self.name() for _ in range(self.chance.randrange(2, 6))]
        document: dict[str, object] = {"codra": 1, "name": self.one(("spec",), NAMES)}
        document["context"] = {name: self.variable() for name in names}
        document["resources"] = {self.name(): self.one(({}, {"slots": 1}), ({"slots": -1}, {"slots": 10**30}, None))}
        document["perception"] = {self.name(): self.algorithm(names) for _ in range(self.chance.randrange(4))}
        document["skills"] = {self.name(): {"preview": self.some(names), "monitor": self.some(names)}}
        if self.chance.random() < 0.3:
            document["observers"] = {self.name(): {"identifies": self.some(names), "period": self.duration()}}
        if self.chance.random() < 0.3:
            template = self.name()
            document["templates"] = {template: self.template(names)}
            document["use"] = {self.name(): {"template": self.one((template,), NAMES), "p": self.text()}}
        if self.chance.random() < self.wild:
            document["include"] = [
                self.chance.choice(("/etc/passwd", "../spec.yaml", "spec.yaml", ".", "x.yaml", "a\0b", "~"))
            ]
        if self.chance.random() < self.wild:
            document[self.chance.choice((*SECTIONS, *NAMES))] = self.chance.choice(
                (None, [], {}, 3, "x", [[[]]], {"a": {"b": {}}})
            )
        return document

    def one(self, tame: Sequence[object], hostile: Sequence[object]) -> object:
        return self.chance.choice(hostile if self.chance.random() < self.wild else tame)

    def name(self) -> str:
        return str(self.one(GOOD_NAMES, NAMES))

    def text(self) -> str:
        return self.chance.choice(TEXTS)

    def duration(self) -> object:
        return self.one(("1 s", "500 ms", "forever"), DURATIONS)

    def value(self) -> dict[str, object]:
        kind = self.one(("bool", "bool", "float", "int", "enum", "str"), TYPES)
        keys: dict[str, object] = {"type": kind}
        if kind == "enum":
            keys["values"] = self.one((["a", "b"], ["open", "closed"]), ([self.name(), self.name()], [], [3]))
        if kind in ("int", "float") and self.chance.random() < 0.5:
            keys |= {
                "unit": self.one(UNITS[:5], UNITS),
                "range": self.one(([0, 1], [-1, 3]), ([1, 0], [0, "1 m"], [-1e308, 1e308])),
            }
        return keys

    def variable(self) -> dict[str, object]:
        keys = self.value()
        if self.chance.random() < 0.5:
            keys["source"] = self.one(("main_execution", "observer"), (*NAMES, ["observer", "a"]))
        if self.chance.random() < 0.5:
            keys["valid_for"] = self.duration()
        if self.chance.random() < 0.3:
            keys["label"] = self.text()
        return keys

    def algorithm(self, names: list[str]) -> dict[str, object]:
        returned = [self.name() for _ in range(2)]
        keys: dict[str, object] = {
            "call": self.one(CALLS[:4], CALLS),
            "with": {self.name(): self.one((1, 1.5, True, "3 cm", *TEXTS), (None, [1, [2, {"a": 3}]]))},
            "returns": {name: self.value() for name in returned},
            "observable_when": [self.condition(names) for _ in range(self.chance.randrange(3))],
            "identifies": {self.chance.choice(names): self.condition(returned)},
        }
        if self.chance.random() < 0.3:
            keys["accept_when"] = [self.condition(returned)]
        if self.chance.random() < 0.3:
            keys["timeout"] = self.one(("1 s", "3 min"), DURATIONS)
        return keys

    def template(self, names: list[str]) -> dict[str, object]:
        kind = self.one(("str",), ("identifier", "bool", "int", "float", "quantity", "object"))
        inner = f"$({self.one(('instance',), ('p', 'q'))})_{self.name()}"
        return {
            "parameters": {"p": kind},
            "context": {inner: self.variable()},
            "perception": {inner: self.algorithm(names)},
        }

    def some(self, names: list[str]) -> list[str]:
        chosen_names = list(dict.fromkeys(self.chance.choice(names) for _ in range(self.chance.randrange(3))))
        hostile = ("a becomes true within 1 s", "a stays 3 m", self.name(), self.text())
        return [*chosen_names, self.chance.choice(hostile)] if self.chance.random() < self.wild else chosen_names

    def condition(self, names: list[str]) -> str:
        form = str(self.one(CONDITIONS, TEXTS))
        return form.format(self.chance.choice(names), self.chance.choice(names)) if form in CONDITIONS else form


def _grown(chance: random.Random) -> Files:
    """Return a spec of mostly the right shape, with hostile names, texts and conditions."""
    spec = _Grower(chance, chance.choice((0.01, 0.05, 0.3))).spec()
    return {"spec.yaml": json.dumps(spec, ensure_ascii=chance.random() < 0.5).encode("utf-8", "surrogatepass")}


def _formed(chance: random.Random) -> Files:
    """Return a spec of mostly the right shape in all forms of YAML: anchors, aliases, merges, tags, block scalars."""
    spec = _Grower(chance, chance.choice((0.0, 0.01, 0.05))).spec()
    text = yaml_text(chance, spec)
    return {"spec.yaml": encoded(chance, damaged(chance, text, (0, 0, 1, 2)))}


def _damaged(chance: random.Random) -> Files:
    """Return a valid spec with damage to one of its files."""
    files = dict(chance.choice(_PROJECTS))
    file = chance.choice(sorted(files))
    return {**_encoded(files), file: encoded(chance, damaged(chance, files[file]))}


def _bytes(chance: random.Random) -> Files:
    """Return a valid spec with some bytes flipped, cut off, or replaced by noise."""
    data = bytearray(chance.choice(_PROJECTS)["spec.yaml"].encode())
    for _ in range(chance.randrange(1, 20)):
        data[chance.randrange(len(data))] = chance.randrange(256)
    return {"spec.yaml": bytes(data[: chance.randrange(len(data))] if chance.random() < 0.3 else data)}


def _noise(chance: random.Random) -> Files:
    letters = chance.choice(("{}[]:,-?&*!|>'\"%@`# \n\t", LETTERS + " :\n-", "".join(map(chr, range(0x20, 0x3000, 7)))))
    return {"spec.yaml": "".join(chance.choices(letters, k=chance.randrange(1, 3000))).encode("utf-8", "surrogatepass")}


def _bomb(chance: random.Random) -> Files:
    """Return an input that is far too large, too deep or too long."""
    many = chance.choice((100, 5_000, 40_000))
    head = "codra: 1\nname: bomb\n"
    texts = (
        "[" * many,
        head + "context: " + "{a: " * many,
        head + "".join(f"{' ' * depth}k{depth}:\n" for depth in range(min(many, 2000))),
        "a: &a [x]\n" + "".join(f"b{i}: &b{i} [*a, *a]\n" for i in range(50)),
        "- " * many,
        head
        + "context:\n"
        + "".join(f"  v{i}: {{type: bool, source: main_execution}}\n" for i in range(min(many, 5000))),
        head + "context:\n" + f"  a: {{type: bool, label: '{'x' * many * 10}'}}\n",
        head + "context:\n" + "".join(f"  v{i % 7}: {{type: bool}}\n" for i in range(min(many, 5000))),
        head + "context:\n" + "".join(f"  v{i}: {{typ: bol}}\n" for i in range(min(many, 3000))),
        head
        + f"perception: {{a: {{call: 'a:b', returns: {{x: {{type: bool}}}}, identifies: {{a: '{'(' * many}x'}}}}}}\n",
        head + f"context: {{a: {{type: bool}}}}\nperception: {{a: {{call: 'a:b', returns: {{x: {{type: bool}}}}, "
        f"identifies: {{a: '{' or '.join(['x'] * min(many, 9000))}'}}}}}}\n",
        head + "context:\n  a: {type: enum, values: [" + ", ".join(f"m{i}" for i in range(min(many, 5000))) + "]}\n",
        head + "skills:\n" + "".join(f"  s{i}: {{preview: [x{i}, y{i}]}}\n" for i in range(min(many, 2000))),
        "---\n" * many,
        "\n" * many + "x",
        "%YAML 1.1\n---\n" + head,
        head + "? " * min(many, 5000) + "a",
        head + "x: |\n" + " y\n" * many,
        head + "x: " + "'" + "\\" * many,
    )
    return {"spec.yaml": chance.choice(texts).encode()}


def _including(chance: random.Random) -> Files:
    """Return a spec whose parts include each other, themselves, or files outside of the project."""
    count = chance.choice((1, 3, 20, 60))
    paths = [f"parts/p{index}.yaml" for index in range(count)]
    files = {"spec.yaml": f"codra: 1\nname: spec\ninclude: {json.dumps(['parts/p0.yaml'])}\n"}
    for index, path in enumerate(paths):
        target = chance.choice(
            (f"p{(index + 1) % count}.yaml", f"p{index}.yaml", "../spec.yaml", "../../../x.yaml", "/dev/zero", ".")
        )
        files[path] = f"codra: 1\ninclude: [{target}]\ncontext: {{v{index}: {{type: bool, source: main_execution}}}}\n"
    return _encoded(files)


def _encoded(files: Mapping[str, str]) -> Files:
    return {file: text.encode("utf-8", "surrogatepass") for file, text in files.items()}


def _projects() -> tuple[dict[str, str], ...]:
    """Return the valid projects of this repository, each with its spec as `spec.yaml`."""
    project_files = []
    for files in projects().values():
        (_, spec), *parts = files.items()
        project_files.append({"spec.yaml": spec, **dict(parts)})
    return tuple(project_files)


_PROJECTS = _projects()
MAKERS = (_spliced, _grown, _formed, _damaged, _bytes, _noise, _bomb, _including)
WEIGHTS = (20, 40, 15, 12, 4, 3, 3, 3)

_COMMANDS = (
    ("compile", "spec.yaml", "--out", OUT, "--no-cache"),
    ("lint", "spec.yaml", "--no-cache"),
    *(
        ("lint", "spec.yaml", "--no-cache", "--format", name)
        for name in ("json", "sarif", "junit", "github", "concise")
    ),
    ("lint", "spec.yaml", "--diff"),
    ("lint", ".", "--no-cache"),
    *(("graph", "spec.yaml", "--format", name) for name in ("json", "dot", "svg", "mermaid")),
)
_COMMAND_WEIGHTS = (40, 10, 3, 3, 3, 3, 3, 10, 4, 5, 5, 5, 5)


def _read(root: Path) -> Answer:
    """Run a command on a spec; if it compiles, its package is up to date afterwards."""
    arguments = (root / "command").read_text().split()
    answer = command(*arguments)
    if arguments[0] == "compile" and answer.is_accepted:
        assert command(*arguments, "--check").is_accepted, "the package is not up to date after compiling"
    return answer


SPECS = Kind(_make, _read)
