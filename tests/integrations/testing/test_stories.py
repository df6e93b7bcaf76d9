from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.integrations.testing.run import StoryFailed
from codra_dsl.runtime import CallError, EventLog, Kind, SimClock, WallClock
from generated import kitchen
from generated.kitchen import fridge
from tests.integrations.testing.timelines import kitchen_run, run_of_only_story
from tests.kitchen_world import Kitchen

READY_VALUES = "{robot_is_localized: true, robot_place: counter, light_is_on: true}"
FRIDGE = f"""\
start:
  perception:
    measure_fridge: {{returns: {{distance: 50 cm}}}}
    look_at_fridge: {{returns: {{angle: 0 deg, edges: 10}}, takes: 500 ms, evidence: 0 s}}
  main_execution: {{set: {READY_VALUES}}}
"""


def failure_text(text: str) -> str:
    with pytest.raises(StoryFailed) as error_info:
        kitchen_run(text).play()
    return str(error_info.value)


# Messages of failures


def test_a_failure_shows_the_expected_and_the_actual_value_and_the_reason_with_lines_of_both_files() -> None:
    text = failure_text(
        FRIDGE
        + """\
stories:
  case:
    0 s: {main_execution: {declare: [fridge_open]}}
    10 s:
      perception: {measure_fridge: {returns: {distance: 3 m}}}
    140 s:
      believes: {fridge_open: true}
"""
    )

    assert (
        text
        == """\
tests/case.timeline.yaml:14:31: at 140 s fridge_open should be true, but it is unknown (stale)
   |
14 |       believes: {fridge_open: true}
   |                               ^^^^
  fridge_open is unknown (stale) at 140 s  [specs/kitchen.yaml:32 (used at specs/kitchen.yaml:67)]
    its evidence, taken at 10 s, was valid for 120 s
    it was false before, from look_at_fridge at 10.5 s
    observer look_at_fridge has been running since 0 s
    declared since 0 s for main_execution
    perception look_at_fridge cannot look  [specs/kitchen.yaml:45 (used at specs/kitchen.yaml:67)]
      job 11 was voided at 11 s: fridge_in_reach did not hold while it looked
      fridge_in_reach is false at 140 s  [specs/kitchen.yaml:54 (used at specs/kitchen.yaml:67)]
        identified at 140 s from evidence taken at 140 s
        observer measure_fridge has been running since 0 s
        perception measure_fridge saw distance = 3 m (job 140)
          by the rule: distance < 0.9  [specs/kitchen.yaml:44 (used at specs/kitchen.yaml:67)]
          robot_is_localized is true at 140 s  [specs/kitchen.yaml:42 (used at specs/kitchen.yaml:67)]
            written by main_execution at 0 s
            valid until 600 s
    missing: fridge_in_reach = true"""
    )


def test_a_decision_that_looked_is_explained_by_the_state_before_its_look() -> None:
    decision = "0 s: {main_execution: {declare: [fridge_open], decide: {fridge_open: {otherwise: false}}}}"

    check = "0.2 s: {decided: {fridge_open: answered}}"
    text = failure_text(f"{FRIDGE}stories:\n  case:\n    {decision}\n    {check}\n")

    assert "  fridge_open is unknown (never_observed) at 0 s" in text


@pytest.mark.parametrize(
    ("check", "message"),
    [
        ("running: [hob_watch]", "at 2 s observer hob_watch should run, but it has not run"),
        ("stopped: [look_at_fridge]", "at 2 s observer look_at_fridge should not run, but it started at 0 s"),
        (
            "decided: {fridge_open: answered}",
            "by 2 s the decision on fridge_open should be answered from context, but at 0 s it was made by looking",
        ),
        (
            "decided: {kettle_state: fell_back}",
            "by 2 s the decision on kettle_state should be made by looking, but there was no decision on it",
        ),
        (
            "believes: {fridge_angle: {is: 30 deg, within: 5 deg}}",
            "at 2 s fridge_angle should be 0.523599 rad within 0.0872665, but it is 0 rad from look_at_fridge",
        ),
        (
            "believes: {fridge_open: {unknown: any}}",
            "at 2 s fridge_open should be unknown, but it is false from look_at_fridge",
        ),
        (
            "believes: {fridge_open: {source: main_execution}}",
            "at 2 s fridge_open should be known from main_execution, but it is false from look_at_fridge",
        ),
        (
            "believes: {fridge_open: {is: false, because: the moon}}",
            "at 2 s fridge_open should be false because of 'the moon', but it is false from look_at_fridge",
        ),
    ],
)
def test_every_kind_of_check_has_a_message(check: str, message: str) -> None:
    begun = "0 s: {main_execution: {declare: [fridge_open], decide: {fridge_open: {otherwise: false}}}}"

    assert message in failure_text(f"{FRIDGE}stories:\n  case:\n    {begun}\n    2 s: {{{check}}}\n")


