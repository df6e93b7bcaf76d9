"""A saving is split into parts, and for all decisions the parts add up to the saving."""

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
        held_after_wait={},
        answer=True,
        answered_s=asking_s + waited_s + looked_s,
        waited_s=waited_s,
        looked_s=looked_s,
        source="",
        has_looked=looked_s > 0.0,
        unanswered="",
        wrong={},
        wrong_answer=None,
    )


looks = st.builds(decision, st.just(0.0), st.just(0.0), seconds)
observed_decisions = st.builds(decision, seconds, seconds, st.one_of(st.just(0.0), seconds), is_preview=st.booleans())


@given(st.lists(looks, min_size=1, max_size=12), st.lists(observed_decisions, max_size=12))
def test_the_parts_of_a_saving_add_up_to_the_difference_of_perception_times(
    decisions_without: list[Decision], decisions_with: list[Decision]
) -> None:
    split_saving = saving(decisions_without, decisions_with)

    assert isclose(
        split_saving.saved_s, spent_s(decisions_without) - spent_s(decisions_with), rel_tol=1e-9, abs_tol=1e-6
    )
    assert split_saving.answered + split_saving.fell_back == split_saving.checks == len(decisions_with)


@given(st.lists(looks, min_size=1, max_size=12), st.lists(observed_decisions, max_size=12))
def test_the_first_scenario_equals_the_measurement(
    decisions_without: list[Decision], decisions_with: list[Decision]
) -> None:
    split_saving = saving(decisions_without, decisions_with)
    measured_scenario = scenarios(split_saving)[0]

    assert isclose(measured_scenario.saved_s, split_saving.saved_s, rel_tol=1e-9, abs_tol=1e-6)


def test_two_answers_and_a_look_are_distinguished() -> None:
    without = [decision(0.0, 0.0, 14.0), decision(0.0, 0.0, 16.0), decision(0.0, 0.0, 18.0)]
    observed = [
        decision(0.1, 0.0, 0.0),
        decision(0.1, 3.0, 0.0, is_preview=False),
        decision(0.1, 8.0, 20.0, is_preview=False),
    ]

    split_saving = saving(without, observed)

    assert (split_saving.answered, split_saving.fell_back, split_saving.monitors, split_saving.look_s) == (
        2,
        1,
        2,
        16.0,
    )
    assert (split_saving.spared_s, split_saving.waiting_s, round(split_saving.asking_s, 9)) == (32.0, 11.0, 0.3)
    assert split_saving.other_looks_s == -4.0
    assert split_saving.fewer_s == 0.0
    assert round(split_saving.saved_s, 9) == 32.0 - 11.0 - 0.3 - 4.0


def test_observers_without_knowledge_cost_time_and_those_with_all_knowledge_only_asking() -> None:
    without = [decision(0.0, 0.0, 10.0), decision(0.0, 0.0, 20.0)]
    observed = [decision(0.5, 0.0, 0.0), decision(0.5, 2.0, 0.0, is_preview=False)]

    cases = {case.name: case.saved_s for case in scenarios(saving(without, observed))}

    assert cases["as measured"] == 30.0 - 3.0
    assert cases["looks take half as long"] == 15.0 - 3.0
    assert cases["looks take twice as long"] == 60.0 - 3.0
    assert cases["observers know nothing"] == -1.0 - WAIT_S
    assert cases["observers know everything at once"] == 29.0


def test_without_any_perception_task_the_saving_is_zero_and_has_no_share() -> None:
    split_saving = saving([], [])

    assert split_saving.saved_s == 0.0
    assert split_saving.share is None
    assert {case.share for case in scenarios(split_saving)} == {None}
