"""Changes of loops: single edits with the category, element and key of every change."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.tooling.diff import Review, Version, review

CASE = Path(__file__).parents[2] / "cases/valid/loops-everything"


def version(folder: Path) -> Version:
    result = plan_paths([folder / "spec.yaml"], folder)
    assert not has_errors(result.diagnostics), result.diagnostics
    return Version(plans=result.plans)


def review_edit(folder: Path, file: str, old: str, new: str) -> Review:
    shutil.copytree(CASE, folder)
    text = (folder / file).read_text("utf-8")
    assert text.count(old) == 1, old
    (folder / file).write_text(text.replace(old, new), "utf-8")
    return review(version(CASE), version(folder))


def change_texts(diff_review: Review) -> list[str]:
    return sorted(
        f"{change.category} {change.element.removeprefix('loops_everything/')} {change.key}"
        for change in diff_review.changes
    )


EDITS = [
    ("close: ramp 2.5 1.5 1", "close: ramp 2.5 1", ["redefined context/distance terms"]),
    ("over: 2 min", "over: 1 min", ["redefined context/drain rate_of"]),
    ("counts: falling, ", "", ["redefined context/drain rate_of"]),
    ("worse: high", "worse: low", ["redefined metric/strain worse"]),
    ("defuzzifier: bisector", "defuzzifier: centroid", ["redefined metric/safety inference"]),
    ("then somewhat high with 0.1", "then high with 0.1", ["redefined metric/safety rules"]),
    ("high: ramp 0.5 1}", "high: ramp 0.6 1}", ["redefined metric/safety terms"]),
    ("label: Safety", "label: Security", ["wording context/safety label", "wording metric/safety label"]),
    ("lead: 0.1", "lead: 0.2", ["redefined adaptation/course lead"]),
    ("hold: 1 s", "hold: 2 s", ["redefined adaptation/course hold"]),
    ("dwell: 3 s", "dwell: 4 s", ["redefined adaptation/speed dwell"]),
    ("otherwise: wait", "otherwise: pick", ["redefined adaptation/course otherwise"]),
    ("battery < 5 percent", "battery < 6 percent", ["redefined adaptation/course always"]),
    ("share_of: lifted, over: 30 s", "share_of: lifted, over: 40 s", ["redefined context/burden share_of"]),
    ("held: lifted, for: 5 s", "held: lifted, for: 6 s", ["redefined context/stuck held"]),
    ("percent, for: 5 s, ", "percent, ", ["redefined adaptation/course always"]),
    ("hold: 2 s", "hold: 3 s", ["redefined action/wait hold"]),
    (
        "    of: robot\n",
        "",
        [
            *(f"api context/{name} of" for name in ("course", "weight_of_pick", "weight_of_wait")),
            "removed adaptation/course of",
        ],
    ),
    ("otherwise: true", "otherwise: false", ["redefined adaptation/care otherwise"]),
    ("period: 100 ms", "period: 200 ms", ["slower agent/laser period"]),
    ("value: load !=", "value: load ==", ["redefined adaptation/care value"]),
    ("period: 200 ms", "period: 300 ms", ["redefined tree/mission period"]),
    ("Drive: [driving]", "Drive: []", ["redefined tree/mission leaves"]),
    ("repeat: on_switch", "repeat: always", ["redefined tree/mission repeat"]),
    ("period: 2 s", "period: 1 s", ["faster loop/first period"]),
    ("monitor: [laser], ", "", ["redefined loop/first monitor"]),
]


@pytest.mark.parametrize(("old", "new", "expected"), EDITS)
def test_an_edit_has_exactly_the_expected_changes(old: str, new: str, expected: list[str], tmp_path: Path) -> None:
    assert change_texts(review_edit(tmp_path / "new", "spec.yaml", old, new)) == expected


def test_another_node_in_the_file_of_a_tree_is_a_change_of_the_tree(tmp_path: Path) -> None:
    result = review_edit(tmp_path / "new", "trees/mission.xml", 'msec="1000"', 'msec="2000"')

    assert change_texts(result) == ["redefined tree/mission file"]


def test_a_removed_metric_and_its_variable_are_one_change(tmp_path: Path) -> None:
    metric = "  calm: {rules: [if lifted is true then low, if lifted is false then high]}\n"
    result = review_edit(tmp_path / "new", "spec.yaml", "metrics:\n", f"metrics:\n{metric}")

    assert change_texts(result) == ["added metric/calm "]
    gone = review(version(tmp_path / "new"), version(CASE))
    assert change_texts(gone) == ["removed metric/calm "]


def test_a_field_without_a_wording_of_its_own_is_reported_by_its_key(tmp_path: Path) -> None:
    (change,) = review_edit(tmp_path / "new", "spec.yaml", "repeat: on_switch", "repeat: always").changes

    assert change.text == "'repeat' has changed: was on_switch, is always"


def test_only_entries_that_differ_are_shown(tmp_path: Path) -> None:
    (change,) = review_edit(tmp_path / "new", "spec.yaml", "high: ramp 0.5 1}", "high: ramp 0.6 1}").changes

    assert change.text == "the terms have changed: was high: ramp 0.5 1, is high: ramp 0.6 1"


@pytest.mark.parametrize(
    ("old", "new", "values"),
    [
        ("share_of: lifted, over: 30 s", "share_of: lifted, over: 40 s", "was lifted over 30 s, is lifted over 40 s"),
        ("held: lifted, for: 5 s", "held: lifted, for: 6 s", "was lifted for 5 s, is lifted for 6 s"),
        ("counts: falling, ", "", "was battery over 120 s, counts falling, is battery over 120 s"),
        ("hold: 2 s", "hold: 3 s", "was 2 s, is 3 s"),
    ],
)
def test_times_of_rates_shares_and_holds_are_shown_with_their_unit(
    old: str, new: str, values: str, tmp_path: Path
) -> None:
    (change,) = review_edit(tmp_path / "new", "spec.yaml", old, new).changes

    assert change.text.endswith(f"has changed: {values}")
