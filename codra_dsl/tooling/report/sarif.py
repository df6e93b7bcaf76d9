"""Findings in the Static Analysis Results Interchange Format (SARIF 2.1.0, an OASIS standard), for code scanning.

Where the standard leaves a choice, the output has the form that GitHub's code scanning accepts, and obeys its limits.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from urllib.parse import quote

import codra_dsl
from codra_dsl.language.diagnostics import Diagnostic, Edit, Fix, Place, Related, Rule, Severity, Span
from codra_dsl.tooling.report.explain import Page, as_text, family_of, page_of
from codra_dsl.tooling.report.findings import as_json, number_findings, related_places, shown_findings, visible_text

_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_ROOT_BASE_ID = "%SRCROOT%"
_CYCLE_CODE_PREFIX = "CDR51"
_FINGERPRINT_KEY = "codraFinding/v1"

MAX_RESULTS = 25_000
"""The maximum number of results in a run. GitHub rejects a run with more results."""
MAX_RELATED_LOCATIONS = 100
"""The number of related locations of a result that GitHub keeps. GitHub rejects a result with more than 1,000."""
MAX_FLOW_STEPS = 1_000
"""The number of locations of a code flow that GitHub keeps. GitHub rejects a result with more than 10,000."""
_MAX_LINKS = 5
_MAX_DESCRIPTION = 1024

_INVALID_SURROGATE = re.compile("[\ud800-\udc7f\udd00-\udfff]")
_NON_WORD = re.compile(r"\W+")
_LINK_LETTERS = re.compile(r"([\\\[\]])")

_Object = dict[str, object]


def render_sarif(diagnostics: Iterable[Diagnostic], folder: str = "") -> str:
    """Return findings as one run of SARIF.

    Args:
        diagnostics: the findings, in file order. The order distinguishes findings with equal fingerprints.
        folder: the path of the files' root within the repository, with `/`.
    """
    findings = shown_findings(diagnostics)
    kept_findings = _most_severe_findings(findings)
    rules = {
        diagnostic.code: diagnostic.rule for diagnostic in sorted(kept_findings, key=lambda diagnostic: diagnostic.code)
    }
    index_by_code = {code: number for number, code in enumerate(rules)}
    places = _Places(folder)
    results = [
        _result_object(diagnostic, index_by_code[diagnostic.code], occurrence, places)
        for diagnostic, occurrence in number_findings(kept_findings)
    ]
    driver = {
        "name": "codra",
        "version": codra_dsl.__version__,
        "rules": [_rule_object(rule) for rule in rules.values()],
    }
    run = {
        "tool": {"driver": driver},
        "invocations": [_invocation(len(findings) - len(kept_findings))],
        "originalUriBaseIds": {_ROOT_BASE_ID: {"description": {"text": "The folder to which all paths are relative."}}},
        "columnKind": "unicodeCodePoints",
        "results": results,
    }
    return as_json({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2) + "\n"


def _most_severe_findings(diagnostics: tuple[Diagnostic, ...]) -> tuple[Diagnostic, ...]:
    """Return all findings, or, if GitHub does not accept so many, as many as possible, errors before warnings."""
    if len(diagnostics) <= MAX_RESULTS:
        return diagnostics
    return tuple(sorted(diagnostics, key=lambda diagnostic: diagnostic.severity is not Severity.ERROR)[:MAX_RESULTS])


def _invocation(omitted_count: int) -> _Object:
    if not omitted_count:
        return {"executionSuccessful": True}
    message_text = f"{omitted_count} findings are left out, because code scanning accepts at most {MAX_RESULTS}."
    notification = {"level": "warning", "message": {"text": message_text}}
    return {"executionSuccessful": True, "toolExecutionNotifications": [notification]}


# ---------------------------------------------------------------------------------------------------- rules


def _rule_object(rule: Rule) -> _Object:
    page = _find_page(rule.code)
    summary = rule.name.replace("-", " ").capitalize() if page is None else page.summary.replace("`", "")
    description = {"text": _sentence(summary)[:_MAX_DESCRIPTION]}
    optional_properties: _Object = {} if page is None else {"properties": {"tags": [_family_tag(rule.code)]}}
    return {
        "id": rule.code,
        "name": rule.name,
        "shortDescription": description,
        "fullDescription": description,
        "defaultConfiguration": {"level": rule.severity.value},
        "help": description if page is None else {"text": as_text(page), "markdown": page.markdown},
        **optional_properties,
    }


def _find_page(code: str) -> Page | None:
    """Return the page of a rule, or None in an installation without pages."""
    try:
        return page_of(code)
    except OSError:
        return None


def _family_tag(code: str) -> str:
    return _NON_WORD.sub("-", family_of(code).lower())


# ---------------------------------------------------------------------------------------------------- results


def _result_object(diagnostic: Diagnostic, rule_index: int, occurrence: int, places: _Places) -> _Object:
    related = related_places(diagnostic)[:MAX_RELATED_LOCATIONS]
    flows = _code_flows(diagnostic, places)
    location: _Object = {"physicalLocation": places.physical_location(diagnostic.place.span)}
    if diagnostic.path:
        location["logicalLocations"] = [{"fullyQualifiedName": visible_text(diagnostic.path)}]
    optional_properties = {
        "relatedLocations": [
            places.location_with_message(related_place, number) for number, related_place in enumerate(related, start=1)
        ],
        "codeFlows": flows,
        "fixes": [_fix_object(diagnostic.fix, places)] if diagnostic.fix is not None else [],
    }
    return {
        "ruleId": diagnostic.code,
        "ruleIndex": rule_index,
        "level": diagnostic.severity.value,
        "message": {"text": _message(diagnostic, () if flows else related[:_MAX_LINKS])},
        "locations": [location],
        **{key: value for key, value in optional_properties.items() if value},
        "partialFingerprints": {_FINGERPRINT_KEY: f"{diagnostic.fingerprint}:{occurrence}"},
    }


def _message(diagnostic: Diagnostic, linked_places: Sequence[Related]) -> str:
    """Return the problem, the help, and links to other places, which GitHub shows."""
    sentences = [_sentence(diagnostic.message)]
    sentences += [_sentence(f"Help: {diagnostic.help}")] if diagnostic.help else []
    if linked_places:
        links = (f"[{_link_text(related.message)}]({number})" for number, related in enumerate(linked_places, start=1))
        sentences.append(f"See: {', '.join(links)}.")
    return " ".join(sentences)


def _sentence(text: str) -> str:
    """Return text as a sentence without links. GitHub shows only the first sentence where space is short."""
    sentence = visible_text(text).replace("](", "] (")
    return sentence if sentence.endswith((".", "!", "?")) else f"{sentence}."


def _link_text(text: str) -> str:
    return _LINK_LETTERS.sub(r"\\\1", visible_text(text))


def _code_flows(diagnostic: Diagnostic, places: _Places) -> list[_Object]:
    """Return the path around a cycle, edge by edge."""
    if not diagnostic.code.startswith(_CYCLE_CODE_PREFIX):
        return []
    main_place = diagnostic.place
    related_edges = [
        related
        for related in diagnostic.related
        if related.place == main_place or related.place.span != main_place.span
    ]
    steps = [
        {"location": places.location_with_message(related_edge)} for related_edge in related_edges[:MAX_FLOW_STEPS]
    ]
    return [{"threadFlows": [{"locations": steps}]}] if steps else []


def _fix_object(fix: Fix, places: _Places) -> _Object:
    file_edit_groups = groupby(sorted(fix.edits, key=lambda edit: edit.span), key=lambda edit: edit.span.file)
    changes = [
        {"artifactLocation": places.artifact_location(file), "replacements": [_replacement(edit) for edit in edits]}
        for file, edits in file_edit_groups
    ]
    return {"description": {"text": _sentence(fix.message)}, "artifactChanges": changes}


def _replacement(edit: Edit) -> _Object:
    return {"deletedRegion": _region(edit.span), "insertedContent": {"text": edit.text}}


class _Places:
    """Locations of files whose root is a folder of the repository."""

    def __init__(self, folder: str) -> None:
        self._prefix = f"{folder}/" if folder else ""
        self._artifacts: dict[str, Mapping[str, str]] = {}

    def physical_location(self, span: Span) -> _Object:
        return {"artifactLocation": self.artifact_location(span.file), "region": _region(span)}

    def location_with_message(self, related: Related, number: int | None = None) -> _Object:
        """Return a location with a message about it, and a number for links to it."""
        identity: _Object = {} if number is None else {"id": number}
        place: Place = related.place
        return identity | {
            "physicalLocation": self.physical_location(place.span),
            "message": {"text": _sentence(related.message)},
        }

    def artifact_location(self, file: str) -> Mapping[str, str]:
        if file not in self._artifacts:
            self._artifacts[file] = {"uri": _uri(self._prefix + file), "uriBaseId": _ROOT_BASE_ID}
        return self._artifacts[file]


def _uri(path: str) -> str:
    """Return a path as a relative reference. Bytes of a file name that are not valid text are kept."""
    return quote(_INVALID_SURROGATE.sub("\N{REPLACEMENT CHARACTER}", path), safe="/", errors="surrogateescape")


def _region(span: Span) -> _Object:
    return {
        "startLine": span.line,
        "startColumn": span.column,
        "endLine": span.end_line,
        "endColumn": span.end_column,
    }