def test_all_failed_checks_are_reported_at_once() -> None:
    checks = "1 s: {believes: {fridge_open: true}}\n    2 s: {running: [hob_watch]}"

    assert failure_text(f"{FRIDGE}stories:\n  case:\n    {checks}\n").count("should") == 2


def test_an_impossible_step_of_the_main_execution_is_reported_with_its_place() -> None:
    text = failure_text(f"{FRIDGE}stories:\n  case:\n    2 s: {{main_execution: {{set: {{fridge_open: true}}}}}}\n")

    assert text.startswith("tests/case.timeline.yaml:10:34: 'set' is not possible: NotDeclaredError: 'fridge_open'")


def test_an_algorithm_that_looks_without_stated_values_is_reported() -> None:
    start = f"start: {{main_execution: {{set: {READY_VALUES}, declare: [fridge_open]}}}}"
    text = failure_text(f"{start}\nstories: {{case: {{2 s: {{}}}}}}\n")

    assert "measure_fridge looked at 0 s, but the values that it returns are not stated" in text


def test_a_handle_that_cannot_be_made_or_lacks_an_attribute_is_reported_with_its_place() -> None:
    with pytest.raises(CallError, match=r"case.timeline.yaml:3: 'tests.kitchen_world:Kichen': AttributeError"):
        kitchen_run("resources: {kitchen: {call: tests.kitchen_world:Kichen}}\nstories: {case: {0 s: {}}}\n").play()
    with pytest.raises(CallError, match=r"case.timeline.yaml:3: kitchen has no attribute 'colour'"):
        kitchen_run("stories: {case: {0 s: {resources: {kitchen: {colour: 1}}}}}\n", {"kitchen": Kitchen()}).play()


# The order at an instant


def test_the_world_changes_after_everything_else_that_is_due_at_the_instant() -> None:
    kitchen_run(
        FRIDGE
        + """\
stories:
  case:
    0 s: {main_execution: {declare: [fridge_open]}}
    3 s:
      perception: {look_at_fridge: {returns: {angle: 60 deg}}}
    3900 ms:
      believes: {fridge_open: {is: false, because: from evidence taken at 3 s}}
    4500 ms:
      believes: {fridge_open: {is: true, because: from evidence taken at 4 s}}
"""
    ).play()


def test_an_operator_overrides_a_variable_until_the_end_of_the_override_or_until_it_is_cleared() -> None:
    text = """\
stories:
  case:
    0 s:
      main_execution: {declare: [fridge_angle]}
    2 s:
      overrides:
        fridge_angle: {is: 30 deg, for: 3 s, reason: it is held open}
        light_is_on: {for: 10 min, reason: lamp changed}
      main_execution: {decide: {fridge_angle: {}}}
      decided: {fridge_angle: answered}
      believes:
        fridge_angle: {is: 30 deg, source: operator, because: it is held open}
        light_is_on: {unknown: overridden, because: "overridden by the operator since 2 s until 602 s: lamp changed"}
    5 s:
      overrides: {light_is_on: cleared}
      believes: {fridge_angle: {is: 0 deg, source: look_at_fridge}, light_is_on: true}
"""

    kitchen_run(FRIDGE + text).play()


def test_a_late_result_is_about_the_time_when_it_would_have_come() -> None:
    kitchen_run(
        f"""\
start:
  perception: {{ask_dock: {{returns: {{contact: true}}}}}}
  main_execution: {{set: {READY_VALUES}, declare: [kettle_docked]}}
stories:
  case:
    1 s:
      perception: {{ask_dock: {{late: 1500 ms, jobs: 1}}}}
    3400 ms:
      believes: {{kettle_docked: {{is: true, because: from evidence taken at 0 s}}}}
    3500 ms:
      believes: {{kettle_docked: {{is: true, because: from evidence taken at 2 s}}}}
"""
    ).play()


