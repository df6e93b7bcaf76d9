"""Apply safe fixes in rounds until nothing more can be fixed. A fix that causes a new error is left out.

Texts are values here: `fix_all` neither reads nor writes files. Its argument `lint` returns the findings about
the texts.
"""

from __future__ import annotations

import re
from bisect import bisect, insort
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field

from codra_dsl.language.diagnostics import Diagnostic, Edit, Severity, is_safe
from codra_dsl.language.frozen import dataclass
from codra_dsl.workspace.suppression.edits import EditableText, Splice, editable_text, splices_of

MAX_ROUNDS = 50
"""The maximum number of rounds; each round applies fixes to the texts of the round before."""

MAX_LINTS = 300
"""The maximum number of times that specs are linted; if more are necessary, nothing is fixed."""

Texts = Mapping[str, bytes]
"""The contents of files, by their names in findings."""

Lint = Callable[[Texts], Sequence[Diagnostic]]
"""A function that returns the findings about specs in which some files have changed."""

_INDEX = re.compile(r"\.[0-9]+(?=\.|$)")

_FixKey = tuple[str, tuple[str, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class FixResult:
    """The result of fixing.

    Attributes:
        texts: the files that change, with their new contents.
        fixed_findings: the findings that were fixed, in the order of fixing.
        diagnostics: the findings after fixing.
    """

    texts: Texts
    fixed_findings: tuple[Diagnostic, ...]
    diagnostics: tuple[Diagnostic, ...]


def fix_all(lint: Lint, texts: Texts) -> FixResult:
    """Return the result of applying the safe fixes of specs.

    All fixes are tried together. If this causes an error, the first fix that causes an error is left out, and the other
    fixes are tried again from the beginning.

    Args:
        lint: returns the findings about specs; its argument has only the files that have changed.
        texts: the files that may be changed.
    """
    fixing = _Fixing(lint, texts)
    try:
        return fixing.run()
    except _TooManyLintsError:
        return FixResult(texts={}, fixed_findings=(), diagnostics=fixing.initial_diagnostics)


class _TooManyLintsError(Exception):
    """The limit of lints is reached; this ends the search for fixes that cause no error."""


@dataclass(slots=True)
class _State:
    """Texts after some fixes, the findings about them, and the fixes that were applied."""

    diagnostics: tuple[Diagnostic, ...]
    texts: dict[str, bytes] = field(default_factory=dict)
    fixed_findings: list[Diagnostic] = field(default_factory=list)


class _Fixing:
    """Searches for fixes that cause no error.

    Attributes:
        initial_diagnostics: the findings before anything is fixed.
    """

    def __init__(self, lint: Lint, texts: Texts) -> None:
        self._lint = lint
        self._original_texts = texts
        self._remaining_lint_count = MAX_LINTS
        self.initial_diagnostics = self._lint_texts({})

    def run(self) -> FixResult:
        """Return the result of all fixes that cause no new error."""
        refused_keys: set[_FixKey] = set()
        while True:
            state = self._fix_until_stable(lambda key: key not in refused_keys)
            if not self._has_new_errors(state):
                changed_texts = {file: data for file, data in state.texts.items() if data != self._original_texts[file]}
                fixed_findings = tuple(state.fixed_findings) if changed_texts else ()
                return FixResult(texts=changed_texts, fixed_findings=fixed_findings, diagnostics=state.diagnostics)
            refused_keys.add(self._find_culprit(list(dict.fromkeys(map(_fix_key, state.fixed_findings))), refused_keys))

    def _lint_texts(self, texts: Texts) -> tuple[Diagnostic, ...]:
        self._remaining_lint_count -= 1
        if self._remaining_lint_count < 0:
            raise _TooManyLintsError
        return tuple(self._lint(texts))

    def _fix_until_stable(self, is_allowed: Callable[[_FixKey], bool]) -> _State:
        """Apply the allowed fixes, round by round, until there is nothing more to fix."""
        state = _State(self.initial_diagnostics)
        earlier_texts: list[dict[str, bytes]] = []
        while len(earlier_texts) < MAX_ROUNDS:
            texts, fixed_findings = self._fix_once(state, is_allowed)
            if not fixed_findings or texts in earlier_texts:
                break
            earlier_texts.append(texts)
            state = _State(self._lint_texts(texts), texts, [*state.fixed_findings, *fixed_findings])
        return state

    def _fix_once(
        self, state: _State, is_allowed: Callable[[_FixKey], bool]
    ) -> tuple[dict[str, bytes], list[Diagnostic]]:
        """Return the texts after one round, and the fixed findings. Of overlapping fixes, only the first is applied."""
        texts: dict[str, EditableText] = {}
        accepted_splices: dict[str, list[Splice]] = {}
        fixed_findings: list[Diagnostic] = []
        fixable_diagnostics = (
            diagnostic for diagnostic in state.diagnostics if is_safe(diagnostic) and is_allowed(_fix_key(diagnostic))
        )
        for diagnostic in fixable_diagnostics:
            splices = self._splices_of_fix(diagnostic, state, texts)
            if splices is None or any(
                _has_conflict(splice, accepted_splices.get(file, ())) for file, splice in splices
            ):
                continue
            for file, splice in splices:
                insort(accepted_splices.setdefault(file, []), splice)
            fixed_findings.append(diagnostic)
        return state.texts | {
            file: texts[file].apply(splices) for file, splices in accepted_splices.items()
        }, fixed_findings

    def _splices_of_fix(
        self, diagnostic: Diagnostic, state: _State, texts: dict[str, EditableText]
    ) -> list[tuple[str, Splice]] | None:
        """Return the ranges that a finding's fix changes in each file; None if it cannot be applied completely."""
        assert diagnostic.fix is not None
        edits: dict[str, list[Edit]] = {}
        for edit in diagnostic.fix.edits:
            edits.setdefault(edit.span.file, []).append(edit)
        splices: list[tuple[str, Splice]] = []
        for file, file_edits in edits.items():
            text = texts.get(file) or self._editable_text(file, state)
            file_splices = None if text is None else splices_of(file_edits, text)
            if text is None or file_splices is None:
                return None
            texts[file] = text
            splices += [(file, splice) for splice in file_splices]
        return splices

    def _editable_text(self, file: str, state: _State) -> EditableText | None:
        data = state.texts.get(file, self._original_texts.get(file))
        return None if data is None else editable_text(data)

    def _has_new_errors(self, state: _State) -> bool:
        """Return whether there are errors that did not exist before fixing."""
        return not _error_counts(state.diagnostics) <= _error_counts(self.initial_diagnostics)

    def _find_culprit(self, keys: list[_FixKey], refused_keys: set[_FixKey]) -> _FixKey:
        """Return a fix that causes an error: the last fix in the shortest prefix of the list that causes an error."""
        good_count, bad_count = 0, len(keys)
        while bad_count - good_count > 1:
            middle_count = (good_count + bad_count) // 2
            prefix_keys = set(keys[:middle_count]) - refused_keys
            if self._has_new_errors(self._fix_until_stable(prefix_keys.__contains__)):
                bad_count = middle_count
            else:
                good_count = middle_count
        return keys[bad_count - 1]


def _has_conflict(splice: Splice, accepted_splices: Sequence[Splice]) -> bool:
    """Return whether a splice overlaps one of the accepted splices, which are sorted and do not overlap each other."""
    position = bisect(accepted_splices, splice)
    return any(splice.conflicts_with(other) for other in accepted_splices[max(0, position - 1) : position + 1])


def _fix_key(diagnostic: Diagnostic) -> _FixKey:
    """Return a key for the fix of a finding. The key does not depend on line numbers."""
    edits = diagnostic.fix.edits if diagnostic.fix is not None else ()
    return diagnostic.fingerprint, tuple(edit.text for edit in edits)


def _error_counts(diagnostics: Sequence[Diagnostic]) -> Counter[tuple[str, ...]]:
    """Count equal errors. Lines and indexes of items are not compared, because fixes can change them."""
    return Counter(
        (diagnostic.code, diagnostic.place.span.file, _INDEX.sub("", diagnostic.path), diagnostic.message)
        for diagnostic in diagnostics
        if diagnostic.severity is Severity.ERROR
    )
