"""Threads that use one context manager at random, and checks whenever they pause."""

from __future__ import annotations

import random
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from codra_dsl.runtime import ContextManager, WallClock
from tests.campaigns.crowd.judging import PATIENCE_S, Life, eventually, judge_end, judge_life, require, stacks
from tests.campaigns.crowd.member import Member
from tests.campaigns.crowd.situation import BEACON, Perception, situation
from tests.runtime.forests import Manager, World

THREADS = 8
PER_ROUND = 25
SILENCE_EVERY = 4
SILENT_WAITS = 10
SHORTEST_TURN_S = 2e-5


@dataclass
class Figures:
    """The figures of a run."""

    done: Counter[str] = field(default_factory=Counter)
    judged: int = 0
    most_running: int = 0
    most_declared: int = 0
    longest_wake_up_s: float = 0.0
    jobs: int = 0
    lives: int = 0
    mistakes: list[str] = field(default_factory=list)


class Crowd:
    """Eight threads, one context manager at a time, and the checks."""

    def __init__(self, seed: int, operations: int, patience_s: float = PATIENCE_S) -> None:
        self.patience_s = patience_s
        self._threads_before = set(threading.enumerate())
        self.seed = seed
        self.model = situation(seed)
        self.perception = Perception()
        self.clock = WallClock()
        self.figures = Figures()
        self.requests: set[tuple[Life, str]] = set()
        self._replacing = threading.Lock()
        self._ended: list[Life] = []
        self.life = self._new_life()
        self._rounds = -(-operations // (THREADS * PER_ROUND))
        self._barrier = threading.Barrier(THREADS, self._judge)
        self._members = [Member(self, number) for number in range(THREADS)]

    def run(self) -> Figures:
        """Run all threads to the end, or to the first mistake, with frequent switches between them."""
        interval_s = sys.getswitchinterval()
        sys.setswitchinterval(SHORTEST_TURN_S)
        try:
            self._run()
        finally:
            sys.setswitchinterval(interval_s)
        return self.figures

    def _run(self) -> None:
        workers = [threading.Thread(target=self._work, args=(member,), daemon=True) for member in self._members]
        postman = threading.Thread(target=self._deliver_mail, args=(tuple(workers),), daemon=True)
        for thread in (*workers, postman):
            thread.start()
        for thread in (*workers, postman):
            while thread.is_alive() and not self.figures.mistakes:
                thread.join(0.1)
        self.figures.jobs = self.perception.calls
        if not self.figures.mistakes:
            self._blaming(self._judge_the_end)
            return
        end = threading.Thread(target=self._end_after_mistakes, args=(workers,), daemon=True)
        end.start()
        end.join(self.patience_s)

    def _end_after_mistakes(self, workers: list[threading.Thread]) -> None:
        """End the context manager, so that no observer runs on beside other tests. This can hang after a mistake."""
        for worker in workers:
            worker.join()
        self.life.close()
        self.clock.close()

    def restart(self) -> None:
        """Start a new context manager, and close the old one while others use it."""
        with self._replacing:
            old, self.life = self.life, self._new_life()
            old.close()
            self._ended.append(old)

    def post(self, request: tuple[Life, str]) -> None:
        """Write the variable that a member waits for."""
        life, name = request
        self.requests.discard(request)
        life.manager.agent("post").set(name, 1)

    def _new_life(self) -> Life:
        self.figures.lives += 1
        handles = {"world": World(self.perception.finds(self.model))}
        return Life(ContextManager[str, str](self.model, clock=self.clock, resources=handles, seed=self.seed))

    def _work(self, member: Member) -> None:
        for _ in range(self._rounds):
            for _ in range(PER_ROUND):
                self._blaming(member.act)
            try:
                self._barrier.wait(10 * self.patience_s)
            except (threading.BrokenBarrierError, AssertionError):
                if not self.figures.mistakes:
                    self._blame("not all threads reach the end of their round" + stacks())
                return
        self._blaming(member.leave)

    def _blaming(self, act: Callable[[], None]) -> None:
        try:
            act()
        except BaseException:  # noqa: BLE001 - recorded, and the others end
            self._blame(traceback.format_exc())

    def _blame(self, mistake: str) -> None:
        self.figures.mistakes.append(f"seed {self.seed}: {mistake}")
        self._barrier.abort()

    def _deliver_mail(self, workers: tuple[threading.Thread, ...]) -> None:
        chance = random.Random(self.seed)
        while any(thread.is_alive() for thread in workers):
            time.sleep(chance.uniform(0.0, 0.003))
            for request in tuple(self.requests):
                self._blaming(lambda request=request: self.post(request))

    # Checks

    def _judge(self) -> None:
        """Check while every thread pauses."""
        try:
            self._judge_pause(random.Random(f"{self.seed}/{self.figures.judged}"))
        except AssertionError as mistake:
            self.figures.mistakes.append(f"seed {self.seed}: {mistake}")
            raise

    def _judge_pause(self, chance: random.Random) -> None:
        manager, figures = self.life.manager, self.figures
        expected = chance.sample(self.model.skills, chance.randint(0, 2))
        manager.expect(*(skill.name for skill in expected))
        declared = {name for skill in expected for name in skill.preview}
        declared.update(*(member.declared(self.life) for member in self._members))
        figures.most_running = max(figures.most_running, judge_life(self.model, manager, declared))
        figures.most_declared = max(figures.most_declared, len(declared))
        figures.judged += 1
        for life in self._ended:
            judge_end(life)
        if figures.judged % SILENCE_EVERY == 0:
            self._judge_silence(manager, chance)

    def _judge_silence(self, manager: Manager, chance: random.Random) -> None:
        """Wait for values while no other event could wake a waiting thread by accident."""
        for member in self._members:
            member.leave()
        manager.expect()
        judge_life(self.model, manager, set())
        require(eventually(self._is_idle), "a perception function runs forever")
        calls = self.perception.calls
        for number in range(SILENT_WAITS):
            self._wait_for(manager, "mail8", lambda: manager.agent("post").set("mail8", number), chance)  # noqa: B023
        require(self.perception.calls == calls, "a perception function runs although no observer runs")
        for _ in range(SILENT_WAITS):
            self._wait_for(manager, BEACON, lambda: manager.declare(BEACON), chance)
            manager.withdraw(BEACON)

    def _is_idle(self) -> bool:
        """Return whether no perception function runs, or is about to run."""
        worker_count = sum(thread.name == "codra-work" for thread in threading.enumerate())
        return self.perception.at_work == 0 and worker_count == self.clock._worker_threads.idle_count

    def _wait_for(self, manager: Manager, name: str, give: Callable[[], None], chance: random.Random) -> None:
        answers: list[object] = []
        since_s = self.clock.now_s()

        def ask() -> None:
            answers.append(manager.decide(name, lambda: None, since_s=since_s, wait_up_to_s=2 * self.patience_s))

        waiter = threading.Thread(target=ask, daemon=True)
        waiter.start()
        time.sleep(chance.choice([0.0, chance.uniform(0.0, 0.002)]))
        given_s = time.monotonic()
        give()
        waiter.join(self.patience_s)
        require(answers not in ([], [None]), f"the thread that waits for {name} was not woken when its value arrived")
        self.figures.longest_wake_up_s = max(self.figures.longest_wake_up_s, time.monotonic() - given_s)
        self.figures.done["wait in silence"] += 1

    def _judge_the_end(self) -> None:
        """Close at the end: no thread of the runtime remains, and no perception function runs."""
        self.life.close()
        for life in (*self._ended, self.life):
            judge_end(life)
        require(eventually(lambda: self.perception.at_work == 0), "a perception function still runs after the end")
        self.clock.close()

        def remaining() -> set[str]:
            return {thread.name for thread in set(threading.enumerate()) - self._threads_before}

        require(eventually(lambda: not remaining()), f"threads remain: {remaining()}")
        calls = self.perception.calls
        time.sleep(0.3)
        require(self.perception.calls == calls, "a perception function was called after the end")
