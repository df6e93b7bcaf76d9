"""Times of a course that change no choice."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.language.check import check
from codra_dsl.language.load import load_text
from tests.language.check.specs import marked_text

SPEC = """\
codra: 1
name: truck
context:
  distance: {{type: float, unit: m, range: [0, 10], source: laser, terms: {{close: ramp 2 1}}}}
agents: {{laser: {{}}}}
actions:
  go:
    {go}
    rules: [if distance is close then low, if distance is not close then high]
  wait:
    {wait}
    rules: [if distance is close then high, if distance is not close then low]
adaptation:
  course: {{choose: [go, wait], in: mission, otherwise: wait, {times}}}
trees:
  mission: {{file: mission.xml, course: {{go: Go, wait: Wait}}, leaves: {{Drive: []}}}}
loops:
  driving: {{adapt: [course], execute: [mission]}}
"""
TREES = """\
<root BTCPP_format="4" main_tree_to_execute="Mission">
  <BehaviorTree ID="Mission">
    <Switch2 variable="{course}" case_1="go" case_2="wait"><SubTree ID="Go"/><SubTree ID="Wait"/><Drive/></Switch2>
  </BehaviorTree>
  <BehaviorTree ID="Go"><Drive/></BehaviorTree>
  <BehaviorTree ID="Wait"><AlwaysSuccess/></BehaviorTree>
  <TreeNodesModel><Action ID="Drive"/></TreeNodesModel>
</root>
"""


def problems(folder: Path, times: str, go: str = "", wait: str = "") -> list[tuple[str, str, str | None]]:
    """Return the findings about the times of the course; `go` and `wait` are keys of these actions."""
    (folder / "mission.xml").write_text(TREES)
    text = SPEC.format(times=times, go=go or "label: Go", wait=wait or "label: Wait")
    spec, diagnostics = load_text(text, "spec.yaml", folder)
    assert spec is not None, diagnostics
    return [
        (marked_text(text, finding), finding.message, finding.help)
        for finding in check(spec)[1]
        if finding.rule.name == "senseless-filter"
    ]


@pytest.mark.parametrize(
    ("times", "go", "wait"),
    [
        ("hold: 5 s, dwell: 5 s", "", ""),
        ("hold: 9 s", "", ""),
        ("hold: 9 s, dwell: 5 s", "hold: 1 s", ""),
        ("hold: 1 s, dwell: 5 s", "hold: 9 s", ""),
        ("cooldown: 6 s, dwell: 5 s, hold: 5 s", "", ""),
        ("cooldown: 6 s, dwell: 5 s, hold: 1 s", "hold: 9 s", ""),
    ],
)
def test_a_time_that_counts_for_one_action_is_no_mistake(times: str, go: str, wait: str, tmp_path: Path) -> None:
    assert problems(tmp_path, times, go, wait) == []


def test_a_dwell_that_is_shorter_than_the_hold_of_each_action_is_useless(tmp_path: Path) -> None:
    message = "'hold' is longer than 'dwell', which makes 'dwell' useless"
    assert problems(tmp_path, "hold: 9 s, dwell: 5 s") == [("9 s", message, "make 'hold' shorter than 'dwell'")]
    assert problems(tmp_path, "hold: 9 s, dwell: 5 s", "hold: 7 s") == [
        ("9 s", message, "make 'hold' shorter than 'dwell'")
    ]
    message = "the 'hold' of each action is longer than 'dwell', which makes 'dwell' useless"
    own_holds = problems(tmp_path, "hold: 1 s, dwell: 5 s", "hold: 7 s", "hold: 8 s")
    assert own_holds == [("5 s", message, "make 'dwell' longer, or remove it")]


def test_a_cooldown_that_is_not_longer_than_the_dwell_or_each_hold_is_useless(tmp_path: Path) -> None:
    message = "'cooldown' is not longer than 'dwell', which makes 'cooldown' useless"
    assert problems(tmp_path, "cooldown: 5 s, dwell: 5 s") == [
        ("5 s", message, "make 'cooldown' longer than 'dwell', or remove it")
    ]
    message = "'cooldown' is not longer than 'hold', which makes 'cooldown' useless"
    assert problems(tmp_path, "cooldown: 5 s, hold: 6 s") == [
        ("5 s", message, "make 'cooldown' longer than 'hold', or remove it")
    ]
