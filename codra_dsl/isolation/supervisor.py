"""The supervisor of a perception process: it ends the process and all its descendants, and reports how it ended.

The supervisor runs no user code, so it never gets stuck. It is the parent of the process and adopts its orphans, so no
descendant escapes. It watches a connection to the program. `TERMINATE` on this connection ends the process at once. If
the program ends, for any reason, the process has a short time to end by itself, and is then ended too.
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
STATUS = struct.Struct("!i")
"""How the process ended, as returned by `os.waitpid`."""

LEAVE_MS = 500
"""How long a process may take to end by itself once the program hangs up."""

TERMINATE_MS = 300
"""How long a process may take to end after SIGTERM."""

_POLL_MS = 500
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_STANDARD_STREAMS = (0, 1, 2)


def main(talk_fd: int, life_fd: int, program: int, call: str) -> None:
    """Start the process of an algorithm and supervise it until it has ended.

    Args:
        talk_fd: the connection between the process and the program.
        life_fd: the connection between the supervisor and the program.
        program: the process ID of the program.
        call: the function or class that the process runs.
    """
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    supervisor = os.getpid()
    worker = os.fork()
    if worker == 0:
        os.close(life_fd)
        _work(talk_fd, supervisor, call)
    os.close(talk_fd)
    _release_output()
    with contextlib.suppress(OSError):
        os.setpgid(worker, worker)
    life = socket.socket(fileno=life_fd)
    _await_end(worker, life, program)
    _signal_group(worker, signal.SIGKILL)
    status = os.waitpid(worker, 0)[1]
    _end_rest()
    with contextlib.suppress(OSError):
        life.sendall(STATUS.pack(status))
    os._exit(0)


def _work(talk_fd: int, supervisor: int, call: str) -> None:
    """Become the process, in a separate process group."""
    from codra_dsl.isolation.worker import work  # noqa: PLC0415 - the supervisor does not need it

    with contextlib.suppress(OSError):
        os.setpgid(0, 0)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != supervisor:
        os._exit(1)
    with contextlib.suppress(OSError):  # when memory runs out, the perception process is killed before the program
        Path("/proc/self/oom_score_adj").write_text("500", "ascii")
    sys.argv[:] = [call]
    try:
        work(socket.socket(fileno=talk_fd), call)
    except BaseException:  # noqa: BLE001 - printed to the log of the process
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    sys.exit(0)


def _await_end(worker: int, life: socket.socket, program: int) -> None:
    """Return once the process has ended, by itself or after an order, or once the last signal was sent to it."""
    end_descriptor = os.pidfd_open(worker)
    while not (ready := _ready_descriptors(end_descriptor, life, _POLL_MS)):
        if os.getppid() != program:
            break
    if end_descriptor in ready:
        return
    order = life.recv(1) if ready else b""
    if order != TERMINATE and _ready_descriptors(end_descriptor, None, LEAVE_MS):
        return
    _signal_group(worker, signal.SIGTERM)
    if not _ready_descriptors(end_descriptor, None, TERMINATE_MS):
        _signal_group(worker, signal.SIGKILL)


def _ready_descriptors(end_descriptor: int, life: socket.socket | None, timeout_ms: int) -> list[int]:
    poll = select.poll()
    poll.register(end_descriptor, select.POLLIN)
    if life is not None:
        poll.register(life, select.POLLIN)
    return [descriptor for descriptor, _ in poll.poll(timeout_ms)]


def _signal_group(worker: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(worker, number)


def _end_rest() -> None:
    """End the orphans of the process in any process group. They are now the supervisor's children."""
    children = Path(f"/proc/self/task/{os.getpid()}/children")  # Linux can be built without this file
    with contextlib.suppress(OSError):
        while True:
            for child in map(int, children.read_text("ascii").split()):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
            os.waitpid(-1, 0)


def _release_output() -> None:
    """Release the standard streams, so that the end of the output pipe marks the end of the process."""
    null_device = os.open(os.devnull, os.O_RDWR)
    for standard_stream in _STANDARD_STREAMS:
        os.dup2(null_device, standard_stream)
    os.close(null_device)


def _prctl(option: int, argument: int) -> None:
    ctypes.CDLL(None).prctl(option, argument, 0, 0, 0)
