"""Hostile projects: settings in `pyproject.toml`, comments that silence findings, manifests, schema copies, caches."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

from tests.campaigns.hostile.damage import damaged, damaged_bytes, damaged_json, encoded
from tests.campaigns.hostile.reading import Answer, Files, Kind, Link, command
from tests.campaigns.hostile.texts import NAMES, NUMBERS, ODD_NAMES, TEXTS

CODES = ("CDR", "CDR7", "CDR71", "CDR7102", "CDR1025", "CDR3003", "CDR99", "cdr7102", "CDR7102 ", "CDR71020", "", "C")
_KEYS = ("select", "ignore", "severity", "fail-on", "fail_on", "selct", "lint", "a.b", '"a b"', '""', "'x'", "\u00e9")
_SPEC = """\
codra: 1
name: door
context:
  near: {type: bool, source: main_execution, valid_for: 5 s}  # codra: ignore[CDR7102] not used yet
  # codra: ignore-next[CDR7101]
  door_open: {type: bool}
perception:
  look:
    call: tests.campaigns.hostile.trap:run
    returns: {seen: {type: bool}}
    observable_when: [near]
    identifies: {door_open: seen}
skills:
  pass_door: {preview: [door_open]}
"""
_MANIFEST = {"codra-manifest": 1, "name": "door", "files": {"__init__.py": "sha256:0"}, "model": "0"}
_COMMENTS = (
    *(
        "# codra: ignore",
        "# codra: ignore[]",
        "# codra: ignore[CDR7102",
        "# codra:ignore[CDR7102]",
        "# codra: ignor[X]",
    ),
    *("# codra: ignore[CDR7102,CDR7102]", "# codra: ignore[" + "CDR7102," * 3000 + "]", "# codra: ignore[*] all"),
    *("#codra: ignore-file[CDR71]", "# codra: ignore[CDR1025] binding", "# noqa", "# codra: " + "x" * 5000),
)


class _Toml:
    """Derives a document of TOML with a table for codra; `wild` is the probability with which a part is hostile."""

    def __init__(self, chance: Random) -> None:
        self.chance = chance
        self.wild = chance.choice((0.0, 0.05, 0.3))

    def document(self) -> str:
        chance = self.chance
        parts = ["[project]\nname = 'robot'\nversion = '1'\n", self.lint(), "[tool.other]\nx = {a = [1, {b = 2}]}\n"]
        if chance.random() < self.wild:
            parts.insert(chance.randrange(3), chance.choice(_TABLES))
        if chance.random() < self.wild:
            chance.shuffle(parts)
        return "".join(parts)

    def lint(self) -> str:
        lines = [
            self.chance.choice(("[tool.codra.lint]", "[tool.codra]\n[tool.codra.lint]", "[ tool . 'codra' . lint ]"))
        ]
        for key in self.chance.sample(("select", "ignore", "severity", "fail-on"), self.chance.randrange(5)):
            written_key = self.chance.choice(_KEYS) if self.is_wild() else key
            lines.append(f"{written_key} = {self.value(3) if self.is_wild() else self.tame(key)}")
        return "\n".join(lines) + "\n"

    def is_wild(self) -> bool:
        return self.chance.random() < self.wild

    def tame(self, key: str) -> str:
        levels = ('"error"', '"warning"')
        if key == "fail-on":
            return self.chance.choice(levels)
        codes = [json.dumps(self.chance.choice(CODES if self.is_wild() else CODES[:4])) for _ in range(3)]
        if key == "severity":
            return "{" + ", ".join(f"{code} = {self.chance.choice(levels)}" for code in codes[:2]) + "}"
        return f"[{', '.join(codes)}]"

    def value(self, depth: int) -> str:
        chance = self.chance
        kind = chance.randrange(8 if depth else 6)
        if kind == 0:
            return chance.choice(
                (*NUMBERS, "0xffffffffffffffffffff", "1979-05-27", "07:32:00", "1979-05-27T07:32:00Z", "+nan")
            )
        if kind == 1:
            return json.dumps(chance.choice((*TEXTS, *ODD_NAMES[:-40])))
        if kind == 2:
            return chance.choice(
                ("'''x\n'''", '"""\\\n   x"""', "'\\'", '"\\u0000"', '"\\U00110000"', '"\\ud800"', '"\\x41"', "''''''")
            )
        if kind == 3:
            return chance.choice(
                ("[" * 2000 + "]" * 2000, "{a=" * 2000 + "1" + "}" * 2000, "[1,]", "{a=1,}", "[[]", "{", "]")
            )
        if kind < 6:
            return chance.choice(("true", "false", '"error"', '"CDR"', "[]", "{}", "True", "error"))
        if kind == 6:
            return f"[{', '.join(self.value(depth - 1) for _ in range(chance.choice((1, 3, 500))))}]"
        return "{" + ", ".join(f"k{n}.{chance.choice(_KEYS)} = {self.value(depth - 1)}" for n in range(3)) + "}"


_TABLES = (
    *(
        "[tool]\ncodra = 3\n",
        "[tool.codra]\n",
        "[[tool.codra]]\n",
        "[[tool.codra.lint]]\n",
        "tool.codra.lint.ignore = ['CDR7']\n",
    ),
    "".join(f"[tool.codra.x{number}]\n" for number in range(2000)),
    "[tool.codra.lint.severity]\n" + "".join(f'CDR{number:04} = "error"\n' for number in range(3000)),
    "[tool.codra.lint]\nignore = [" + '"CDR7102", ' * 5000 + "]\n",
    "[tool.codra.lint]\n" + "".join(f"key{number} = 1\n" for number in range(3000)),
    "a" + ".a" * 90 + " = 1\n",
    "a" + ".a" * 5000 + " = 1\n",
    "x = " + "9" * 5000 + "\n",
    "[" + "a." * 300 + "a]\n",
    "#" * 300_000 + "\n",
    "x = '" + "y" * 200_000 + "'\n",
    "[a]\n[a]\n",
    "a = 1\na.b = 2\n",
)


def _make(chance: Random) -> Files:
    text, spec = _Toml(chance).document(), _SPEC
    kind = chance.random()
    if kind < 0.6:
        text = damaged(chance, text, (1, 1, 2, 4))
    if chance.random() < 0.3:
        place = chance.randrange(spec.count("\n"))
        lines = spec.split("\n")
        lines[place] += f"  {chance.choice(_COMMENTS)}"
        spec = damaged(chance, "\n".join(lines), (0, 0, 1))
    files: dict[str, bytes | Link] = {"pyproject.toml": encoded(chance, text), "specs/door.yaml": encoded(chance, spec)}
    files |= _further_files(chance) if chance.random() < 0.4 else {}
    return {**files, "command": " ".join(_arguments(chance)).encode()}


def _further_files(chance: Random) -> dict[str, bytes | Link]:
    """Return files that the tool itself writes into a project, made by a stranger."""
    manifest = damaged_json(chance, json.loads(json.dumps(_MANIFEST))).encode("utf-8", "surrogatepass")
    link = Link(chance.choice(("/dev/zero", "/etc/passwd", ".", "..", "manifest.json", "/nowhere", "../../../..")))
    cache = chance.randbytes(chance.choice((0, 10, 3000))) if chance.random() < 0.5 else manifest
    name = chance.choice(NAMES[:14])
    sets: tuple[dict[str, bytes | Link], ...] = (
        {
            "generated/door/manifest.json": damaged_bytes(chance, manifest),
            "generated/door/__init__.py": b"raise SystemExit",
        },
        {"generated/door/manifest.json": link},
        {"generated/door": link},
        {"generated": chance.choice((link, b"a file"))},
        {f"generated/{name}/manifest.json": manifest, f"generated/{name}/x.py": b"import os; os.system('touch owned')"},
        {".codra/schema.json": chance.choice((link, manifest, b"x" * 300_000))},
        {".codra_cache/lint.json": cache, ".codra_cache/compile.json": cache, ".codra_cache/x/y": cache},
        {".codra_cache": chance.choice((link, cache))},
        {"specs/pyproject.toml": manifest, "specs/link.yaml": link},
        {"specs/a.yaml/b": b"", "specs/.hidden.yaml": manifest, "specs/b.yaml": manifest},
    )
    return chance.choice(sets)


def _arguments(chance: Random) -> tuple[str, ...]:
    fail_on = chance.choice(((), (), ("--fail-on", "warning")))
    return chance.choice(
        (
            ("lint", "specs", *fail_on),
            ("lint", "specs", "--format", chance.choice(("json", "sarif", "junit", "github", "concise"))),
            ("lint", "specs/door.yaml", "--diff"),
            ("lint", "specs", "--fix"),
            ("compile", "specs", "--check"),
            ("compile", "specs", *fail_on),
            ("graph", "specs", "--format", "json"),
        )
    )


def _read(root: Path) -> Answer:
    return command(*(root / "command").read_text().split())


SETTINGS = Kind(_make, _read, changes=("generated", ".codra_cache", ".codra", "specs"))
"""`lint --fix` may change specs, and `compile` the packages, the cache and the copy of the schema."""
