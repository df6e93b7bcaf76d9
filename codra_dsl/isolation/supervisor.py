"""The supervisor of a perception process: it ends the process with all descendants, and reports how the process ended.

The supervisor runs no user code, so it never gets stuck. It is the parent of the process and adopts orphaned
descendants of the process, so no descendant escapes. It watches a connection to the program. When it receives
`TERMINATE` on this connection, it ends the process at once. If the program ends, for any reason, the process has a
short time to end by itself; then the supervisor ends it.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import socket
import struct
import sys
import traceback
from pathlib import Path

TERMINATE = b"T"
WAIT_STATUS = struct.Struct("!i")
"""The format of the status of the ended process, which `os.waitpid` returns."""

EXIT_TIMEOUT_MS = 500
"""How long a process may take to end by itself after the program has closed its connection."""

SIGTERM_TIMEOUT_MS = 300
"""How long a process may take to end after SIGTERM."""

_POLL_PERIOD_MS = 500
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_STANDARD_DESCRIPTORS = (0, 1, 2)


def main(message_fd: int, control_fd: int, program_pid: int, call: str) -> None:
    """Start the process of an algorithm and supervise it until it has ended.

    Args:
        message_fd: the file descriptor of the connection between the process and the program.
        control_fd: the file descriptor of the connection between the supervisor and the program.
        program_pid: the process ID of the program.
        call: the function or class that the process runs.
    """
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    supervisor_pid = os.getpid()
    worker_pid = os.fork()
    if worker_pid == 0:
        os.close(control_fd)
        _become_worker(message_fd, supervisor_pid, call)
    os.close(message_fd)
    _release_standard_streams()
    with contextlib.suppress(OSError):
        os.setpgid(worker_pid, worker_pid)
    control_socket = socket.socket(fileno=control_fd)
    _await_end(worker_pid, control_socket, program_pid)
    _signal_group(worker_pid, signal.SIGKILL)
    status = os.waitpid(worker_pid, 0)[1]
    _kill_orphans()
    with contextlib.suppress(OSError):
        control_socket.sendall(WAIT_STATUS.pack(status))
    os._exit(0)


def _become_worker(message_fd: int, supervisor_pid: int, call: str) -> None:
    """Run the algorithm in this process, in a separate process group."""
    from codra_dsl.isolation.worker import run_worker  # noqa: PLC0415 - the supervisor does not need it

    with contextlib.suppress(OSError):
        os.setpgid(0, 0)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != supervisor_pid:
        os._exit(1)
    with contextlib.suppress(OSError):  # when memory runs out, the perception process is killed before the program
        Path("/proc/self/oom_score_adj").write_text("500", "ascii")
    sys.argv[:] = [call]
    try:
        run_worker(socket.socket(fileno=message_fd), call)
    except BaseException:  # noqa: BLE001 - printed to the log of the process
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    sys.exit(0)


def _await_end(worker_pid: int, control_socket: socket.socket, program_pid: int) -> None:
    """Wait until the process has ended by itself or by SIGTERM, or until SIGKILL was sent to it."""
    worker_pidfd = os.pidfd_open(worker_pid)
    while not (ready := _ready_descriptors(worker_pidfd, control_socket, _POLL_PERIOD_MS)):
        if os.getppid() != program_pid:
            break
    if worker_pidfd in ready:
        return
    command = control_socket.recv(1) if ready else b""
    if command != TERMINATE and _ready_descriptors(worker_pidfd, None, EXIT_TIMEOUT_MS):
        return
    _signal_group(worker_pid, signal.SIGTERM)
    if not _ready_descriptors(worker_pidfd, None, SIGTERM_TIMEOUT_MS):
        _signal_group(worker_pid, signal.SIGKILL)


def _ready_descriptors(worker_pidfd: int, control_socket: socket.socket | None, timeout_ms: int) -> list[int]:
    poll = select.poll()
    poll.register(worker_pidfd, select.POLLIN)
    if control_socket is not None:
        poll.register(control_socket, select.POLLIN)
    return [descriptor for descriptor, _ in poll.poll(timeout_ms)]


def _signal_group(worker_pid: int, signal_number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(worker_pid, signal_number)


def _kill_orphans() -> None:
    """End the orphaned descendants of the process, which are now the supervisor's children, in any process group."""
    children = Path(f"/proc/self/task/{os.getpid()}/children")  # Linux can be built without this file
    with contextlib.suppress(OSError):
        while True:
            for child in map(int, children.read_text("ascii").split()):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
            os.waitpid(-1, 0)


def _release_standard_streams() -> None:
    """Release the standard streams, so that the end of the output pipe marks the end of the process."""
    null_descriptor = os.open(os.devnull, os.O_RDWR)
    for descriptor in _STANDARD_DESCRIPTORS:
        os.dup2(null_descriptor, descriptor)
    os.close(null_descriptor)


def _prctl(option: int, argument: int) -> None:
    ctypes.CDLL(None).prctl(option, argument, 0, 0, 0)
