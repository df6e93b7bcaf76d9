"""Run the tests of the store's situations with other seeds.

Run it with `python -m tests.campaigns.stores [NAME=SEED ...]`. The names are those of `CHECKS`. A run has the duration
of its test, which is long enough for the default seeds; with another seed, a robot may need more time.
"""

from __future__ import annotations

import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from codra_papers.store.simulator.situations import Situation
from tests.papers.store import test_loops_of_the_store as loops
from tests.papers.store.mission.test_trips import check_hidden_trip, check_ordinary_trip, check_trip_of_second_order

DEFAULT_RUNS = (
    *("ordinary=4", "people-close=4", "second-try=6", "hidden=8", "absent=4"),
    *("trip=5", "hidden-trip=7", "second-order-trip=3"),
)


def _check_loops(situation: Situation, check: Callable[[loops.RecordedRuns], None], seed: int) -> None:
    with tempfile.TemporaryDirectory(prefix="codra-stores-") as folder:
        check(loops.RecordedRuns(lambda _: Path(folder), {situation: seed}))


def _check_second_try(seed: int) -> None:
    with tempfile.TemporaryDirectory(prefix="codra-stores-") as folder:
        loops.check_second_try_and_delivery(loops.RecordedRun(Path(folder), Situation.PEOPLE_CLOSE, seed, 293.0))


CHECKS: Mapping[str, Callable[[int], None]] = {
    **{
        situation.name.lower().replace("_", "-"): partial(_check_loops, situation, check)
        for situation, check in {
            Situation.ORDINARY: loops.test_an_ordinary_order_is_delivered_and_counted_as_done,
            Situation.SECOND_ORDER: (
                loops.test_a_container_that_is_full_is_brought_to_the_general_delivery_pose_instead
            ),
            Situation.PEOPLE_CLOSE: loops.test_people_close_make_safety_fall_to_a_half_and_the_pick_up_is_aborted,
            Situation.HIDDEN: loops.test_a_container_that_is_hidden_from_the_first_pose_is_fetched_from_the_second,
            Situation.ABSENT: loops.test_without_a_container_the_base_gets_a_notice_and_the_robot_returns,
        }.items()
    },
    "second-try": _check_second_try,
    "trip": check_ordinary_trip,
    "hidden-trip": check_hidden_trip,
    "second-order-trip": check_trip_of_second_order,
}
"""The checks by name. The trips are driven by a program, the other runs by the loops of specs/store.yaml."""


def main(runs: tuple[str, ...]) -> int:
    """Run the checks; return 1 if one fails."""
    failed_runs = []
    for run in runs:
        name, _, seed = run.partition("=")
        try:
            CHECKS[name](int(seed))
        except Exception:  # noqa: BLE001 - the other seeds are run, too
            traceback.print_exc()
            failed_runs.append(run)
        print(f"{run}: {'failed' if run in failed_runs else 'as tested'}", flush=True)
    return 1 if failed_runs else 0


if __name__ == "__main__":
    sys.exit(main(tuple(sys.argv[1:]) or DEFAULT_RUNS))
