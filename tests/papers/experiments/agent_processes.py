"""Runs of the store with agents as processes, which are killed on the way."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from pathlib import Path

from codra_dsl.runtime.journal import Event
from codra_papers.experiments.store.run import (
    CompiledSpec,
    ProcessSettings,
    StoreRun,
    StoreRunSettings,
    run_store,
)
from codra_papers.store.processes.supervisor import AgentProcesses
from codra_papers.store.simulator.situations import Situation, StoreSettings
from codra_papers.store.simulator.store import Store
from generated import store
from tests.runtime.journal.journals import read

TASKS = {
    "navigating": "navigation",
    "detecting": "container_detection",
    "rotating": "turning",
    "checking": "wheel_check",
    "lifting": "fork",
    "lowering": "fork",
}
"""The tasks of the processes, with their executors."""


class KilledRun:
    """A run with agents as processes, and the events in its journal.

    Attributes:
        killed_agents: the agents that were killed, with the instants of the kills.
        restart_count: how many processes were started again.
        shop: the shop at the end of the run.
    """

    def __init__(
        self,
        journal: Path,
        shop: StoreSettings,
        duration_s: float,
        kill: Callable[[Store, float], str],
        is_over: Callable[[Store, Mapping[str, float]], bool],
    ) -> None:
        """Run the store.

        Args:
            journal: the file of the journal.
            shop: the situation and the seed.
            duration_s: the longest duration of the run.
            kill: called ten times a second; returns the agent whose process is killed now, or an empty text.
            is_over: returns whether the run ends now.
        """
        self.killed_agents: dict[str, float] = {}
        self._processes: list[AgentProcesses] = []
        self._stores: list[Store] = []
        self._kill, self._is_over = kill, is_over
        settings = StoreRunSettings(
            shop=shop,
            duration_s=duration_s,
            journal=journal,
            progress=self._act,
            on_opened=self._stores.append,
            is_over=lambda: is_over(self._stores[0], self.killed_agents),
            processes=ProcessSettings(on_started=self._processes.append),
        )
        self.run: StoreRun = run_store(CompiledSpec.of(store), settings)
        self.shop = self._stores[0]
        self.restart_count = self._processes[0].restart_count
        self.events: list[Event] = list(read(journal)[1])

    def _act(self, now_s: float) -> None:
        if not self._stores:
            return
        agent = self._kill(self._stores[0], now_s)
        if agent and agent not in self.killed_agents:
            self.killed_agents[agent] = now_s
            self._processes[0].processes[agent].send_signal(signal.SIGKILL)

    def ends(self, task: str) -> list[str]:
        """Return the results of a task, and the reasons of its abortions, in order."""
        return [
            str(event.details.get("result") or event.details.get("message"))
            for event in self.events
            if event.name == task and event.what in ("finished", "aborted")
        ]


def executor_at_work(shop: Store) -> str:
    """Return an agent that executes a task now; empty if none does."""
    snapshot = shop.knowledge.snapshot()
    return next((agent for task, agent in TASKS.items() if snapshot.handover(task).stage == "is"), "")


__all__ = ["KilledRun", "Situation", "StoreSettings", "executor_at_work"]
