"""The row about loops: one round of the loop of `specs/store.yaml`, after the distance of a person has changed.

Our side is a complete round: the new distance is written into context and the knowledge graph, inputs are read with
their stamps, both fuzzy stages are inferred, metrics and weights are written by their agent, the filter and the hard
rules choose the course, the parameter is set, both trees are ticked, and the event log records all these steps.

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
INITIAL_INPUTS: Mapping[str, tuple[str, float | str]] = {
    "bumped": ("navigation", False),
    "person_distance": ("person_detection", 6.0),
    "picking_up": ("picking", True),
    "order_open": ("mission", True),
    "loaded": ("fork", False),
    "battery_level": ("navigation", 80.0),
    "container_load": ("picker_page", "empty"),
    "strange_gap": ("lasers", 5.0),
    "pose_spread": ("localisation", 0.03),
    "charging": ("navigation", False),
}
"""For each input, the agent that writes the input, and the value."""

COMPUTED_INPUTS: Mapping[str, float] = {
    "battery_drain": 0.0,
    "people_at_container": 0.0,
    "full_on_fork": 0.0,
    "crowding": 0.0,
}
"""The inputs that the runtime computes, with their values as numbers. The person is near for half of the time at most,
so that `crowding` acts as 0."""

WARM_UP_S = 130.0
"""The time after which the rate of the battery is known."""

DISTANCES_M = [0.5 + 0.02 * step for step in range(150)]
ROUNDS_PER_REFRESH = 10
"""All inputs are written again after this many rounds: before the first input is out of date, but not so often that the
readings in the battery's history are too few for the battery's rate."""

CALLS_PER_TURN = 150
TURNS = 15


def rows(scratch: Path) -> Iterator[Row]:
    """Measure both sides in turns, by processor time."""
    names = [*INITIAL_INPUTS, *COMPUTED_INPUTS]
    # As numbers, false, true and the first member are 0, 1 and 0.
    initial_values = [0.0, 0.0, 1.0, 1.0, 0.0, 80.0, 0.0, 5.0, 0.03, 0.0, *COMPUTED_INPUTS.values()]
    contexts = [[initial_values[0], distance_m, *initial_values[2:]] for distance_m in DISTANCES_M]
    (plan,) = plan_paths([ROOT / "specs" / "store.yaml"], ROOT).plans
    mape, clock = plan.checked.mape, SimClock()
    assert mape is not None
    with store.start(clock=clock, resources={}) as codra, store.loops(codra, clock=clock, robot=_robot(mape)):
        agents = {agent: codra.agent(agent) for agent in {agent for agent, _ in INITIAL_INPUTS.values()}}

        def refresh() -> None:
            for name, (agent, value) in INITIAL_INPUTS.items():
                agents[agent].set(name, value)

        def approach(distance_m: float) -> None:
            agents["person_detection"].set("person_distance", distance_m)
            clock.sleep(PERIOD_S)

        for _ in range(round(WARM_UP_S)):
            refresh()
            clock.sleep(1.0)
        with FuzzyLite(_engines(scratch, mape), names, contexts) as fuzzylite:
            yield _row(fuzzylite, refresh, approach, lambda: _weights(codra))


def _row(
    fuzzylite: FuzzyLite,
    refresh: Callable[[], None],
    approach: Callable[[float], None],
    weights: Callable[[], list[float]],
) -> Row:
    for call, (distance_m, their_weights) in enumerate(zip(DISTANCES_M, fuzzylite.weights, strict=True)):
        if call % ROUNDS_PER_REFRESH == 0:
            refresh()
        approach(distance_m)
        np.testing.assert_allclose(weights(), their_weights, atol=1e-6)
    distance_cycle = itertools.cycle(DISTANCES_M)
    ours_s, theirs_s = [], []
    for _ in range(TURNS):
        total_s = 0.0
        for call in range(CALLS_PER_TURN):
            if call % ROUNDS_PER_REFRESH == 0:
                refresh()  # not part of the round
            distance_m, start_s = next(distance_cycle), time.process_time()
            approach(distance_m)
            total_s += time.process_time() - start_s
        ours_s.append(total_s / CALLS_PER_TURN)
        theirs_s.append(fuzzylite.scalar_s(CALLS_PER_TURN))
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
    """Return a robot on which actions never end and conditions are never true."""
    robot = Robot()
    for model in {model.id: model for tree in mape.trees for model in tree.forest.forest.models}.values():
        is_action = model.kind is NodeKind.ACTION
        robot.does(model.id, lambda _, is_action=is_action: Result.RUNNING if is_action else False)
    return robot
