"""The loop as an agent in a shop: it analyses, chooses, aborts and sets."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from codra_dsl.runtime import Kind, NotASourceError, UnknownNameError, WallClock
from codra_dsl.runtime.behavior_trees import Action, Entry, Leaf, Node, Ports, Result, Robot, Switch, Task, TreeError
from codra_dsl.runtime.knowledge import AgentTakenError, Stage
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.course_filters import SwitchReason
from codra_dsl.runtime.loops.courses import CourseState, Decision
from codra_dsl.runtime.loops.declarations import MapeModel, Repeat
from codra_dsl.runtime.loops.planning import Context, Plan, Planning
from codra_dsl.runtime.values.conditions import choose, value
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error
from tests.runtime.loops.shop import CHOICES, COURSE, MAPE, MISSION, SPEED, UNFILTERED, Shop

CLOSE_M, FAR_M = 1.0, 6.0


def with_course(**settings: object) -> MapeModel:
    """Return the shop's loops with another course."""
    return replace(MAPE, courses=(replace(COURSE, **settings),))  # type: ignore[arg-type]


def test_a_calm_shop_delivers() -> None:
    shop = Shop()
    shop.begin()
    assert (shop.course(), shop.codra.get("course_now").value) == ("deliver", "deliver")
    assert shop.codra.get("max_speed").value == 1.2
    assert shop.stage("to_deliver") is Stage.WANTS
    assert [event.details["because"] for event in shop.events("chosen")] == ["first"]


def test_a_close_person_makes_it_abort_by_the_handshake_and_go_to_the_start() -> None:
    shop = Shop()
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.pass_s(4.0, person=CLOSE_M)

    assert shop.course() == "start"
    handover = shop.codra.knowledge.snapshot().handover("to_deliver")
    assert (handover.stage, handover.reason) == (Stage.ABORTED, "requester")
    assert shop.stage("to_start") is Stage.WANTS
    (ended,) = shop.events("ended")
    assert (ended.details["branch"], ended.details["result"], ended.details["took_s"]) == ("deliver", "halted", 0.0)


class Steadfast:
    """Lets only the first decision pass."""

    def __init__(self, *arguments: Any) -> None:
        self.planning = Planning(*arguments)
        self.model, self.courses = self.planning.model, self.planning.courses
        self.decisions: dict[str, list[Decision]] = {name: [] for name in self.courses}

    def resume(self) -> None:
        self.planning.resume()

    def course_state(self, course: str) -> CourseState:
        return self.planning.course_state(course)

    def watches(self) -> tuple[str, ...]:
        return self.planning.watches()

    def plan(self, context: Context, now_s: float) -> Plan:
        plan = self.planning.plan(context, now_s)
        new = [decision for decision in plan.decisions if not self.decisions[decision.course]]
        passed = tuple(replace(decision, because=SwitchReason.PLANNER) for decision in new)
        for decision in passed:
            self.decisions[decision.course].append(decision)
        return replace(plan, decisions=passed)

    def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
        return self.planning.kept_by(decision)


def test_a_custom_planner_replaces_the_declared_one() -> None:
    shop = Shop(planner=Steadfast)
    shop.begin()
    shop.pass_s(8.0, person=CLOSE_M)

    assert shop.codra.get("course_now").value == "deliver"
    assert shop.stage("to_deliver") is Stage.WANTS
    assert [decision.because for decision in shop.mape.decisions("course")] == [SwitchReason.PLANNER]
    assert "a planner that replaces the spec's planner chose it" in str(shop.codra.why("course_now"))


def test_metrics_and_weights_are_variables_that_only_the_analyst_may_write() -> None:
    shop = Shop()
    shop.begin()
    reading = shop.codra.get("safety")
    assert (reading.source, reading.value) == ("analysis", pytest.approx(0.7833125))
    assert shop.codra.knowledge.get("context", "safety") == reading
    with pytest.raises(NotASourceError):
        shop.agents["people"].set("safety", 1.0)
    with pytest.raises(AgentTakenError):
        shop.codra.agent("analysis")


