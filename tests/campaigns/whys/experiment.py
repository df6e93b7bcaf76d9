"""One experiment: a run, an explanation of an unknown variable, and a second run with the missing conditions."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.journal.events_in_file import EventsInFile
from codra_dsl.runtime.journal.reader import JournalReader
from tests.campaigns.whys.arena import Run, package, run_until, write
from tests.command_server import run_codra

LONGEST_S = 14.0
WATCHED_S = 12.0
DRAWS = 400


@dataclass(frozen=True)
class Outcome:
    """The result of an experiment.

    Attributes:
        point: a description of the spec, the variable and the instant.
        named: how many conditions were reported as missing.
        looked: whether an algorithm then began to look without further changes; None if no algorithm identifies it.
        mistake: a description of the mistake; empty if there is none.
    """

    point: str
    named: int
    looked: bool | None
    mistake: str


def experiment(seed: int, folder: Path) -> Outcome:
    """Run, ask about an unknown variable, run again up to that instant, supply the missing conditions, and compare."""
    chance, module, journal = Random(f"point {seed}"), package(seed, folder), folder / "run.mcap"
    run_until(module, seed, LONGEST_S, journal).manager.close()
    name, at_s = _unknown(journal, module, chance)
    point = f"seed {seed}: {module.MODEL.name} {name} at {at_s}"
    missing = asked(journal, name, at_s)
    run = run_until(module, seed, at_s, None)
    blocked = run.manager.obstacle(name)
    if run.manager.get(name).known:
        return Outcome(point, len(missing), None, "it is known in the second run")
    if bool(blocked) is not bool(missing):
        return Outcome(point, len(missing), None, f"blocked by {blocked!r}, and missing is {missing}")
    run.still_since_s = at_s
    for change in missing:
        _supply(run, name, change)
    left = run.manager.obstacle(name)
    observed = any(name in observer.identifies for observer in run.model.observers)
    if observed and left:
        return Outcome(point, len(missing), None, f"still blocked by {left}, after {missing}")
    if not observed and not run.manager.get(name).known:
        return Outcome(point, len(missing), None, f"still unknown, after {missing}")
    return Outcome(point, len(missing), _looks(run, name), "")


def asked(journal: Path, name: str, at_s: float) -> list[dict[str, Any]]:
    """Return the conditions that `codra why` reports as missing; the experiment uses no other result of the run."""
    arguments = ("why", name, "--journal", str(journal), "--at", repr(at_s), "--format", "json")
    done = run_codra(arguments, Path.cwd(), os.environ)
    assert done.returncode == 0, done.stderr.decode()
    missing: list[dict[str, Any]] = json.loads(done.stdout)["missing"]
    return missing


def _unknown(journal: Path, module: ModuleType, chance: Random) -> tuple[str, float]:
    """Return a random variable and an instant at which it was unknown."""
    names = [variable.name for variable in module.MODEL.variables]
    with JournalReader(journal) as reader:
        past = EventsInFile(reader, reader.header().summary, ends_before_close=False)
        for _ in range(DRAWS):
            name, at_s = chance.choice(names), chance.uniform(0.0, LONGEST_S)
            event = past.latest_events(at_s).present_events.get(name)
            if event is None or event.what != "identified":
                return name, at_s
    raise AssertionError(f"all is known all the time in {journal}")


def _supply(run: Run, name: str, missing: dict[str, Any]) -> None:
    """Make a missing change: write a value, wait for an instant, declare, or write as another source."""
    if missing["value"] is not None:
        write(run, missing["variable"], missing["value"])
    elif missing["from_s"] is not None:
        run.clock.sleep(missing["from_s"] - run.clock.now_s())
    elif missing["condition"].startswith("declare "):
        run.manager.declare(missing["variable"])
    elif missing["condition"].startswith("only "):
        kind = next(variable.type for variable in run.model.variables if variable.name == name)
        write(run, name, {"bool": True, "int": 1, "float": 1.0}.get(kind.kind, next(iter(kind.members), "text")))


def _looks(run: Run, name: str) -> bool | None:
    """Return whether an algorithm of a variable looks now or soon, without further changes."""
    observer = next(
        (candidate for candidate in run.manager._forest.observers.values() if name in candidate.model.identifies), None
    )
    if observer is None:
        return None
    algorithms = {branch.algorithm.name for branch in observer.branches if name in branch.value_terms}
    from_s, until_s = run.clock.now_s(), run.clock.now_s() + WATCHED_S
    while run.clock.now_s() < until_s:
        if any(event.name in algorithms and event.instant_s >= from_s for event in run.manager.record.of(Kind.JOB)):
            return True
        run.clock.sleep(0.5)
    return False
