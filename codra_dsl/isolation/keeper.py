"""The keeper of a perception process: it ends the process, and all that this one started, and tells how it ended.

The keeper runs nothing of the user's, so it is never stuck, and it is the parent of the process and of its orphans, so
none of them escapes. It watches a connection to the program: `TERMINATE` on it ends the process at once, and so does,
after a moment in which the process may end by itself, the end of the program, however that comes about.
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
"""How the process ended, as `os.waitpid` tells it."""

LEAVE_MS = 500
"""How long a process may take to end by itself once the program hangs up."""

TERMINATE_MS = 300
"""How long it may take after SIGTERM."""

_LOOK_MS = 500
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_STANDARD = (0, 1, 2)


def main(talk_fd: int, life_fd: int, program: int, call: str) -> None:
    """Start the process of an algorithm and keep it until it has ended.

    Args:
        talk_fd: the connection between the process and the program.
        life_fd: the connection between the keeper and the program.
        program: the number of the program's process.
        call: what the process runs.
    """
    signal.pthread_sigmask(signal.SIG_SETMASK, [])
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    keeper = os.getpid()
    worker = os.fork()
    if worker == 0:
        os.close(life_fd)
        _work(talk_fd, keeper, call)
    os.close(talk_fd)
    _let_go_of_output()
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


def _work(talk_fd: int, keeper: int, call: str) -> None:
    """Be the process, in a group of its own."""
    from codra_dsl.isolation.worker import work  # noqa: PLC0415 - the keeper itself needs none of it

    with contextlib.suppress(OSError):
        os.setpgid(0, 0)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != keeper:
        os._exit(1)
    with contextlib.suppress(OSError):  # when memory runs out, the program is worth more than its perception
        Path("/proc/self/oom_score_adj").write_text("500", "ascii")
    sys.argv[:] = [call]
    try:
        work(socket.socket(fileno=talk_fd), call)
    except BaseException:  # noqa: BLE001 - told where all that it prints goes
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    sys.exit(0)


def _await_end(worker: int, life: socket.socket, program: int) -> None:
    """Return when the process has ended, by itself or because it was told to."""
    ended = os.pidfd_open(worker)
    while not (ready := _ready(ended, life, _LOOK_MS)):
        if os.getppid() != program:
            break
    if ended in ready:
        return
    order = life.recv(1) if ready else b""
    if order != TERMINATE and _ready(ended, None, LEAVE_MS):
        return
    _signal_group(worker, signal.SIGTERM)
    if not _ready(ended, None, TERMINATE_MS):
        _signal_group(worker, signal.SIGKILL)


def _ready(ended: int, life: socket.socket | None, timeout_ms: int) -> list[int]:
    poll = select.poll()
    poll.register(ended, select.POLLIN)
    if life is not None:
        poll.register(life, select.POLLIN)
    return [descriptor for descriptor, _ in poll.poll(timeout_ms)]


def _signal_group(worker: int, number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(worker, number)


def _end_rest() -> None:
    """End what the process has left behind: its orphans are the keeper's children, whatever their group."""
    children = Path(f"/proc/self/task/{os.getpid()}/children")  # Linux may be built without it
    with contextlib.suppress(OSError):
        while True:
            for child in map(int, children.read_text("ascii").split()):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
            os.waitpid(-1, 0)


def _let_go_of_output() -> None:
    """Hold nothing that ends when the process ends."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for standard in _STANDARD:
        os.dup2(nothing, standard)
    os.close(nothing)


def _prctl(option: int, argument: int) -> None:
    ctypes.CDLL(None).prctl(option, argument, 0, 0, 0)
