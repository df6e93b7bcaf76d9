"""Hostile main executions for `codra import` and `codra coverage`: Python, behavior trees and RAFCON state machines."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

from tests.campaigns.hostile.damage import damaged, damaged_bytes, damaged_json, encoded
from tests.campaigns.hostile.reading import OUT, OWNED, Answer, Files, Kind, Link, command
from tests.campaigns.hostile.texts import NUMBERS, ODD_NAMES, RESERVED_NAMES, TEXTS
from tests.campaigns.hostile.trees import TREES

ROOT = Path(__file__).parents[3]
_PYTHON = tuple(
    path.read_text("utf-8")
    for path in (*sorted((ROOT / "tests/cases/imports").glob("*.py")), ROOT / "codra_papers/lab/mission.py")
)
_MACHINE = ROOT / "examples/rafcon_lab/tend_pcr_cycler"
_MACHINE_FILES = {
    path.relative_to(_MACHINE).as_posix(): path.read_bytes() for path in sorted(_MACHINE.rglob("*")) if path.is_file()
}
_RUN = f"__import__('pathlib').Path({OWNED!r}).touch()"


def _growing(chance: Random) -> str:
    """Return Python whose analysis would grow without limits: in depth, in calls, in texts or in values."""
    many = chance.choice((50, 500, 5000))
    return chance.choice(
        (
            "if " + "(" * min(many, 500) + "f()" + ")" * min(many, 500) + ": pass",
            "if " + "not " * many + "f(): pass",
            "if f()" + " + f()" * many + ": pass",
            "if f" + "()" * many + ": pass",
            "x" + ".a" * many + " = 1\nif x" + ".a" * many + ".is_b(): pass",
            "x = f()\n" + "x = (x, x)\n" * many + "if x: pass",
            "x = 'a'\n" + "x = f'{x}{x}'\n" * many + "if is_a(x): pass",
            "x = {'a': 1}\n" + "x = {'a': x, 'b': x}\n" * many + "if f(x['a']): pass",
            "".join(f"def f{n}(a):\n f{n + 1}(a + '1'); f{n + 1}(a + '2')\n" for n in range(min(many, 60))),
            "".join(f"def f{n}(a):\n f{n + 1}(f'{{a}}1'); f{n + 1}(f'{{a}}2')\n" for n in range(min(many, 60)))
            + "f0('')\n",
            "def f(a):\n if g(a): f(f'{a}1')\nf('')\n",
            "".join(f"if f{n}(): pass\n" for n in range(many)),
            "if f(" + "a, " * many + "): pass",
            "for a in (1, 2, 3, 4):\n"
            + "".join(f"{' ' * n}for a in (1, 2, 3, 4):\n" for n in range(1, 19))
            + " " * 19
            + "f()",
            "".join(f"class C{n}:\n def f(self):\n  if self.g(): pass\n" for n in range(many)),
            "if f():\n"
            + "".join(f"{' ' * n}if f():\n" for n in range(1, min(many, 99)))
            + " " * min(many, 99)
            + "pass",
        )
    )


def _hostile_python(chance: Random) -> str:
    name, text, number = chance.choice((*ODD_NAMES, *RESERVED_NAMES)), chance.choice(TEXTS), chance.choice(NUMBERS)
    return chance.choice(
        (
            f"{_RUN}\nif {_RUN}: pass\n",
            f"@{_RUN}\nclass A({_RUN}):\n def is_a(self, b={_RUN}): return 1\nif A().is_a(): pass",
            f"import {name}\nif {name}.is_a({text!r}): pass",
            f"if is_a({number}) > {number}: pass",
            f"with codra.skill({text!r}):\n if codra.decide({text!r}): pass",
            f"if f'{{{name}}}{text!r}': pass",
            f"# -*- coding: {text} -*-\nif a(): pass",
            f"match f():\n case {text!r} | {number}: pass\n case {{'a': [*_]}} if g(): pass",
        )
    )


def _make_python(chance: Random) -> Files:
    maker = chance.choices((_growing, _hostile_python, lambda chance: chance.choice(_PYTHON)), (2, 4, 6))[0]
    text = maker(chance)
    data = encoded(chance, damaged(chance, text) if chance.random() < 0.7 else text)
    return {"robot.py": damaged_bytes(chance, data) if chance.random() < 0.05 else data}


def _make_trees(chance: Random) -> Files:
    files = dict(TREES.make(chance))
    return {"robot.xml" if name == "tree.xml" else name: content for name, content in files.items()}


def _make_machine(chance: Random) -> Files:
    files: dict[str, bytes | Link] = {f"robot/{name}": data for name, data in _MACHINE_FILES.items()}
    for name in chance.sample(sorted(_MACHINE_FILES), chance.choice((0, 1, 1, 3))):
        data, kind = _MACHINE_FILES[name], chance.random()
        if name.endswith(".json") and kind < 0.6:
            files[f"robot/{name}"] = encoded(chance, damaged_json(chance, json.loads(data)))
        elif kind < 0.8:
            files[f"robot/{name}"] = damaged_bytes(chance, data)
        elif kind < 0.9:
            del files[f"robot/{name}"]
        else:
            files[f"robot/{name}"] = Link(chance.choice(("/etc/passwd", "/dev/zero", "core_data.json", "..", ".")))
    return files


def _make(chance: Random) -> Files:
    return chance.choices((_make_python, _make_trees, _make_machine), (5, 3, 2))[0](chance)


def _read(root: Path) -> Answer:
    """Draft a spec, then judge it. A draft must lint without errors and cover every decision of its source."""
    source = next(name for name in ("robot.py", "robot.xml", "robot") if (root / name).exists())
    draft = f"{OUT}/draft.yaml"
    answer = command("import", source, "--as", "draft", "--output", draft)
    if (root / draft).exists():
        assert answer.is_accepted
        answers = (
            command("lint", draft, "--no-cache"),
            command("coverage", draft, "--of", source, "--fail-under", "100", "--output", f"{OUT}/coverage.txt"),
            command("coverage", draft, "--of", source, "--format", "json", "--graph", f"{OUT}/coverage.dot"),
        )
        assert all(answer.is_accepted for answer in answers), answers
    return answer


SOURCES = Kind(_make, _read)
