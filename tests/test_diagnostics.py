"""Suggestions of similar names, and findings that a template gives in each of its uses."""

from __future__ import annotations

from itertools import product

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.diagnostics import Diagnostic, Place, Rule, Severity, Span, once_per_template, suggest

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
def test_the_nearest_name_is_suggested_and_of_several_one_that_begins_alike(name: str, others: set[str]) -> None:
    near = [(distance(name, other), other[:1] != name[:1], other) for other in others - {name}]
    best = min((each for each in near if each[0] <= max(1, len(name) // 3)), default=(0, False, None))

    assert suggest(name, others) == best[2]


def test_of_names_that_differ_only_in_case_the_other_one_is_meant() -> None:
    assert suggest("Door_open", ["Door_opem", "door_open"]) == "door_open"


def found(message: str, use: int | None, path: str = "a") -> Diagnostic:
    span = Span("spec.yaml", 3, 1, 3, 9)
    place = Place(span, None if use is None else Span("spec.yaml", use, 1, use, 5))
    return Diagnostic(rule=RULE, message=message, place=place, path=path)


def test_what_a_template_gives_in_each_use_is_one_finding_at_the_first_use() -> None:
    (one,) = once_per_template([found("in sugar", 9, "context.sugar"), found("in salt", 8, "context.salt")])

    assert (one.message, [other.message for other in one.related]) == ("in salt", ["in another use: in sugar"])


def test_several_findings_that_a_use_gives_at_one_place_stay_several() -> None:
    several = [found("first", 8), found("second", 8), found("first", 9), found("second", 9)]

    assert [each.message for each in once_per_template(several)] == ["first", "second"]


def test_findings_outside_templates_stay_as_they_are() -> None:
    several = (found("first", None), found("second", None))

    assert once_per_template(several) == several
