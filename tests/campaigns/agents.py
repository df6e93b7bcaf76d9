"""P2's three situations with the agents of the robot's body as processes, each of which is killed once on the way.

python -m tests.campaigns.agents SEED [SITUATION...]

Each mission must end as the spec states, although every agent was killed: the order is closed, the robot waits at the
start, every process was started again, and no task is left without its executor. A run lasts minutes of real time.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from random import Random

from codra_papers.store.agents import AGENTS
from codra_papers.store.layout import START
from codra_papers.store.simulator.store import Store
from tests.papers.experiments.agent_processes import TASKS, KilledRun, Situation, StoreSettings, executor_at_work

SITUATIONS = (Situation.SECOND_ORDER, Situation.PEOPLE_CLOSE, Situation.HIDDEN)
CLOSED = {"done", "aborted", "failed"}
MAX_DURATION_S = 1500.0
KILL_PERIOD_S = 12.0
"""The time between two kills, in which a process starts again and works."""

RESTED_S = 20.0


class Kills:
    """Kills each agent once: the executors in the middle of a task, and the others while the robot is on its way."""

    def __init__(self, seed: int) -> None:
        self._random = Random(f"{seed} kills")
        self._left = sorted(AGENTS)
        self._next_s = 15.0
        self._patience_s = 60.0
        self.closed_since_s = 0.0

    @property
    def are_over(self) -> bool:
        return not self._left

    def choose(self, shop: Store, now_s: float) -> str:
        """Return the agent to be killed now; empty for none."""
        if now_s < self._next_s or not self._left:
            return ""
        agent = executor_at_work(shop)
        if agent not in self._left:
            others = [name for name in self._left if name not in TASKS.values()]
            may_be_idle = now_s > self._next_s + self._patience_s  # an executor that this mission does not need
            agent = self._random.choice(others or (self._left if may_be_idle else [""]))
        if agent:
            self._left.remove(agent)
            self._next_s = now_s + KILL_PERIOD_S
        return agent

    def is_over(self, shop: Store, _: Mapping[str, float]) -> bool:
        """Return whether all agents were killed, all orders are closed, and the robot has rested at the start since."""
        snapshot, robot = shop.knowledge.snapshot(), shop.world.state().robot
        states = [snapshot.get(node.name, "state") for node in snapshot.nodes("order")]
        is_closed = bool(states) and all(state.known and state.value in CLOSED for state in states)
        is_home = robot.at.distance_m(START) < 0.5 and robot.surface_speed_m_s() == 0.0
        if not (self.are_over and is_closed and is_home):
            self.closed_since_s = snapshot.instant_s
        return snapshot.instant_s - self.closed_since_s > RESTED_S


def faults(run: KilledRun) -> list[str]:
    """Return what is wrong with a run; empty if it ended as the spec states."""
    problems: list[str] = []
    if run.run.duration_s >= MAX_DURATION_S:
        problems.append("the mission did not end")
    if set(run.killed_agents) != set(AGENTS):
        problems.append(f"not killed: {sorted(set(AGENTS) - set(run.killed_agents))}")
    if run.restart_count < len(AGENTS):
        problems.append(f"only {run.restart_count} processes were started again")
    if not set(run.run.orders) <= CLOSED:
        problems.append(f"orders: {dict(run.run.orders)}")
    if run.run.score.bumps:
        problems.append(f"{run.run.score.bumps} bumps")
    return problems


def main(seed: int, situations: Sequence[Situation]) -> int:
    """Run some situations; return 1 if one of them did not end as the spec states."""
    result = 0
    for situation in situations:
        with tempfile.TemporaryDirectory() as folder:
            kills = Kills(seed)
            shop = StoreSettings(seed=seed, situation=situation)
            run = KilledRun(Path(folder) / "run.mcap", shop, MAX_DURATION_S, kills.choose, kills.is_over)
        lost_count = sum(run.ends(task).count("executor_lost") for task in TASKS)
        print(
            f"{situation}: {run.run.duration_s:.0f} s, orders {dict(run.run.orders)}, {run.restart_count} restarts, "
            f"{lost_count} tasks whose executor was lost, {run.run.score.bumps} bumps",
            flush=True,
        )
        for fault in faults(run):
            print(f"  {fault}", flush=True)
            result = 1
    return result


if __name__ == "__main__":
    chosen = tuple(Situation(name.replace("-", " ")) for name in sys.argv[2:])
    sys.exit(main(int(sys.argv[1]), chosen or SITUATIONS))