def test_the_evidence_of_a_metric_is_that_of_its_oldest_input() -> None:
    shop = Shop()
    shop.begin()
    now_s = shop.clock.now_s()
    shop.agents["people"].set("person_distance", 5.0, evidence_s=now_s)
    shop.clock.sleep(0.1)
    assert shop.codra.get("safety").evidence_s == now_s
    assert shop.codra.get("weight_of_deliver").evidence_s == 0.0  # of the container, which was not written since
    assert shop.codra.get("battery_drain").evidence_s == 11.5


def test_a_rate_is_unknown_at_first_and_then_follows_the_battery() -> None:
    shop = Shop()
    shop.write(person=FAR_M, battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.clock.sleep(0.1)
    assert not shop.codra.get("battery_drain").known
    for second in range(30):
        shop.write(person=FAR_M, battery=80.0 - second * 0.05)
        shop.clock.sleep(1.0)
    assert shop.codra.get("battery_drain").value == pytest.approx(3.0)
    assert shop.codra.get("power_autonomy").value == pytest.approx(0.5, abs=0.01)


def test_a_stale_distance_counts_as_a_close_person() -> None:
    shop = Shop()
    shop.begin()
    for _ in range(16):
        shop.write(battery=80.0)
        shop.clock.sleep(0.5)
    assert not shop.codra.get("person_distance").known
    assert shop.codra.get("safety").value == pytest.approx(0.5, abs=0.01)
    assert shop.course() == "start"


def test_an_empty_battery_during_a_mission_makes_it_dock() -> None:
    shop = Shop()
    shop.begin()
    for level in range(80, 4, -2):
        shop.pass_s(1.0, battery=float(level))
    assert shop.course() == "dock"
    assert [(event.details["action"], event.details["because"]) for event in shop.events("chosen")] == [
        ("deliver", "first"),
        ("dock", "leads"),
    ]
    assert shop.stage("to_deliver") is Stage.ABORTED
    assert shop.stage("to_dock") is Stage.WANTS


@pytest.mark.parametrize(("bumped", "battery", "action"), [(True, 4.0, "start"), (False, 4.0, "dock")])
def test_of_two_hard_rules_the_first_declared_one_decides_and_why_shows_it(
    bumped: bool, battery: float, action: str
) -> None:
    shop = Shop()
    shop.begin()
    shop.write(bumped=bumped, battery=battery)
    shop.clock.sleep(0.01)
    assert shop.course() == action
    (decision,) = shop.mape.decisions("course")[1:]
    assert decision.because is SwitchReason.HARD_RULE
    assert decision.rule is not None
    rule = f"by the hard rule: {decision.rule.text} then {action}"
    assert f"{action} was chosen at 12 s instead of deliver: {rule}" in str(shop.codra.why("course_now"))


def test_a_hard_rule_breaks_the_dwell_and_holds_its_action_while_it_holds() -> None:
    shop = Shop()
    shop.begin()
    shop.write(bumped=True)
    shop.clock.sleep(0.01)
    assert shop.course() == "start"
    shop.pass_s(20.0)
    assert shop.course() == "start"
    shop.write(bumped=False)
    shop.pass_s(3.0)
    assert shop.course() == "deliver"


def switches(model: MapeModel) -> int:
    """Return how often the course changes while a person steps in and out of range each second for a minute."""
    shop = Shop(model)
    shop.begin()
    before = len(shop.events("chosen"))
    for second in range(30):
        shop.pass_s(1.0, person=CLOSE_M if second % 2 else FAR_M)
    return len(shop.events("chosen")) - before


def test_a_person_who_steps_in_and_out_makes_it_flap_only_without_the_filter() -> None:
    assert switches(replace(MAPE, courses=(UNFILTERED,))) == 29
    assert switches(MAPE) == 0


def test_a_metric_that_became_worse_breaks_the_dwell_and_one_that_became_better_does_not() -> None:
    shop = Shop(with_course(dwell_s=30.0))
    shop.begin()
    shop.pass_s(4.0, person=CLOSE_M)
    assert [event.details["because"] for event in shop.events("chosen")] == ["first", "worse"]
    shop.pass_s(20.0)
    assert shop.course() == "start"
    shop.pass_s(10.0)
    assert shop.course() == "deliver"


def test_a_parameter_is_set_at_once_and_then_dwells_unless_a_metric_became_worse() -> None:
    shop = Shop()
    shop.begin()
    shop.pass_s(1.0, person=CLOSE_M)
    shop.pass_s(1.0)
    assert shop.codra.get("max_speed").value == 0.3
    shop.pass_s(2.0)
    assert shop.codra.get("max_speed").value == 1.2
    shop.pass_s(1.0, person=CLOSE_M)
    assert shop.codra.get("max_speed").value == 0.3
    settings = [(event.instant_s, event.details["value"], event.details["because"]) for event in shop.events("set")]
    assert settings == [
        (0.0, 1.2, "first"),
        (12.0, 0.3, "changed"),
        (pytest.approx(15.0, abs=1e-3), 1.2, "changed"),
        (16.0, 0.3, "worse"),
    ]


def test_a_parameter_whose_value_is_unknown_stays() -> None:
    speed = replace(SPEED, value=choose(0.3, value("person_distance") < 2.0, 1.2))
    shop = Shop(replace(MAPE, parameters=(speed,)))
    shop.begin()
    shop.clock.sleep(5.0)
    assert not shop.codra.get("person_distance").known
    assert shop.codra.get("max_speed").value == 1.2


class Stubborn(Action):
    """Asks for a task and does not abort it when it is halted."""

    def __init__(self, shop: Callable[[], Shop]) -> None:
        self._shop = shop

    def start(self, _: Ports) -> Result:
        self._shop().mission.request("to_deliver")
        return Result.RUNNING

    def go_on(self, _: Ports) -> Result:
        return Result.RUNNING

    def halt(self, _: Ports) -> None:
        pass


def stubborn(model: MapeModel) -> Shop:
    """Return a shop whose deliver action does not abort its task."""
    robot = Robot()
    made: list[Shop] = []
    robot.can("deliver", lambda: Stubborn(lambda: made[0]))
    for name in ("start", "dock"):
        robot.can(name, lambda name=name: Task(f"to_{name}", made[0].mission, made[0].codra.knowledge))  # type: ignore[misc]
    robot_model = replace(model, trees=(replace(model.trees[0], tasks=("to_deliver", "to_start", "to_dock")),))
    shop = Shop.__new__(Shop)
    made.append(shop)
    shop.__init__(robot_model, robot=robot)  # type: ignore[misc]
    return shop


def test_a_branch_that_does_not_end_in_time_is_reported_and_left() -> None:
    shop = stubborn(MAPE)
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.write(bumped=True)
    shop.pass_s(1.5)
    assert (shop.stage("to_deliver"), shop.stage("to_start")) == (Stage.IS, None)
    shop.pass_s(1.0)
    (overdue,) = shop.events("overdue")
    assert (overdue.instant_s, overdue.details["tasks"]) == (14.0, ["to_deliver"])
    assert shop.stage("to_start") is Stage.WANTS
    assert "the branch deliver had not ended after 2 s: to_deliver" in str(shop.codra.why("course"))


def test_a_branch_that_ends_late_but_in_time_is_waited_for() -> None:
    shop = stubborn(MAPE)
    shop.begin()
    request = shop.codra.knowledge.snapshot().handover("to_deliver").request
    shop.driver.acknowledge(request)
    shop.write(bumped=True)
    shop.pass_s(1.0)
    shop.driver.finish(request, "there")
    shop.pass_s(2.0)
    assert shop.events("overdue") == []
    (ended,) = shop.events("ended")
    assert ended.details["took_s"] == pytest.approx(1.0, abs=0.11)
    assert shop.stage("to_start") is Stage.WANTS


def raising(_: Ports) -> bool:
    raise OSError("the fork is stuck")


def robot_that(**does: Callable[[Ports], bool | Result]) -> Robot:
    """Return a robot whose given actions are functions; the other actions run forever."""
    robot = Robot()
    for name in CHOICES:
        robot.does(name, does.get(name, lambda _: Result.RUNNING))
    return robot


def test_an_action_that_raises_is_reported_and_the_loop_goes_on() -> None:
    shop = Shop(robot=robot_that(deliver=raising))
    shop.begin()
    assert {event.details["message"] for event in shop.events("failed")} == {"OSError: the fork is stuck"}
    shop.pass_s(4.0, person=CLOSE_M)
    assert (shop.course(), shop.mape.loop("store").trees["mission"].branch) == ("start", "start")


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_an_action_that_raises_a_hostile_exception_is_reported_and_the_loop_goes_on(kind: str) -> None:
    error, text = hostile_error(kind), HOSTILE_ERRORS[kind]

    def raising_error(_: Ports) -> bool:
        raise error

    shop = Shop(robot=robot_that(deliver=raising_error))
    shop.begin()
    shop.pass_s(2.0)
    messages = [event.details["message"] for event in shop.events("failed")]
    assert set(messages) == {text}
    assert len(messages) > 1


def test_a_wrong_value_of_a_parameter_is_reported_and_affects_only_that_parameter() -> None:
    shop = Shop(replace(MAPE, parameters=(replace(SPEED, value=choose(9.0, value("safety") < 0.6, 1.2)),)))
    shop.begin()
    shop.pass_s(4.0, person=CLOSE_M)
    assert any("9.0 lies outside" in event.details["message"] for event in shop.events("failed"))
    assert (shop.course(), shop.codra.get("max_speed").value) == ("start", 1.2)


@pytest.mark.parametrize(("repeat", "times"), [(Repeat.ALWAYS, 120), (Repeat.ON_SWITCH, 1)])
def test_a_tree_that_has_completed_starts_again_or_rests_until_the_next_switch(repeat: Repeat, times: int) -> None:
    done: list[float] = []
    robot = robot_that(deliver=lambda _: done.append(0.0) is None)
    shop = Shop(replace(MAPE, trees=(replace(MISSION, repeat=repeat),)), robot=robot)
    shop.begin()
    assert len(done) == pytest.approx(times, abs=times * 0.02)
    shop.write(bumped=True)
    shop.pass_s(1.0)
    shop.write(bumped=False)
    shop.pass_s(9.0)
    assert shop.course() == "deliver"
    assert len(done) > times


def test_a_stopped_loop_halts_its_tree_and_continues_after_a_new_start() -> None:
    shop = Shop()
    shop.begin()
    shop.mape.stop()
    assert shop.stage("to_deliver") is Stage.ABORTED
    shop.pass_s(5.0, person=CLOSE_M)
    assert shop.course() == "deliver"
    assert not shop.mape.loop("store").is_running
    shop.mape.start()
    shop.pass_s(3.0, person=CLOSE_M)
    assert shop.course() == "start"
    shop.mape.close()
    assert [event.what for event in shop.events("started", "stopped")] == ["started", "stopped"] * 2
    shop.codra.agent("analysis").close()


def test_a_robot_without_a_needed_action_is_rejected_when_the_loop_is_made() -> None:
    with pytest.raises(TreeError, match="the robot has no action 'deliver'"):
        Shop(robot=Robot())


def test_a_tree_without_a_branch_for_an_action_is_rejected_when_the_loop_is_made() -> None:
    with pytest.raises(ValueError, match="the tree 'mission' has no branch for dock"):
        Shop(replace(MAPE, trees=(replace(MISSION, branches={"deliver": "deliver", "start": "start"}),)))
    with pytest.raises(ValueError, match="the tree 'mission' has no course 'cruise' to follow"):
        Shop(replace(MAPE, trees=(replace(MISSION, course="cruise"),)))


@pytest.mark.parametrize("key", ["rates", "analyse", "adapt", "execute"])
def test_a_loop_with_an_undeclared_name_is_rejected_when_it_is_made(key: str) -> None:
    with pytest.raises(UnknownNameError, match="'cruise'"):
        Shop(replace(MAPE, loops=(replace(MAPE.loops[0], **{key: ("cruise",)}),)))  # type: ignore[arg-type]


def a_story() -> Shop:
    """Return a shop after many events."""
    shop = Shop()
    shop.begin()
    shop.pass_s(4.0, person=CLOSE_M)
    shop.write(load="loading")
    for level in range(60, 2, -4):
        shop.pass_s(0.5, battery=float(level), person=2.0)
    shop.mape.close()
    return shop


def test_the_same_story_gives_the_same_record() -> None:
    assert a_story().codra.record.text() == a_story().codra.record.text()


def wait(event: Callable[[], bool]) -> bool:
    """Let real time pass until a condition holds; ten seconds at most."""
    for _ in range(200):
        if event():
            return True
        threading.Event().wait(0.05)
    return False


QUICK = replace(COURSE, smooth_s=0.0, hold_s=0.0, dwell_s=0.0, abort_s=0.2)


def test_in_real_time_it_switches_when_an_input_changes() -> None:
    with WallClock() as clock:
        shop = Shop(replace(MAPE, courses=(QUICK,)), clock=clock)
        shop.write(person=FAR_M, battery=80.0, load="empty", bumped=False)
        shop.mape.start()
        assert wait(lambda: shop.stage("to_deliver") is Stage.WANTS)
        shop.write(bumped=True)
        assert wait(lambda: shop.stage("to_start") is Stage.WANTS)
        assert shop.stage("to_deliver") is Stage.ABORTED
        shop.mape.close()
        shop.codra.close()


def test_in_real_time_an_action_that_hangs_while_it_is_halted_is_reported() -> None:
    freed = threading.Event()

    class Hanging(Stubborn):
        def start(self, _: Ports) -> Result:
            return Result.RUNNING

        def halt(self, _: Ports) -> None:
            freed.wait(20.0)

    robot = Robot()
    robot.can("deliver", partial(Hanging, Shop))
    for name in ("start", "dock"):
        robot.does(name, lambda _: Result.RUNNING)
    with WallClock() as clock:
        shop = Shop(replace(MAPE, courses=(QUICK,)), clock=clock, robot=robot)
        shop.write(person=FAR_M, battery=80.0, load="empty", bumped=False)
        shop.mape.start()
        mission = shop.mape.loop("store").trees["mission"]
        assert wait(lambda: mission.branch == "deliver")
        shop.write(bumped=True)
        assert wait(lambda: len(shop.events("overdue")) == 1)
        freed.set()
        assert wait(lambda: mission.branch == "start")
        (ended,) = shop.events("ended")
        assert ended.details["took_s"] >= 0.2
        shop.mape.close()
        shop.codra.close()


def test_all_events_of_a_loop_have_its_kind() -> None:
    record = a_story().codra.record
    assert {event.what for event in record.of(Kind.ADAPTATION)} == {
        "started",
        "computed",
        "analysed",
        "chosen",
        "explained",
        "ended",
        "set",
        "stopped",
    }


@pytest.mark.parametrize("period_s", [0.07, 0.5, 5.0])
def test_the_period_of_a_loop_changes_no_decision(period_s: float) -> None:
    def story(model: MapeModel) -> list[tuple[object, object, float]]:
        shop = Shop(model)
        shop.begin()
        for index in range(30):
            shop.pass_s(1.5, person=2.4 - 0.04 * index, battery=40.0 - index)
        return [(event.details["action"], event.details["because"], event.instant_s) for event in shop.events("chosen")]

    often = story(replace(MAPE, loops=(replace(MAPE.loops[0], period_s=period_s),)))
    plain = story(MAPE)
    assert [choice[:2] for choice in often] == [choice[:2] for choice in plain]
    assert [choice[2] for choice in often] == pytest.approx([choice[2] for choice in plain], abs=1e-4)


def test_two_loops_share_the_work() -> None:
    analysing = replace(MAPE.loops[0], name="analysing", adapt=(), execute=())
    acting = replace(MAPE.loops[0], name="acting", rates=(), analyse=())
    shop = Shop(replace(MAPE, loops=(analysing, acting)))
    shop.begin()
    shop.pass_s(4.0, person=CLOSE_M)
    assert (shop.course(), shop.codra.get("safety").value) == ("start", 0.5)
    assert {event.details["loop"] for event in shop.events("chosen", "set", "ended")} == {"acting"}


def test_a_course_chosen_again_before_the_old_branch_has_ended_goes_to_the_newest() -> None:
    shop = stubborn(MAPE)
    shop.begin()
    shop.driver.acknowledge(shop.codra.knowledge.snapshot().handover("to_deliver").request)
    shop.write(bumped=True)
    shop.pass_s(0.5)
    shop.write(bumped=False, battery=3.0)
    shop.pass_s(3.0, battery=3.0)
    assert (shop.course(), shop.stage("to_start"), shop.stage("to_dock")) == ("dock", None, Stage.WANTS)


def test_an_action_whose_halting_raises_does_not_keep_the_next_branch_from_beginning() -> None:
    class Jammed(Stubborn):
        def start(self, _: Ports) -> Result:
            return Result.RUNNING

        def halt(self, _: Ports) -> None:
            raise OSError("the brake is jammed")

    robot = Robot()
    robot.can("deliver", partial(Jammed, Shop))
    for name in ("start", "dock"):
        robot.does(name, lambda _: Result.RUNNING)
    shop = Shop(robot=robot)
    shop.begin()
    shop.pass_s(4.0, person=CLOSE_M)
    assert [event.details["message"] for event in shop.events("failed")] == ["OSError: the brake is jammed"]
    (ended,) = shop.events("ended")
    assert (ended.details["result"], shop.mape.loop("store").trees["mission"].branch) == ("failed", "start")


def test_a_tree_is_never_ticked_between_two_branches() -> None:
    """So a switch on the course needs no case for the time between, and its default is a normal branch."""
    seen: list[str] = []

    def mission() -> Node:
        kind = Switch(Entry("course"), "start", "dock")
        return Node("mission", kind, *(Node(name, Leaf(name)) for name in ("start", "dock", "deliver")))

    robot = robot_that(**{name: lambda _, name=name: bool(seen.append(name)) or Result.RUNNING for name in CHOICES})
    shop = Shop(replace(MAPE, trees=(replace(MISSION, build=mission),)), robot=robot)
    shop.begin()
    shop.write(bumped=True)
    shop.pass_s(1.0)
    shop.write(bumped=False, battery=3.0)
    shop.pass_s(2.0, battery=3.0)
    assert [name for name, _ in itertools.groupby(seen)] == ["deliver", "start", "dock"]


def test_an_action_that_ends_its_thread_is_reported_and_the_loop_goes_on() -> None:
    def leaving(_: Ports) -> bool:
        raise SystemExit(3)

    shop = Shop(robot=robot_that(deliver=leaving))
    shop.begin()
    shop.pass_s(2.0)
    assert {event.details["message"] for event in shop.events("failed")} == {"SystemExit: 3"}
    assert shop.mape.loop("store").is_running