def test_a_wait_of_the_main_execution_does_not_delay_the_world() -> None:
    kitchen_run(
        FRIDGE
        + """\
stories:
  case:
    3 s:
      main_execution:
        begin: [open_fridge]
        act: [open_fridge]
        acted: [open_fridge]
        decide: {fridge_angle: {since: 5 s, wait_up_to: 10 s}}
      decided: {fridge_angle: answered}
      believes: {fridge_angle: 60 deg}
    4 s:
      perception: {look_at_fridge: {returns: {angle: 60 deg}}}
"""
    ).play()


def test_a_story_counts_from_its_beginning_for_any_time_of_the_clock() -> None:
    kitchen_run(
        FRIDGE
        + "stories: {case: {3 s: {main_execution: {declare: [fridge_open]}}, 4 s: {believes: {fridge_open: false}}}}",
        start_s=1234.5,
    ).play()


# A program as the main execution


def test_a_program_runs_in_a_story_and_is_checked_by_it() -> None:
    text = f"""\
{FRIDGE}stories:
  case:
    2 s: {{perception: {{look_at_fridge: {{returns: {{angle: 60 deg}}}}}}}}
    9 s: {{believes: {{fridge_open: true}}}}
"""

    with kitchen_run(text) as run:
        run.codra.declare("fridge_open")
        run.clock.sleep(1.5)
        assert run.codra.get("fridge_open").value is False
        run.until(4.0)
        assert run.codra.get("fridge_open").value is True

    assert run.clock.now_s() == 9.0
    assert not run.codra.declared()


def test_a_story_writes_for_an_agent_whose_handle_the_program_holds() -> None:
    text = """\
codra: 1
timeline: store
agents: {navigation: {every: 20 s}}
stories:
  case:
    1 s: {agents: {navigation: {battery_level: 40 percent}}}
    70 s: {believes: {battery_level: 40 percent}}
"""

    with run_of_only_story(text) as run:
        navigation = run.codra.agent("navigation")
        navigation.set("battery_level", 90.0)
        run.until(50.0)
        assert run.codra.knowledge.get("battery", "battery_level").value == 40.0
        navigation.graph.set("battery", "charging", True)


def test_a_program_that_starts_the_observers_itself_is_given_the_start_of_the_story() -> None:
    run, clock, record = (
        kitchen_run(f"{FRIDGE}stories: {{case: {{2 s: {{believes: {{fridge_open: true}}}}}}}}"),
        SimClock(50.0),
        EventLog(),
    )

    with run.start(clock=clock, resources={"kitchen": Kitchen()}, record=record) as codra:
        codra.declare("fridge_open")
        clock.sleep(5.0)
    with pytest.raises(StoryFailed, match="at 52 s fridge_open should be true, but it is false"):
        run.check()

    assert record.of(Kind.JOB)


def test_a_program_that_ends_before_a_moment_fails_the_story() -> None:
    run = kitchen_run(f"{FRIDGE}stories: {{case: {{9 s: {{running: [hob_watch]}}}}}}")

    with run.start(clock=SimClock(), resources={}):
        pass
    with pytest.raises(StoryFailed, match="the run was over at 0 s, before this moment"):
        run.check()


def test_a_timeline_has_no_main_execution_beside_a_program() -> None:
    run = kitchen_run("stories: {case: {9 s: {main_execution: {declare: [fridge_open]}}}}")

    with pytest.raises(ValueError, match=r"case.timeline.yaml:3: a program is the main execution here"):
        run.__enter__()


def test_a_story_runs_in_simulated_time_only() -> None:
    clock: Any = WallClock()

    with clock, pytest.raises(TypeError, match="give it a SimClock"):
        kitchen_run("stories: {case: {9 s: {}}}").start(clock=clock, resources={})


def test_an_exception_of_a_program_is_not_hidden_by_failed_checks() -> None:
    with pytest.raises(ZeroDivisionError), kitchen_run("stories: {case: {9 s: {running: [hob_watch]}}}"):
        _ = 1 / 0


# The same seed, the same event log


