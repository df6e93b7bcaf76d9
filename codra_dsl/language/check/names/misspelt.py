"""Findings about misspelt declarations: an unknown name is used, and a similar declared name is never used."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from codra_dsl.language.check.index.corrections import Owner
from codra_dsl.language.check.index.mentions import Mention
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAX_SUGGESTIONS, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, replacement_fix, suggest
from codra_dsl.language.load.schema.misspelt_names import misspelt_declarations


def find_misspelt_declarations(
    spec_index: SpecIndex,
    unknown_mentions: Iterable[Sequence[Mention]],
    declared_names: Iterable[str],
    used_names: Iterable[str],
) -> dict[str, str]:
    """Return a mapping from unknown names to the misspelt declared names that should be these names.

    Args:
        spec_index: the spec.
        unknown_mentions: the mentions of each unknown name.
        declared_names: all declared names.
        used_names: all names that are used, including unknown names.
    """
    compared_mentions = (mentions for mentions, _ in zip(unknown_mentions, range(MAX_SUGGESTIONS), strict=False))
    use_counts = {mentions[0].name: len(_first_mentions(mentions)) for mentions in compared_mentions}
    if not use_counts:
        return {}
    used_name_set, declarations = frozenset(used_names), list(declared_names)
    unused_names = [name for name in declarations if name not in used_name_set]
    return (
        misspelt_declarations(use_counts, unused_names, declarations, spec_index.vocabulary, suggest)
        if unused_names
        else {}
    )


def misspelt_finding(
    spec_index: SpecIndex,
    owner: Owner,
    declared_name: str,
    mentions: Sequence[Mention],
    *,
    rule: str,
    noun: str,
    place: Place,
    path: str,
) -> Diagnostic:
    """Return the finding about a misspelt declaration, and record its correction."""
    intended_name = mentions[0].name
    spec_index.corrections.add_misspelt_declaration(owner, declared_name, intended_name)
    first_mentions = _first_mentions(mentions)
    uses_text = (
        f", used {len(first_mentions)} times," if len(first_mentions) > 1 else f", which {mentions[0].user} uses,"
    )
    return finding(
        rule,
        f"{noun} '{declared_name}' is used nowhere, and '{intended_name}'{uses_text} is not declared",
        place,
        path=path,
        help=f"did you mean '{intended_name}'?",
        related=tuple(Related(f"in {mention.user}", mention.place) for mention in first_mentions),
        fix=replacement_fix(place, declared_name, intended_name, safe=False),
    )


def _first_mentions(mentions: Iterable[Mention]) -> tuple[Mention, ...]:
    """Return the first mention at each place: a mention in a template counts once for all uses of the template."""
    return tuple({mention.place.span: mention for mention in reversed(list(mentions))}.values())[::-1]
