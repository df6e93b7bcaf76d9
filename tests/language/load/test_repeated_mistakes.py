"""A mistake that several elements repeat is examined once, and reported at each of them."""

from __future__ import annotations

from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_text
from codra_dsl.language.load.schema.schema import errors_of
from tests.language.load.texts import NOWHERE


def findings(context: str) -> tuple[Diagnostic, ...]:
    return load_text(f"codra: 1\nname: kitchen\ncontext:\n{context}", "kitchen.yaml", NOWHERE)[1]


def test_equal_mistakes_are_reported_at_each_element() -> None:
    lines = "".join(f"  v{number}: {{typ: bol, source: 3}}\n" for number in range(5))

    reported = [(finding.code, finding.place.span.line) for finding in findings(lines)]

    alone = [finding.code for finding in findings("  v0: {typ: bol, source: 3}\n")]
    assert sorted(reported) == sorted((code, line) for code in alone for line in range(4, 9))


def test_values_that_are_equal_in_python_but_of_different_types_have_different_errors() -> None:
    assert errors_of("resource", {"slots": 1}) == ()
    assert [error.path for error in errors_of("resource", {"slots": True})] == [("slots",)]
    assert errors_of("resource", {"slots": 1}) == ()


def test_errors_of_equal_data_are_computed_once() -> None:
    data = {"typ": "bol", "number": 17}

    assert errors_of("context_variable", dict(data)) is errors_of("context_variable", dict(data))
    assert errors_of("context_variable", {**data, "typ": "float"})[0].data["typ"] == "float"
