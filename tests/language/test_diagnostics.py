"""Suggestions of similar names, and findings that a template gives in several uses."""

from __future__ import annotations

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Diagnostic, Place, Rule, Severity, Span, once_per_template, suggest

NAMES = st.text("abc", min_size=1, max_size=7)
RULE = Rule(code="CDR9999", name="example", severity=Severity.ERROR)


def distance(left: str, right: str) -> int:
    """Return the optimal string alignment distance by its definition."""
    table = {(row, 0): row for row in range(len(left) + 1)} | {(0, column): column for column in range(len(right) + 1)}
    for row, column in product(range(1, len(left) + 1), range(1, len(right) + 1)):
        replaced = table[row - 1, column - 1] + (left[row - 1] != right[column - 1])
        table[row, column] = min(table[row - 1, column] + 1, table[row, column - 1] + 1, replaced)
        if row > 1 and column > 1 and left[row - 2 : row] == right[column - 2 : column][::-1]:
            table[row, column] = min(table[row, column], table[row - 2, column - 2] + 1)
    return table[len(left), len(right)]


@given(NAMES, st.sets(NAMES, max_size=12))
def test_the_nearest_name_is_suggested_and_the_first_letter_breaks_ties(name: str, others: set[str]) -> None:
    candidates = [(distance(name, other), other[:1] != name[:1], other) for other in others - {name}]
    best_candidate = min(
        (candidate for candidate in candidates if candidate[0] <= max(1, len(name) // 3)), default=(0, False, None)
    )

    assert suggest(name, others) == best_candidate[2]


def test_a_name_that_differs_only_in_case_is_suggested() -> None:
    assert suggest("Door_open", ["Door_opem", "door_open"]) == "door_open"


def make_diagnostic(message: str, use: int | None, path: str = "a") -> Diagnostic:
    span = Span("spec.yaml", 3, 1, 3, 9)
    place = Place(span, None if use is None else Span("spec.yaml", use, 1, use, 5))
    return Diagnostic(rule=RULE, message=message, place=place, path=path)


def test_one_template_text_gives_one_finding_at_its_first_use() -> None:
    (one,) = once_per_template(
        [make_diagnostic("in sugar", 9, "context.sugar"), make_diagnostic("in salt", 8, "context.salt")]
    )

    assert (one.message, [other.message for other in one.related]) == ("in salt", ["in another use: in sugar"])


def test_several_findings_of_one_use_at_one_place_stay_separate() -> None:
    several = [
        make_diagnostic("first", 8),
        make_diagnostic("second", 8),
        make_diagnostic("first", 9),
        make_diagnostic("second", 9),
    ]

    assert [finding.message for finding in once_per_template(several)] == ["first", "second"]


def test_findings_outside_templates_stay_as_they_are() -> None:
    several = (make_diagnostic("first", None), make_diagnostic("second", None))

    assert once_per_template(several) == several
