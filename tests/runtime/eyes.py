"""Well and badly behaved perception functions for tests of isolation, in a separate process or in a thread."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path
from typing import Any

from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error

KEPT: list[bytes] = []
"""Memory that a process keeps from one job to the next."""


def counts(*, job: Any) -> dict[str, object]:
    """Use everything that `job` offers, and return the number of jobs that this process has executed."""
    start_s = job.now_s()
    KEPT.append(b"")
    job.sleep(job.random.uniform(0.1, 0.4))
    job.evidence(start_s, job.now_s())
    job.sleep(0.1)
    return {"seen": job.index % 3 != 0 and not job.cancelled, "number": len(KEPT), "pid": os.getpid()}


def echoes(*, what: str, given: bool, job: Any) -> dict[str, object]:
    return {"seen": given, "text": f"{what} {job.index}"}


def asks(*, camera: Any, gain: Any, job: Any) -> dict[str, object]:
    frame = camera.frame(2, gain=gain)
    camera.noted.append(3)
    return {"seen": frame.mean() == 2 * gain, "number": camera.edges + len(camera.names), "pid": job.index}


def asks_for_more(*, camera: Any, names: str, job: Any) -> dict[str, object]:
    """Return the errors for attributes of a handle that a process may not use."""
    errors = []
    for name in names.split():
        try:
            getattr(camera, name)("echo reached > /dev/stderr")
        except AttributeError as error:
            errors.append(str(error))
    return {"text": "\n".join(errors)}


def forges_calls(*, camera: Any, names: str, job: Any) -> dict[str, object]:
    """Call attributes of a handle by messages of this process's own, as `asks_for_more` does by the handle."""
    sender = object.__getattribute__(camera, "_request_sender")
    errors = []
    for name in names.split():
        try:
            sender.ask("call", "camera", name, ["echo reached > /dev/stderr"], {})
        except AttributeError as error:
            errors.append(str(error))
    return {"text": "\n".join(errors)}


def calls_the_handle(*, camera: Any, job: Any) -> dict[str, object]:
    return {"seen": True, "number": int(camera(job.index))}


def raises(*, job: Any) -> object:
    raise ValueError("no picture")


def raises_hostile_errors(*, job: Any) -> object:
    """Raise all hostile exceptions, one in each job."""
    raise hostile_error(list(HOSTILE_ERRORS)[job.index])


def exits(*, job: Any) -> object:
    sys.exit(3)


def dies(*, job: Any) -> object:
    os._exit(3)


def dies_when_asked(*, pids: str, job: Any) -> object:
    """Work, and write the process ID to a file, so that a test can kill the process."""
    with Path(pids).open("a") as stream:
        stream.write(f"{os.getpid()}\n")
    return {"seen": True}


def crashes(*, job: Any) -> object:
    os.kill(os.getpid(), signal.SIGSEGV)
    time.sleep(60)
    return {}


def returns_100_mb(*, job: Any) -> object:
    return {"seen": b"x" * 10**8}


def returns_a_long_text(*, job: Any) -> object:
    return {"text": "x" * 10**8}


def returns_much(*, job: Any) -> object:
    return {f"value{number}": "x" * 9_000 for number in range(1000)}


def returns_a_list(*, job: Any) -> object:
    return [1]


def returns_nothing(*, job: Any) -> object:
    return {}


def returns_a_large_number(*, job: Any) -> object:
    return {"number": 2**70}


def keeps_100_mb(*, job: Any) -> object:
    KEPT[:] = [os.urandom(10**8)]
    return {"seen": True}


def deaf(*, pids: str, job: Any) -> object:
    """Ignore all signals, also in child processes. One child is a daemon; all processes loop forever."""
    for number in range(1, signal.NSIG):
        if number not in (signal.SIGKILL, signal.SIGSTOP):
            try:
                signal.signal(number, signal.SIG_IGN)
            except (OSError, ValueError):
                continue
    if os.fork() == 0 and os.fork() == 0:
        os.setsid()
    with Path(pids).open("a") as stream:
        stream.write(f"{os.getpid()}\n")
    while True:
        pass


