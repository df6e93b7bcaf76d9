"""How old evidence becomes before newer evidence replaces it: the bounds on which CDR7108 relies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from codra_dsl.runtime import SimClock
from tests.runtime.forests import World, forest, observer, seen, started, variable

JUST_IN_TIME = 0.999
"""The share of the timeout that the longest looks take."""


def max_age_s(
    period_s: float, min_interval_s: float, timeout_s: float, shares: Sequence[float], *, is_early: bool
) -> float:
    """Return the largest age of evidence at its renewal, for looks that take shares of the timeout.

    If `is_early` is true, the function states that its evidence is from the beginning of the look.
    """

    def find(job: Any) -> dict[str, bool]:
        if is_early:
            job.evidence(job.now_s(), job.now_s())
        job.sleep(shares[job.index % len(shares)] * timeout_s)
        return {"seen": True}

    look = seen("find", "x", timeout_s=timeout_s, min_interval_s=min_interval_s)
    clock = SimClock()
    with started(forest([variable("x")], observer("watch", look, period_s=period_s)), World({"find": find}), clock) as (
        manager
    ):
        manager.declare("x")
        clock.sleep(40.0)
        readings = [reading for reading in manager.history("x") if reading.known]
    assert len(readings) > 3
    return max(later.identified_s - earlier.evidence_s for earlier, later in pairwise(readings))


@given(
    period_s=st.sampled_from([0.5, 1.0, 3.0]),
    min_interval_s=st.sampled_from([0.0, 2.0]),
    timeout_s=st.sampled_from([0.5, 2.0, 4.0]),
    shares=st.lists(st.floats(0.01, JUST_IN_TIME), min_size=1, max_size=6),
    is_early=st.booleans(),
)
@example(period_s=1.0, min_interval_s=0.0, timeout_s=4.0, shares=[JUST_IN_TIME], is_early=True)
def test_evidence_is_renewed_within_the_pause_and_a_timeout_or_within_two_timeouts_if_it_is_early(
    *, period_s: float, min_interval_s: float, timeout_s: float, shares: list[float], is_early: bool
) -> None:
    pause_s = max(period_s, min_interval_s)
    limit_s = (max(pause_s, timeout_s) if is_early else pause_s) + timeout_s

    assert max_age_s(period_s, min_interval_s, timeout_s, shares, is_early=is_early) < limit_s


@pytest.mark.parametrize(
    ("timeout_s", "shares", "is_early", "limit_s"),
    [
        (4.0, [0.001, JUST_IN_TIME], False, 5.0),
        (0.5, [0.001, JUST_IN_TIME], False, 1.5),
        (4.0, [JUST_IN_TIME], True, 8.0),
        (0.5, [JUST_IN_TIME], True, 1.5),
    ],
)
def test_the_bounds_are_reached(timeout_s: float, shares: list[float], is_early: bool, limit_s: float) -> None:
    age_s = max_age_s(1.0, 0.0, timeout_s, shares, is_early=is_early)

    assert limit_s - 0.02 < age_s < limit_s
