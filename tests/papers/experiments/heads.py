"""Words in the heads of tables that a reader of a report may not know."""

from __future__ import annotations

from collections.abc import Iterator

from codra_papers.experiments.campaign.document import Document, Table

WORDS = (
    "balanced",
    "constant",
    "evidence",
    "fell back",
    "fresh",
    "from s",
    "identified",
    "lag",
    "late",
    "loops",
    "measured",
    "monitoring",
    "never seen",
    "p90",
    "perceived",
    "preview",
    "reason",
    "seen wrongly",
    "slot",
    "strict",
    "trigger",
    "voided",
    "window",
)


def unexplained_heads(document: Document) -> Iterator[tuple[str, str]]:
    """Yield (head, word) for each head of a column with a word that neither the caption nor the glossary explains."""
    tables = [part for section in document.sections for part in section.parts if isinstance(part, Table)]
    explained = {row[0] for row in tables[0].rows}
    for table in tables[1:]:
        for head in table.header:
            for word in WORDS:
                if word in head.lower() and word not in explained and word not in table.caption.lower():
                    yield head, word
