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
from codra_dsl.isolation.supervisor import EXIT_TIMEOUT_MS, SIGTERM_TIMEOUT_MS, TERMINATE, WAIT_STATUS, child_pids
from codra_dsl.runtime.forks import new_lock

_LOGGER = logging.getLogger("codra_dsl.perception")

_BOOT_CODE = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from codra_dsl.isolation.supervisor import main; "
    "main(*map(int, sys.argv[2:5]), sys.argv[5])"
)
_END_TIMEOUT_S = (EXIT_TIMEOUT_MS + SIGTERM_TIMEOUT_MS) / 1000 + 1.0
_LISTENER_TIMEOUT_S = 0.5
_CHUNK_BYTES = 8192
_CHUNK_PERIOD_S = 0.05
_NORMAL_END_TEXT = "ended with exit code 0"
_LOST_TEXT = "ended, because its supervisor was stopped or killed"
_INHERITED_TEXT = "belongs to the program of which this program is a fork"
_MAX_LINE_CHARACTERS = 200


class Process:
    """A process from its start to its end, and the supervisor that ends it (`codra_dsl.isolation.supervisor`).

    The process is spawned, never forked, and shares only a connection with the program. Its output goes to the logger
    `codra_dsl.perception` at a limited rate. A process that writes too much output has to
    wait, but the program does not wait for it.

    If the program forks itself, the process belongs only to the parent: the child can neither use nor end it.

    Attributes:
        is_ending: whether the process was ordered to end.
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
        control_socket, child_control_socket = socket.socketpair()
        with child_message_socket, child_control_socket:
            self._guard = subprocess.Popen(
                _guard_command(child_message_socket.fileno(), child_control_socket.fileno(), call),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(child_message_socket.fileno(), child_control_socket.fileno()),
                start_new_session=True,
            )
        self.is_ending = False
        self._connection = Connection(message_socket)
        self._program_pid = os.getpid()
        self._name = name
        self._control_socket = control_socket
        self._end_lock = new_lock()
        self._end_text: str | None = None
        self._is_terminated = False
        self._last_lines: deque[str] = deque(maxlen=1)
        self._shut_down_sockets = weakref.finalize(
            self, _shut_down_sockets, message_socket, control_socket, os.getpid()
        )
        output = self._guard.stdout
        assert output is not None
        listener_arguments = (output, name, self._last_lines)
        self._listener = threading.Thread(target=_log_output, args=listener_arguments, name="codra-output", daemon=True)
        self._listener.start()

    @property
    def connection(self) -> Connection:
        """Return the connection to the process.

        Raises:
            EOFError: if this program is a fork of the program that started the process.
        """
        if self._is_inherited:
            raise EOFError(_INHERITED_TEXT)
        return self._connection

    @property
    def is_idle(self) -> bool:
        """Return whether the process waits for a request, because it has neither ended nor sent a message."""
        if self._is_inherited or self.is_ending:
            return False
        poll = select.poll()
        poll.register(self._connection.socket, select.POLLIN)
        return not poll.poll(0)

    @property
    def _is_inherited(self) -> bool:
        return os.getpid() != self._program_pid

    def terminate(self) -> None:
        """End the process at once by SIGTERM and then SIGKILL; do not wait for its end."""
        self.is_ending = self._is_terminated = True
        if self._is_inherited:
            return
        with contextlib.suppress(OSError):
            self._control_socket.send(TERMINATE, socket.MSG_DONTWAIT)

    def hang_up(self) -> None:
        """Close the connections: the process ends itself or, a little later, its supervisor ends it. Do not wait."""
        self.is_ending = True
        self._shut_down_sockets()

    def wait_for_end(self) -> str:
        """Wait for the end of a process that was ordered to end or has ended; return a text that describes the end."""
        if self._is_inherited:
            return _INHERITED_TEXT
        with self._end_lock:
            if self._end_text is None:
                self._end_text = self._wait_for_end()
            return self._end_text

    def wait_for_end_in_background(self) -> None:
        """Wait in a separate thread for the end of a process that was ordered to end."""
        threading.Thread(target=self.wait_for_end, name="codra-leaving", daemon=True).start()

    def _wait_for_end(self) -> str:
        status = b""
        with contextlib.suppress(OSError):
            self._control_socket.settimeout(_END_TIMEOUT_S)
            status = self._control_socket.recv(WAIT_STATUS.size)
        self.hang_up()
        self._control_socket.close()
        self._end_guard()
        end_text = _describe_end(WAIT_STATUS.unpack(status)[0]) if len(status) == WAIT_STATUS.size else _LOST_TEXT
        if end_text != _NORMAL_END_TEXT:
            self._listener.join(_LISTENER_TIMEOUT_S)
            output_text = f"; it printed last: {self._last_lines[-1]}" if self._last_lines else ""
            # the end of a terminated process is reported as a failed job
            level = logging.INFO if self._is_terminated else logging.WARNING
            _LOGGER.log(level, "the process of perception %r %s%s", self._name, end_text, output_text)
        return end_text

    def _end_guard(self) -> None:
        """Wait until the guard has ended. It first ends all other processes."""
        self._guard.send_signal(signal.SIGCONT)  # a process that stops both its guard and its supervisor
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._guard.wait(_END_TIMEOUT_S)
            return
        _kill_tree(self._guard.pid)  # a process that stops its guard and its supervisor again and again
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._guard.wait(_END_TIMEOUT_S)


def _kill_tree(pid: int) -> None:
    """Kill a process and its descendants, the descendants first."""
    with contextlib.suppress(OSError):
        for child_pid in child_pids(pid):
            _kill_tree(child_pid)
    with contextlib.suppress(OSError):
        os.kill(pid, signal.SIGKILL)


def _guard_command(message_fd: int, control_fd: int, call: str) -> list[str]:
    number_arguments = map(str, (message_fd, control_fd, os.getpid()))
    return [sys.executable, "-P", "-c", _BOOT_CODE, json.dumps(list(map(str, sys.path))), *number_arguments, call]


def _shut_down_sockets(message_socket: socket.socket, control_socket: socket.socket, program_pid: int) -> None:
    """Shut down both connections, unless this process inherited them from its parent."""
    if os.getpid() == program_pid:
        for open_socket, how in ((message_socket, socket.SHUT_RDWR), (control_socket, socket.SHUT_WR)):
            with contextlib.suppress(OSError):
                open_socket.shutdown(how)
    message_socket.close()


def _describe_end(status: int) -> str:
    code: Any = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


def _log_output(output: IO[bytes], name: str, last_lines: deque[str]) -> None:
    """Log the output of a process at a limited rate."""
    unset_event = threading.Event()
    with output:
        while data := os.read(output.fileno(), _CHUNK_BYTES):
            lines = [line[:_MAX_LINE_CHARACTERS].rstrip() for line in data.decode(errors="replace").splitlines()]
            for line in filter(None, lines):
                last_lines.append(line)
                _LOGGER.info("%s: %s", name, line)
            if len(data) == _CHUNK_BYTES:
                unset_event.wait(_CHUNK_PERIOD_S)
