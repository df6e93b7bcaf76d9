"""The supervisor of a perception process: it ends the process with all descendants, and reports how the process ended.

The supervisor runs no user code, so it never gets stuck. It is the parent of the process and adopts orphaned
descendants of the process, so no descendant escapes. It watches a connection to the program. When it receives
`TERMINATE` on this connection, it ends the process at once. If the program ends, for any reason, the process has a
short time to end by itself; then the supervisor ends it.

The process can send signals to its supervisor. So the supervisor has a parent, the guard, and the two watch each other:
if the supervisor is killed or stopped, the guard ends it, adopts its descendants and ends them; if the guard is killed,
the supervisor ends the process.
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
from typing import NoReturn

from codra_dsl.isolation.error_text import loggable

TERMINATE = b"T"
WAIT_STATUS = struct.Struct("!i")
"""The format of the status of the ended process, which `os.waitpid` returns."""

EXIT_TIMEOUT_MS = 500
"""How long a process may take to end by itself after the program has closed its connection."""

SIGTERM_TIMEOUT_MS = 300
"""How long a process may take to end after SIGTERM."""

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_STANDARD_DESCRIPTORS = (0, 1, 2)


def main(message_fd: int, control_fd: int, program_pid: int, call: str) -> None:
    """Start the supervisor and the process of an algorithm, and guard the supervisor until both have ended.

    Args:
        message_fd: the file descriptor of the connection between the process and the program.
        control_fd: the file descriptor of the connection between the supervisor and the program.
        program_pid: the process ID of the program.
        call: the function or class that the process runs.
    """
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # a program that ignores SIGCHLD passes this on
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    parent_pidfds = (os.pidfd_open(program_pid), os.pidfd_open(os.getpid()))
    if os.getppid() != program_pid:
        os._exit(1)
    supervisor_pid = os.fork()
    if supervisor_pid == 0:
        _supervise(message_fd, control_fd, parent_pidfds, call)
    for descriptor in (message_fd, control_fd, *parent_pidfds):
        os.close(descriptor)
    _release_standard_streams()
    _guard(supervisor_pid)


def _guard(supervisor_pid: int) -> NoReturn:
    """Wait until the supervisor has ended or was stopped; then end it and all processes that it has left."""
    os.waitpid(supervisor_pid, os.WUNTRACED)
    _kill_children()
    os._exit(0)


def _supervise(message_fd: int, control_fd: int, parent_pidfds: tuple[int, int], call: str) -> NoReturn:
    """Start the process of an algorithm, and supervise it until it has ended.

    Args:
        message_fd: the file descriptor of the connection between the process and the program.
        control_fd: the file descriptor of the connection between the supervisor and the program.
        parent_pidfds: file descriptors of the program and of the guard; they are ready when these processes have ended.
        call: the function or class that the process runs.
    """
    guard_pid, supervisor_pid = os.getppid(), os.getpid()
    os.setsid()  # so no signal to a process group reaches both the guard and the supervisor
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGCONT)  # if the process stops the supervisor and kills the guard
    worker_pid = os.fork()
    if worker_pid == 0:
        for descriptor in (control_fd, *parent_pidfds):
            os.close(descriptor)
        _become_worker(message_fd, supervisor_pid, call)
    os.close(message_fd)
    _release_standard_streams()
    with contextlib.suppress(OSError):
        os.setpgid(worker_pid, worker_pid)
    control_socket = socket.socket(fileno=control_fd)
    _await_end(worker_pid, control_socket, parent_pidfds)
    _signal_group(worker_pid, signal.SIGKILL)
    status = os.waitpid(worker_pid, 0)[1]
    _kill_children()
    with contextlib.suppress(OSError):
        control_socket.sendall(WAIT_STATUS.pack(status))
    if os.getppid() == guard_pid:
        os.kill(guard_pid, signal.SIGCONT)  # if the process has stopped it
    os._exit(0)


def _become_worker(message_fd: int, supervisor_pid: int, call: str) -> NoReturn:
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
    except BaseException as error:  # noqa: BLE001 - printed to the log of the process
        traceback.print_exception(loggable(error))
        sys.stderr.flush()
        os._exit(1)
    sys.exit(0)


def _await_end(worker_pid: int, control_socket: socket.socket, parent_pidfds: tuple[int, int]) -> None:
    """Wait until the process has ended by itself or by SIGTERM, or until SIGKILL was sent to it."""
    worker_pidfd = os.pidfd_open(worker_pid)
    ready_descriptors = _ready_descriptors(None, worker_pidfd, control_socket.fileno(), *parent_pidfds)
    if worker_pidfd in ready_descriptors:
        return
    command = control_socket.recv(1) if control_socket.fileno() in ready_descriptors else b""
    if command != TERMINATE and _ready_descriptors(EXIT_TIMEOUT_MS, worker_pidfd):
        return
    _signal_group(worker_pid, signal.SIGTERM)
    if not _ready_descriptors(SIGTERM_TIMEOUT_MS, worker_pidfd):
        _signal_group(worker_pid, signal.SIGKILL)


def _ready_descriptors(timeout_ms: int | None, *descriptors: int) -> list[int]:
    """Wait until at least one of some file descriptors is ready, or the timeout is over; return the ready ones."""
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    return [descriptor for descriptor, _ in poll.poll(timeout_ms)]


def _signal_group(worker_pid: int, signal_number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(worker_pid, signal_number)


def child_pids(pid: int) -> list[int]:
    """Return the process IDs of the children of a process.

    Raises:
        OSError: if there is no such process, or if Linux was built without lists of children.
    """
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text("ascii").split()]


def _kill_children() -> None:
    """End all children of this process, in any process group. Their orphaned descendants become children as well."""
    with contextlib.suppress(OSError):
        while True:
            for child_pid in child_pids(os.getpid()):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child_pid, signal.SIGKILL)
            os.waitpid(-1, 0)


def _release_standard_streams() -> None:
    """Release the standard streams, so that the end of the output pipe marks the end of the process."""
    null_descriptor = os.open(os.devnull, os.O_RDWR)
    for descriptor in _STANDARD_DESCRIPTORS:
        os.dup2(null_descriptor, descriptor)
    os.close(null_descriptor)


def _prctl(option: int, argument: int) -> None:
    ctypes.CDLL(None).prctl(option, argument, 0, 0, 0)
