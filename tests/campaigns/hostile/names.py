"""Hostile names: everything that a spec declares gets names of Python, of generated code, and names that are none."""

from __future__ import annotations

import builtins
import re
import sys
from functools import cache
from pathlib import Path
from random import Random

from codra_dsl.integrations.inspection.loading import load_package
from tests.campaigns.hostile.reading import OUT, Answer, Files, Kind, command
from tests.campaigns.hostile.specs import PROJECT
from tests.campaigns.hostile.texts import NAMES, ODD_NAMES, RESERVED_NAMES, TEXTS
from tests.campaigns.mutants.mutation import projects

ROOT = Path(__file__).parents[3]
_KEY = re.compile(r"(?:^|[{,])[ \t]*([A-Za-z_]\w*)[ \t]*:", re.MULTILINE)
_NAME = re.compile(r"^name: (\w+)", re.MULTILINE)
_WORD = re.compile(r"[A-Za-z_]\w*")
_MAX_SPEC = 8_000


@cache
def _generated_names() -> tuple[str, ...]:
    """Return all words of the generated packages of this repository, which the emitter can use."""
    files = sorted((ROOT / "generated").rglob("*.py"))
    words = {word for file in files for word in _WORD.findall(file.read_text("utf-8"))}
    modules = {part for file in files for part in (file.stem, file.stem.title(), file.stem.upper())}
    return tuple(sorted(words | modules | set(dir(builtins))))


@cache
def _specs() -> tuple[dict[str, str], ...]:
    """Return the small valid specs of this repository, each with its files; the spec itself is `spec.yaml`."""
    specs = []
    for files in projects().values():
        (_, spec), *parts = files.items()
        if len(spec) < _MAX_SPEC:
            specs.append({"spec.yaml": spec, **dict(parts)})
    return tuple(specs)


@cache
def _schema_words() -> frozenset[str]:
    """Return the keys of the language, which are not names."""
    return frozenset(_WORD.findall((ROOT / "codra_dsl/schema.json").read_text("utf-8")))


def _name(chance: Random, names: list[str]) -> str:
    """Return a name; sometimes a form of another name of the spec, which can clash with it."""
    kind = chance.random()
    if kind < 0.45:
        return chance.choice(_generated_names())
    if kind < 0.6:
        return chance.choice((*RESERVED_NAMES, *NAMES))
    if kind < 0.75 and names:
        name = chance.choice(names)
        forms = (
            name.upper(),
            name.title(),
            name.title().replace("_", ""),
            f"{name}_",
            f"{name}_1",
            f"{name}s",
            f"_{name}",
        )
        return chance.choice((*forms, name.replace("_", "__"), f"observe_{name}", f"{name}_observer", name))
    odd_name = chance.choice((*ODD_NAMES, *TEXTS))
    return odd_name if len(odd_name) < 10_000 or chance.random() < 0.1 else "a" * 200


def _make(chance: Random) -> Files:
    """Return a valid spec in which a few names are replaced wherever they occur."""
    if chance.random() < 0.12:
        return _named_on_command_line(chance)
    files = dict(chance.choice(_specs()))
    names = sorted({*_KEY.findall(files["spec.yaml"]), *_NAME.findall(files["spec.yaml"])} - _schema_words())
    for _ in range(chance.choice((1, 1, 2, 4))):
        if not names:
            break
        old, new = chance.choice(names), _name(chance, names)
        written = new if _WORD.fullmatch(new) else f'"{_escaped(new)}"' if chance.random() < 0.7 else new
        files = {file: re.sub(rf"\b{old}\b", lambda _, text=written: text, text) for file, text in files.items()}
    if chance.random() < 0.3:
        spec_name = _name(chance, names)
        files["spec.yaml"] = _NAME.sub(lambda _: f'name: "{_escaped(spec_name)}"', files["spec.yaml"])
    data = {file: text.encode("utf-8", "surrogatepass") for file, text in files.items()}
    return {"pyproject.toml": PROJECT, "command": f"compile\nspec.yaml\n--out\n{OUT}\n--no-cache".encode(), **data}


def _escaped(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter == "_" else f"\\U{ord(letter):08x}" for letter in name)


def _named_on_command_line(chance: Random) -> Files:
    """Return a command with a name as an argument."""
    name = _name(chance, []).replace("\x00", "").replace("\n", " ")[:5000]
    name = name.encode("utf-8", "surrogateescape" if "\ud800" not in name else "replace").decode("utf-8")
    path = name.replace("..", "").lstrip("/")  # a command may read any file that its caller names
    arguments = chance.choice(
        (
            ("init", f"{OUT}/new", "--name", name),
            ("explain", name),
            ("lint", path),
            ("graph", "spec.yaml", "--select", name),
            ("diff", path, "spec.yaml"),
            ("compile", "spec.yaml", "--out", f"{OUT}/{path}"),
        )
    )
    spec = chance.choice(_specs())["spec.yaml"].encode()
    return {
        "pyproject.toml": PROJECT,
        "spec.yaml": spec,
        "command": "\n".join(arguments).encode("utf-8", "surrogateescape"),
    }


def _read(root: Path) -> Answer:
    """Run a command; if the spec compiles, load its package: names that clash would break or change it."""
    answer = command(*(root / "command").read_text("utf-8").split("\n"))
    for package in sorted((root / OUT).glob("*/manifest.json")) if answer.is_accepted else ():
        before = set(sys.modules)
        model = load_package(package.parent).MODEL
        assert model.name == package.parent.name
        for name in set(sys.modules) - before:
            del sys.modules[name]
    return answer


def _prepare() -> None:
    _generated_names()
    _specs()
    _schema_words()


NAMES_KIND = Kind(_make, _read, prepare=_prepare)
