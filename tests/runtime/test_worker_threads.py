"""Threads that run functions one after the other."""

from __future__ import annotations

import os
import signal
import threading
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from decimal import getcontext
from functools import partial

import pytest

from codra_dsl.runtime import worker_threads
from codra_dsl.runtime.worker_threads import WorkerThreads

PATIENCE_S = 30.0
NAME = "test-work"


@pytest.fixture
def workers() -> Iterator[WorkerThreads]:
    workers = WorkerThreads(NAME)
    yield workers
    workers.close()
    wait_until(lambda: not threads())


def run_and_wait(workers: WorkerThreads, function: Callable[[], object]) -> None:
    is_over = threading.Event()
    workers.run(lambda: (function(), is_over.set()))
    assert is_over.wait(PATIENCE_S)


def wait_until(is_ready: Callable[[], bool]) -> None:
    pause, deadline = threading.Event(), PATIENCE_S / 0.001
    while not is_ready():
        deadline -= 1
        assert deadline > 0
        pause.wait(0.001)


def threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == NAME]


def test_a_function_that_hangs_delays_no_other_function(workers: WorkerThreads) -> None:
    release, numbers = threading.Event(), list[int]()
    for _ in range(3):
        workers.run(lambda: release.wait(PATIENCE_S))

    for number in range(5):
        run_and_wait(workers, lambda: numbers.append(number))  # noqa: B023

    release.set()
    assert numbers == [0, 1, 2, 3, 4]


def test_a_thread_that_has_ended_its_function_runs_the_next_one(workers: WorkerThreads) -> None:
    identifiers = set[int]()
    for _ in range(10):
        run_and_wait(workers, lambda: identifiers.add(threading.get_ident()))
        wait_until(lambda: workers.idle_count == 1)

    assert len(identifiers) == 1


def test_a_thread_that_waits_keeps_nothing_of_its_last_function_in_memory(workers: WorkerThreads) -> None:
    class Image:
        pass

    image = Image()
    reference = weakref.ref(image)
    run_and_wait(workers, partial(str, image))
    del image

    wait_until(lambda: reference() is None)
    assert len(threads()) == 1


def test_a_function_does_not_see_the_context_variables_of_the_function_before_it(workers: WorkerThreads) -> None:
    digits = list[int]()

    def calculate() -> None:
        digits.append(getcontext().prec)
        getcontext().prec = 3

    for _ in range(2):
        run_and_wait(workers, calculate)
        wait_until(lambda: workers.idle_count == 1)

    assert digits[0] == digits[1] > 3


def test_of_the_threads_that_wait_the_last_one_runs_the_next_function(workers: WorkerThreads) -> None:
    release, identifiers = threading.Event(), set[int]()
    for _ in range(8):
        workers.run(lambda: release.wait(PATIENCE_S))
    release.set()
    wait_until(lambda: workers.idle_count == 8)

    for _ in range(20):
        run_and_wait(workers, lambda: identifiers.add(threading.get_ident()))
        wait_until(lambda: workers.idle_count == 8)

    assert len(identifiers) == 1


def test_threads_that_wait_end_when_the_workers_are_closed(workers: WorkerThreads) -> None:
    release = threading.Event()
    for _ in range(4):
        workers.run(lambda: release.wait(PATIENCE_S))
    release.set()
    wait_until(lambda: workers.idle_count == 4)

    workers.close()

    wait_until(lambda: not threads())


def test_a_function_that_runs_when_the_workers_are_closed_ends_with_its_thread(workers: WorkerThreads) -> None:
    release, ended = threading.Event(), threading.Event()
    workers.run(lambda: (release.wait(PATIENCE_S), ended.set()))
    workers.close()
    assert len(threads()) == 1

    release.set()

    assert ended.wait(PATIENCE_S)
    wait_until(lambda: not threads())


def test_a_thread_that_has_waited_for_long_ends(workers: WorkerThreads, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_threads, "IDLE_S", 0.001)
    run_and_wait(workers, lambda: None)

    wait_until(lambda: not threads())

    assert workers.idle_count == 0
    run_and_wait(workers, lambda: None)


@pytest.mark.parametrize("method", ["run", "close"])
def test_a_thread_ends_if_a_signal_handler_interrupts_what_would_wake_it(
    workers: WorkerThreads, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    class Interrupted(list[object]):
        def pop(self, *_: object) -> object:
            super().pop()
            raise KeyboardInterrupt

    monkeypatch.setattr(worker_threads, "IDLE_S", 0.1)
    run_and_wait(workers, lambda: None)
    wait_until(lambda: workers.idle_count == 1)
    monkeypatch.setattr(workers, "_waiting_inboxes", Interrupted(workers._waiting_inboxes))

    with pytest.raises(KeyboardInterrupt):
        workers.run(lambda: None) if method == "run" else workers.close()

    wait_until(lambda: not threads())
    run_and_wait(workers, lambda: None)


def test_each_function_runs_once_while_threads_end_and_begin(
    workers: WorkerThreads, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_threads, "IDLE_S", 0.0)
    counts, finished = Counter[tuple[int, int]](), threading.Semaphore(0)

    def submit(submitter: int) -> None:
        for number in range(500):
            workers.run(lambda number=number: (counts.update([(submitter, number)]), finished.release()))

    submitters = [threading.Thread(target=submit, args=(number,)) for number in range(4)]
    for thread in submitters:
        thread.start()
    for _ in range(2000):
        assert finished.acquire(timeout=PATIENCE_S)

    assert set(counts.values()) == {1}
    assert len(counts) == 2000


def test_after_a_fork_the_child_uses_a_thread_of_its_own(workers: WorkerThreads) -> None:
    run_and_wait(workers, lambda: None)
    wait_until(lambda: workers.idle_count == 1)

    child = os.fork()
    if child == 0:
        is_over = threading.Event()
        workers.run(is_over.set)
        os._exit(0 if is_over.wait(PATIENCE_S) else 1)

    assert os.waitpid(child, 0)[1] == 0


def test_a_child_that_a_function_forks_ends_with_the_function(
    workers: WorkerThreads, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_threads, "IDLE_S", 2 * PATIENCE_S)
    children = list[int]()
    run_and_wait(workers, lambda: children.append(os.fork()))

    try:
        wait_until(lambda: os.waitpid(children[0], os.WNOHANG) == (children[0], 0))
    except AssertionError:
        os.kill(children[0], signal.SIGKILL)
        raise
