"""Misspelt declarations: the cause of several unknown names is one declared name that is never used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from codra_dsl.language.check.index.corrections import Owner
from codra_dsl.language.check.index.mentions import Mention
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAX_SUGGESTIONS, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, replacing, suggest
from codra_dsl.language.load.schema.misspelt import misspelt_declarations


def blamed(
    scope: SpecIndex, unknown: Iterable[Sequence[Mention]], declared: Iterable[str], used: Iterable[str]
) -> dict[str, str]:
    """Return the misspelt declaration for unknown names; `unknown` has the mentions of each, `used` all used names."""
    compared = (mentions for mentions, _ in zip(unknown, range(MAX_SUGGESTIONS), strict=False))
    uses = {mentions[0].name: len(_written(mentions)) for mentions in compared}
    if not uses:
        return {}
    named, known = frozenset(used), list(declared)
    unused = [name for name in known if name not in named]
    return misspelt_declarations(uses, unused, known, scope.vocabulary, suggest) if unused else {}


def blame(
    scope: SpecIndex,
    owner: Owner,
    declared: str,
    mentions: Sequence[Mention],
    *,
    rule: str,
    noun: str,
    place: Place,
    path: str,
) -> Diagnostic:
    """Return the finding about a misspelt declaration, and record its correction."""
    name = mentions[0].name
    scope.corrections.declaration(owner, declared, name)
    written = _written(mentions)
    times = f", used {len(written)} times," if len(written) > 1 else f", which {mentions[0].user} uses,"
    return finding(
        rule,
        f"{noun} '{declared}' is used nowhere, and '{name}'{times} is not declared",
        place,
        path=path,
        help=f"did you mean '{name}'?",
        related=tuple(Related(f"in {mention.user}", mention.place) for mention in written),
        fix=replacing(place, declared, name, safe=False),
    )


def _written(mentions: Iterable[Mention]) -> tuple[Mention, ...]:
    """Return the first mention at each place: a mention in a template counts once, however often it is used."""
    return tuple({mention.place.span: mention for mention in reversed(list(mentions))}.values())[::-1]
