"""What a loop does at its edges: stopped for a while, fed by itself, left in the midst of leaving, slow to tick."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from codra_dsl.runtime import WallClock
from codra_dsl.runtime.behavior_trees import Entry, Leaf, Node, Result, Robot, Switch, Timeout
from codra_dsl.runtime.knowledge import Stage
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.courses import Decision
from codra_dsl.runtime.loops.declarations import HardRuleModel, MapeModel, Repeat
from codra_dsl.runtime.loops.loop import Mape
from codra_dsl.runtime.loops.planning import Planning
from codra_dsl.runtime.values.conditions import choose, known, value
from tests.runtime.loops.shop import BUMPED, CHOICES, COURSE, MAPE, MISSION, SPEED, UNFILTERED, Shop
from tests.runtime.loops.test_loop import CLOSE_M, robot_that, stubborn, wait


def test_a_lead_from_before_a_stop_does_not_count_after_it() -> None:
    shop = Shop(replace(MAPE, courses=(replace(COURSE, smooth_s=1.0, hold_s=1.0, dwell_s=0.0),)))
    shop.begin()
    shop.pass_s(0.5, person=CLOSE_M)  # the weight of start leads from here on, and is not smoothed so far yet
    shop.mape.stop()
    shop.clock.sleep(60.0)
    shop.tell(person=6.0, battery=80.0)
    shop.mape.start()
    shop.pass_s(5.0)
    assert [each.details["action"] for each in shop.told("chosen")] == ["deliver"]


def rule(condition: str, action: str) -> HardRuleModel:
    return HardRuleModel(condition=value("course_now") == condition, action=action, text=condition)


CIRCLES = {
    "course": replace(MAPE, courses=(replace(UNFILTERED, always=(rule("deliver", "dock"), rule("dock", "deliver"))),)),
    "speed": replace(
        MAPE,
        parameters=(replace(SPEED, value=choose(0.3, known("max_speed") & (value("max_speed") > 1.0), 1.2)),),
    ),
}


@pytest.mark.parametrize("name", CIRCLES)
def test_what_follows_from_itself_is_told_and_time_goes_on(name: str) -> None:
    model: MapeModel = CIRCLES[name]
    shop = Shop(replace(model, parameters=tuple(replace(each, dwell_s=0.0) for each in model.parameters)))
    shop.tell(person=6.0, battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.clock.sleep(0.25)
    (first, *_) = shop.told("failed")
    assert first.details["message"].startswith(f"'{name}' has changed 10 times at one instant")
    changes = [each for each in shop.told("chosen", "set") if each.name == name]
    assert 20 <= len(changes) <= 50


def test_a_tree_that_rests_begins_anew_though_its_course_is_chosen_again_before_another_began() -> None:
    runs: list[float] = []
    robot = Robot()
    for name in CHOICES:
        robot.does(name, lambda _: bool(runs.append(0.0)) or Result.SUCCESS)
    shop = Shop(replace(MAPE, trees=(replace(MISSION, repeat=Repeat.ON_SWITCH),)), robot=robot)
    shop.begin()
    assert len(runs) == 1
    tree = shop.mape.loop("store").trees["mission"]
    tree.choose("dock")
    tree.choose("deliver")
    shop.pass_s(1.0)
    assert (len(runs), tree.branch) == (2, "deliver")


def test_a_branch_that_does_not_end_is_left_in_time_however_seldom_its_tree_is_ticked() -> None:
    model = replace(MAPE, trees=(replace(MISSION, period_s=30.0),))
    shop = stubborn(model)
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.tell(bumped=True)
    shop.pass_s(1.5)
    assert shop.stage("to_start") is None
    shop.pass_s(1.0)
    assert shop.stage("to_start") is Stage.WANTS


def test_what_a_branch_waited_for_before_it_was_left_wakes_nobody() -> None:
    """Its time comes while the branch has not ended: then nothing is due, and time goes on."""

    def mission() -> Node:
        kind = Switch(Entry("course"), "start", "dock")
        start, dock, deliver = (Node(name, Leaf(name)) for name in ("start", "dock", "deliver"))
        return Node("mission", kind, start, dock, Node("timed", Timeout(13_000), deliver))

    shop = stubborn(replace(MAPE, trees=(replace(MISSION, build=mission),)))
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.tell(bumped=True)
    shop.pass_s(2.0)
    assert shop.stage("to_start") is Stage.WANTS


def test_a_chain_has_what_its_hard_rule_reads_though_no_fuzzy_rule_does() -> None:
    shop = Shop(replace(MAPE, courses=(replace(COURSE, always=(BUMPED,)),)))
    shop.begin()
    shop.tell(bumped=True)
    shop.clock.sleep(0.1)
    assert "bumped was true, from evidence taken at 12 s" in str(shop.codra.why("course")).lower()


def test_a_chain_has_what_a_parameter_reads_though_no_fuzzy_rule_does() -> None:
    shop = Shop(replace(MAPE, parameters=(replace(SPEED, value=choose(0.3, value("bumped"), 1.2)),)))
    shop.begin()
    shop.tell(bumped=True)
    shop.clock.sleep(0.1)
    assert "bumped was true, from evidence taken at 12 s" in str(shop.codra.why("max_speed")).lower()


def test_a_value_that_a_variable_cannot_take_is_told_once_and_is_not_taken_as_set() -> None:
    """Neither does it dwell, nor is the value before set anew; what lies in the range is set at once."""
    shop = Shop(replace(MAPE, parameters=(replace(SPEED, value=value("person_distance"), dwell_s=3.0),)))
    shop.mape.start()
    for person in (1.0, 6.0, 6.0, 1.0, 6.0, 0.5):
        shop.pass_s(1.0, person=person)
    told = [(each.details["value"], each.instant_s) for each in shop.told("set")]
    assert told == [(1.0, 0.0), (0.5, 5.0)]
    failed = [(each.name, each.instant_s, each.details["message"]) for each in shop.told("failed")]
    why = "'max_speed' is not set: 6.0 lies outside [0, 1.5]; bound the value, or state a wider range"
    assert failed == [("speed", 1.0, why), ("speed", 4.0, why)]
    assert shop.codra.get("max_speed").value == 0.5


def test_an_explanation_that_takes_long_keeps_no_decision_waiting() -> None:
    """In real time: somebody bumps into the robot while it is still being worked out what would have kept a course."""
    is_asked, may_go_on = threading.Event(), threading.Event()

    class Slow(Planning):
        def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
            is_asked.set()
            may_go_on.wait(60.0)
            return super().kept_by(decision)

    with WallClock() as clock:
        shop = Shop(clock=clock)
        shop.mape.close()
        shop.tell(person=6.0, battery=80.0, load="empty", bumped=False)
        with Mape(shop.codra, MAPE, clock=clock, robot=robot_that(), planner=Slow) as mape:
            assert wait(lambda: mape.standing("course").state.action == "deliver")
            shop.tell(battery=3.0)
            assert wait(lambda: mape.standing("course").state.action == "dock")
            assert is_asked.wait(10.0)
            shop.tell(bumped=True)
            assert wait(lambda: mape.standing("course").state.action == "start")
            may_go_on.set()
        shop.codra.close()
