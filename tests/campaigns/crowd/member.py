"""One of the threads: its actions and its declarations."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from codra_dsl.runtime import Reason, Skill
from codra_dsl.runtime.values.model import SkillModel
from tests.campaigns.crowd.judging import Life, eventually, require
from tests.campaigns.crowd.situation import OBSERVED, SENSORS
from tests.runtime.forests import Manager

if TYPE_CHECKING:
    from tests.campaigns.crowd.crowd import Crowd

MOST_SKILLS = 2


class Member:
    """One of eight threads; only it declares and withdraws its variables, while skills are shared."""

    def __init__(self, crowd: Crowd, number: int) -> None:
        self._crowd = crowd
        self._number = number
        self._chance = random.Random(f"{crowd.seed}/{number}")
        self._life = crowd.life
        self._mine: set[str] = set()
        self._under_way: list[tuple[SkillModel, AbstractContextManager[Skill], Skill]] = []
        self._actions: dict[str, tuple[float, Callable[[Manager], None]]] = {
            "declare": (12, self._declare),
            "withdraw": (8, self._withdraw),
            "expect": (6, self._expect),
            "begin a skill": (6, self._begin),
            "act": (4, self._act_of_skill),
            "end a skill": (6, self._finish),
            "set": (12, self._set),
            "set by an agent": (12, self._set_by_agent),
            "expire": (4, self._expire),
            "break or repair perception": (4, self._break_or_repair_algorithm),
            "decide": (8, self._decide),
            "wait for mail": (8, self._wait_for_mail),
            "use a slot": (3, self._use_slot),
            "look around": (6, self._look_around),
            "stop and restart": (0.6, self._restart),
        }

    def act(self) -> None:
        """Execute a random action."""
        life = self._crowd.life
        if life is not self._life:
            self.leave()
            self._life, self._mine = life, set()
        action_name = self._chance.choices(list(self._actions), [weight for weight, _ in self._actions.values()])[0]
        self._crowd.figures.done[action_name] += 1
        try:
            self._actions[action_name][1](life.manager)
        except RuntimeError as error:
            if not (life.is_closing and "closed" in str(error)):
                raise
            self._crowd.figures.done["(refused, because closed)"] += 1

    def declared(self, life: Life) -> set[str]:
        """Return the variables that must be declared for this member in a life."""
        if life is not self._life:
            return set()
        return self._mine.union(*(skill.preview + skill.monitor for skill, _, _ in self._under_way))

    def leave(self) -> None:
        """End its skills and withdraw its declarations."""
        while self._under_way:
            self._under_way.pop()[1].__exit__(None, None, None)
        while self._mine:
            self._life.manager.withdraw(self._mine.pop())

    def _own(self) -> str:
        """Return a variable that only this member declares by name."""
        return f"v{self._number + 8 * self._chance.randrange(OBSERVED // 8)}"

    def _declare(self, manager: Manager) -> None:
        name = self._own()
        manager.declare(name, self._chance.choice([None, None, True, False]))
        self._mine.add(name)

    def _withdraw(self, manager: Manager) -> None:
        name = self._own()
        manager.withdraw(name)
        self._mine.discard(name)

    def _expect(self, manager: Manager) -> None:
        skills = self._chance.sample(self._crowd.model.skills, self._chance.randint(0, 2))
        manager.expect(*(skill.name for skill in skills))

    def _begin(self, manager: Manager) -> None:
        if len(self._under_way) >= MOST_SKILLS:
            self._finish(manager)
        skill = self._chance.choice(self._crowd.model.skills)
        opened = manager.skill(skill.name)
        self._under_way.append((skill, opened, opened.__enter__()))

    def _act_of_skill(self, _: Manager) -> None:
        if self._under_way:
            with self._chance.choice(self._under_way)[2].acting():
                time.sleep(self._chance.uniform(0.0, 0.002))

    def _finish(self, _: Manager) -> None:
        if self._under_way:
            self._under_way.pop(self._chance.randrange(len(self._under_way)))[1].__exit__(None, None, None)

    def _set(self, manager: Manager) -> None:
        name = self._chance.choice(["near", "lit", *sorted(self._mine)])
        if name in self._mine and self._life.is_closing:
            return
        age_s = self._chance.choice([0.0, self._chance.uniform(0.0, 1.0)])
        try:
            manager.set(name, self._chance.random() < 0.8, evidence_s=self._crowd.clock.now_s() - age_s)
        except PermissionError:
            require(self._life.is_closing, f"{name} is declared and may not be set")

    def _set_by_agent(self, manager: Manager) -> None:
        name = f"s{self._chance.randrange(SENSORS)}"
        age_s = self._chance.choice([0.0, self._chance.uniform(0.0, 0.3)])
        evidence_s = self._crowd.clock.now_s() - age_s
        manager.agent("device").set(name, self._chance.random() < 0.8, evidence_s=evidence_s)

    def _expire(self, manager: Manager) -> None:
        """Require that a value without newer evidence is stale at the end of its validity."""
        name = f"s{self._chance.randrange(SENSORS)}"
        manager.agent("device").set(name, True)
        validity_s = manager._store.variables[name].valid_for_s
        expires_s = self._crowd.clock.now_s() + validity_s
        require(eventually(lambda: self._crowd.clock.now_s() > expires_s), "time does not pass")
        reading = manager.get(name)
        is_stale = reading.reason is Reason.STALE
        is_newer = reading.known and reading.evidence_s + validity_s > expires_s
        require(is_stale or is_newer, f"{name} should be stale: {reading}")

    def _break_or_repair_algorithm(self, _: Manager) -> None:
        broken, name = self._crowd.perception.broken, f"look_v{self._chance.randrange(OBSERVED)}"
        if name in broken:
            broken.discard(name)
        else:
            broken.add(name)

    def _decide(self, manager: Manager) -> None:
        name = f"v{self._chance.randrange(OBSERVED)}"
        wait_s = self._chance.choice([0.0, 0.0, self._chance.uniform(0.0, 0.02)])
        shadow = self._chance.random() < 0.2
        manager.decide(name, lambda: self._chance.choice([True, None]), wait_up_to_s=wait_s, shadow=shadow)

    def _wait_for_mail(self, manager: Manager) -> None:
        """Wait until another thread has written; the wake-up must not be lost."""
        life, name = self._life, f"mail{self._number}"
        asked_s = self._crowd.clock.now_s()
        for other in tuple(self._crowd.requests):  # serve the other waiting members first
            self._crowd.post(other)
        self._crowd.requests.add((life, name))
        answer = manager.decide(name, lambda: None, since_s=asked_s, wait_up_to_s=self._crowd.patience_s)
        waited_s = self._crowd.clock.now_s() - asked_s
        self._crowd.requests.discard((life, name))
        require(answer == 1 or life.is_closing, f"{name} was not seen within {waited_s} s")
        require(waited_s < self._crowd.patience_s / 2, f"{name} was seen after {waited_s} s only")

    def _use_slot(self, manager: Manager) -> None:
        resources = self._chance.choice([["eye"], ["hand"], ["eye", "hand"]])
        with manager.slot(*resources):
            time.sleep(self._chance.uniform(0.0, 0.002))

    def _look_around(self, manager: Manager) -> None:
        name = f"v{self._chance.randrange(OBSERVED)}"
        reading = manager.get(name)
        require(reading.known is (reading.reason is None), f"{name} is neither known nor unknown")
        self._chance.choice([manager.obstacle, manager.history, manager.why])(name)

    def _restart(self, _: Manager) -> None:
        self._crowd.restart()
