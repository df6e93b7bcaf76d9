"""The glossary of a report explains the words that are in the heads of its tables."""

from __future__ import annotations

from codra_papers.experiments.campaign.document import Section, Table
from codra_papers.experiments.lab.glossary import MEANINGS, glossary


def words_for(*tables: Table) -> list[str]:
    (table,) = glossary([Section(title="Results", parts=tables)]).parts
    assert isinstance(table, Table)
    return [str(row[0]) for row in table.rows]


def test_words_in_heads_of_columns_and_of_rows_are_explained() -> None:
    columns = Table(caption="", header=("arm", "lag median s"), rows=[("naive", 1.0)])
    rows = Table(caption="", header=("", "", "Run 1"), rows=[("naive", "of these, late s", 2.0)])

    assert words_for(columns, rows) == ["arm", "late", "lag"]


def test_words_that_do_not_occur_are_left_out() -> None:
    assert words_for(Table(caption="lag", header=("seed",), rows=[(7,)])) == []


def test_a_meaning_is_no_longer_than_a_line() -> None:
    assert all(meaning and len(meaning) < 110 for meaning in MEANINGS.values())
