"""The separate process of a perception algorithm, as seen by the program."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import weakref
from collections import deque
from typing import IO, Any

from codra_dsl.isolation.messages import Connection
from codra_dsl.isolation.supervisor import LEAVE_MS, STATUS, TERMINATE, TERMINATE_MS

_LOGGER = logging.getLogger("codra_dsl.perception")

_BOOT = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from codra_dsl.isolation.supervisor import main; "
    "main(*map(int, sys.argv[2:5]), sys.argv[5])"
)
_ENDS_WITHIN_S = (LEAVE_MS + TERMINATE_MS) / 1000 + 1.0
_LISTENS_S = 0.5
_CHUNK_BYTES = 8192
_CHUNK_PERIOD_S = 0.05
_NORMAL_END = "ended with exit code 0"
_MAX_LINE = 200


class Process:
    """A process from its start to its end, and the supervisor that ends it (`codra_dsl.isolation.supervisor`).

    The process is spawned, never forked, and shares only a connection with the program. Its output goes to the logger
    `codra_dsl.perception` at a limited rate. A process that writes too much output waits; nothing else waits for it.

    Attributes:
        connection: the connection to the process.
        is_doomed: whether the process was ordered to end.
    """

    def __init__(self, name: str, call: str) -> None:
        """Start the process.

        Args:
            name: the name of the algorithm.
            call: the function or class that the process imports.

        Raises:
            OSError: if the machine cannot start another process.
        """
        message_socket, child_message_socket = socket.socketpair()
        life_socket, child_life_socket = socket.socketpair()
        with child_message_socket, child_life_socket:
            self._supervisor = subprocess.Popen(
                _worker_command(child_message_socket.fileno(), child_life_socket.fileno(), call),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(child_message_socket.fileno(), child_life_socket.fileno()),
                start_new_session=True,
            )
        self.connection = Connection(message_socket)
        self.is_doomed = False
        self._name = name
        self._life_socket = life_socket
        self._ending = threading.Lock()
        self._end: str | None = None
        self._is_terminated = False
        self._last_lines: deque[str] = deque(maxlen=1)
        self._hang_up = weakref.finalize(self, _hang_up, message_socket, life_socket, os.getpid())
        output = self._supervisor.stdout
        assert output is not None
        listener_arguments = (output, name, self._last_lines)
        self._listener = threading.Thread(target=_listen, args=listener_arguments, name="codra-output", daemon=True)
        self._listener.start()

    @property
    def is_silent(self) -> bool:
        """Return whether the process waits for a request, because it has neither ended nor sent a message."""
        poll = select.poll()
        poll.register(self.connection.connection, select.POLLIN)
        return not self.is_doomed and not poll.poll(0)

    def terminate(self) -> None:
        """End the process at once by SIGTERM and then SIGKILL; do not wait for its end."""
        self.is_doomed = self._is_terminated = True
        with contextlib.suppress(OSError):
            self._life_socket.send(TERMINATE, socket.MSG_DONTWAIT)

    def hang_up(self) -> None:
        """Let the process end by itself; its supervisor ends it soon if it does not. Do not wait for its end."""
        self.is_doomed = True
        self._hang_up()

    def wait_for_end(self) -> str:
        """Wait for the end of a process that was ordered to end or has ended; return a text that describes the end."""
        with self._ending:
            if self._end is None:
                self._end = self._wait_for_end()
            return self._end

    def leave(self) -> None:
        """Wait in a separate thread for the end of a process that was ordered to end."""
        threading.Thread(target=self.wait_for_end, name="codra-leaving", daemon=True).start()

    def _wait_for_end(self) -> str:
        status = b""
        with contextlib.suppress(OSError):
            self._life_socket.settimeout(_ENDS_WITHIN_S)
            status = self._life_socket.recv(STATUS.size)
        self.hang_up()
        self._life_socket.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._supervisor.wait(_ENDS_WITHIN_S)
        end_text = _end_text(STATUS.unpack(status)[0]) if len(status) == STATUS.size else "was lost"
        if end_text != _NORMAL_END:
            self._listener.join(_LISTENS_S)
            output_text = f"; it printed last: {self._last_lines[-1]}" if self._last_lines else ""
            # the end of a terminated process is reported as a failed job
            level = logging.INFO if self._is_terminated else logging.WARNING
            _LOGGER.log(level, "the process of perception %r %s%s", self._name, end_text, output_text)
        return end_text


def _worker_command(talk_fd: int, life_fd: int, call: str) -> list[str]:
    numbers = map(str, (talk_fd, life_fd, os.getpid()))
    return [sys.executable, "-P", "-c", _BOOT, json.dumps(list(map(str, sys.path))), *numbers, call]


def _hang_up(message_socket: socket.socket, life_socket: socket.socket, program_pid: int) -> None:
    """Shut down both connections, unless this process inherited them from its parent."""
    if os.getpid() == program_pid:
        for connection, how in ((message_socket, socket.SHUT_RDWR), (life_socket, socket.SHUT_WR)):
            with contextlib.suppress(OSError):
                connection.shutdown(how)
    message_socket.close()


def _end_text(status: int) -> str:
    code: Any = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


def _listen(output: IO[bytes], name: str, last_lines: deque[str]) -> None:
    """Log the output of a process at a limited rate."""
    never = threading.Event()
    with output:
        while data := os.read(output.fileno(), _CHUNK_BYTES):
            lines = [line[:_MAX_LINE].rstrip() for line in data.decode(errors="replace").splitlines()]
            for line in filter(None, lines):
                last_lines.append(line)
                _LOGGER.info("%s: %s", name, line)
            if len(data) == _CHUNK_BYTES:
                never.wait(_CHUNK_PERIOD_S)
