"""`refresh: on_event`: when the algorithms of such a variable run, and when they do not."""

from __future__ import annotations

from hypothesis import given as given_values
from hypothesis import settings
from hypothesis import strategies as st

from codra_dsl.logic import known, value
from codra_dsl.runtime import ContextModel, Reason, SimClock
from codra_dsl.runtime.values.model import SkillModel
from tests.runtime.forests import World, forest, given, observer, seen, started, takes, variable

SEEN = {"seen": True}
SKILLS = [
    SkillModel(name="watch", monitor=("a",)),
    SkillModel(name="push", preview=("a",), changes=("a",)),
    SkillModel(name="pull", monitor=("a",), changes=("a",)),
    SkillModel(name="speak"),
]


def a_model(**settings: object) -> ContextModel:
    look = seen("look", "a", when=[value("near")])
    return forest(
        [given("near"), variable("a", refresh="on_event", **settings)], observer("o", look, period_s=2.0), skills=SKILLS
    )


def test_it_is_observed_until_it_is_known_and_then_no_more() -> None:
    clock, world = SimClock(), World({"look": {}})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        world.finds["look"] = SEEN
        clock.sleep(100.0)
        assert manager.get("a").value is True
    assert world.asked_s("look") == [0.0, 2.0, 4.0, 6.0]


def test_it_is_observed_again_once_it_is_unknown() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(valid_for_s=10.0), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(25.0)
    assert world.asked_s("look") == [0.0, 10.0, 20.0]


def test_it_is_observed_again_once_it_was_forgotten() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(when_unobservable="forget"), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        manager.set("near", False)
        clock.sleep(0.0)
        assert manager.get("a").reason is Reason.FORGOTTEN
        clock.sleep(5.0)
        manager.set("near", True)
        clock.sleep(20.0)
    assert world.asked_s("look") == [0.0, 10.0]


def test_while_a_skill_monitors_it_it_is_observed_periodically() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        with manager.skill("watch"):
            clock.sleep(5.0)
        clock.sleep(50.0)
    assert world.asked_s("look") == [0.0, 5.0, 7.0, 9.0]


def test_evidence_from_before_the_end_of_acting_causes_another_look_even_for_the_same_value() -> None:
    clock, world = SimClock(), World({"look": takes(1.0, SEEN)})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(4.5)
        with manager.skill("watch") as skill, skill.acting():
            clock.sleep(0.5)
        clock.sleep(0.1)
        manager.set("a", True)
        clock.sleep(20.0)
    assert world.asked_s("look") == [0.0, 4.5, 5.5]


def test_after_any_acting_it_is_observed_once() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        with manager.skill("speak") as skill:
            with skill.acting():
                clock.sleep(5.0)
            clock.sleep(50.0)
    assert world.asked_s("look") == [0.0, 10.0]


def test_a_variable_that_a_skill_changes_is_observed_only_after_acting() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        with manager.skill("push") as skill, skill.acting():
            clock.sleep(1.5)
            assert manager.get("a").reason is Reason.INVALIDATED
            world.finds["look"] = {"seen": False}
        clock.sleep(0.0)
        assert manager.get("a").value is False
        clock.sleep(50.0)
    assert world.asked_s("look") == [0.0, 6.5]


def test_a_variable_that_a_skill_changes_and_monitors_is_observed_while_it_acts() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        with manager.skill("pull") as skill, skill.acting():
            clock.sleep(5.0)
        clock.sleep(50.0)
    assert [round(at_s, 3) for at_s in world.asked_s("look")] == [0.0, 5.0, 7.0, 9.0, 10.0]


def test_a_look_that_began_before_acting_ended_does_not_count_as_the_one_after_it() -> None:
    clock, world = SimClock(), World({"look": takes(1.0, SEEN)})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(4.0)
        with manager.skill("watch") as skill, skill.acting():
            clock.sleep(2.5)
        clock.sleep(50.0)
    assert world.asked_s("look") == [0.0, 4.0, 6.0, 7.0]


def test_a_rejected_look_after_acting_is_repeated() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        world.finds["look"] = {}
        with manager.skill("speak") as skill, skill.acting():
            clock.sleep(1.0)
        clock.sleep(3.0)
        world.finds["look"] = SEEN
        clock.sleep(50.0)
    assert world.asked_s("look") == [0.0, 6.0, 8.0, 10.0]


