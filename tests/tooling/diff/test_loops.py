"""What a review tells of loops: one edit each, with the category and element of every change."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.tooling.diff import Review, Version, review

CASE = Path(__file__).parents[2] / "cases/valid/loops-everything"


def version(folder: Path) -> Version:
    found = plan_paths([folder / "spec.yaml"], folder)
    assert not has_errors(found.diagnostics), found.diagnostics
    return Version(plans=found.plans)


def edited(folder: Path, file: str, old: str, new: str) -> Review:
    shutil.copytree(CASE, folder)
    text = (folder / file).read_text("utf-8")
    assert text.count(old) == 1, old
    (folder / file).write_text(text.replace(old, new), "utf-8")
    return review(version(CASE), version(folder))


def told(found: Review) -> list[str]:
    return sorted(
        f"{each.category} {each.element.removeprefix('loops_everything/')} {each.key}" for each in found.changes
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
    ("value: load !=", "value: load ==", ["redefined adaptation/care value"]),
    ("period: 200 ms", "period: 300 ms", ["redefined tree/mission period"]),
    ("Drive: [driving]", "Drive: []", ["redefined tree/mission leaves"]),
    ("repeat: on_switch", "repeat: always", ["redefined tree/mission repeat"]),
    ("period: 2 s", "period: 1 s", ["faster loop/first period"]),
    ("monitor: [laser], ", "", ["redefined loop/first monitor"]),
]


@pytest.mark.parametrize(("old", "new", "expected"), EDITS)
def test_each_edit_is_told_as_what_it_means(old: str, new: str, expected: list[str], tmp_path: Path) -> None:
    assert told(edited(tmp_path / "new", "spec.yaml", old, new)) == expected


def test_another_node_in_the_file_of_a_tree_is_told_of_the_tree(tmp_path: Path) -> None:
    found = edited(tmp_path / "new", "trees/mission.xml", 'msec="1000"', 'msec="2000"')

    assert told(found) == ["redefined tree/mission file"]


def test_a_metric_that_is_gone_takes_its_variable_along_and_is_told_once(tmp_path: Path) -> None:
    metric = "  calm: {rules: [if lifted is true then low, if lifted is false then high]}\n"
    found = edited(tmp_path / "new", "spec.yaml", "metrics:\n", f"metrics:\n{metric}")

    assert told(found) == ["added metric/calm "]
    gone = review(version(tmp_path / "new"), version(CASE))
    assert told(gone) == ["removed metric/calm "]
