"""What the compiler says of a mutant, and how good that is."""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from codra_dsl.compiler import compile_paths
from codra_dsl.diagnostics import Diagnostic
from tests.mutants.mutation import PROJECT, Mutant, Slip

SUGGESTION = re.compile(r"did you mean '(?P<name>[^']*)'")
FOR_PEOPLE = re.compile(r"^\s*(?:-\s*)?\{?.*\b(?:label|description|title)\b")
DECLARED = re.compile(r"^(?!call\b|with\b|- )[\w$(){\"]+:|^name:")
UNTOLD = {"sources.json", "manifest.json"}


class Fate(StrEnum):
    """What became of a mutant."""

    NEAR = "found within one line"
    FAR = "found elsewhere"
    HARMLESS = "harmless: it means the same"
    PROSE = "harmless: only what people read is another"
    NAME = "harmless: a free name is another"
    MISSED = "missed: another valid spec"


@dataclass(frozen=True)
class Verdict:
    """A mutant and what the compiler said."""

    mutant: Mutant
    fate: Fate
    findings: tuple[Diagnostic, ...]

    @property
    def suggestion(self) -> str | None:
        """Return the first name that a finding suggests, for a misspelt one."""
        told = (SUGGESTION.search(found.help) for found in self.findings)
        first = next((match for match in told if match is not None), None)
        return first["name"] if first is not None and self.mutant.slip is Slip.RENAME else None


@dataclass(frozen=True)
class Original:
    """A valid project: what it means, and what was found about it before anything was changed."""

    meaning: Mapping[str, str]
    known: frozenset[tuple[str, str]]


def original(files: Mapping[str, str]) -> Original:
    """Return what a project means before anything is changed."""
    meaning, found = compiled(files)
    return Original(meaning, frozenset((each.code, each.message) for each in found))


def judge(before: Original, mutant: Mutant) -> Verdict:
    """Compile a mutant and say what became of it."""
    meaning, found = compiled(mutant.files)
    new = tuple(each for each in found if (each.code, each.message) not in before.known)
    return Verdict(mutant, _fate(before, mutant, meaning, new), new)


def _fate(before: Original, mutant: Mutant, meaning: Mapping[str, str], new: tuple[Diagnostic, ...]) -> Fate:
    if any(_is_near(found, mutant) for found in new):
        return Fate.NEAR
    if new:
        return Fate.FAR
    if meaning == before.meaning:
        return Fate.HARMLESS
    if FOR_PEOPLE.match(mutant.context):
        return Fate.PROSE
    return Fate.NAME if _only_names(before.meaning, meaning, mutant) else Fate.MISSED


def _only_names(before: Mapping[str, str], after: Mapping[str, str], mutant: Mutant) -> bool:
    """Return whether the code is the same but for a name that only the spec itself gives: no call, no argument."""
    if mutant.slip is not Slip.RENAME or not DECLARED.search(mutant.context):
        return False
    old, new = mutant.token.text.casefold(), mutant.replacement.casefold()
    return _words(before, old, "") == _words(after, new, "")


def _words(meaning: Mapping[str, str], name: str, blank: str) -> Counter[str]:
    text = "\n".join((*meaning, *meaning.values())).casefold()
    return Counter(re.findall(r"\w+|[^\w\s]", text.replace(name, blank)))


def _is_near(found: Diagnostic, mutant: Mutant) -> bool:
    spans = [found.place.span]
    spans += [found.place.use] if found.place.use is not None else []
    return any(span.file == mutant.token.file and abs(span.line - mutant.line) <= 1 for span in spans)


def compiled(files: Mapping[str, str]) -> tuple[dict[str, str], tuple[Diagnostic, ...]]:
    """Return the generated code of a project without what only says where things stand, and the findings."""
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        (root / "pyproject.toml").write_text(PROJECT)
        for file, text in files.items():
            path = root / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
        spec = root / next(iter(files))
        compilation = compile_paths([spec], root)
        told = {path: text for path, text in compilation.files.items() if Path(path).name not in UNTOLD}
        return told, compilation.planned.diagnostics


def described(verdict: Verdict) -> str:
    """Return a verdict as one line of JSON."""
    mutant = verdict.mutant
    return json.dumps(
        {
            "fate": verdict.fate.name,
            "slip": mutant.slip,
            "token": mutant.token.text,
            "into": mutant.replacement,
            "at": f"{mutant.token.file}:{mutant.line}",
            "line": mutant.context,
            "findings": [
                f"{each.place.span.file}:{each.place.span.line} {each.code} {each.message} ({each.help})"
                for each in verdict.findings
            ],
        }
    )
