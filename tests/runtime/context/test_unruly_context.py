"""Hysteresis, expectations, events and subscribers together, under threads in real time, and their replay."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.logic import Term, age, known, value
from codra_dsl.runtime import ContextModel, Journal, Kind, NotDeclaredError, Reason, WallClock
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import between, confirmed
from codra_dsl.runtime.values.model import ExpectationModel, SkillModel, real
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, variable
from tests.runtime.journal.journals import read

Manager = ContextManager[str, str]
NAMES = [f"v{number}" for number in range(8)]
GAP = value("gap")
FORMS: list[Term] = [
    GAP > 0.5,
    between(GAP > 0.6, GAP < 0.4),
    confirmed(GAP > 0.5, 2, 3),
    confirmed(between(GAP > 0.6, GAP < 0.4), 2, 2),
]


def unruly(job: Any) -> object:
    if job.random.random() < 0.5:
        job.evidence(job.now_s(), job.now_s())
    job.sleep(job.random.random() * 0.01)
    if job.random.random() < 0.1:
        raise ValueError("no picture")
    return {"gap": job.random.choice([None, 0.5, 0.7, 0.8, 0.2, 0.3])}


def unruly_model(seed: int) -> ContextModel:
    chance = random.Random(seed)
    variables = [
        variable(
            name,
            when_unobservable=chance.choice(["keep", "forget"]),
            valid_for_s=chance.choice([0.05, 0.3, 60.0]),
            refresh=chance.choice(["periodic", "on_event"]),
        )
        for name in NAMES
    ]
    observers = []
    for number in range(0, len(NAMES), 2):
        pair = NAMES[number : number + 2]
        when = [value("near")] if chance.random() < 0.5 else [known("near") | ~known(pair[0])]
        looks = [
            Look(
                algorithm(f"look_{rank}_{number}", {"gap": real(optional=True)}),
                {name: chance.choice(FORMS) for name in pair},
                when if rank else (),
            )
            for rank in range(chance.choice([1, 2]))
        ]
        observers.append(observer(f"o{number}", *looks, period_s=chance.choice([0.01, 0.03])))
    skills = [unruly_skill(f"s{number}", chance) for number in range(4)]
    return forest([*variables, given("near", valid_for_s=0.1)], *observers, skills=skills)


def unruly_skill(name: str, chance: random.Random) -> SkillModel:
    monitor = tuple(chance.sample(NAMES, 3))
    expects = [
        ExpectationModel(
            text=f"{variable_name} ...",
            condition=chance.choice([value(variable_name), ~value(variable_name)]),
            **chance.choice([{}, {"within_s": 0.02}, {"within_s": 0.2}]),
        )
        for variable_name in monitor
    ]
    changes = tuple(chance.sample(NAMES, 2))
    return SkillModel(name=name, preview=(), monitor=monitor, changes=changes, expects=tuple(expects))


def hammer(manager: Manager, clock: WallClock, seed: int, end_s: float) -> None:
    chance = random.Random(seed)

    def look(_: str) -> bool | None:
        return chance.choice([True, False, None])

    while clock.now_s() < end_s:
        name, action = chance.choice(NAMES), chance.randrange(7)
        if action == 0:
            manager.declare(name)
        elif action == 1:
            manager.withdraw(name)
        elif action == 2:
            manager.set("near", chance.random() < 0.7)
        elif action == 3:
            with manager.skill(f"s{chance.randrange(4)}") as skill:
                with skill.acting(), skill.subscribe(lambda _: manager.set("near", True)):
                    clock.sleep(chance.random() * 0.03)
                verification = skill.verify(chance.choice([look, None]), wait_up_to_s=chance.choice([0.0, 0.03]))
                assert len(verification.met) + len(verification.violated) + len(verification.not_seen) == 3
        elif action == 4:
            assert manager.why(name).variable == name
            with manager.subscribe([name, "near"], lambda reading: manager.get(reading.name)):
                clock.sleep(chance.random() * 0.01)
        elif action == 5:
            manager.wait_for(chance.choice([name, value(name) | (age("near") > 0.01)]), 0.01)
        else:
            manager.decide(name, lambda: chance.choice([True, None]), wait_up_to_s=chance.choice([0.0, 0.01]))


def in_threads(count: int, body: Callable[[int], None]) -> list[BaseException]:
    errors: list[BaseException] = []

    def run(number: int) -> None:
        try:
            body(number)
        except NotDeclaredError:
            pass
        except BaseException as error:  # noqa: BLE001 - returned below
            errors.append(error)

    threads = [threading.Thread(target=run, args=(number,), daemon=True) for number in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert not any(thread.is_alive() for thread in threads)
    return errors


@pytest.mark.parametrize("seed", range(3))
def test_a_run_under_threads_is_replayed_byte_for_byte(tmp_path: Path, seed: int) -> None:
    model, path = unruly_model(seed), tmp_path / "run.mcap"
    world = World({f"look_{rank}_{number}": unruly for rank in range(2) for number in range(0, len(NAMES), 2)})
    with (
        WallClock() as clock,
        Manager(model, clock=clock, resources={"world": world}, seed=seed, record=Journal(path)) as manager,
    ):
        end_s = clock.now_s() + 1.5
        assert in_threads(4, lambda number: hammer(manager, clock, number, end_s)) == []

    header, events = read(path)
    replay_result = replay(header, events, model, Manager, Journal(tmp_path / "again.mcap"))
    assert replay_result.difference is None
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()
    assert {"met", "violated", "not_seen"} <= {event.what for event in events if event.kind is Kind.EXPECTATION}
    reasons = {event.details["reason"] for event in events if event.kind is Kind.JOB and event.what == "rejected"}
    assert {Reason.REJECTED, Reason.UNCONFIRMED} <= reasons
