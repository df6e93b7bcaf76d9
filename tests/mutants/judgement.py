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
from codra_dsl.diagnostics import Diagnostic, has_errors
from tests.mutants.functions import perception_of
from tests.mutants.mutation import Mutant, Slip, laid_out

SUGGESTION = re.compile(r"did you mean (?P<quote>['\"])(?P<name>.*?)(?P=quote)")
QUOTED = re.compile(r"'([^']*)'|\"([^\"]*)\"")
FOR_PEOPLE = re.compile(r"^\s*(?:-\s*)?\{?.*\b(?:label|description|title)\b")
DECLARED = re.compile(r"(?!call:|with:)[\w$()]+:|name: ")
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
    def suggestion(self) -> tuple[str, bool] | None:
        """Return what the first finding that suggests something suggests for a misspelt name, and if that is right.

        It is, if it is the token as it was, or what the finding names with the token put right in it.
        """
        told = ((found, SUGGESTION.search(found.help)) for found in self.findings)
        first = next(((found, match["name"]) for found, match in told if match is not None), None)
        if first is None or self.mutant.slip is not Slip.RENAME:
            return None
        found, name = first
        token, typo = self.mutant.token.text, self.mutant.replacement
        named = {each for pair in QUOTED.findall(found.message) for each in pair if typo in each}
        return name, name == token or name in {each.replace(typo, token) for each in named}


@dataclass(frozen=True)
class Original:
    """A valid project: what it means, and what was found about it before anything was changed."""

    modules: Mapping[str, str]
    meaning: Mapping[str, str]
    known: frozenset[tuple[str, str]]
    is_valid: bool


def original(files: Mapping[str, str]) -> Original:
    """Return what a project means before anything is changed, with the perception functions that it calls."""
    modules = perception_of(files)
    meaning, found = compiled({**files, **modules})
    known = frozenset((each.code, each.message) for one in found for each in (one, *one.each_use))
    return Original(modules, meaning, known, is_valid=not has_errors(found))


def judge(before: Original, mutant: Mutant) -> Verdict:
    """Compile a mutant and say what became of it."""
    meaning, found = compiled({**mutant.files, **before.modules})
    new = tuple(each for each in found if not _is_known(each, before, mutant))
    return Verdict(mutant, _fate(before, mutant, meaning, new), new)


def _is_known(found: Diagnostic, before: Original, mutant: Mutant) -> bool:
    """Return whether it was found before, be it about an element that had its name as yet."""
    token, other = mutant.token.text, mutant.replacement
    return any(
        code == found.code and found.message in (message, message.replace(token, other))
        for code, message in before.known
    )


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
    if not mutant.is_first or not DECLARED.match(mutant.context):
        return False
    old, new = _words(before), _words(after)
    renamed = {word: _renamed(word, mutant) for word in (old - new)}
    gone = Counter({renamed[word]: count for word, count in (old - new).items()})
    return all(word != renamed[word] for word in renamed) and gone == new - old


def _renamed(word: str, mutant: Mutant) -> str:
    """Return a word with the token changed in it, as the parameter before it is filled in and names are written."""
    return re.sub(re.escape(mutant.token.text), mutant.replacement, word, count=1, flags=re.IGNORECASE).casefold()


def _words(meaning: Mapping[str, str]) -> Counter[str]:
    text = "\n".join((*meaning, *meaning.values())).casefold()
    return Counter(re.findall(r"\w+|[^\w\s]", text))


def _is_near(found: Diagnostic, mutant: Mutant) -> bool:
    spans = [found.place.span]
    spans += [found.place.use] if found.place.use is not None else []
    return any(span.file == mutant.token.file and abs(span.line - mutant.line) <= 1 for span in spans)


def compiled(files: Mapping[str, str]) -> tuple[dict[str, str], tuple[Diagnostic, ...]]:
    """Return the generated code of a project without what only says where things stand, and the findings."""
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        compilation = compile_paths([laid_out(files, root)], root)
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
