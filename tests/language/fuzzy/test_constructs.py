"""Every construct of FuzzyLite is supported, has reference values, and is in the docs."""

from __future__ import annotations

from pathlib import Path

from tests.language.fuzzy.constructs import SUPPORTED, engines_by_word, known_words, table

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "fuzzy.md"


def test_every_construct_of_fuzzylite_is_supported() -> None:
    assert [(kind, word) for kind, word in known_words() if word not in SUPPORTED[kind]] == []


def test_every_construct_is_in_an_engine_with_reference_values() -> None:
    assert set(known_words()) - set(engines_by_word()) == set()


def test_the_page_has_the_generated_table() -> None:
    """`python -m tests.language.fuzzy.constructs` prints it."""
    assert table() in PAGE.read_text("utf-8")
