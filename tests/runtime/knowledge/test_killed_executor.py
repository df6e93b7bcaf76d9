"""An executor in its own process is killed at every step of the handshake, in real time."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading

import pytest

from codra_dsl.runtime import WallClock
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge, Request, Stage
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel, NodeModel, NodeTypeModel, TaskModel, absent, path

PATIENCE_S = 60.0

MODEL = KnowledgeModel(
    name="one_task",
    node_types=(NodeTypeModel(name="robot"),),
    nodes=(NodeModel(name="robot", type="robot"),),
    tasks=(
        TaskModel(
            name="detecting",
            origin="robot",
            by="worker",
            requesters=("ann",),
            results=("found", "lost"),
            acknowledge_s=3.0,
            finish_s=3.0,
        ),
    ),
)

DETECTOR = """
import sys
print("ready", flush=True)
for asked in sys.stdin:
    print("acknowledge", flush=True)
    sys.stdin.readline()
    print("finish", flush=True)
"""


class Worker:
    """The executor: it takes the steps that its process requests, and none after the process has died."""

    def __init__(self, handle: AgentHandle) -> None:
        self._handle = handle
        self._process = subprocess.Popen(
            [sys.executable, "-c", DETECTOR], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def take(self, request: Request, steps: int) -> threading.Thread:
        """Send a request to the process, which is killed after some steps; return the thread that listens to it."""
        thread = threading.Thread(target=self._listen, args=(request, steps))
        thread.start()
        return thread

    def _listen(self, request: Request, steps: int) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        take = {
            "acknowledge": self._handle.acknowledge,
            "finish": lambda request: self._handle.finish(request, "found"),
        }
        for _ in range(steps):
            self._process.stdin.write("go on\n")
            self._process.stdin.flush()
            take[self._process.stdout.readline().strip()](request)
        self._process.kill()
        assert self._process.wait(PATIENCE_S) == -signal.SIGKILL
        self._process.stdin.close()
        self._process.stdout.close()
        self._handle.close()


@pytest.mark.parametrize(
    ("steps", "stage", "reason", "result"),
    [
        (0, Stage.ABORTED, "unacknowledged", None),
        (1, Stage.ABORTED, "overdue", None),
        (2, Stage.FINISHED, "", "found"),
    ],
)
def test_a_task_of_a_killed_executor_ends_at_its_deadline_and_can_be_requested_again(
    steps: int, stage: Stage, reason: str, result: str | None
) -> None:
    knowledge = Knowledge(MODEL, clock=(clock := WallClock()))
    ann = knowledge.as_agent("ann")
    worker = Worker(knowledge.as_agent("worker"))
    listening = worker.take(ann.request("detecting"), steps)
    assert knowledge.wait_for(path("robot", str(stage), "detecting"), timeout_s=PATIENCE_S)
    listening.join(PATIENCE_S)
    seen = knowledge.snapshot()
    handover = seen.handover("detecting")
    assert (handover.stage, handover.reason, handover.result) == (stage, reason, result)
    assert seen.holds(absent("robot", "wants", "detecting"), absent("robot", "is", "detecting"))
    assert seen.get("detecting", "reason").content == (reason or None)

    again = ann.request("detecting")
    with knowledge.as_agent("worker") as another:
        another.acknowledge(again)
        another.finish(again, "lost")
    assert (again.number, knowledge.get("detecting", "result").value) == (2, "lost")
    clock.close()
