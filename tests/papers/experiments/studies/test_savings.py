"""A saving, taken apart: its parts add up to what was saved, whatever the decisions were."""

from __future__ import annotations

from math import isclose

from hypothesis import given
from hypothesis import strategies as st

from codra_papers.experiments.lab.outcomes import Decision
from codra_papers.experiments.studies.lab_runtime.executions import spent_s
from codra_papers.experiments.studies.lab_runtime.savings import saving, scenarios
from codra_papers.lab.mission import WAIT_S

seconds = st.floats(0.0, 100.0)


def decision(asking_s: float, waited_s: float, looked_s: float, *, is_preview: bool = True) -> Decision:
    return Decision(
        instant_s=0.0,
        variable="pcr_cycler_open",
        skill="open_pcr_cycler",
        is_preview=is_preview,
        truth=True,
        held={},
        fresh={},
        answer=True,
        answered_s=asking_s + waited_s + looked_s,
        waited_s=waited_s,
        looked_s=looked_s,
        has_looked=looked_s > 0.0,
        unanswered="",
        wrong={},
        wrong_answer=None,
    )


looks = st.builds(decision, st.just(0.0), st.just(0.0), seconds)
asked = st.builds(decision, seconds, seconds, st.one_of(st.just(0.0), seconds), is_preview=st.booleans())


@given(st.lists(looks, min_size=1, max_size=12), st.lists(asked, max_size=12))
def test_the_parts_of_a_saving_add_up_to_the_difference_of_perception_times(
    without: list[Decision], observed: list[Decision]
) -> None:
    found = saving(without, observed)

    assert isclose(found.saved_s, spent_s(without) - spent_s(observed), rel_tol=1e-9, abs_tol=1e-6)
    assert found.answered + found.fell_back == found.checks == len(observed)


@given(st.lists(looks, min_size=1, max_size=12), st.lists(asked, max_size=12))
def test_the_first_scenario_is_what_was_measured(without: list[Decision], observed: list[Decision]) -> None:
    found = saving(without, observed)
    measured = scenarios(found)[0]

    assert isclose(measured.saved_s, found.saved_s, rel_tol=1e-9, abs_tol=1e-6)


def test_two_answers_and_a_look_are_told_apart() -> None:
    without = [decision(0.0, 0.0, 14.0), decision(0.0, 0.0, 16.0), decision(0.0, 0.0, 18.0)]
    observed = [
        decision(0.1, 0.0, 0.0),
        decision(0.1, 3.0, 0.0, is_preview=False),
        decision(0.1, 8.0, 20.0, is_preview=False),
    ]

    found = saving(without, observed)

    assert (found.answered, found.fell_back, found.monitors, found.look_s) == (2, 1, 2, 16.0)
    assert (found.spared_s, found.waiting_s, round(found.asking_s, 9)) == (32.0, 11.0, 0.3)
    assert found.other_looks_s == -4.0
    assert found.fewer_s == 0.0
    assert round(found.saved_s, 9) == 32.0 - 11.0 - 0.3 - 4.0


def test_observers_that_know_nothing_cost_time_and_those_that_know_all_only_asking() -> None:
    without = [decision(0.0, 0.0, 10.0), decision(0.0, 0.0, 20.0)]
    observed = [decision(0.5, 0.0, 0.0), decision(0.5, 2.0, 0.0, is_preview=False)]

    cases = {case.name: case.saved_s for case in scenarios(saving(without, observed))}

    assert cases["as measured"] == 30.0 - 3.0
    assert cases["looks take half as long"] == 15.0 - 3.0
    assert cases["looks take twice as long"] == 60.0 - 3.0
    assert cases["observers know nothing"] == -1.0 - WAIT_S
    assert cases["observers know everything at once"] == 29.0


def test_without_any_perception_task_nothing_is_saved_and_no_share_is_told() -> None:
    found = saving([], [])

    assert found.saved_s == 0.0
    assert found.share is None
    assert {case.share for case in scenarios(found)} == {None}
