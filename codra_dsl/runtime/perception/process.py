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
_WELL = "ended with exit code 0"
_MAX_LINE = 200


class Process:
    """A process from its start to its end, and the supervisor that ends it (`codra_dsl.isolation.supervisor`).

    It is spawned, never forked, and shares only a connection with the program. Its output goes to the logger
    `codra_dsl.perception` at a limited rate: if a process floods its output, only this process waits.

    Attributes:
        connection: the connection to the process.
        is_doomed: whether the process was ordered to end.
    """

    def __init__(self, name: str, call: str) -> None:
        """Start it.

        Args:
            name: the name of the algorithm.
            call: the function or class that the process imports.

        Raises:
            OSError: if the machine cannot start another process.
        """
        talk, their_talk = socket.socketpair()
        life, their_life = socket.socketpair()
        with their_talk, their_life:
            self._supervisor = subprocess.Popen(
                _command(their_talk.fileno(), their_life.fileno(), call),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(their_talk.fileno(), their_life.fileno()),
                start_new_session=True,
            )
        self.connection = Connection(talk)
        self.is_doomed = False
        self._name = name
        self._life = life
        self._ending = threading.Lock()
        self._how: str | None = None
        self._is_terminated = False
        self._printed: deque[str] = deque(maxlen=1)
        self._hang_up = weakref.finalize(self, _hang_up, talk, life, os.getpid())
        output = self._supervisor.stdout
        assert output is not None
        listening = (output, name, self._printed)
        self._listener = threading.Thread(target=_listen, args=listening, name="codra-output", daemon=True)
        self._listener.start()

    @property
    def is_silent(self) -> bool:
        """Return whether the process waits for a request: it has neither ended nor sent a message."""
        poll = select.poll()
        poll.register(self.connection.connection, select.POLLIN)
        return not self.is_doomed and not poll.poll(0)

    def terminate(self) -> None:
        """End the process at once, by SIGTERM, then by SIGKILL, without waiting."""
        self.is_doomed = self._is_terminated = True
        with contextlib.suppress(OSError):
            self._life.send(TERMINATE, socket.MSG_DONTWAIT)

    def hang_up(self) -> None:
        """Let the process end by itself, or be ended soon, without waiting."""
        self.is_doomed = True
        self._hang_up()

    def ended(self) -> str:
        """Wait for the end of the process, and return a text that describes how it ended."""
        with self._ending:
            if self._how is None:
                self._how = self._awaited_end()
            return self._how

    def leave(self) -> None:
        """Wait in a separate thread for the end of a process that was ordered to end."""
        threading.Thread(target=self.ended, name="codra-leaving", daemon=True).start()

    def _awaited_end(self) -> str:
        status = b""
        with contextlib.suppress(OSError):
            self._life.settimeout(_ENDS_WITHIN_S)
            status = self._life.recv(STATUS.size)
        self.hang_up()
        self._life.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._supervisor.wait(_ENDS_WITHIN_S)
        how = _described(STATUS.unpack(status)[0]) if len(status) == STATUS.size else "was lost"
        if how != _WELL:
            self._listener.join(_LISTENS_S)
            printed = f"; it printed last: {self._printed[-1]}" if self._printed else ""
            level = (
                logging.INFO if self._is_terminated else logging.WARNING
            )  # a terminated process is reported as a failed job
            _LOGGER.log(level, "the process of perception %r %s%s", self._name, how, printed)
        return how


def _command(talk_fd: int, life_fd: int, call: str) -> list[str]:
    numbers = map(str, (talk_fd, life_fd, os.getpid()))
    return [sys.executable, "-P", "-c", _BOOT, json.dumps(list(map(str, sys.path))), *numbers, call]


def _hang_up(talk: socket.socket, life: socket.socket, program: int) -> None:
    """Shut down both connections, unless this process inherited them from its parent."""
    if os.getpid() == program:
        for connection, how in ((talk, socket.SHUT_RDWR), (life, socket.SHUT_WR)):
            with contextlib.suppress(OSError):
                connection.shutdown(how)
    talk.close()


def _described(status: int) -> str:
    code: Any = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


def _listen(output: IO[bytes], name: str, printed: deque[str]) -> None:
    """Log the output of a process at a limited rate."""
    never = threading.Event()
    with output:
        while data := os.read(output.fileno(), _CHUNK_BYTES):
            lines = [connection[:_MAX_LINE].rstrip() for connection in data.decode(errors="replace").splitlines()]
            for connection in filter(None, lines):
                printed.append(connection)
                _LOGGER.info("%s: %s", name, connection)
            if len(data) == _CHUNK_BYTES:
                never.wait(_CHUNK_PERIOD_S)
