"""Calls from other threads, run by the serving thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.integrations.rafcon.hand_over import HandOver


def run_in_thread(function: Callable[[], object]) -> tuple[threading.Thread, list[object]]:
    results: list[object] = []

    def body() -> None:
        try:
            results.append(function())
        except (ArithmeticError, RuntimeError) as error:
            results.append(error)

    thread = threading.Thread(target=body, daemon=True)
    thread.start()
    return thread, results


@given(st.lists(st.integers(1, 20), min_size=1, max_size=4))
def test_every_call_runs_in_the_thread_that_serves_and_comes_back_to_its_own(counts: list[int]) -> None:
    hand_over, thread_ids = HandOver(), list[int]()

    def ask(caller: int, count: int) -> list[tuple[int, int]]:
        def record(number: int) -> tuple[int, int]:
            thread_ids.append(threading.get_ident())
            return caller, number

        return [hand_over.call(lambda number=number: record(number)) for number in range(count)]

    threads_and_results = [
        run_in_thread(lambda caller=caller, count=count: ask(caller, count)) for caller, count in enumerate(counts)
    ]

    def end() -> None:
        for thread, _ in threads_and_results:
            thread.join(60.0)
        hand_over.end()

    run_in_thread(end)
    hand_over.serve()

    assert set(thread_ids) == {threading.get_ident()}
    assert [results for _, results in threads_and_results] == [
        [[(caller, number) for number in range(count)]] for caller, count in enumerate(counts)
    ]


def test_an_exception_of_a_call_is_raised_in_the_calling_thread() -> None:
    hand_over = HandOver()
    thread, results = run_in_thread(lambda: hand_over.call(lambda: 1 / 0))

    def end() -> None:
        thread.join(60.0)
        hand_over.end()

    run_in_thread(end)
    hand_over.serve()

    assert isinstance(results[0], ZeroDivisionError)


def test_a_call_may_itself_call() -> None:
    hand_over = HandOver()
    thread, results = run_in_thread(lambda: hand_over.call(lambda: hand_over.call(threading.get_ident)))

    def end() -> None:
        thread.join(60.0)
        hand_over.end()

    run_in_thread(end)
    hand_over.serve()

    assert results == [threading.get_ident()]


@pytest.mark.parametrize("when", ["before the end", "after it"])
def test_a_call_that_is_not_served_is_refused_if_it_came(when: str) -> None:
    hand_over = HandOver()
    if when == "after it":
        hand_over.refuse()
    thread, results = run_in_thread(lambda: hand_over.call(threading.get_ident))
    while when == "before the end" and hand_over._calls.empty():
        threading.Event().wait(0.001)
    hand_over.refuse()
    thread.join(60.0)

    assert "the run is over" in str(results[0])


def test_methods_and_values_of_a_handle_are_used_in_the_serving_thread() -> None:
    class Arm:
        reach_m = 0.9

        def thread(self, *values: object, **keywords: object) -> tuple[object, ...]:
            return (threading.get_ident(), values, keywords)

    hand_over = HandOver()
    arm = hand_over.proxy_of(Arm())
    thread, results = run_in_thread(lambda: (arm.reach_m, arm.thread(1, twice=2)))

    def end() -> None:
        thread.join(60.0)
        hand_over.end()

    run_in_thread(end)
    hand_over.serve()

    assert results == [(0.9, (threading.get_ident(), (1,), {"twice": 2}))]
