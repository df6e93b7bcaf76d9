"""The effect of a look on its variables: kept, forgotten, rejected, failed; and the order of alternatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import pytest
from py_trees.behaviour import Behaviour

from codra_dsl.logic import age, known, value
from codra_dsl.runtime import Reason, SimClock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.observers.observer import Observer
from codra_dsl.runtime.values.model import boolean, real
from tests.runtime.forests import (
    Look,
    Manager,
    World,
    algorithm,
    events,
    forest,
    given,
    observer,
    seen,
    started,
    takes,
    variable,
)

YES, NO = {"seen": True}, {"seen": False}


def raises(_: object) -> object:
    raise ValueError("no picture")


def one_look(unobservable: str = "keep", **settings: Any) -> ContextModel:
    """Return a model of variable `a`, observed by `eye` while `near`."""
    a = variable("a", when_unobservable=unobservable)
    return forest([given("near"), a], observer("o", seen("eye", "a", when=[value("near")], **settings)))


def alternatives(*looks: Look, variables: Sequence[str] = ("a",), unobservable: str = "keep") -> ContextModel:
    names = [variable(name, when_unobservable=unobservable) for name in variables]
    return forest([given("bright"), given("near"), *names], observer("o", *looks))


# Keep and forget


@pytest.mark.parametrize(("unobservable", "is_known"), [("keep", True), ("forget", False)])
def test_when_a_precondition_fails_keep_leaves_the_value_and_forget_does_not(unobservable: str, is_known: bool) -> None:
    clock = SimClock()
    with started(one_look(unobservable), World({"eye": takes(0.2, YES)}), clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(1.5)
        assert manager.get("a").value is True
        manager.set("near", False)
        clock.sleep(0)
        reading = manager.get("a")
    assert reading.known is is_known
    if unobservable == "forget":
        assert (reading.reason, reading.detail, reading.evidence_s) == (Reason.FORGOTTEN, "value('near')", 1.5)


@pytest.mark.parametrize(("unobservable", "is_known"), [("keep", True), ("forget", False)])
def test_when_a_result_is_rejected_keep_leaves_the_value_and_forget_does_not(unobservable: str, is_known: bool) -> None:
    results = [YES, {"seen": None}]
    clock = SimClock()
    world = World({"eye": takes(0.2, lambda: results.pop(0) if len(results) > 1 else results[0])})
    with started(one_look(unobservable), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(1.5)
        reading = manager.get("a")
    assert reading.known is is_known
    if unobservable == "forget":
        assert (reading.reason, reading.evidence_s) == (Reason.REJECTED, 1.2)


def test_an_unobservable_variable_is_forgotten_at_once_while_a_job_still_processes_older_evidence() -> None:
    clock = SimClock()
    world = World({"eye": takes(2.0, YES, snapshot=True)})
    with started(one_look("forget"), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(3)
        assert manager.get("a").evidence_s == 0.0
        manager.set("near", False)
        clock.sleep(0)
        assert manager.get("a").reason is Reason.FORGOTTEN
        clock.sleep(2)
        assert manager.get("a").reason is Reason.FORGOTTEN
        stamps = [(reading.evidence_s, reading.known) for reading in manager.history("a")]
    assert stamps == [(0.0, True), (2.0, True), (3.0, False)]


def test_evidence_that_arrives_after_the_precondition_failed_is_present_with_keep_and_history_with_forget() -> None:
    for unobservable, is_known in [("keep", True), ("forget", False)]:
        clock = SimClock()
        world = World({"eye": takes(2.0, YES, snapshot=True)})
        with started(one_look(unobservable), world, clock) as manager:
            manager.set("near", True)
            manager.declare("a")
            clock.sleep(1)
            manager.set("near", False)
            clock.sleep(5)
            assert manager.get("a").known is is_known
            assert manager.history("a")[0].value is True


def test_a_precondition_that_fails_for_a_moment_between_ticks_counts_as_failed() -> None:
    clock = SimClock()
    with started(one_look("forget"), World({"eye": takes(0.2, YES)}), clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(0.5)
        manager.set("near", False)
        manager.set("near", True)
        clock.sleep(0)
        assert manager.get("a").reason is Reason.FORGOTTEN
        clock.sleep(1)
        assert manager.get("a").known


def test_a_value_that_the_main_execution_wrote_while_unobservable_is_not_forgotten() -> None:
    """The value is forgotten only once the precondition has held and then fails."""
    clock = SimClock()
    with started(one_look("forget"), World({"eye": takes(9.0, YES)}), clock) as manager:
        manager.set("near", False)
        manager.declare("a", value=True)
        for near in (False, False, True):
            clock.sleep(1)
            manager.set("near", near)
            clock.sleep(0)
            assert manager.get("a").known
        clock.sleep(1)
        manager.set("near", False)
        clock.sleep(0)
        assert manager.get("a").reason is Reason.FORGOTTEN


def test_a_failure_of_a_precondition_that_is_known_only_later_removes_the_value() -> None:
    """`near` is measured late: its failure at 2.0 s is known at 2.8 s, after `a` was observed at 2.5 s."""
    world = World({"eye": YES, "base": takes(0.8, lambda: NO if len(world.asked_s("base")) == 3 else YES)})
    base = Look(algorithm("base"), {"near": value("seen")})

    def measure(job: Any) -> object:
        job.evidence(job.now_s(), job.now_s())
        return takes(0.8, NO if job.now_s() == 2.0 else YES)(job)

    world.finds["base"] = measure
    model = forest(
        [variable("near"), variable("a", when_unobservable="forget")],
        observer("b", base),
        observer("o", seen("eye", "a", when=[value("near")]), period_s=0.5),
    )
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(2.6)
        assert manager.get("a").value is True
        clock.sleep(0.3)
        reading = manager.get("a")
    assert (reading.reason, reading.detail) == (Reason.FORGOTTEN, "value('near')")


@pytest.mark.parametrize("unobservable", ["keep", "forget"])
def test_when_an_observer_stops_forget_is_withdrawn_and_keep_stays_and_ages(unobservable: str) -> None:
    clock = SimClock()
    with started(one_look(unobservable), World({"eye": YES}), clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(0.5)
        manager.withdraw("a")
        reading = manager.get("a")
        assert (reading.reason is Reason.WITHDRAWN) is (unobservable == "forget")
        clock.sleep(10)
        if unobservable == "keep":
            assert manager.get("a").age_s(clock.now_s()) == 10.5


# Rejected, failed


def test_a_result_without_a_value_for_a_variable_rejects_only_that_variable() -> None:
    eye = Look(
        algorithm("eye", {"angle": real(optional=True), "latched": boolean()}),
        {"open": value("angle") > 0.6, "locked": value("latched")},
    )
    model = forest([variable("open"), variable("locked")], observer("o", eye))
    clock = SimClock()
    with started(model, World({"eye": {"latched": False}}), clock) as manager:
        manager.declare("open")
        clock.sleep(1)
        assert manager.get("open").reason is Reason.REJECTED
        assert manager.get("locked").value is False


def test_a_value_outside_the_range_of_its_variable_is_failed() -> None:
    eye = Look(algorithm("eye", {"angle": real()}), {"angle": value("angle") * 2.0})
    clock = SimClock()
    model = forest([variable("angle", type=real(0, 3))], observer("o", eye))
    with started(model, World({"eye": {"angle": 2.0}}), clock) as manager:
        manager.declare("angle")
        clock.sleep(0)
        reading = manager.get("angle")
    assert (reading.reason, reading.detail) == (Reason.FAILED, "4.0 lies outside [0, 3]")


def test_a_failure_makes_the_last_value_of_its_algorithm_unknown() -> None:
    clock = SimClock()
    world = World({"eye": takes(0.5, YES)})
    with started(one_look(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(0.75)
        assert manager.get("a").known
        world.finds["eye"] = raises
        clock.sleep(1)
        reading = manager.get("a")
    assert (reading.reason, reading.detail, reading.source) == (Reason.FAILED, "ValueError: no picture", "eye")


def test_a_failure_leaves_the_value_of_another_writer() -> None:
    clock = SimClock()
    world = World({"eye": takes(0.5, YES)})
    with started(one_look(), world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(0.75)
        world.finds["eye"] = raises
        manager.set("a", False)
        clock.sleep(5)
        reading = manager.get("a")
    assert (reading.value, reading.source) == (False, "main_execution")


def test_a_look_that_always_fails_gives_failed_instead_of_never_observed() -> None:
    clock = SimClock()
    with started(one_look(), World({"eye": raises}), clock) as manager:
        manager.set("near", True)
        assert manager.get("a").reason is Reason.NEVER_OBSERVED
        manager.declare("a")
        clock.sleep(3)
        assert manager.get("a").reason is Reason.FAILED
        assert len(manager.history("a")) == 1


def test_voided_evidence_gives_no_reason_of_its_own() -> None:
    clock = SimClock()
    with started(one_look(), World({"eye": takes(0.5, YES)}), clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(0.25)
        manager.set("near", False)
        clock.sleep(1)
        assert manager.get("a").reason is Reason.NEVER_OBSERVED


# Alternatives


def test_alternatives_switch_with_the_situation() -> None:
    camera, sonar = seen("camera", "a", when=[value("bright")]), seen("sonar", "a", when=[value("near")])
    world = World({"camera": takes(0.1, YES), "sonar": takes(0.1, NO)})
    clock = SimClock()
    with started(alternatives(camera, sonar), world, clock) as manager:
        manager.declare("a")
        sources_and_algorithms = []
        for bright, near in [(True, True), (False, True), (True, True), (True, False), (False, False)]:
            manager.set("bright", bright)
            manager.set("near", near)
            clock.sleep(3.5)
            sources_and_algorithms.append((manager.get("a").source, {name for name, _ in world.calls}))
            world.calls.clear()
    camera_looks, sonar_looks, no_looks = ("camera", {"camera"}), ("sonar", {"sonar"}), ("camera", set())
    assert sources_and_algorithms == [camera_looks, sonar_looks, camera_looks, camera_looks, no_looks]


def test_alternatives_switch_during_a_job_in_both_directions() -> None:
    camera, sonar = seen("camera", "a", when=[value("bright")]), seen("sonar", "a", when=[~value("bright")])
    world = World({"camera": takes(2.0, YES), "sonar": takes(2.0, NO)})
    clock = SimClock()
    with started(alternatives(camera, sonar), world, clock) as manager:
        manager.set("bright", True)
        manager.declare("a")
        for bright in (False, True):
            clock.sleep(1)
            manager.set("bright", bright)
        clock.sleep(2.5)
        assert manager.get("a").source == "camera"
    assert world.calls[:3] == [("camera", 0.0), ("sonar", 1.0), ("camera", 2.0)]
    assert events(manager, Kind.JOB, "sonar") == ["started", "cancelled"]


def test_only_the_better_rank_looks_while_it_delivers() -> None:
    world = World({"camera": takes(0.1, YES), "sonar": takes(0.1, NO)})
    clock = SimClock()
    with started(alternatives(seen("camera", "a"), seen("sonar", "a")), world, clock) as manager:
        manager.declare("a")
        clock.sleep(10)
    assert {name for name, _ in world.calls} == {"camera"}


def return_no_value(_: object) -> object:
    return {"seen": None}


@pytest.mark.parametrize(
    "failing_function",
    [raises, return_no_value, takes(2.0, {"seen": None}), takes(9.0, YES)],
    ids=["raises", "rejected", "rejected late", "timed out"],
)
@pytest.mark.parametrize("accepts", [[], [known("seen")]], ids=["plain", "refined"])
def test_an_alternative_looks_when_the_better_one_does_not_deliver(
    failing_function: object, accepts: list[Any]
) -> None:
    """The better one keeps looking too, even if it takes long."""
    world = World({"camera": failing_function, "sonar": takes(0.3, NO)})
    clock = SimClock()
    with started(alternatives(seen("camera", "a", accept=accepts), seen("sonar", "a")), world, clock) as manager:
        manager.declare("a")
        clock.sleep(30)
        assert manager.get("a").value is False
    assert len(world.asked_s("sonar")) >= 3
    assert len(world.asked_s("camera")) >= 3


def test_the_alternative_stops_looking_once_the_better_one_delivers() -> None:
    world = World({"camera": raises, "sonar": takes(0.3, NO)})
    clock = SimClock()
    with started(alternatives(seen("camera", "a"), seen("sonar", "a")), world, clock) as manager:
        manager.declare("a")
        clock.sleep(3.5)
        assert len(world.asked_s("sonar")) >= 2
        world.finds["camera"] = takes(0.1, YES)
        clock.sleep(2)
        world.calls.clear()
        clock.sleep(10)
        assert {name for name, _ in world.calls} == {"camera"}


@pytest.mark.parametrize("unobservable", ["keep", "forget"])
def test_a_failure_removes_no_value_while_an_alternative_delivers(unobservable: str) -> None:
    world = World({"camera": takes(0.3, YES), "sonar": takes(0.3, NO)})
    clock = SimClock()
    model = alternatives(seen("camera", "a"), seen("sonar", "a"), unobservable=unobservable)
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(0.5)
        world.finds["camera"] = raises
        clock.sleep(3)
        assert [reading.known for reading in manager.history("a")] == [True] * 4
        assert manager.get("a").source == "sonar"


def test_when_no_alternative_delivers_the_failure_removes_the_value_of_its_algorithm() -> None:
    world = World({"camera": takes(0.3, YES), "sonar": return_no_value})
    clock = SimClock()
    with started(alternatives(seen("camera", "a"), seen("sonar", "a")), world, clock) as manager:
        manager.declare("a")
        clock.sleep(0.5)
        world.finds["camera"] = raises
        clock.sleep(1)
        reading = manager.get("a")
    assert (reading.reason, reading.source) == (Reason.FAILED, "camera")


def test_a_variable_without_a_value_from_the_better_one_is_left_to_the_other() -> None:
    """The camera returns only `a`, the lever switch only `b`: both stay fresh."""
    camera_look = Look(algorithm("camera"), {"a": value("seen"), "b": value("absent")})
    camera_look = Look(
        algorithm("camera", {"seen": boolean(), "absent": boolean(optional=True)}), camera_look.identifies
    )
    world = World({"camera": takes(1.5, YES), "switch": takes(0.2, NO)})
    clock = SimClock()
    with started(alternatives(camera_look, seen("switch", "b"), variables=("a", "b")), world, clock) as manager:
        manager.declare("a")
        clock.sleep(20)
        assert (manager.get("a").source, manager.get("b").source) == ("camera", "switch")
        assert manager.get("a").age_s(clock.now_s()) < 4
        assert manager.get("b").age_s(clock.now_s()) < 4


def test_two_alternatives_for_different_variables_do_not_starve_each_other() -> None:
    """Each job takes longer than the period, so that both are always due."""
    first = seen("camera", "a", "b", when=[value("bright")])
    world = World({"camera": YES, "left": takes(1.5, YES), "right": takes(1.5, NO)})
    clock = SimClock()
    model = alternatives(first, seen("left", "a"), seen("right", "b"), variables=("a", "b"))
    with started(model, world, clock) as manager:
        manager.set("bright", False)
        manager.declare("a")
        clock.sleep(12.1)
        assert (manager.get("a").value, manager.get("b").value) == (True, False)
        assert [name for name, _ in world.calls] == ["left", "right"] * 4 + ["left"]
        manager.set("bright", True)
        clock.sleep(5)
    assert {name for name, at_s in world.calls if at_s > 14} == {"camera"}


def test_a_running_alternative_is_not_interrupted_by_the_better_one() -> None:
    camera = seen("camera", "a", when=[value("bright")])
    world = World({"camera": takes(0.1, YES), "sonar": takes(4.0, NO)})
    clock = SimClock()
    with started(alternatives(camera, seen("sonar", "a")), world, clock) as manager:
        manager.set("bright", False)
        manager.declare("a")
        clock.sleep(1)
        manager.set("bright", True)
        clock.sleep(4)
    assert world.calls[:2] == [("sonar", 0.0), ("camera", 4.0)]
    assert events(manager, Kind.JOB, "sonar") == ["started", "returned"]


# Times of looks


def test_an_observer_that_starts_again_looks_at_once_but_not_before_its_least_interval() -> None:
    for interval_s, expected in [(0.0, [0.0, 0.5]), (0.8, [0.0, 0.8])]:
        world = World({"eye": YES})
        clock = SimClock()
        with started(one_look(min_interval_s=interval_s), world, clock) as manager:
            manager.set("near", True)
            manager.declare("a")
            clock.sleep(0.5)
            manager.withdraw("a")
            manager.declare("a")
            clock.sleep(0.5)
        assert world.asked_s("eye") == expected


def test_the_least_interval_is_from_start_to_start_although_jobs_wait_for_a_slot() -> None:
    world = World({"eye": takes(0.1, YES), "slow": takes(4.0, YES)})
    quick, slow = seen("eye", "a", slots=("one",), min_interval_s=3.0), seen("slow", "b", slots=("one",))
    model = forest(
        [variable("a"), variable("b")], observer("o", quick), observer("p", slow, priority=1), slots={"one": 1}
    )
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("b")
        manager.declare("a")
        clock.sleep(3.5)
        manager.withdraw("b")
        clock.sleep(10)
    starts_s = world.asked_s("eye")
    assert starts_s == [3.5, 6.5, 9.5, 12.5]


def test_a_condition_with_an_age_looks_again_when_its_result_changes() -> None:
    """The condition `not known(a) or age(a) > 10 s` depends on the observer's own variable."""
    eye = seen("eye", "a", when=[~known("a") | (age("a") > 10.0)])
    world = World({"eye": takes(0.5, YES, snapshot=True)})
    clock = SimClock()
    with started(forest([variable("a")], observer("o", eye)), world, clock) as manager:
        manager.declare("a")
        clock.sleep(35)
    assert world.asked_s("eye") == pytest.approx([0, 10, 20, 30], abs=1e-4)


