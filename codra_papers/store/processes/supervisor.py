"""Starts the process of each agent, and starts it again when it has ended."""

from __future__ import annotations

import os
import secrets
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

from codra_dsl.runtime import ContextManager
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.remote import Server
from codra_papers.store.agents import AGENTS
from codra_papers.store.body import Body
from codra_papers.store.processes.body_server import BodyServer
from codra_papers.store.processes.program import KEY_VARIABLE

CHECK_PERIOD_S = 0.1
START_TIMEOUT_S = 60.0
END_TIMEOUT_S = 5.0
MAX_FAILED_STARTS = 3
"""How many processes may end before all processes work."""


class AgentStartError(RuntimeError):
    """An agent's process does not work."""


class AgentProcesses:
    """The agents of a body, each in a process of its own.

    Attributes:
        processes: the present process of each agent, by the name of the agent.
        restart_count: how many processes were started again.
    """

    def __init__(
        self,
        codra: ContextManager[Any, Any],
        body: Body,
        clock: Clock,
        package_folder: Path,
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Serve the graph and the body, and start all processes.

        Args:
            codra: the context manager with the graph.
            body: the body.
            clock: the clock of the body, in real time.
            package_folder: the folder of the generated package of the spec.
            report: called with a text when a process has ended and is started again.
        """
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.restart_count = 0
        self._clock = clock
        self._report = report
        self._package_folder = package_folder
        self._folder = tempfile.TemporaryDirectory(prefix="codra-")
        self._key = secrets.token_bytes(32)
        folder = Path(self._folder.name)  # only this user can open it
        self._manager, self._body = folder / "manager.sock", folder / "body.sock"
        self._server = Server(codra, self._manager)
        self._body_server = BodyServer(body, clock, self._body, self._key)
        self._is_closed = False
        for name in AGENTS:
            self.processes[name] = self._start(name)
        self._check()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._is_closed = True
        for process in self.processes.values():
            process.terminate()
        for process in self.processes.values():
            try:
                process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            _close_output(process)
        self._server.close()
        self._body_server.__exit__()
        self._folder.cleanup()

    def wait_until_ready(self, check: Callable[[], None] = lambda: None) -> None:
        """Wait until the process of each agent works.

        Args:
            check: called repeatedly; it may raise an exception to end the wait.

        Raises:
            AgentStartError: if a process does not work within `START_TIMEOUT_S`, or ends again and again.
        """
        end_s = self._clock.now_s() + START_TIMEOUT_S
        for name in AGENTS:
            while not self._read_output(name):
                if self._clock.now_s() > end_s:
                    raise AgentStartError(f"agent {name} does not work within {START_TIMEOUT_S:g} s")
                if self.restart_count > MAX_FAILED_STARTS:
                    raise AgentStartError("the processes of its agents end again and again")
                check()
                self._clock.sleep(CHECK_PERIOD_S)

    def _read_output(self, name: str) -> bytes | None:
        output = self.processes[name].stdout
        return None if output is None else output.read()

    def _start(self, name: str) -> subprocess.Popen[bytes]:
        program = "codra_papers.store.processes.program"
        arguments = (name, str(self._package_folder), str(self._manager), str(self._body))
        process = subprocess.Popen(
            [sys.executable, "-m", program, *arguments],
            env={**os.environ, KEY_VARIABLE: self._key.hex()},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for the supervisor, which ends the processes
        )
        assert process.stdout is not None
        os.set_blocking(process.stdout.fileno(), False)
        return process

    def _check(self) -> None:
        """Start the processes again that have ended; do so again and again."""
        if self._is_closed:
            return
        for name, process in self.processes.items():
            if process.poll() is not None:
                self._report(f"agent {name} has ended (exit code {process.returncode}) and is started again")
                self.processes[name] = self._start(name)
                self.restart_count += 1
                _close_output(process)  # only now, because another thread reads the output of the present process
        self._clock.call_at(self._clock.now_s() + CHECK_PERIOD_S, self._check)


def _close_output(process: subprocess.Popen[bytes]) -> None:
    if process.stdout is not None:
        process.stdout.close()
