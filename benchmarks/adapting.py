"""The row about loops: one round of the loop of `specs/store.yaml`, after the distance of a person has changed.

Our side is a complete round: the new distance is written into context and the knowledge graph, inputs are read with
their stamps, both fuzzy stages are inferred, metrics and weights are written by their agent, the filter and the hard
rules choose the course, the parameter is set, both trees are ticked, and the event log records all of it.

The peer is FuzzyLite for Python with the same rules. Its engines are built once and called with one row per call, as
its documentation shows: two inferences and nothing else. We know no library with a complete loop; a loop based on
FuzzyLite would add the cost of everything else. The weights must be the same on both sides.
"""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from fuzzylite_calls import ROOT, FuzzyLite
from rows import Row

from codra_dsl.compiler import plan_paths
from codra_dsl.language.behavior_trees import NodeKind
from codra_dsl.language.check.checked.loops import CheckedMape
from codra_dsl.language.fuzzy import write_fll
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Result, Robot
from generated import store

PERIOD_S = 0.1
CALM: Mapping[str, tuple[str, float | str]] = {
    "bumped": ("navigation", False),
    "person_distance": ("person_detection", 6.0),
    "picking_up": ("picking", True),
    "order_open": ("mission", True),
    "loaded": ("fork", False),
    "battery_level": ("navigation", 80.0),
    "container_load": ("picker_page", "empty"),
}
"""The agent that writes each input, and the value."""

WARM_UP_S = 130.0
"""The time after which the rate of the battery is known."""

DISTANCES_M = [0.5 + 0.02 * step for step in range(150)]
REFRESHED_EVERY = 10
"""All inputs are written again after this many rounds: before the first one is out of date, and not so often that the
history of the battery, 100 readings, is too short for its rate."""

CALLS = 150
TURNS = 15


def rows(scratch: Path) -> Iterator[Row]:
    """Measure both sides in turns, by processor time."""
    names = [*CALM, "battery_drain"]
    still = [0.0, 0.0, 1.0, 1.0, 0.0, 80.0, 0.0, 0.0]  # as numbers: false, true and the first member are 0, 1 and 0
    contexts = [[still[0], distance_m, *still[2:]] for distance_m in DISTANCES_M]
    (plan,) = plan_paths([ROOT / "specs" / "store.yaml"], ROOT).plans
    mape, clock = plan.checked.mape, SimClock()
    assert mape is not None
    with store.start(clock=clock, resources={}) as codra, store.loops(codra, clock=clock, robot=_robot(mape)):
        agents = {agent: codra.agent(agent) for agent in {agent for agent, _ in CALM.values()}}

        def refresh() -> None:
            for name, (agent, value) in CALM.items():
                agents[agent].set(name, value)

        def approach(distance_m: float) -> None:
            agents["person_detection"].set("person_distance", distance_m)
            clock.sleep(PERIOD_S)

        for _ in range(round(WARM_UP_S)):
            refresh()
            clock.sleep(1.0)
        with FuzzyLite(_engines(scratch, mape), names, contexts) as peer:
            yield _row(peer, refresh, approach, lambda: _weights(codra))


def _row(
    peer: FuzzyLite,
    refresh: Callable[[], None],
    approach: Callable[[float], None],
    weights: Callable[[], list[float]],
) -> Row:
    for call, (distance_m, theirs) in enumerate(zip(DISTANCES_M, peer.weights, strict=True)):
        if call % REFRESHED_EVERY == 0:
            refresh()
        approach(distance_m)
        np.testing.assert_allclose(weights(), theirs, atol=1e-6)
    given = itertools.cycle(DISTANCES_M)
    ours_s, theirs_s = [], []
    for _ in range(TURNS):
        taken_s = 0.0
        for call in range(CALLS):
            if call % REFRESHED_EVERY == 0:
                refresh()  # not part of the round
            distance_m, began_s = next(given), time.process_time()
            approach(distance_m)
            taken_s += time.process_time() - began_s
        ours_s.append(taken_s / CALLS)
        theirs_s.append(peer.scalar_s(CALLS))
    return Row(name="adaptation_round", ours=statistics.median(ours_s), peer=statistics.median(theirs_s), target=1.0)


def _engines(scratch: Path, mape: CheckedMape) -> tuple[Path, Path]:
    """Write the rules of the spec in FLL."""
    assert mape.metrics is not None
    assert mape.actions is not None
    files = (scratch / "metrics.fll", scratch / "actions.fll")
    for file, stage in zip(files, (mape.metrics, mape.actions), strict=True):
        file.write_text(write_fll(stage.engine), "utf-8")
    return files


def _weights(codra: store.Store) -> list[float]:
    return [codra.get(f"weight_of_{action}").value for action in ("pick", "deliver", "start", "dock")]


def _robot(mape: CheckedMape) -> Robot:
    """Return a robot whose actions keep running, and whose conditions never hold."""
    robot = Robot()
    for model in {model.id: model for tree in mape.trees for model in tree.forest.forest.models}.values():
        goes_on = model.kind is NodeKind.ACTION
        robot.does(model.id, lambda _, goes_on=goes_on: Result.RUNNING if goes_on else False)
    return robot
