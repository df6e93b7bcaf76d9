"""Findings about misspelt declarations: an unknown name is used, and a similar declared name is never used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from codra_dsl.language.check.index.corrections import Owner
from codra_dsl.language.check.index.mentions import Mention
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAX_SUGGESTIONS, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, replacing, suggest
from codra_dsl.language.load.schema.misspelt_names import misspelt_declarations


def find_misspelt_declarations(
    scope: SpecIndex, unknown: Iterable[Sequence[Mention]], declared: Iterable[str], used: Iterable[str]
) -> dict[str, str]:
    """Return, for unknown names, the misspelt declarations that cause them.

    Args:
        scope: the spec.
        unknown: the mentions of each unknown name.
        declared: all declared names.
        used: all names that are used, unknown or not.
    """
    compared_mentions = (mentions for mentions, _ in zip(unknown, range(MAX_SUGGESTIONS), strict=False))
    uses = {mentions[0].name: len(_first_mentions(mentions)) for mentions in compared_mentions}
    if not uses:
        return {}
    used_names, declared_names = frozenset(used), list(declared)
    unused_names = [name for name in declared_names if name not in used_names]
    return misspelt_declarations(uses, unused_names, declared_names, scope.vocabulary, suggest) if unused_names else {}


def misspelt_finding(
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
    scope.corrections.add_misspelt_declaration(owner, declared, name)
    first_mentions = _first_mentions(mentions)
    uses_text = (
        f", used {len(first_mentions)} times," if len(first_mentions) > 1 else f", which {mentions[0].user} uses,"
    )
    return finding(
        rule,
        f"{noun} '{declared}' is used nowhere, and '{name}'{uses_text} is not declared",
        place,
        path=path,
        help=f"did you mean '{name}'?",
        related=tuple(Related(f"in {mention.user}", mention.place) for mention in first_mentions),
        fix=replacing(place, declared, name, safe=False),
    )


def _first_mentions(mentions: Iterable[Mention]) -> tuple[Mention, ...]:
    """Return the first mention at each place: a mention in a template counts once for all uses of the template."""
    return tuple({mention.place.span: mention for mention in reversed(list(mentions))}.values())[::-1]
