"""The model for the crowd: a forest of more than fifty variables, and perception with random failures."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from codra_dsl.logic import Term, age, known, value
from codra_dsl.runtime import ContextModel
from codra_dsl.runtime.observers.observer import ObserverModel
from codra_dsl.runtime.values.model import SkillModel, integer
from tests.runtime.forests import Look, forest, given, observer, seen, variable

MAIL, SENSORS, OBSERVED, SKILLS = 9, 6, 60, 8
BEACON = "beacon"
LONGEST_TIMEOUT_S = 0.2


def situation(seed: int) -> ContextModel:
    """Return a forest with shared trees, alternatives, feedback, slots, and variables that agents write."""
    chance = random.Random(seed)
    names = [f"v{number}" for number in range(OBSERVED)]
    sensors = [f"s{number}" for number in range(SENSORS)]
    variables = [
        variable(BEACON),
        *(given(name) for name in ("near", "lit")),
        *(variable(f"mail{number}", sources=("post",), type=integer()) for number in range(MAIL)),
        *(variable(name, sources=("device",), valid_for_s=chance.uniform(0.005, 0.2)) for name in sensors),
        *(_observed(name, chance) for name in names),
    ]
    beacon = observer("o_beacon", seen("look_beacon", BEACON, timeout_s=60.0), period_s=0.05)
    observers = list(_observers(chance, names, [*names, *sensors, "near", "lit"]))
    skills = [
        SkillModel(
            name=f"k{number}",
            preview=tuple(chance.sample(names, 3)),
            monitor=tuple(chance.sample(names, chance.randint(0, 2))),
            changes=tuple(chance.sample(names, 2)),
        )
        for number in range(SKILLS)
    ]
    return forest(variables, beacon, *observers, skills=skills, slots={"eye": 2, "hand": 1})


def _observed(name: str, chance: random.Random) -> Any:
    valid_for_s = chance.choice([float("inf"), 0.05, 0.5])
    return variable(name, when_unobservable=chance.choice(["keep", "forget"]), valid_for_s=valid_for_s)


def _observers(chance: random.Random, names: list[str], needed: list[str]) -> Iterator[ObserverModel]:
    left = names[: chance.randint(50, len(names))]
    chance.shuffle(left)
    while left:
        mine = [left.pop() for _ in range(min(len(left), chance.randint(1, 3)))]
        others = [name for name in needed if name not in mine]
        looks = [_look(f"look_{mine[0]}", mine, others, chance)]
        if chance.random() < 0.3:
            looks.append(_look(f"feel_{mine[0]}", mine, others, chance))
        period_s = chance.uniform(0.01, 0.2)
        yield observer(f"o_{mine[0]}", *looks, period_s=period_s, priority=chance.uniform(0.0, 3.0))


def _look(name: str, mine: list[str], others: list[str], chance: random.Random) -> Look:
    when = [_condition(need, chance) for need in chance.sample(others, chance.choice([0, 0, 1, 1, 2]))]
    slots = tuple(chance.sample(["eye", "hand"], chance.choice([0, 0, 1, 2])))
    return seen(name, *mine, when=when, slots=slots, timeout_s=chance.uniform(0.02, LONGEST_TIMEOUT_S))


def _condition(need: str, chance: random.Random) -> Term:
    limit_s = chance.choice([0.05, 0.3])
    return chance.choice([value(need), ~known(need) | value(need), ~known(need) | (age(need) > limit_s)])


class Perception:
    """All perception functions: each works, raises, returns nonsense, sleeps or hangs at random.

    Attributes:
        broken: algorithms that always raise at present.
    """

    def __init__(self, hang: Callable[[float], None] = time.sleep) -> None:
        """Create perception functions with random behaviour.

        `hang` spends time without reacting to `job`.
        """
        self._hang = hang
        self.broken: set[str] = set()
        self.calls = 0
        self._at_work = 0
        self._counting = threading.Lock()

    @property
    def at_work(self) -> int:
        """Return how many functions run."""
        return self._at_work

    def finds(self, model: ContextModel) -> dict[str, object]:
        """Return the functions of the algorithms of all observers of a model."""
        names = [
            f"{verb}_{observer_model.identifies[0]}" for observer_model in model.observers for verb in ("look", "feel")
        ]
        return {name: self._moody(name) for name in names}

    @contextmanager
    def _counted(self) -> Iterator[None]:
        with self._counting:
            self._at_work += 1
            self.calls += 1
        try:
            yield
        finally:
            with self._counting:
                self._at_work -= 1

    def _moody(self, name: str) -> object:
        def look(job: Any) -> object:
            with self._counted():
                if name in self.broken:
                    raise ValueError("broken")
                return {"seen": True} if name == f"look_{BEACON}" else self._random_result(job)

        return look

    def _random_result(self, job: Any) -> object:
        mood = job.random.random()
        if mood < 0.08:
            raise ValueError("no picture")
        if mood < 0.12:
            return job.random.choice([None, [True], {"seen": "yes"}, {"seen": True, "heard": 1}, {}])
        if mood < 0.15:
            job.sleep(2 * LONGEST_TIMEOUT_S)
        elif mood < 0.17:
            self._hang(2 * LONGEST_TIMEOUT_S)
        elif mood < 0.4:
            job.evidence(job.now_s(), job.now_s())
            job.sleep(job.random.uniform(0.0, 0.02))
        elif mood < 0.6:
            job.sleep(job.random.uniform(0.0, 0.05))
        return {"seen": job.random.random() < 0.8}
