"""The rules of findings about behaviour trees. Codes are never reused."""

from __future__ import annotations

from collections.abc import Iterable

from codra_dsl.language.diagnostics import Diagnostic, Place, Related, Severity, rules, suggest

_ERROR, _WARNING = Severity.ERROR, Severity.WARNING

RULES = rules(
    # Limits
    ("CDR0301", "tree-file-too-large", _ERROR),
    ("CDR0302", "tree-too-deep", _ERROR),
    ("CDR0303", "too-many-tree-nodes", _ERROR),
    # XML
    ("CDR1301", "xml-syntax", _ERROR),
    ("CDR1302", "xml-doctype", _ERROR),
    ("CDR1303", "xml-encoding", _ERROR),
    ("CDR1304", "xml-not-kept", _WARNING),
    ("CDR1305", "xml-not-escaped", _WARNING),
    # Shape
    ("CDR2301", "no-tree-file", _ERROR),
    ("CDR2302", "misplaced-element", _ERROR),
    ("CDR2303", "wrong-children", _ERROR),
    ("CDR2304", "missing-attribute", _ERROR),
    ("CDR2305", "port-value", _ERROR),
    ("CDR2306", "library-refuses-name", _WARNING),
    ("CDR2307", "library-refuses-children", _WARNING),
    ("CDR2308", "tree-format", _WARNING),
    ("CDR2309", "tree-without-id", _WARNING),
    # Names
    ("CDR3301", "unknown-tree-node", _ERROR),
    ("CDR3302", "unsupported-tree-node", _ERROR),
    ("CDR3303", "unknown-port", _ERROR),
    ("CDR3304", "missing-port", _ERROR),
    ("CDR3305", "unknown-subtree", _ERROR),
    ("CDR3306", "duplicate-tree", _ERROR),
    ("CDR3307", "unused-remap", _WARNING),
    ("CDR3308", "tree-include", _ERROR),
    ("CDR3309", "attribute-without-effect", _WARNING),
    ("CDR3310", "undeclared-tree-node", _WARNING),
    ("CDR3311", "port-without-value", _WARNING),
    ("CDR3312", "undeclared-port", _WARNING),
    # Scripts and entries
    ("CDR4301", "script-syntax", _ERROR),
    ("CDR4302", "script-unsupported", _ERROR),
    ("CDR4303", "entry-types-differ", _ERROR),
    # Graph
    ("CDR5301", "subtree-recursion", _ERROR),
)

MAX_SUGGESTIONS = 200
"""The maximum number of searches for similar names. Each search costs time, and a hostile file could cause many."""


class TreeFindings:
    """An append-only list of findings, with a limit on the number of suggestions."""

    def __init__(self) -> None:
        self._findings: list[Diagnostic] = []
        self._suggestions_left = MAX_SUGGESTIONS

    def add(
        self, rule: str, message: str, place: Place, *, help: str, path: str = "", related: Iterable[Related] = ()
    ) -> None:
        """Report one finding of a rule of `RULES`."""
        finding = Diagnostic(
            rule=RULES[rule], message=message, place=place, path=path, help=help, related=tuple(related)
        )
        self._findings.append(finding)

    def extend(self, findings: Iterable[Diagnostic]) -> None:
        """Append findings."""
        self._findings.extend(findings)

    def all(self) -> tuple[Diagnostic, ...]:
        """Return the findings in the order in which they were added."""
        return tuple(self._findings)

    def name_help(self, name: str, candidates: Iterable[str], fallback: str) -> str:
        """Return the help for an unknown name: the name that it most likely means, or `fallback`."""
        suggestion = self.suggestion(name, candidates)
        return f"did you mean '{suggestion}'?" if suggestion else fallback

    def suggestion(self, name: str, candidates: Iterable[str]) -> str | None:
        """Return the name that an unknown name most likely means; None if there is none, or after many searches."""
        if not self._suggestions_left:
            return None
        self._suggestions_left -= 1
        return suggest(name, candidates)
