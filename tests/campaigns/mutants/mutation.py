"""Projects of valid specs, their tokens, and typing mistakes in one token."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from tests.test_docs import blocks

ROOT = Path(__file__).parents[3]
PROJECT = "[tool.codra]\n"

TOKEN = re.compile(
    r"""
    (?P<comment>(?:^|(?<=\s))\#.*)
    | (?P<text>"(?:[^"\\\n]|\\.)*"|'(?:[^'\n]|'')*')
    | (?P<word>[A-Za-z_][A-Za-z0-9_]*)
    | (?P<number>\d+(?:\.\d+)?)
    | (?P<mark>[<>=!]=|\$\(|[^\s\w])
    """,
    re.VERBOSE | re.MULTILINE,
)
TYPES = {"word": ("17", "true", "[]"), "number": ("abc", "true", '"7"'), "text": ("17", "[]", "true")}
LETTERS = "abcdefghijklmnopqrstuvwxyz"


class Slip(StrEnum):
    """The change to a token."""

    DELETE = "delete"
    RENAME = "rename"
    RETYPE = "retype"


@dataclass(frozen=True)
class Token:
    """A token of a file; its kind is the name of the matching group of TOKEN."""

    file: str
    start: int
    kind: str
    text: str


@dataclass(frozen=True)
class Mutant:
    """A project with one token changed."""

    files: Mapping[str, str]
    token: Token
    slip: Slip
    replacement: str

    @property
    def line(self) -> int:
        """Return the 1-based line of the change."""
        return self.files[self.token.file].count("\n", 0, self.token.start) + 1

    @property
    def is_first(self) -> bool:
        """Return whether only parts of its own name come before the changed token on its line."""
        before = self.files[self.token.file][: self.token.start].rpartition("\n")[2]
        return re.fullmatch(r"\s*[\w$()]*|name: ", before) is not None

    @property
    def context(self) -> str:
        """Return the changed line."""
        return self.files[self.token.file].split("\n")[self.line - 1].strip()


def projects() -> dict[str, dict[str, str]]:
    """Return the files of every valid spec of this repository, by the spec's path."""
    files_by_path = {}
    for spec in sorted((ROOT / "specs").glob("*.yaml")):
        files_by_path[f"specs/{spec.name}"] = _with_parts(spec, ROOT / "specs")
    valid = ROOT / "tests" / "cases" / "valid"
    for spec in sorted([*valid.glob("*.yaml"), *valid.glob("*/spec.yaml")]):
        files_by_path[f"valid/{spec.relative_to(valid)}"] = _with_parts(spec, spec.parent)
    for page in sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]):
        for index, block in enumerate(blocks(page)):
            if block.kind == "yaml" and block.body.startswith("codra: 1\nname:") and "include" not in block.body:
                files_by_path[f"{page.name}#{index}"] = {"spec.yaml": block.body}
    return files_by_path


def _with_parts(spec: Path, folder: Path) -> dict[str, str]:
    parts = sorted((folder / "parts").glob("*.yaml")) if "include:" in spec.read_text("utf-8") else []
    return {path.relative_to(folder).as_posix(): path.read_text("utf-8") for path in (spec, *parts)}


def laid_out(files: Mapping[str, str], root: Path) -> Path:
    """Write the files of a project into a folder and return the path of its spec."""
    for file, text in {"pyproject.toml": PROJECT, **files}.items():
        path = root / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return root / next(iter(files))


def tokens(files: Mapping[str, str]) -> list[Token]:
    """Return all tokens outside comments."""
    return [
        Token(file, match.start(), str(match.lastgroup), match.group())
        for file, text in files.items()
        for match in TOKEN.finditer(text)
        if match.lastgroup != "comment"
    ]


def mutate(files: Mapping[str, str], token: Token, chance: random.Random) -> Mutant:
    """Return a project with a change of a token, chosen uniformly from those that apply to it."""
    slips = [Slip.DELETE]
    slips += [Slip.RENAME] if token.kind == "word" else []
    slips += [Slip.RETYPE] if token.kind in TYPES else []
    slip = chance.choice(slips)
    replacement = _replacement(token, slip, chance)
    text = files[token.file]
    changed = text[: token.start] + replacement + text[token.start + len(token.text) :]
    return Mutant({**files, token.file: changed}, token, slip, replacement)


def _replacement(token: Token, slip: Slip, chance: random.Random) -> str:
    if slip is Slip.DELETE:
        return ""
    if slip is Slip.RETYPE:
        return chance.choice([text for text in TYPES[token.kind] if text != token.text])
    while (typo := _typo(token.text, chance)) == token.text:
        pass
    return typo


def _typo(word: str, chance: random.Random) -> str:
    """Return a word with a letter left out, doubled, replaced, or swapped with its neighbour."""
    at = chance.randrange(len(word))
    before, letter, after = word[:at], word[at], word[at + 1 :]
    forms = [before + letter + letter + after, before + chance.choice(LETTERS) + after]
    forms += [before + after] if len(word) > 1 and (at or after[0].isalpha()) else []
    forms += [before + after[0] + letter + after[1:]] if after else []
    return chance.choice(forms)
