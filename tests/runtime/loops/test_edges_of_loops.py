"""Edge cases of a loop: a stop for a while, dependence on itself, a switch while a branch ends, slow ticks."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from codra_dsl.runtime import ContextManager, SimClock, WallClock
from codra_dsl.runtime.behavior_trees import Entry, Leaf, Node, Result, Robot, Switch, Timeout, TreeError
from codra_dsl.runtime.journal import Event
from codra_dsl.runtime.knowledge import AgentTakenError, KnowledgeModel, Stage
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.courses import Decision
from codra_dsl.runtime.loops.declarations import HardRuleModel, MapeModel, Repeat
from codra_dsl.runtime.loops.loop import Mape
from codra_dsl.runtime.loops.planning import Planning
from codra_dsl.runtime.values.conditions import choose, known, value
from codra_dsl.runtime.values.declarations import DERIVED
from tests.runtime.loops.shop import BUMPED, CHOICES, COURSE, KNOWLEDGE, MAPE, MISSION, MODEL, SPEED, UNFILTERED, Shop
from tests.runtime.loops.test_loop import CLOSE_M, robot_that, stubborn, wait


def test_a_lead_from_before_a_stop_does_not_count_after_it() -> None:
    shop = Shop(replace(MAPE, courses=(replace(COURSE, smooth_s=1.0, hold_s=1.0, dwell_s=0.0),)))
    shop.begin()
    shop.pass_s(0.5, person=CLOSE_M)  # the weight of start leads from here on, its smoothed weight not yet
    shop.mape.stop()
    shop.clock.sleep(60.0)
    shop.write(person=6.0, battery=80.0)
    shop.mape.start()
    shop.pass_s(5.0)
    assert [event.details["action"] for event in shop.events("chosen")] == ["deliver"]


def rule(condition: str, action: str) -> HardRuleModel:
    return HardRuleModel(condition=value("course_now") == condition, action=action, text=condition)


CIRCLES = {
    "course": replace(MAPE, courses=(replace(UNFILTERED, always=(rule("deliver", "dock"), rule("dock", "deliver"))),)),
    "speed": replace(
        MAPE,
        parameters=(replace(SPEED, value=choose(0.3, known("max_speed") & (value("max_speed") > 1.0), 1.2)),),
    ),
}


def without_dwell(model: MapeModel) -> MapeModel:
    return replace(model, parameters=tuple(replace(parameter, dwell_s=0.0) for parameter in model.parameters))


def messages(shop: Shop) -> list[str]:
    return [event.details["message"] for event in shop.events("failed")]


def changes(shop: Shop, name: str) -> list[Event]:
    return [event for event in shop.events("chosen", "set") if event.name == name]


@pytest.mark.parametrize("name", CIRCLES)
def test_an_adaptation_that_depends_on_itself_is_reported_and_time_goes_on(name: str) -> None:
    shop = Shop(without_dwell(CIRCLES[name]))
    shop.write(person=6.0, battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.clock.sleep(0.25)
    assert messages(shop) == [f"'{name}' has changed 10 times in a row: it depends on itself"]
    assert 10 < len(changes(shop, name)) < 20


@pytest.mark.parametrize("name", CIRCLES)
def test_an_adaptation_that_depends_on_itself_waits_for_the_next_period_in_real_time(name: str) -> None:
    model = without_dwell(CIRCLES[name])
    with WallClock() as clock:
        shop = Shop(replace(model, loops=tuple(replace(loop, period_s=3600.0) for loop in model.loops)), clock=clock)
        shop.write(person=6.0, battery=80.0, load="empty", bumped=False)
        shop.mape.start()
        assert wait(lambda: bool(shop.events("failed")))
        assert messages(shop) == [f"'{name}' has changed 10 times in a row: it depends on itself"]
        (failed,) = shop.events("failed")
        # on a slow machine, the distance is stale before the next lines, and the loop analyses again
        assert len([event for event in changes(shop, name) if event.instant_s <= failed.instant_s]) == 10
        count = len(changes(shop, name))
        shop.write(bumped=True)
        assert wait(lambda: len(changes(shop, name)) > count)
        shop.mape.close()
        shop.codra.close()


def test_a_weight_that_depends_on_itself_through_a_derived_variable_is_reported_and_time_goes_on() -> None:
    weight = "weight_of_start"
    distance_m = choose(6.0, known(weight) & (value(weight) > 0.5), CLOSE_M)
    variables = (
        replace(variable, derived=distance_m, sources=(DERIVED,)) if variable.name == "person_distance" else variable
        for variable in MODEL.variables
    )
    shop = Shop(context=replace(MODEL, variables=tuple(variables)))
    shop.write(battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.clock.sleep(0.25)
    assert f"'{weight}' has changed 10 times in a row: it depends on itself" in messages(shop)


def test_a_resting_tree_starts_again_even_if_its_course_is_chosen_again_before_another_began() -> None:
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


def test_a_branch_that_does_not_end_is_left_in_time_even_if_its_tree_is_rarely_ticked() -> None:
    model = replace(MAPE, trees=(replace(MISSION, period_s=30.0),))
    shop = stubborn(model)
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.write(bumped=True)
    shop.pass_s(1.5)
    assert shop.stage("to_start") is None
    shop.pass_s(1.0)
    assert shop.stage("to_start") is Stage.WANTS


def test_the_timeout_of_a_branch_that_was_left_does_not_wake_the_loop() -> None:
    """Its timeout is over while the branch has not ended: then no tick is due, and time goes on."""

    def mission() -> Node:
        kind = Switch(Entry("course"), "start", "dock")
        start, dock, deliver = (Node(name, Leaf(name)) for name in ("start", "dock", "deliver"))
        return Node("mission", kind, start, dock, Node("timed", Timeout(13_000), deliver))

    shop = stubborn(replace(MAPE, trees=(replace(MISSION, build=mission),)))
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.write(bumped=True)
    shop.pass_s(2.0)
    assert shop.stage("to_start") is Stage.WANTS


def test_a_chain_contains_the_inputs_of_its_hard_rule_even_if_no_fuzzy_rule_reads_them() -> None:
    shop = Shop(replace(MAPE, courses=(replace(COURSE, always=(BUMPED,)),)))
    shop.begin()
    shop.write(bumped=True)
    shop.clock.sleep(0.1)
    assert "bumped was true, from evidence taken at 12 s" in str(shop.codra.why("course")).lower()


def test_a_chain_contains_the_inputs_of_a_parameter_even_if_no_fuzzy_rule_reads_them() -> None:
    shop = Shop(replace(MAPE, parameters=(replace(SPEED, value=choose(0.3, value("bumped"), 1.2)),)))
    shop.begin()
    shop.write(bumped=True)
    shop.clock.sleep(0.1)
    assert "bumped was true, from evidence taken at 12 s" in str(shop.codra.why("max_speed")).lower()


def test_a_value_that_a_variable_cannot_take_is_reported_once_and_does_not_count_as_set() -> None:
    """It has no dwell, and the value before is not set again; a value in the range is set at once."""
    shop = Shop(replace(MAPE, parameters=(replace(SPEED, value=value("person_distance"), dwell_s=3.0),)))
    shop.mape.start()
    for person in (1.0, 6.0, 6.0, 1.0, 6.0, 0.5):
        shop.pass_s(1.0, person=person)
    settings = [(event.details["value"], event.instant_s) for event in shop.events("set")]
    assert settings == [(1.0, 0.0), (0.5, 5.0)]
    failed = [(event.name, event.instant_s, event.details["message"]) for event in shop.events("failed")]
    why = "'max_speed' is not set: 6.0 lies outside [0, 1.5]; limit the value, or state a wider range"
    assert failed == [("speed", 1.0, why), ("speed", 4.0, why)]
    assert shop.codra.get("max_speed").value == 0.5


def test_a_long_explanation_does_not_delay_decisions() -> None:
    """In real time: a person bumps into the robot while the counterfactuals of a switch are still being computed."""
    is_asked, may_go_on = threading.Event(), threading.Event()

    class Slow(Planning):
        def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
            is_asked.set()
            may_go_on.wait(60.0)
            return super().kept_by(decision)

    with WallClock() as clock:
        shop = Shop(clock=clock)
        shop.mape.close()
        shop.write(person=6.0, battery=80.0, load="empty", bumped=False)
        with Mape(shop.codra, MAPE, clock=clock, robot=robot_that(), planner=Slow) as mape:
            assert wait(lambda: mape.course_state("course").state.action == "deliver")
            shop.write(battery=3.0)
            assert wait(lambda: mape.course_state("course").state.action == "dock")
            assert is_asked.wait(10.0)
            shop.write(bumped=True)
            assert wait(lambda: mape.course_state("course").state.action == "start")
            may_go_on.set()
        shop.codra.close()


@pytest.mark.parametrize("knowledge", [None, KNOWLEDGE], ids=["without a knowledge graph", "with a knowledge graph"])
def test_a_context_manager_has_one_set_of_loops_at_a_time(knowledge: KnowledgeModel | None) -> None:
    clock, robot = SimClock(), robot_that()
    with ContextManager(MODEL, clock=clock, resources={}, knowledge=knowledge) as codra:
        with pytest.raises(TreeError) as error_info:
            Mape(codra, MAPE, clock=clock, robot=Robot())
        taken = pytest.raises(AgentTakenError, match="the loops cannot write as agent 'analysis'")
        with Mape(codra, MAPE, clock=clock, robot=robot) as mape, taken:
            Mape(codra, MAPE, clock=clock, robot=robot)
        with Mape(codra, MAPE, clock=clock, robot=robot):
            mape.close()  # a second time: the loops that are open now stay open
            with pytest.raises(AgentTakenError):
                Mape(codra, MAPE, clock=clock, robot=robot)
    assert error_info.value.__traceback__ is not None  # keeps the loops that could not be made alive
