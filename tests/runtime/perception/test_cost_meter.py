"""Costs and results of observers: each job that has ended is counted once."""

from __future__ import annotations

from typing import Any

from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from codra_dsl.logic import value
from codra_dsl.runtime import Cost, Kind, SimClock
from codra_dsl.runtime.journal import Event
from tests.runtime.forests import World, forest, given, observer, seen, started, takes, variable

YES = {"seen": True}


def raises(_: Any) -> object:
    raise ValueError


def test_every_way_a_job_can_end_has_its_count() -> None:
    ways = {"accepted": takes(0.5, YES), "rejected": takes(0.5, {}), "failed": raises, "late": takes(9.0, YES)}
    model = forest(
        [given("near"), *(variable(name) for name in (*ways, "voided", "nobody"))],
        *(observer(f"o_{name}", seen(name, name, timeout_s=2.0)) for name in ways),
        observer("o_voided", seen("voided", "voided", when=[value("near")])),
        observer("unneeded", seen("unneeded", "nobody")),
    )
    clock = SimClock()
    with started(model, World({**ways, "voided": takes(0.8, YES)}), clock) as manager:
        manager.set("near", True)
        for name in (*ways, "voided"):
            manager.declare(name)
        for _ in range(4):
            clock.sleep(0.25)
            manager.set("near", False)
            manager.set("near", True)
        clock.sleep(2.2)
    spent = manager.spent()
    assert spent["o_accepted"] == Cost(jobs=4, accepted=3, cancelled=1, perception_s=1.5 + (3.2 - 3.0))
    assert spent["o_rejected"] == Cost(jobs=4, rejected=3, cancelled=1, perception_s=1.5 + (3.2 - 3.0))
    assert spent["o_failed"] == Cost(jobs=4, failed=4)
    assert spent["o_late"] == Cost(jobs=2, failed=1, cancelled=1, perception_s=2.0 + (3.2 - 2.0))
    assert spent["o_voided"].voided >= 1
    assert spent["unneeded"] == Cost()


def test_waiting_for_a_slot_counts_as_cost() -> None:
    model = forest(
        [variable("a"), variable("b")],
        observer("oa", seen("see_a", "a", slots=("one", "two"), min_interval_s=99.0), priority=1),
        observer("ob", seen("see_b", "b", slots=("one",), min_interval_s=99.0)),
        slots={"one": 1, "two": 1},
    )
    clock = SimClock()
    with started(model, World({"see_a": takes(2.0, YES), "see_b": takes(0.5, YES)}), clock) as manager:
        manager.declare("a")
        manager.declare("b")
        clock.sleep(4.0)
        spent = manager.spent()
    assert spent["oa"] == Cost(jobs=1, accepted=1, perception_s=2.0, slot_s=4.0)
    assert spent["ob"] == Cost(jobs=1, accepted=1, waiting_s=2.0, perception_s=0.5, slot_s=0.5)


STEPS = st.lists(
    st.tuples(st.sampled_from(["declare", "withdraw", "near", "far", "sleep"]), st.floats(0.0, 2.0)), max_size=30
)


@settings(max_examples=40, deadline=None)
@drawn(STEPS, st.sampled_from([takes(0.7, YES), takes(0.7, {}), takes(3.0, YES), raises]), st.booleans())
def test_every_job_that_began_has_exactly_one_end(steps: list[tuple[str, float]], find: object, snapshot: bool) -> None:
    find = takes(1.2, YES, snapshot=True) if snapshot else find
    look = seen("eye", "a", when=[value("near")], timeout_s=2.0, slots=("one",))
    model = forest([given("near"), variable("a")], observer("o", look), slots={"one": 1})
    clock = SimClock()
    with started(model, World({"eye": find}), clock) as manager:
        for what, duration_s in [("near", 0.0), ("declare", 0.0), *steps]:
            if what in ("near", "far"):
                manager.set("near", what == "near")
            elif what != "sleep":
                getattr(manager, what)("a")
            clock.sleep(duration_s)
        jobs: list[Event] = list(manager.record.of(Kind.JOB))
    spent = manager.spent()["o"]
    ended = spent.accepted + spent.rejected + spent.voided + spent.failed + spent.cancelled
    assert spent.jobs == ended >= sum(event.what == "started" for event in jobs)
    assert spent.slot_s == spent.perception_s
