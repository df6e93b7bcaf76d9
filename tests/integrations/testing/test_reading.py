from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.integrations.testing.told import HEAD, findings

KITCHEN = (Path(__file__).parents[2] / "kitchen.timeline.yaml").read_text("utf-8")
LAB = (Path(__file__).parents[2] / "lab.timeline.yaml").read_text("utf-8")


def moment(text: str) -> str:
    return f"{HEAD}stories:\n  told:\n    1 s: {{{text}}}\n"


def test_all_mistakes_of_a_file_are_found_at_once_each_where_it_is() -> None:
    text = (
        HEAD
        + """\
resuorces: {kitchen: {call: kitchen_world.Kitchen}}
agents: {wall_swich: {every: 5 s}}
start:
  perception: {look_at_fridge: {returns: {angle: 3 m, edges: 2}, take: 5 s}}
  main_execution: {expect: [open_frigde]}
stories:
  told:
    9 s: {believes: {kettle_state: hott}}
    5 s: {stopped: [hobwatch]}
"""
    )

    assert [(each.place.span.line, each.place.span.column, each.message, each.help) for each in findings(text)] == [
        (3, 1, "unknown key 'resuorces' in timeline 'kitchen'", "did you mean 'resources'?"),
        (
            3,
            29,
            "'kitchen_world.Kitchen' names no class or function",
            "write 'module:name', for example 'door_world:Camera'",
        ),
        (4, 10, "spec 'kitchen' has no agent 'wall_swich'", "did you mean 'wall_switch'?"),
        (6, 50, "'angle' is in rad, not in m", "write a number in rad, or another unit of its kind"),
        (6, 66, "unknown key 'take' in 'look_at_fridge' of timeline 'kitchen'", "did you mean 'takes'?"),
        (7, 29, "spec 'kitchen' has no skill 'open_frigde'", "did you mean 'open_fridge'?"),
        (
            10,
            36,
            "'kettle_state' has a wrong value: 'hott' is none of empty, cold, hot, boiling",
            "write one of empty, cold, hot, boiling",
        ),
        (11, 5, "'5 s' does not come after '9 s'", "write moments in order, each once"),
        (11, 21, "spec 'kitchen' has no observer 'hobwatch'", "did you mean 'hob_watch'?"),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file holds no keys"),
        ("codra: 1\nstories: {told: {0 s: {}}}\n", "'timeline' is missing in timeline 'codra'"),
        ("codra: 1\ntimeline: kitche\nstories: {told: {0 s: {}}}\n", "there is no compiled spec 'generated/kitche'"),
        (f"{HEAD}stories: {{told: {{}}}}\n", "'told' in 'stories' of timeline 'kitchen' is empty"),
        (f"{HEAD}stories: {{told: {{1: {{}}}}}}\n", "'1' is no instant of a story"),
        (moment("believes: {fridge_angle: 0.5}"), "'fridge_angle' is in rad, and '0.5' has no unit"),
        (moment("believes: {fridge_open: {unknown: stale, is: true}}"), "'is' is about a value, and it is unknown"),
        (moment("agents: {wall_switch: {fridge_open: true}}"), "agent 'wall_switch' is no source of 'fridge_open'"),
        (moment("perception: {weigh_kettle: {returns: {}}}"), "'weigh_kettle' returns 'weight' as well"),
        (moment("perception: {look_at_hob: {raises: a, hangs: true}}"), "'raises', 'hangs': only one of them can be"),
        (
            moment("perception: {weigh_kettle: {takes: 1 s}}"),
            "it is not said what 'weigh_kettle' returns, so its own function is called",
        ),
        (
            moment("perception: {weigh_kettle: {raises: a, evidence: [2 s, 1 s]}}"),
            "'evidence' ends before it begins",
        ),
        (moment("main_execution: {act: [open_fridge]}"), "skill 'open_fridge' is not under way"),
        (
            moment("main_execution: {begin: [open_fridge], set: {}, end: [open_fridge, open_fridge]}"),
            "the text 'open_fridge' occurs twice in 'end' in 'main_execution' of timeline 'kitchen'",
        ),
        (moment("resources: {vision: {a: 1}}"), "spec 'kitchen' has no handle 'vision'"),
        (
            moment("decided: {fridge_open: context}"),
            "'fridge_open' in 'decided' of timeline 'kitchen' cannot be 'context'",
        ),
    ],
)
def test_a_mistake_is_told_with_a_way_out(text: str, message: str) -> None:
    found = findings(text)

    assert message in [each.message for each in found]
    assert all(each.help for each in found)


@given(st.data())
@settings(max_examples=300)
def test_whatever_is_spoilt_in_a_timeline_reading_it_never_raises(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from([KITCHEN, LAB]))
    lines = text.splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        spoilt = data.draw(
            st.sampled_from(
                ["", "  - 1", "    5: {}", "x", lines[at][1:], lines[at].replace(":", ""), f"{lines[at]} 1"]
            )
        )
        lines[at] = spoilt

    for each in findings("\n".join(lines)):
        assert each.message
        assert each.place.span.file == "tests/told.timeline.yaml"


def test_nothing_that_a_timeline_names_is_imported_when_it_is_read() -> None:
    text = f"{HEAD}resources: {{kitchen: {{call: no.such.module:Kitchen}}}}\nstories: {{told: {{1 s: {{}}}}}}\n"

    assert findings(text) == ()
