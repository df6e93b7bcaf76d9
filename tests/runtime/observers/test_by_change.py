"""Ticking by change gives the same as ticking every tree at every instant with an event, as in the paper."""

from __future__ import annotations

import json
import random
from typing import Any

import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.context import components as components_module
from codra_dsl.runtime.observers.forest import Forest
from codra_dsl.runtime.observers.observer import Observer
from tests.campaigns.crowd.situation import OBSERVED, SENSORS, Perception, situation
from tests.runtime.forests import Manager, World, started

STEPS = 30
PERIOD_S = 0.013
"""The period of ticking all trees without an event: a tenth of the paper's one second, for periods a tenth as long."""


class EveryTree(Forest):
    """The forest of P1: after any event, every running tree is ticked until none has an effect."""

    def changed(self, variable: str, is_renewed: bool) -> None:  # noqa: ARG002 - any change ticks all
        self.tick_all()

    def request_tick(self, observer: Observer) -> None:  # noqa: ARG002 - any observer ticks all
        self.tick_all()

    def tick_all(self) -> None:
        for observer in self.observers.values():
            super().request_tick(observer)


class CountingForestFactory:
    """Creates a forest, and counts its ticks."""

    def __init__(self, kind: type[Forest]) -> None:
        self.kind = kind
        self.ticks = 0

    def __call__(self, *arguments: Any) -> Forest:
        created_forest = self.kind(*arguments)
        tick = created_forest._tick

        def count_tick(observer: Observer, now_s: float) -> list:
            self.ticks += 1
            return tick(observer, now_s)

        created_forest._tick = count_tick
        return created_forest


def story(seed: int, forest: CountingForestFactory, monkeypatch: pytest.MonkeyPatch) -> dict[str, list[object]]:
    """Return the readings of each variable, and the events of each observer and algorithm, in order.

    Instants are rounded to the nanosecond, because they are summed up in more or fewer steps.
    """
    model, clock, chance = situation(seed), SimClock(), random.Random(seed)
    with monkeypatch.context() as patch:
        patch.setattr(components_module, "Forest", forest)
        if forest.kind is EveryTree:
            patch.setattr(Observer, "_needs_another_tick", lambda _: True)
        world = World(Perception(hang=lambda _: None).finds(model))
        with started(model, world, clock, seed) as manager:
            if forest.kind is EveryTree:
                tick_often(manager, clock)
            for _ in range(STEPS):
                do_something(manager, chance)
                clock.sleep(chance.choice([0.0, chance.uniform(0.0, 0.1), 0.3]))
    events_by_element: dict[str, list[object]] = {}
    for event in manager.record:
        events_by_element.setdefault(f"{event.kind} {event.name}", []).append(_rounded(json.loads(event.as_json())))
    return events_by_element


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return round(value, 9) if isinstance(value, float) else value


def tick_often(manager: Manager, clock: SimClock) -> None:
    with manager._clock:
        manager._forest.tick_all()
    clock.call_at(clock.now_s() + PERIOD_S, lambda: tick_often(manager, clock))


def do_something(manager: Manager, chance: random.Random) -> None:
    draw, name = chance.random(), f"v{chance.randrange(OBSERVED)}"
    evidence_s = manager._clock.now_s() - chance.choice([0.0, 0.0, chance.uniform(0.0, 0.2)])
    if draw < 0.3:
        manager.declare(name, chance.choice([None, None, True, False]))
    elif draw < 0.4:
        for declared in sorted(manager.declared())[: chance.randint(1, 4)]:
            manager.withdraw(declared)
    elif draw < 0.6:
        manager.set(chance.choice(["near", "lit"]), chance.random() < 0.7, evidence_s=evidence_s)
    elif draw < 0.8:
        sensor = f"s{chance.randrange(SENSORS)}"
        manager.agent("device").set(sensor, chance.random() < 0.8, evidence_s=evidence_s)
    elif draw < 0.9:
        manager.expect(f"k{chance.randrange(8)}")
    else:
        with manager.skill(f"k{chance.randrange(8)}") as skill, skill.acting():
            manager._clock.sleep(chance.uniform(0.0, 0.1))


@pytest.mark.parametrize("seed", range(3))
def test_ticking_by_change_gives_the_same_events_and_readings_as_ticking_every_tree(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_change, every_tree = (CountingForestFactory(forest) for forest in (Forest, EveryTree))

    assert story(seed, by_change, monkeypatch) == story(seed, every_tree, monkeypatch)
    assert 5 * by_change.ticks < every_tree.ticks


class RenewalOverlookingForest(Forest):
    """A deliberate bug: newer evidence for the same value ticks no reader, not even a reader of its age."""

    def changed(self, variable: str, is_renewed: bool) -> None:
        if not is_renewed:
            super().changed(variable, is_renewed)


def test_an_overlooked_change_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    stories = [story(4, CountingForestFactory(forest), monkeypatch) for forest in (RenewalOverlookingForest, EveryTree)]

    assert stories[0] != stories[1]
