"""The times of stages are measured with a clock that is passed as an argument."""

from __future__ import annotations

from codra_dsl.workspace.timings import UNTIMED, Timings


def test_a_table_has_the_stages_the_rest_and_the_total() -> None:
    instants_s = iter([0.0, 1.0, 3.0, 3.0, 4.0, 4.0, 5.0, 8.0])
    timings = Timings(lambda: next(instants_s))

    with timings.stage("load"):
        pass
    with timings.stage("check"):
        pass
    with timings.stage("load"):
        pass

    assert timings.table() == (
        "load        3.000 s  37.5 %\n"
        "check       1.000 s  12.5 %\n"
        "rest        4.000 s  50.0 %\n"
        "total       8.000 s 100.0 %"
    )


def test_without_a_clock_no_time_is_measured() -> None:
    with UNTIMED.stage("load"):
        pass

    assert UNTIMED.table() == ""


def test_a_stage_that_fails_is_measured_too() -> None:
    instants_s = iter([0.0, 1.0, 3.0, 4.0])
    timings = Timings(lambda: next(instants_s))

    try:
        with timings.stage("load"):
            raise KeyError
    except KeyError:
        pass

    assert timings.table().splitlines()[0] == "load        2.000 s  50.0 %"