def test_a_story_gives_the_event_log_of_an_equivalent_program() -> None:
    run = kitchen_run(
        """\
resources: {kitchen: {call: tests.kitchen_world:Kitchen}}
stories:
  case:
    0 s: {main_execution: {set: {robot_is_localized: true, light_is_on: true}, begin: [open_fridge]}}
    2500 ms: {resources: {kitchen: {angle_rad: {fridge: 90 deg}}}, main_execution: {act: [open_fridge]}}
    6 s: {main_execution: {acted: [open_fridge], decide: {fridge_open: {since: 4 s}}, end: [open_fridge]}}
    9 s: {agents: {wall_switch: {light_is_on: false}}, believes: {fridge_open: true}}
"""
    )
    run.play()
    clock, kitchen_handle = SimClock(), Kitchen()
    with kitchen.start(clock=clock, resources={"kitchen": kitchen_handle}) as codra:
        codra.set("robot_is_localized", True)
        codra.set("light_is_on", True)
        with codra.skill("open_fridge") as skill:
            clock.sleep(2.5)
            kitchen_handle.angle_rad["fridge"] = math.pi / 2
            with skill.acting():
                clock.sleep(3.5)
            codra.decide("fridge_open", otherwise=lambda: None, since_s=4.0)
        clock.sleep(3.0)
        codra.agent("wall_switch").set("light_is_on", False)
        clock.sleep(0.0)

    assert run.record.text() == codra.record.text()


ALGORITHMS = {"measure_fridge": "distance: 40 cm", "look_at_fridge": "angle: 40 deg", "look_at_hob": "lamp: low"}
ENTRIES = ["works", "{raises: no frame}", "{hangs: true}", "{garbage: 3}", "{late: 700 ms}", "{raises: a, jobs: 2}"]
CHECK = "running: [hob_watch], believes: {fridge_open: {unknown: any}}, decided: {pot_fill: answered}"


@st.composite
def stories(draw: st.DrawFn) -> str:
    """Draw moments in which algorithms fail and work again, as the lines of a story."""
    lines = ["    0 s: {main_execution: {declare: [fridge_open, hob_level, pot_fill]}}"]
    for at_ms in draw(st.lists(st.integers(1, 20_000), min_size=1, max_size=6, unique=True).map(sorted)):
        name = draw(st.sampled_from(sorted(ALGORITHMS)))
        returned_values = f"{{returns: {{{ALGORITHMS[name]}}}}}" if name != "look_at_hob" else "works"
        entry = draw(st.sampled_from([*ENTRIES, returned_values]))
        lines.append(f"    {at_ms} ms: {{perception: {{{name}: {entry}}}}}")
    return "\n".join(lines)


@given(stories(), st.integers(0, 3))
@settings(max_examples=40)
def test_a_story_gives_the_same_event_log_every_time_with_or_without_checks(story: str, seed: int) -> None:
    head = f"seed: {seed}\n{FRIDGE.replace('counter', 'stove')}stories:\n  case:\n"
    records = []
    for checks in ("", CHECK):
        run = kitchen_run(f"{head}{story}\n    21 s: {{{checks}}}\n", {"kitchen": Kitchen(power_w=1500.0)})
        if checks:
            with pytest.raises(StoryFailed):
                run.play()
        else:
            run.play()
        records.append(run.record.text())

    assert records[0] == records[1]


def test_another_seed_gives_another_event_log() -> None:
    texts = []
    for seed in (1, 2):
        start = "start: {main_execution: {set: {robot_is_localized: true, robot_place: stove}, declare: [pot_fill]}}"
        run = kitchen_run(
            f"seed: {seed}\n{start}\nstories: {{case: {{9 s: }}}}\n", {"kitchen": Kitchen(power_w=1500.0)}
        )
        run.play()
        texts.append(run.record.text())

    assert texts[0] != texts[1]


def test_in_a_story_the_functions_of_hosts_are_scripted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fridge, "LOOK_AT_FRIDGE", replace(fridge.LOOK_AT_FRIDGE, host="arm_pc"))
    kitchen_run(
        FRIDGE
        + """\
stories:
  case:
    0 s: {main_execution: {declare: [fridge_open]}}
    10 s:
      believes: {fridge_open: false}
"""
    ).play()
