"""Findings as a project wants to hear them: without what comments silence and settings leave out, each at its level."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from codra_dsl.diagnostics import Diagnostic, Severity, in_file_order
from codra_dsl.triage.settings import Settings
from codra_dsl.triage.suppressions import Sources, Suppressions


def triaged(diagnostics: Iterable[Diagnostic], settings: Settings, sources: Sources) -> tuple[Diagnostic, ...]:
    """Return findings in file order, with those about suppression comments.

    Comments come first: whether one is of use depends on no setting. While any error is left, later checks may not
    have been made, and no comment is called unused.
    """
    comments = Suppressions(sources)
    left = [each for found in diagnostics for each in comments.left(found)]
    complete = not any(each.rule.severity is Severity.ERROR for each in left)
    all_found = (*left, *comments.findings(complete=complete))
    return in_file_order(_leveled(found, settings) for found in all_found if settings.wants(found.rule))


def _leveled(found: Diagnostic, settings: Settings) -> Diagnostic:
    level = settings.level(found.rule)
    return found if level is found.rule.severity else replace(found, level=level)