def eats_a_core(*, job: Any) -> object:
    while True:
        pass


def floods_its_output(*, job: Any) -> object:
    while True:
        os.write(1, b"nonsense " * 1000 + b"\n")


def floods_its_connection(*, job: Any) -> object:
    """Write to every open descriptor."""
    while True:
        for descriptor in range(3, 256):  # the process of a test that has many open files has larger numbers
            try:
                os.write(descriptor, b"\xff" * 100_000)
            except OSError:
                continue


def sends_pickles(*, job: Any) -> object:
    """Send a pickle that would run code in the program if the program unpickled it."""
    bad = b"cos\nsystem\n(S'echo bad'\ntR."
    return _sends(len(bad).to_bytes(4, "big") + bad)


def attacks_its_supervisor(*, pids: str, signals: str, job: Any) -> object:
    """In the first job, start a daemon and send signals to the supervisor and its guard, then loop forever.

    Args:
        pids: a file, which gets the process IDs of all processes that must end.
        signals: the targets and signals, such as `supervisor STOP, guard KILL`; after `again:`, the daemon sends them
            again and again.
        job: the job.
    """
    if Path(pids).exists():
        return {"seen": True}
    supervisor = os.getppid()
    guard = int(Path(f"/proc/{supervisor}/stat").read_text().rpartition(")")[2].split()[1])
    attacks = [attack.split() for attack in signals.removeprefix("again: ").split(", ")]

    def attack() -> None:
        for target, name in attacks:
            os.kill({"supervisor": supervisor, "guard": guard}[target], signal.Signals[f"SIG{name}"])

    daemon = os.fork()
    if daemon == 0:
        os.setsid()
        while signals.startswith("again: "):
            attack()
        signal.pause()
    Path(pids).write_text(f"{os.getpid()} {daemon} {supervisor} {guard}")
    attack()
    while True:
        pass


def asks_for_what_is_hidden(*, camera: Any, job: Any) -> object:
    message = b'["call", "camera", "__class__", [], {}]'
    return _sends(len(message).to_bytes(4, "big") + message)


def _sends(data: bytes) -> object:
    for descriptor in range(3, 256):  # the process of a test that has many open files has larger numbers
        try:
            os.write(descriptor, data)
        except OSError:
            continue
    time.sleep(60)
    return {}


class Net:
    """A perception class that logs the calls of its methods."""

    def __init__(self) -> None:
        self.jobs = 0

    def setup(self, *, log: str, camera: Any = None) -> None:
        self.log = Path(log)
        self._append_to_log("setup" if camera is None else f"setup {camera.edges}")

    def perceive(self, *, log: str, job: Any, **_: Any) -> dict[str, object]:
        self.jobs += 1
        self._append_to_log("perceive")
        return {"seen": True, "number": self.jobs}

    def close(self) -> None:
        self._append_to_log("close")

    def _append_to_log(self, what: str) -> None:
        with self.log.open("a") as stream:
            stream.write(f"{what}\n")


class NetThatDies(Net):
    def perceive(self, *, log: str, job: Any, **_: Any) -> dict[str, object]:
        perception_result = super().perceive(log=log, job=job)
        if job.index == 1:
            os._exit(0)
        return perception_result


class NeverSetUp:
    def setup(self) -> None:
        raise ValueError("no weights")

    def perceive(self, *, job: Any) -> object:
        return {"seen": True}


class SetUpLate:
    """A class whose first job times out, because setting up takes longer than a job may."""

    def setup(self) -> None:
        time.sleep(0.5)

    def perceive(self, *, job: Any) -> object:
        return {"seen": True}


class NeverClosed:
    def perceive(self, *, job: Any) -> object:
        return {"seen": True}

    def close(self) -> None:
        raise ValueError("no way")


class StuckInClose(NeverClosed):
    def close(self) -> None:
        time.sleep(60)


class Blind:
    """A class that cannot perceive."""
