"""Safe fixes: applied in rounds until nothing more can be fixed, and never at the price of a new error.

Texts are values here: `fix_all` neither reads nor writes files. What it calls `lint` says what is found in them.
"""

from __future__ import annotations

import re
from bisect import bisect, insort
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from codra_dsl.language.diagnostics import Diagnostic, Edit, Severity, is_safe
from codra_dsl.workspace.suppression.edits import EditableText, Splice, editable, splices_of

MAX_ROUNDS = 50
"""How often fixes are looked for in what fixes have made."""

MAX_LINTS = 300
"""How often specs are linted in all, before nothing is fixed."""

Texts = Mapping[str, bytes]
"""What files hold, by their names in findings."""

Lint = Callable[[Texts], Sequence[Diagnostic]]
"""Returns the findings about specs with some files changed."""

_INDEX = re.compile(r"\.[0-9]+(?=\.|$)")

_Key = tuple[str, tuple[str, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fixed:
    """What fixing came to.

    Attributes:
        texts: the files that change, with what they hold then.
        applied: the findings that were fixed, in the order in which they were.
        diagnostics: what is found afterwards.
    """

    texts: Texts
    applied: tuple[Diagnostic, ...]
    diagnostics: tuple[Diagnostic, ...]


def fix_all(lint: Lint, texts: Texts) -> Fixed:
    """Return what specs come to by safe fixes.

    All fixes are tried together. Where an error comes of it, the first fix that brings one is left out and the others
    are tried again from the beginning.

    Args:
        lint: is given those of the files that have changed.
        texts: the files that may be changed.
    """
    fixing = _Fixing(lint, texts)
    try:
        return fixing.run()
    except _TooManyError:
        return Fixed(texts={}, applied=(), diagnostics=fixing.before)


class _TooManyError(Exception):
    """Ends the search for fixes that bring no error."""


@dataclass(slots=True)
class _State:
    """Texts as they come to be, what is found in them, and which fixes made them."""

    diagnostics: tuple[Diagnostic, ...]
    texts: dict[str, bytes] = field(default_factory=dict)
    applied: list[Diagnostic] = field(default_factory=list)


class _Fixing:
    """Attributes: `before` has what is found before anything is fixed."""

    def __init__(self, lint: Lint, texts: Texts) -> None:
        self._lint = lint
        self._originals = texts
        self._left = MAX_LINTS
        self.before = self._linted({})

    def run(self) -> Fixed:
        """Return what can be fixed without a new error."""
        refused: set[_Key] = set()
        while True:
            state = self._to_end(lambda key: key not in refused)
            if not self._worse(state):
                changed = {file: data for file, data in state.texts.items() if data != self._originals[file]}
                applied = tuple(state.applied) if changed else ()
                return Fixed(texts=changed, applied=applied, diagnostics=state.diagnostics)
            refused.add(self._culprit(list(dict.fromkeys(map(_key, state.applied))), refused))

    def _linted(self, texts: Texts) -> tuple[Diagnostic, ...]:
        self._left -= 1
        if self._left < 0:
            raise _TooManyError
        return tuple(self._lint(texts))

    def _to_end(self, allowed: Callable[[_Key], bool]) -> _State:
        """Apply what is allowed, round by round, until there is nothing more to fix."""
        state = _State(self.before)
        seen: list[dict[str, bytes]] = []
        while len(seen) < MAX_ROUNDS:
            texts, applied = self._round(state, allowed)
            if not applied or texts in seen:
                break
            seen.append(texts)
            state = _State(self._linted(texts), texts, [*state.applied, *applied])
        return state

    def _round(self, state: _State, allowed: Callable[[_Key], bool]) -> tuple[dict[str, bytes], list[Diagnostic]]:
        """Apply fixes that do not meet; of those that do, the first."""
        texts: dict[str, EditableText] = {}
        taken: dict[str, list[Splice]] = {}
        applied: list[Diagnostic] = []
        wanted = (found for found in state.diagnostics if is_safe(found) and allowed(_key(found)))
        for found in wanted:
            splices = self._splices(found, state, texts)
            if splices is None or any(_meets(one, taken.get(file, ())) for file, one in splices):
                continue
            for file, one in splices:
                insort(taken.setdefault(file, []), one)
            applied.append(found)
        return state.texts | {file: texts[file].after(several) for file, several in taken.items()}, applied

    def _splices(
        self, found: Diagnostic, state: _State, texts: dict[str, EditableText]
    ) -> list[tuple[str, Splice]] | None:
        """Return where a finding's fix changes which file; None where it cannot be applied as a whole."""
        assert found.fix is not None
        edits: dict[str, list[Edit]] = {}
        for edit in found.fix.edits:
            edits.setdefault(edit.span.file, []).append(edit)
        splices: list[tuple[str, Splice]] = []
        for file, several in edits.items():
            text = texts.get(file) or self._editable(file, state)
            made = None if text is None else splices_of(several, text)
            if text is None or made is None:
                return None
            texts[file] = text
            splices += [(file, splice) for splice in made]
        return splices

    def _editable(self, file: str, state: _State) -> EditableText | None:
        data = state.texts.get(file, self._originals.get(file))
        return None if data is None else editable(data)

    def _worse(self, state: _State) -> bool:
        """Return whether there are errors that were not there before."""
        return not _errors(state.diagnostics) <= _errors(self.before)

    def _culprit(self, keys: list[_Key], refused: set[_Key]) -> _Key:
        """Return a fix that brings an error: the last of the shortest beginning of a list of fixes that does."""
        good, bad = 0, len(keys)
        while bad - good > 1:
            middle = (good + bad) // 2
            some = set(keys[:middle]) - refused
            if self._worse(self._to_end(some.__contains__)):
                bad = middle
            else:
                good = middle
        return keys[bad - 1]


def _meets(splice: Splice, taken: Sequence[Splice]) -> bool:
    """Return whether a splice meets one of others, which are sorted and do not meet each other."""
    at = bisect(taken, splice)
    return any(splice.meets(other) for other in taken[max(0, at - 1) : at + 1])


def _key(found: Diagnostic) -> _Key:
    """Return what tells a fix from others, wherever its lines have gone."""
    edits = found.fix.edits if found.fix is not None else ()
    return found.fingerprint, tuple(edit.text for edit in edits)


def _errors(diagnostics: Sequence[Diagnostic]) -> Counter[tuple[str, ...]]:
    """Return the errors among findings, by what they say: lines and the indexes of items may move."""
    return Counter(
        (found.code, found.place.span.file, _INDEX.sub("", found.path), found.message)
        for found in diagnostics
        if found.severity is Severity.ERROR
    )
