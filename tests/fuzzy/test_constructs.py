"""Everything that FuzzyLite has is supported, has reference values, and is in the docs."""

from __future__ import annotations

from pathlib import Path

from tests.fuzzy.constructs import SUPPORTED, engines_by_word, known, table

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "fuzzy.md"


def test_every_construct_of_fuzzylite_is_supported() -> None:
    assert [(kind, word) for kind, word in known() if word not in SUPPORTED[kind]] == []


def test_every_construct_is_in_an_engine_with_reference_values() -> None:
    assert set(known()) - set(engines_by_word()) == set()


def test_the_page_has_the_table_that_the_code_makes() -> None:
    """`python -m tests.fuzzy.constructs` prints it."""
    assert table() in PAGE.read_text("utf-8")
