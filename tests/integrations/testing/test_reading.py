from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.integrations.testing.reading import read_timeline
from codra_dsl.integrations.testing.timeline import Behaviour
from tests.integrations.testing.timelines import HEAD, PATH, findings

KITCHEN = (Path(__file__).parents[2] / "kitchen.timeline.yaml").read_text("utf-8")
LAB = (Path(__file__).parents[2] / "lab.timeline.yaml").read_text("utf-8")


def moment(text: str) -> str:
    return f"{HEAD}stories:\n  case:\n    1 s: {{{text}}}\n"


def test_mistakes_in_overrides_are_reported_with_their_places() -> None:
    overrides = (
        "overrides: {kettle_stat: cleared, light_is_on: {is: 3, for: forever, reason: ' '}, hob_power: clear, "
        "pot_fill: {is: 5 percent, reson: test}}"
    )

    assert [(finding.place.span.column, finding.message, finding.help) for finding in findings(moment(overrides))] == [
        (23, "spec 'kitchen' has no context-variable 'kettle_stat'", "did you mean 'kettle_state'?"),
        (63, "'is' has a wrong value: 3 is not of type bool", "write true or false"),
        (
            71,
            "'for' in timeline 'kitchen' must be a duration, not 'forever'",
            "give a number with ms, s, min or h",
        ),
        (88, "'reason' is empty", "state why the operator overrides it"),
        (
            105,
            "'hob_power' in 'overrides' of timeline 'kitchen' cannot be 'clear'",
            "allowed: cleared, or for example 'hob_power: {is: true, for: 10 min, reason: sensor broken}'",
        ),
        (112, "'for' is missing in 'pot_fill' of timeline 'kitchen'", "add it, for example 'for: 10 min'"),
        (138, "unknown key 'reson' in 'pot_fill' of timeline 'kitchen'", "did you mean 'reason'?"),
    ]


@pytest.mark.parametrize(
    ("text", "help_text"),
    [
        ("believes: {light_is_on: unknown}", "write 'light_is_on: {unknown: any}'"),
        ("believes: {pot_fill: {is: unknown}}", "write 'unknown: any' instead of 'is'"),
        (
            "overrides: {light_is_on: {is: unknown, for: 10 min, reason: test}}",
            "remove 'is': an override without a value makes the context-variable unknown",
        ),
        (
            "overrides: {light_is_on: true}",
            "for example 'light_is_on: {is: true, for: 10 min, reason: sensor broken}'",
        ),
        ("believes: {light_is_on: maybe}", "write true or false"),
    ],
)
def test_the_help_about_a_wrong_value_shows_how_a_timeline_states_it(text: str, help_text: str) -> None:
    assert [finding.help for finding in findings(moment(text))] == [help_text]


def test_an_override_in_a_timeline_is_no_longer_than_one_in_a_run() -> None:
    (finding,) = findings(moment("overrides: {light_is_on: {is: true, for: 25 h, reason: test}}"))
    assert (finding.message, finding.help) == ("'for' is longer than 24 h", "override it again before it ends")


def test_lists_of_names_state_what_they_take() -> None:
    entries = ("begin: [enter]", "begin: {open_fridge: 5 s}", "declare: [enter]", "act: kitchen")
    findings_by_entry = {entry: findings(moment(f"main_execution: {{{entry}}}")) for entry in entries}
    skills = "'open_dishwasher', 'open_fridge', 'boil_water', 'pour_water', 'cook'"
    must_be = "in 'main_execution' of timeline 'kitchen' must be a list of skills, not"

    assert [(finding.message, finding.help) for (finding,) in findings_by_entry.values()] == [
        ("spec 'kitchen' has no skill 'enter'", f"'begin' takes {skills}"),
        (f"'begin' {must_be} a mapping", "write 'begin: [open_fridge]'"),
        (
            "spec 'kitchen' has no context-variable 'enter'",
            "'declare' takes 'dishwasher_in_reach', 'dishwasher_open', 'dishwasher_angle', 'fridge_in_reach', "
            "'fridge_open', 'fridge_angle', 'robot_is_localized', 'robot_place', 'light_is_on', 'kettle_in_view', "
            "'kettle_docked', 'kettle_state', and 5 more",
        ),
        (f"'act' {must_be} the text 'kitchen'", "write 'act: [kitchen]'"),
    ]


def test_units_are_checked_under_garbage() -> None:
    garbage = ("angle: 3 m", "angle: 3 metre", "angle: 30 degree", "angle: far", 'angle: "3 m"', "edges: 3 m")
    findings_by_garbage = {
        text: findings(moment(f"perception: {{look_at_fridge: {{garbage: {{{text}}}}}}}")) for text in garbage
    }

    assert [[(finding.message, finding.help) for finding in found] for found in findings_by_garbage.values()] == [
        [("'angle' is in rad, but '3 m' is in m", "write a number in rad, or another unit of its kind")],
        [("unknown unit 'metre' in '3 metre'", "did you mean 'm'? Quote it if it is text")],
        [("unknown unit 'degree' in '30 degree'", "did you mean 'deg'? Quote it if it is text")],
        [],
        [],
        [("'edges' has no unit, but '3 m' is in m", "write a number")],
    ]


def test_a_quantity_under_garbage_gets_the_unit_of_its_returned_value() -> None:
    text = moment("perception: {look_at_fridge: {garbage: {angle: 180 deg, edges: many, others: 3 m}}}")
    timeline, _, _ = read_timeline(PATH, {"tests/case.timeline.yaml": text.encode()})
    assert timeline is not None
    (change,) = timeline.stories[0].moments[0].changes

    assert isinstance(change, Behaviour)
    assert change.fault is not None
    assert change.fault.garbage == ({"angle": math.pi, "edges": "many", "others": "3 m"},)