def test_the_given_variables_of_an_algorithm_must_be_known_and_have_their_values_at_its_start() -> None:
    eye = seen("eye", "a", given=("near",), slots=("one",))
    model = forest([given("near"), variable("a")], observer("o", eye), slots={"one": 1})
    world = World({"eye": takes(0.5, YES)})
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(2)
        assert world.calls == []
        with manager.slot("one"):
            manager.set("near", True)
            clock.sleep(1)
            manager.set("near", False)
        clock.sleep(0.5)
        assert world.given == [{"near": False}]


def reasons(manager: Manager, name: str) -> list[Reason | None]:
    return [reading.reason for reading in manager.history(name)]


def test_an_observer_without_preconditions_never_forgets() -> None:
    model = forest([variable("a", when_unobservable="forget")], observer("o", seen("eye", "a")))
    clock = SimClock()
    with started(model, World({"eye": YES}), clock) as manager:
        manager.declare("a")
        clock.sleep(5)
        assert set(reasons(manager, "a")) == {None}


def test_branches_that_share_variables_also_through_others_are_rivals() -> None:
    looks = [seen("x", "a"), seen("y", "b"), seen("z", "b", "a"), seen("w", "c"), seen("v", "d"), seen("u", "d")]
    with started(alternatives(*looks, variables="abcd"), World()) as manager:
        branches = manager._forest.observers["o"].branches
    rivals = {branch.algorithm.name: [rival.algorithm.name for rival in branch.rivals] for branch in branches}
    assert rivals == {
        **{name: ["x", "y", "z"] for name in "xyz"},
        "w": ["w"],
        **{name: ["v", "u"] for name in "vu"},
    }


def test_the_rivals_of_very_many_alternatives_are_found_by_looking_at_each_pair_only_once() -> None:
    looks = [seen(f"eye{number}", "a") for number in range(300)]
    comparisons = 0

    class CountingNames(list[str]):
        def __iter__(self) -> Iterator[str]:
            nonlocal comparisons
            comparisons += 1
            return super().__iter__()

    def build(owner: Observer) -> Behaviour:
        root = model.build(owner)
        for branch in owner.branches:
            branch.identifies = CountingNames(branch.identifies)
        return root

    model = observer("o", *looks)
    with started(forest([variable("a")], replace(model, build=build)), World()):
        pass
    assert comparisons < 10 * len(looks)
