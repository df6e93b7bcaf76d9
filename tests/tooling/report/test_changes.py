"""Reviews as Markdown: long tables are cut, and say what they lack."""

from __future__ import annotations

import pytest

from codra_dsl.tooling.diff import Category, Change, Review
from codra_dsl.tooling.report.changes import Versions, render_markdown

VERSIONS = Versions(before="A", after="B", show_file_before=str, show_file_after=str)


@pytest.mark.parametrize(("count", "rest"), [(199, []), (200, []), (201, ["and 1 more"]), (450, ["and 250 more"])])
def test_a_table_of_a_pull_request_has_at_most_two_hundred_rows(count: int, rest: list[str]) -> None:
    changes = tuple(
        Change(category=Category.WEAKER, element=f"lab/context/v{number}", message="is weaker")
        for number in range(count)
    )
    lines = render_markdown(Review(changes=changes), VERSIONS).splitlines()

    assert sum("lab/context/v" in line for line in lines) == min(count, 200)
    assert [line for line in lines if line.startswith("and ")] == rest