def test_all_mistakes_of_a_file_are_reported_at_once_with_their_places() -> None:
    text = (
        HEAD
        + """\
resuorces: {kitchen: {call: kitchen_world.Kitchen}}
agents: {wall_swich: {every: 5 s}}
start:
  perception: {look_at_fridge: {returns: {angle: 3 m, edges: 2}, take: 5 s}}
  main_execution: {expect: [open_frigde]}
stories:
  case:
    9 s: {believes: {kettle_state: hott}}
    5 s: {stopped: [hobwatch]}
"""
    )

    assert [
        (finding.place.span.line, finding.place.span.column, finding.message, finding.help)
        for finding in findings(text)
    ] == [
        (3, 1, "unknown key 'resuorces' in timeline 'kitchen'", "did you mean 'resources'?"),
        (
            3,
            29,
            "'kitchen_world.Kitchen' is not the name of a class or function",
            "write 'module:name', for example 'door_world:Camera'",
        ),
        (4, 10, "spec 'kitchen' has no agent 'wall_swich'", "did you mean 'wall_switch'?"),
        (6, 50, "'angle' is in rad, but '3 m' is in m", "write a number in rad, or another unit of its kind"),
        (6, 66, "unknown key 'take' in 'look_at_fridge' of timeline 'kitchen'", "did you mean 'takes'?"),
        (7, 29, "spec 'kitchen' has no skill 'open_frigde'", "did you mean 'open_fridge'?"),
        (
            10,
            36,
            "'kettle_state' has a wrong value: 'hott' is not one of empty, cold, hot, boiling",
            "write one of empty, cold, hot, boiling",
        ),
        (11, 5, "'5 s' is not later than '9 s'", "write moments in order, each only once"),
        (11, 21, "spec 'kitchen' has no observer 'hobwatch'", "did you mean 'hob_watch'?"),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file holds no keys"),
        ("codra: 1\nstories: {case: {0 s: {}}}\n", "'timeline' is missing in timeline 'codra'"),
        ("codra: 1\ntimeline: kitche\nstories: {case: {0 s: {}}}\n", "there is no compiled spec 'generated/kitche'"),
        (f"{HEAD}stories: {{case: {{}}}}\n", "'case' in 'stories' of timeline 'kitchen' is empty"),
        (f"{HEAD}stories: {{case: {{1: {{}}}}}}\n", "'1' is not an instant of a story"),
        (moment("believes: {fridge_angle: 0.5}"), "'fridge_angle' is in rad, and '0.5' has no unit"),
        (
            moment("believes: {fridge_open: {unknown: stale, is: true}}"),
            "'is' describes a value, but 'unknown' expects none",
        ),
        (moment("agents: {wall_switch: {fridge_open: true}}"), "agent 'wall_switch' is not a source of 'fridge_open'"),
        (moment("perception: {weigh_kettle: {returns: {}}}"), "'weigh_kettle' also returns 'weight'"),
        (
            moment("perception: {look_at_hob: {raises: a, hangs: true}}"),
            "'raises', 'hangs': a fault can have only one of these keys",
        ),
        (
            moment("perception: {weigh_kettle: {takes: 1 s}}"),
            "the results of 'weigh_kettle' are not stated, so its own function is called",
        ),
        (
            moment("perception: {weigh_kettle: {raises: a, evidence: [2 s, 1 s]}}"),
            "'evidence' ends before it begins",
        ),
        (moment("main_execution: {act: [open_fridge]}"), "skill 'open_fridge' is not running"),
        (
            moment("main_execution: {begin: [open_fridge], set: {}, end: [open_fridge, open_fridge]}"),
            "the text 'open_fridge' occurs twice in 'end' in 'main_execution' of timeline 'kitchen'",
        ),
        (
            f"{HEAD}resources: {{kitchen: {{call: 'kitchen_world:Kitchen:new'}}}}\nstories: {{case: {{0 s: {{}}}}}}\n",
            "'kitchen_world:Kitchen:new' is not the name of a class or function",
        ),
        (moment("resources: {vision: {a: 1}}"), "spec 'kitchen' has no handle 'vision'"),
        (
            moment("decided: {fridge_open: context}"),
            "'fridge_open' in 'decided' of timeline 'kitchen' cannot be 'context'",
        ),
    ],
)
def test_a_mistake_is_reported_with_help(text: str, message: str) -> None:
    mistakes = findings(text)

    assert message in [mistake.message for mistake in mistakes]
    assert all(mistake.help for mistake in mistakes)


@given(st.data())
@settings(max_examples=75)
def test_reading_a_damaged_timeline_never_raises(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from([KITCHEN, LAB]))
    lines = text.splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        index = data.draw(st.integers(0, len(lines) - 1))
        damaged_line = data.draw(
            st.sampled_from(
                ["", "  - 1", "    5: {}", "x", lines[index][1:], lines[index].replace(":", ""), f"{lines[index]} 1"]
            )
        )
        lines[index] = damaged_line

    for finding in findings("\n".join(lines)):
        assert finding.message
        assert finding.place.span.file == "tests/case.timeline.yaml"


def test_reading_a_timeline_imports_none_of_its_names() -> None:
    text = f"{HEAD}resources: {{kitchen: {{call: no.such.module:Kitchen}}}}\nstories: {{case: {{1 s: {{}}}}}}\n"

    assert findings(text) == ()
