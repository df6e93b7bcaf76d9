"""Findings in the Static Analysis Results Interchange Format (SARIF 2.1.0, an OASIS standard), for code scanning.

What GitHub's code scanning takes of it, and no more than it takes, decides where the standard leaves a choice.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from urllib.parse import quote

from codra_dsl import __version__
from codra_dsl.language.diagnostics import Diagnostic, Edit, Fix, Place, Related, Rule, Severity, Span
from codra_dsl.tooling.report.explain import Page, as_text, family_of, page_of
from codra_dsl.tooling.report.findings import as_json, numbered, related_places, visible

_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_ROOT = "%SRCROOT%"
_CYCLES = "CDR51"
_FINGERPRINT = "codraFinding/v1"

MAX_RESULTS = 25_000
"""How many results a run may have, lest GitHub refuse all of them."""
MAX_RELATED = 100
"""How many related locations of a result GitHub keeps; it refuses a result with more than 1,000."""
MAX_STEPS = 1_000
"""How many locations of a code flow GitHub keeps; it refuses a result with more than 10,000."""
_MAX_LINKS = 5
_MAX_DESCRIPTION = 1024

_NO_FILE_BYTE = re.compile("[\ud800-\udc7f\udd00-\udfff]")
_NO_WORD = re.compile(r"\W+")
_LINK_LETTERS = re.compile(r"([\\\[\]])")

_Object = dict[str, object]


def render_sarif(diagnostics: Iterable[Diagnostic], folder: str = "") -> str:
    """Return findings as one run of SARIF.

    Args:
        diagnostics: in file order; of two with one fingerprint, the order tells them apart.
        folder: of the files' root within the repository, with `/`.
    """
    all_found = tuple(diagnostics)
    kept = _most_severe(all_found)
    rules = {found.code: found.rule for found in sorted(kept, key=lambda found: found.code)}
    numbers = {code: number for number, code in enumerate(rules)}
    places = _Places(folder)
    results = [_result(found, numbers[found.code], occurrence, places) for found, occurrence in numbered(kept)]
    driver = {"name": "codra", "version": __version__, "rules": [_rule(rule) for rule in rules.values()]}
    run = {
        "tool": {"driver": driver},
        "invocations": [_invocation(len(all_found) - len(kept))],
        "originalUriBaseIds": {_ROOT: {"description": {"text": "The folder that all paths are relative to."}}},
        "columnKind": "unicodeCodePoints",
        "results": results,
    }
    return as_json({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2) + "\n"


def _most_severe(diagnostics: tuple[Diagnostic, ...]) -> tuple[Diagnostic, ...]:
    """Return as many findings as GitHub takes; errors stay before warnings do."""
    if len(diagnostics) <= MAX_RESULTS:
        return diagnostics
    return tuple(sorted(diagnostics, key=lambda found: found.severity is not Severity.ERROR)[:MAX_RESULTS])


def _invocation(left_out: int) -> _Object:
    if not left_out:
        return {"executionSuccessful": True}
    told = f"{left_out} findings more than the {MAX_RESULTS} that code scanning takes are left out."
    notification = {"level": "warning", "message": {"text": told}}
    return {"executionSuccessful": True, "toolExecutionNotifications": [notification]}


# ---------------------------------------------------------------------------------------------------- rules


def _rule(rule: Rule) -> _Object:
    page = _page(rule.code)
    summary = rule.name.replace("-", " ").capitalize() if page is None else page.summary.replace("`", "")
    described = {"text": _sentence(summary)[:_MAX_DESCRIPTION]}
    optional: _Object = {} if page is None else {"properties": {"tags": [_tag(rule.code)]}}
    return {
        "id": rule.code,
        "name": rule.name,
        "shortDescription": described,
        "fullDescription": described,
        "defaultConfiguration": {"level": rule.severity.value},
        "help": described if page is None else {"text": as_text(page), "markdown": page.markdown},
        **optional,
    }


def _page(code: str) -> Page | None:
    """Return what there is to say about a rule; an installation without pages still has findings."""
    try:
        return page_of(code)
    except OSError:
        return None


def _tag(code: str) -> str:
    return _NO_WORD.sub("-", family_of(code).lower())


# ---------------------------------------------------------------------------------------------------- results


def _result(found: Diagnostic, rule_index: int, occurrence: int, places: _Places) -> _Object:
    related = related_places(found)[:MAX_RELATED]
    flows = _flows(found, places)
    location: _Object = {"physicalLocation": places.at(found.place.span)}
    if found.path:
        location["logicalLocations"] = [{"fullyQualifiedName": visible(found.path)}]
    optional = {
        "relatedLocations": [places.noted(each, number) for number, each in enumerate(related, start=1)],
        "codeFlows": flows,
        "fixes": [_fix(found.fix, places)] if found.fix is not None else [],
    }
    return {
        "ruleId": found.code,
        "ruleIndex": rule_index,
        "level": found.severity.value,
        "message": {"text": _message(found, () if flows else related[:_MAX_LINKS])},
        "locations": [location],
        **{key: value for key, value in optional.items() if value},
        "partialFingerprints": {_FINGERPRINT: f"{found.fingerprint}:{occurrence}"},
    }


def _message(found: Diagnostic, linked: Sequence[Related]) -> str:
    """Return what is wrong, the way out, and links to other places: GitHub shows those that are linked."""
    sentences = [_sentence(found.message)]
    sentences += [_sentence(f"Help: {found.help}")] if found.help else []
    if linked:
        links = (f"[{_linked(each.message)}]({number})" for number, each in enumerate(linked, start=1))
        sentences.append(f"See: {', '.join(links)}.")
    return " ".join(sentences)


def _sentence(text: str) -> str:
    """Return text of which nothing is taken for a link, with an end: where space is short one sentence is shown."""
    shown = visible(text).replace("](", "] (")
    return shown if shown.endswith((".", "!", "?")) else f"{shown}."


def _linked(text: str) -> str:
    return _LINK_LETTERS.sub(r"\\\1", visible(text))


def _flows(found: Diagnostic, places: _Places) -> list[_Object]:
    """Return the path around a cycle, edge by edge."""
    if not found.code.startswith(_CYCLES):
        return []
    here = found.place
    edges = [each for each in found.related if each.place == here or each.place.span != here.span]
    steps = [{"location": places.noted(each)} for each in edges[:MAX_STEPS]]
    return [{"threadFlows": [{"locations": steps}]}] if steps else []


def _fix(fix: Fix, places: _Places) -> _Object:
    by_file = groupby(sorted(fix.edits, key=lambda edit: edit.span), key=lambda edit: edit.span.file)
    changes = [
        {"artifactLocation": places.artifact(file), "replacements": [_replacement(edit) for edit in edits]}
        for file, edits in by_file
    ]
    return {"description": {"text": _sentence(fix.message)}, "artifactChanges": changes}


def _replacement(edit: Edit) -> _Object:
    return {"deletedRegion": _region(edit.span), "insertedContent": {"text": edit.text}}


class _Places:
    """Locations of files whose root is a folder of the repository."""

    def __init__(self, folder: str) -> None:
        self._prefix = f"{folder}/" if folder else ""
        self._artifacts: dict[str, Mapping[str, str]] = {}

    def at(self, span: Span) -> _Object:
        return {"artifactLocation": self.artifact(span.file), "region": _region(span)}

    def noted(self, related: Related, number: int | None = None) -> _Object:
        """Return a location with what is to be seen there, and a number for links to it."""
        identity: _Object = {} if number is None else {"id": number}
        place: Place = related.place
        return identity | {"physicalLocation": self.at(place.span), "message": {"text": _sentence(related.message)}}

    def artifact(self, file: str) -> Mapping[str, str]:
        if file not in self._artifacts:
            self._artifacts[file] = {"uri": _uri(self._prefix + file), "uriBaseId": _ROOT}
        return self._artifacts[file]


def _uri(path: str) -> str:
    """Return a relative reference; bytes of a file name that are no text stay what they are."""
    return quote(_NO_FILE_BYTE.sub("\N{REPLACEMENT CHARACTER}", path), safe="/", errors="surrogateescape")


def _region(span: Span) -> _Object:
    return {
        "startLine": span.line,
        "startColumn": span.column,
        "endLine": span.end_line,
        "endColumn": span.end_column,
    }