def test_an_observer_that_starts_again_does_not_observe_a_known_variable() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    with started(a_model(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
        manager.withdraw("a")
        manager.declare("a")
        clock.sleep(5.0)
    assert world.asked_s("look") == [0.0]


def test_an_algorithm_looks_periodically_for_its_periodic_variables() -> None:
    clock, world = SimClock(), World({"look": SEEN})
    model = forest([variable("a", refresh="on_event"), variable("b")], observer("o", seen("look", "a", "b")))
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(3.5)
    assert world.asked_s("look") == [0.0, 1.0, 2.0, 3.0]


def test_an_alternative_looks_on_events_as_well() -> None:
    clock, world = SimClock(), World({"eye": {}, "ear": SEEN})
    model = forest([variable("a", refresh="on_event")], observer("o", seen("eye", "a"), seen("ear", "a")))
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(30.0)
        assert manager.get("a").source == "ear"
    assert (world.asked_s("eye"), world.asked_s("ear")) == ([0.0], [0.0])


# Preconditions of other observers


def a_chain(*, b_valid_for_s: float = 3.0) -> ContextModel:
    """Return a model: `a` needs `b`; `b` is valid for 3 s, and forgotten while `near` does not hold."""
    variables = [
        given("near"),
        variable("b", refresh="on_event", valid_for_s=b_valid_for_s, when_unobservable="forget"),
        variable("a", refresh="on_event"),
    ]
    look_b = seen("look_b", "b", when=[value("near")])
    look_a = seen("look_a", "a", when=[value("b")])
    return forest(variables, observer("ob", look_b, period_s=1.0), observer("oa", look_a, period_s=2.0), skills=SKILLS)


def test_a_precondition_is_observed_only_when_an_observer_that_needs_it_is_due() -> None:
    clock, world = SimClock(), World({"look_a": SEEN, "look_b": SEEN})
    with started(a_chain(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(20.0)
        assert not manager.get("b").known
        assert manager.get("a").value is True
        with manager.skill("speak") as skill, skill.acting():
            clock.sleep(0.5)
        clock.sleep(20.0)
    assert world.asked_s("look_b") == [0.0, 20.5]
    assert world.asked_s("look_a") == [0.0, 20.5]


def test_a_precondition_that_does_not_hold_is_observed_again_once_it_is_stale() -> None:
    clock, world = SimClock(), World({"look_a": SEEN, "look_b": {"seen": False}})
    with started(a_chain(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(7.0)
        world.finds["look_b"] = SEEN
        clock.sleep(20.0)
        assert manager.get("a").value is True
    assert world.asked_s("look_b") == [0.0, 3.0, 6.0, 9.0]
    assert world.asked_s("look_a") == [9.0]


def test_a_declared_precondition_is_observed_for_itself() -> None:
    clock, world = SimClock(), World({"look_a": SEEN, "look_b": SEEN})
    with started(a_chain(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(4.0)
        manager.declare("b")
        clock.sleep(5.0)
    assert world.asked_s("look_b") == [0.0, 4.0, 7.0]


def test_an_observer_waits_for_its_pause_before_it_needs_its_precondition_again() -> None:
    clock, world = SimClock(), World({"look_a": {}, "look_b": SEEN})
    with started(a_chain(b_valid_for_s=1.5), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(5.0)
    assert world.asked_s("look_a") == [0.0, 2.0, 4.0]
    assert world.asked_s("look_b") == [0.0, 2.0, 4.0]


def test_observers_that_need_only_each_other_do_not_look() -> None:
    clock, world = SimClock(), World({"look_a": SEEN, "look_b": SEEN, "look_c": SEEN})
    needing = [variable(name, refresh="on_event", valid_for_s=2.0) for name in "ab"]
    circle = [
        observer("oa", seen("look_a", "a", when=[~known("b") | value("b")])),
        observer("ob", seen("look_b", "b", when=[~known("a") | value("a")])),
    ]
    goal = observer("oc", seen("look_c", "c", when=[value("a")]))
    with started(forest([*needing, variable("c", refresh="on_event")], *circle, goal), world, clock) as manager:
        manager.declare("c")
        clock.sleep(30.0)
        assert manager.get("c").value is True
    assert world.asked_s("look_c") == [0.0]
    assert world.asked_s("look_a") == [0.0]


@settings(deadline=None)
@given_values(
    st.lists(
        st.tuples(
            st.sampled_from(["near", "far", "declare", "withdraw", "push", "watch", "speak", "set", "blind", "see"]),
            st.sampled_from([0.0, 0.3, 1.0, 2.0, 7.0]),
        ),
        max_size=25,
    ),
    st.sampled_from([0.0, 0.4, 3.0]),
    st.sampled_from(["keep", "forget"]),
)
def test_after_any_steps_it_is_observed_after_the_last_acting_and_then_no_more(
    steps: list[tuple[str, float]], takes_s: float, when_unobservable: str
) -> None:
    clock, world, acted_s = SimClock(), World({"look": takes(takes_s, SEEN)}), 0.0
    with started(a_model(when_unobservable=when_unobservable), world, clock) as manager:
        for action, pause_s in steps:
            if action in ("near", "far"):
                manager.set("near", action == "near")
            elif action == "declare":
                manager.declare("a")
            elif action == "withdraw":
                manager.withdraw("a")
            elif action == "set" and "a" in manager.declared():
                manager.set("a", False)
            elif action in ("blind", "see"):
                world.finds["look"] = takes(takes_s, SEEN if action == "see" else {})
            elif action in ("push", "watch", "speak"):
                with manager.skill(action) as skill, skill.acting():
                    clock.sleep(pause_s)
                acted_s = clock.now_s()
            clock.sleep(pause_s)
        world.finds["look"] = takes(takes_s, SEEN)
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(15.0)
        reading = manager.get("a")
        assert reading.known
        assert reading.start_s >= acted_s
        looked = len(world.asked_s("look"))
        clock.sleep(100.0)
        assert len(world.asked_s("look")) == looked
