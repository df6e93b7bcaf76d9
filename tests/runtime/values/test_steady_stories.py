"""Random stories of variables with hysteresis, confirmation, looks on events and skills: invariants of every story."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.logic import Term, age, known, value
from codra_dsl.runtime import ContextManager, ContextModel, Journal, SimClock
from codra_dsl.runtime.context import components as components_module
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.hysteresis import between, confirmed
from codra_dsl.runtime.values.model import ExpectationModel, SkillModel, real
from tests.runtime.forests import Look, Manager, World, algorithm, forest, given, observer, variable
from tests.runtime.journal.journals import read
from tests.runtime.observers.test_by_change import EveryTree, _rounded, tick_often

NAMES = [f"v{number}" for number in range(8)]
RESULT_TYPES = {"gap": real(optional=True)}
STEPS = 60


def situation(seed: int) -> ContextModel:
    """Return a forest of variables with bands and confirmation, alternatives, and skills that expect something."""
    chance = random.Random(seed)
    variables = [
        variable(
            name,
            when_unobservable=chance.choice(["keep", "forget"]),
            valid_for_s=chance.choice([float("inf"), 0.3, 2.0]),
            refresh=chance.choice(["periodic", "on_event"]),
        )
        for name in NAMES
    ]
    skills = [_skill(f"k{number}", chance) for number in range(4)]
    return forest([given("near"), *variables], *_observers(chance), skills=skills, slots={"eye": 1})


def _skill(name: str, chance: random.Random) -> SkillModel:
    preview, watched = (chance.sample(NAMES, 2) for _ in range(2))
    return SkillModel(
        name=name,
        preview=tuple(preview),
        monitor=tuple(watched),
        changes=tuple(chance.sample(NAMES, 2)),
        expects=(
            ExpectationModel(text="becomes", condition=value(watched[0]), within_s=chance.choice([0.1, 0.5])),
            ExpectationModel(text="stays", condition=~value(watched[1])),
        ),
    )


def _observers(chance: random.Random) -> Iterator[ObserverModel]:
    for name in NAMES:
        needed_names = chance.sample(["near", *(other for other in NAMES if other != name)], chance.choice([0, 1, 1]))
        algorithm_names = [f"look_{name}", f"feel_{name}"][: chance.choice([1, 1, 2])]
        looks = [_look(algorithm_name, name, needed_names, chance) for algorithm_name in algorithm_names]
        yield observer(f"o_{name}", *looks, period_s=chance.uniform(0.02, 0.2))


def _look(algorithm_name: str, name: str, needed_names: list[str], chance: random.Random) -> Look:
    high, low = value("gap") > 0.6, value("gap") < 0.4
    simple_condition, band = value("gap") > 0.5, between(high, low)
    term = chance.choice([simple_condition, band, confirmed(simple_condition, 2, 3), confirmed(band, 2, 3)])
    when = [_condition(need, chance) for need in needed_names]
    slots = chance.choice([(), ("eye",)])
    return Look(
        algorithm(algorithm_name, RESULT_TYPES, timeout_s=0.1, slots=slots), {name: term}, when, [value("gap") < 0.95]
    )


def _condition(need: str, chance: random.Random) -> Term:
    return chance.choice([value(need), ~known(need) | value(need), ~known(need) | (age(need) > 0.0937)])


def finds(job: Any) -> object:
    mood = job.random.random()
    if mood < 0.1:
        raise ValueError("no picture")
    if mood < 0.3:
        job.evidence(job.now_s(), job.now_s())
    job.sleep(job.random.choice([0.0, 0.02, 0.05, 0.12]))
    return {"gap": job.random.choice([None, *(job.random.random() for _ in range(9))])}


def events_of_story(seed: int, record: Journal | None = None, *, is_often_ticked: bool = False) -> list[str]:
    """Return the events of a story, after checking the invariants at every step."""
    clock, chance = SimClock(), random.Random(seed)
    world = World(
        dict.fromkeys((f"{algorithm_name}_{name}" for algorithm_name in ("look", "feel") for name in NAMES), finds)
    )
    resources = {"world": world}
    with ContextManager[str, str](
        situation(seed), clock=clock, resources=resources, seed=seed, record=record
    ) as manager:
        if is_often_ticked:
            tick_often(manager, clock)
        for _ in range(STEPS):
            do_something(manager, clock, chance)
            clock.sleep(chance.choice([0.0, chance.uniform(0.0, 0.1), 0.3]))
            check(manager, clock)
        return [event.as_json() for event in manager.record]


@cache
def events_of_seed(seed: int) -> list[str]:
    return events_of_story(seed)


def do_something(manager: Manager, clock: SimClock, chance: random.Random) -> None:
    draw, name = chance.random(), chance.choice(NAMES)
    if draw < 0.3:
        manager.declare(name)
    elif draw < 0.35:
        manager.withdraw(name)
    elif draw < 0.55:
        manager.set("near", chance.random() < 0.7, evidence_s=clock.now_s() - chance.choice([0.0, 0.05]))
    elif draw < 0.65:
        manager.decide(name, lambda: clock.sleep(0.1) or chance.choice([True, False, None]), wait_up_to_s=0.1)
    elif draw < 0.7:
        manager.expect(f"k{chance.randrange(4)}")
    else:
        with manager.skill(f"k{chance.randrange(4)}") as skill:
            with skill.acting():
                clock.sleep(chance.uniform(0.0, 0.2))
                check(manager, clock)
            skill.verify(lambda _: chance.choice([True, None]), wait_up_to_s=chance.choice([0.0, 0.3]))


def check(manager: Manager, clock: SimClock) -> None:
    for name in NAMES:
        reading, cell = manager.get(name), manager._store.cells[name]
        assert reading.known == (reading.content is not None) == (reading.reason is None)
        if reading.known:
            assert cell.invalidated_s <= reading.start_s <= reading.evidence_s <= clock.now_s() < reading.expires_s
        evidence_s = [past_reading.evidence_s for past_reading in manager.history(name)]
        assert evidence_s == sorted(evidence_s)


@pytest.mark.parametrize("seed", range(4))
def test_known_values_are_valid_and_newer_than_the_last_change_and_the_run_replays(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    events = events_of_story(seed, Journal(path))
    assert events_of_seed(seed) == events
    header, recorded_events = read(path)
    assert replay(header, recorded_events, situation(seed), ContextManager[str, str], None).difference is None


@pytest.mark.parametrize("seed", range(4))
def test_ticking_by_change_gives_the_same_as_ticking_at_every_instant(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_change = by_subject(events_of_seed(seed))
    monkeypatch.setattr(components_module, "Forest", EveryTree)
    monkeypatch.setattr(Observer, "_needs_another_tick", lambda _: True)

    assert by_change == by_subject(events_of_story(seed, is_often_ticked=True))


def by_subject(events: list[str]) -> dict[str, list[object]]:
    """Return the events of each variable, observer and algorithm, in order."""
    subjects: dict[str, list[object]] = {}
    for event in map(json.loads, events):
        subjects.setdefault(f"{event['kind']} {event['name']}", []).append(_rounded(event))
    return subjects
