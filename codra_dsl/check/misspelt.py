"""Declarations that are misspelt: the root of several unknown names is one name that is declared and never used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from codra_dsl.check.meant import Owner
from codra_dsl.check.mentions import Mention
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import MAX_SUGGESTIONS, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related, replacing, suggest
from codra_dsl.load.misspelt import misspelt_declarations


def blamed(
    scope: Scope, unknown: Iterable[Sequence[Mention]], declared: Iterable[str], used: Iterable[str]
) -> dict[str, str]:
    """Return, for unknown names, the declaration that is misspelt; `unknown` has the mentions of each, `used` all."""
    told = (mentions for mentions, _ in zip(unknown, range(MAX_SUGGESTIONS), strict=False))
    uses = {mentions[0].name: len(_written(mentions)) for mentions in told}
    if not uses:
        return {}
    named, known = frozenset(used), list(declared)
    unused = [name for name in known if name not in named]
    return misspelt_declarations(uses, unused, known, scope.vocabulary, suggest) if unused else {}


def blame(
    scope: Scope,
    owner: Owner,
    declared: str,
    mentions: Sequence[Mention],
    *,
    rule: str,
    noun: str,
    place: Place,
    path: str,
) -> Diagnostic:
    """Return the finding about a misspelt declaration, and let it be read as its uses have it from now on."""
    name = mentions[0].name
    scope.meant_names.declaration(owner, declared, name)
    written = _written(mentions)
    times = f", used {len(written)} times," if len(written) > 1 else f", which {mentions[0].user} names,"
    return finding(
        rule,
        f"{noun} '{declared}' is used nowhere, and '{name}'{times} is not declared",
        place,
        path=path,
        way_out=f"did you mean '{name}'?",
        related=tuple(Related(f"in {mention.user}", mention.place) for mention in written),
        fix=replacing(place, declared, name, safe=False),
    )


def _written(mentions: Iterable[Mention]) -> tuple[Mention, ...]:
    """Return the first mention at each place: what a template says once counts once, however many uses it has."""
    return tuple({mention.place.span: mention for mention in reversed(list(mentions))}.values())[::-1]
