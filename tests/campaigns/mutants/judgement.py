"""Judge the compiler's findings about a mutant."""

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
from codra_dsl.language.diagnostics import Diagnostic, has_errors
from tests.campaigns.mutants.functions import perception_of
from tests.campaigns.mutants.mutation import Mutant, Slip, laid_out

SUGGESTION = re.compile(r"did you mean (?P<quote>['\"])(?P<name>.*?)(?P=quote)")
QUOTED = re.compile(r"'([^']*)'|\"([^\"]*)\"")
FREE_TEXT_LINE = re.compile(r"^\s*(?:-\s*)?\{?.*\b(?:label|description|title)\b")
DECLARED = re.compile(r"(?!call:|with:)[\w$()]+:|name: ")
IGNORED_FILES = {"sources.json", "manifest.json"}


class Fate(StrEnum):
    """The outcome for a mutant."""

    NEAR = "reported within one line"
    FAR = "reported elsewhere"
    HARMLESS = "harmless: the meaning is the same"
    PROSE = "harmless: only text for people has changed"
    NAME = "harmless: only a free name has changed"
    MISSED = "missed: another valid spec"


@dataclass(frozen=True)
class Verdict:
    """A mutant and the compiler's new findings."""

    mutant: Mutant
    fate: Fate
    findings: tuple[Diagnostic, ...]

    @property
    def suggestion(self) -> tuple[str, bool] | None:
        """Return the first suggestion for a misspelt name, and whether it is correct.

        It is correct if it is the original token, or a name in the message with the original token restored. If a
        declaration is misspelt, its uses are reported: then the suggestion is correct if it is the misspelt name.
        """
        findings_and_matches = ((finding, SUGGESTION.search(finding.help)) for finding in self.findings)
        first = next(((finding, match["name"]) for finding, match in findings_and_matches if match is not None), None)
        if first is None or self.mutant.slip is not Slip.RENAME:
            return None
        finding, name = first
        token, typo = self.mutant.token.text, self.mutant.replacement
        named = {text for pair in QUOTED.findall(finding.message) for text in pair}
        restored = {text.replace(typo, token) for text in named if typo in text}
        is_misspelt_declaration = DECLARED.match(self.mutant.context) is not None and token in named
        return name, name == token or name in restored or (is_misspelt_declaration and name == typo)


@dataclass(frozen=True)
class Original:
    """A valid project: its meaning, and the findings about it before any change."""

    modules: Mapping[str, str]
    meaning: Mapping[str, str]
    known: frozenset[tuple[str, str]]
    is_valid: bool


def original(files: Mapping[str, str]) -> Original:
    """Return a project before any change, with the perception functions that it calls."""
    modules = perception_of(files)
    meaning, findings = compiled({**files, **modules})
    known = frozenset((finding.code, finding.message) for one in findings for finding in (one, *one.use_findings))
    return Original(modules, meaning, known, is_valid=not has_errors(findings))


def judge(before: Original, mutant: Mutant) -> Verdict:
    """Compile a mutant and return the verdict."""
    meaning, findings = compiled({**mutant.files, **before.modules})
    new = tuple(finding for finding in findings if not _is_known(finding, before, mutant))
    return Verdict(mutant, _fate(before, mutant, meaning, new), new)


def _is_known(finding: Diagnostic, before: Original, mutant: Mutant) -> bool:
    """Return whether a finding existed before, possibly with the unchanged name of its element."""
    token, other = mutant.token.text, mutant.replacement
    return any(
        code == finding.code and finding.message in (message, message.replace(token, other))
        for code, message in before.known
    )


def _fate(before: Original, mutant: Mutant, meaning: Mapping[str, str], new: tuple[Diagnostic, ...]) -> Fate:
    if any(_is_near(finding, mutant) for finding in new):
        return Fate.NEAR
    if new:
        return Fate.FAR
    if meaning == before.meaning:
        return Fate.HARMLESS
    if FREE_TEXT_LINE.match(mutant.context):
        return Fate.PROSE
    return Fate.NAME if _only_names(before.meaning, meaning, mutant) else Fate.MISSED


def _only_names(before: Mapping[str, str], after: Mapping[str, str], mutant: Mutant) -> bool:
    """Return whether the code differs only in a name that the spec itself defines: no call, no argument."""
    if not mutant.is_first or not DECLARED.match(mutant.context):
        return False
    old, new = _words(before), _words(after)
    renamed = {word: _renamed(word, mutant) for word in (old - new)}
    gone = Counter({renamed[word]: count for word, count in (old - new).items()})
    return all(word != renamed[word] for word in renamed) and gone == new - old


def _renamed(word: str, mutant: Mutant) -> str:
    """Return a word with the changed token, in lower case."""
    return re.sub(re.escape(mutant.token.text), mutant.replacement, word, count=1, flags=re.IGNORECASE).casefold()


def _words(meaning: Mapping[str, str]) -> Counter[str]:
    text = "\n".join((*meaning, *meaning.values())).casefold()
    return Counter(re.findall(r"\w+|[^\w\s]", text))


def _is_near(finding: Diagnostic, mutant: Mutant) -> bool:
    spans = [finding.place.span]
    spans += [finding.place.use] if finding.place.use is not None else []
    return any(span.file == mutant.token.file and abs(span.line - mutant.line) <= 1 for span in spans)


def compiled(files: Mapping[str, str]) -> tuple[dict[str, str], tuple[Diagnostic, ...]]:
    """Return the generated code of a project without files about sources, and the findings."""
    with tempfile.TemporaryDirectory() as name:
        root = Path(name)
        compilation = compile_paths([laid_out(files, root)], root)
        code = {path: text for path, text in compilation.files.items() if Path(path).name not in IGNORED_FILES}
        return code, compilation.planned.diagnostics


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
                f"{finding.place.span.file}:{finding.place.span.line} {finding.code} {finding.message} ({finding.help})"
                for finding in verdict.findings
            ],
        }
    )
