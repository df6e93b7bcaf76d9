"""Hostile files for the commands that check, draw and convert single files: `codra fuzzy`, `knowledge` and `trees`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from random import Random

from tests.campaigns.hostile.engines import ENGINES
from tests.campaigns.hostile.graphs import DSR, GRAPHML
from tests.campaigns.hostile.reading import OUT, Answer, Files, Kind, Link, command
from tests.campaigns.hostile.trees import TREES

ROOT = Path(__file__).parents[3]
_ENGINES = tuple(path.read_text("utf-8") for path in sorted((ROOT / "tests/data/fuzzy").glob("*.fll")))
_NUMBERS = ("0", "-1", "1e308", "-1e308", "1e-300", "5e-324", "1.7976931348623157e308", "1e15", "0.1", "inf", "-inf")
_COMMENTS = (b"# codra: ignore[CDR2214] x\n", b"<!-- codra: ignore[CDR2404] -->\n", b"# codra: ignore[CDR9999]\n")
_TARGETS = ("/dev/zero", "/etc/passwd", "file", ".", "missing", "/proc/self/mem")
_SETTINGS = b'[tool.codra.lint]\nignore = ["CDR2214", "CDR2403"]\nfail-on = "warning"\n'
_COMMANDS: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "engine.fll": (("fuzzy", "check"), ("fuzzy", "draw", "--output", f"{OUT}/engine.svg")),
    "graph.json": (("knowledge", "check"),),
    "graph.graphml": (("knowledge", "check"), ("knowledge", "check", "--both-ways")),
    "tree.xml": (
        ("trees", "check"),
        ("trees", "graph", "--format", "mermaid"),
        ("trees", "convert", "--output", f"{OUT}/tree.xml"),
    ),
}


def _make(chance: Random) -> Files:
    """Return a hostile file of one kind, sometimes under the name of another kind, as a link, or with settings."""
    kind = chance.choices((ENGINES, DSR, GRAPHML, TREES), (40, 25, 25, 10))[0]
    is_drawable = kind is ENGINES and chance.random() < 0.5
    files: dict[str, bytes | Link] = {"engine.fll": _drawable(chance)} if is_drawable else dict(kind.make(chance))
    name = next(name for name in _COMMANDS if name in files)
    content = files[name]
    if isinstance(content, bytes):
        content = _of_version_5(chance, content) if kind is ENGINES and chance.random() < 0.4 else content
        content = _undirected(chance, content) if kind is GRAPHML and chance.random() < 0.5 else content
        files[name] = chance.choice(_COMMENTS) + content if chance.random() < 0.05 else content
    if chance.random() < 0.05:
        files[chance.choice(list(_COMMANDS))] = files.pop(name)
    if chance.random() < 0.02:
        files = {name: Link(chance.choice(_TARGETS))}
    if chance.random() < 0.1:
        files["pyproject.toml"] = _SETTINGS
    return files


def _drawable(chance: Random) -> bytes:
    """Return an engine that is well-formed, with a few hostile numbers."""
    parts = re.split(r"(?<= )(-?[\d.]+)(?=[ \n])", chance.choice(_ENGINES))
    for _ in range(chance.choice((0, 1, 3, 10))):
        parts[chance.randrange(len(parts) // 2) * 2 + 1] = chance.choice(_NUMBERS)
    return "".join(parts).encode()


def _of_version_5(chance: Random, engine: bytes) -> bytes:
    """Return an engine with some words of FuzzyLite 5."""
    replacements = (
        (b"aggregation:", b"accumulation:"),
        (b"activation: General", chance.choice((b"activation: Minimum", b"activation: none"))),
        (b"lock-previous:", b"lock-valid:"),
        (b"implication:", chance.choice((b"implication:", b"#"))),
    )
    for old, new in replacements:
        engine = engine.replace(old, new) if chance.random() < 0.8 else engine
    return engine


def _undirected(chance: Random, graph: bytes) -> bytes:
    """Return GraphML with undirected edges."""
    graph = graph.replace(b'edgedefault="directed"', chance.choice((b'edgedefault="undirected"', b"")))
    return graph.replace(b"<edge ", chance.choice((b"<edge ", b'<edge directed="false" ')), chance.choice((1, -1)))


def _read(root: Path) -> Answer:
    """Run every command for a kind of file."""
    name = next(name for name in _COMMANDS if (root / name).is_symlink() or (root / name).exists())
    answers = [command(*arguments, name) for arguments in _COMMANDS[name]]
    return Answer(answers[0].is_accepted, tuple(code for answer in answers for code in answer.codes))


SINGLE_FILES = Kind(_make, _read)
