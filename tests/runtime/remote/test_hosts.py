"""Observers whose functions run on a host: over a fake network, in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

import pytest

from codra_dsl.runtime import ContextManager, ContextModel, Journal, SimClock
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal import EventLog, Kind
from codra_dsl.runtime.observers.observer import Observer
from codra_dsl.runtime.remote.fake_network import FakeNetwork, Faults
from codra_dsl.runtime.remote.host import Host
from codra_dsl.runtime.remote.session import open_session
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.values.conditions_held import has_held
from codra_dsl.runtime.values.model import SkillModel
from tests.runtime.forests import World, events, forest, given, observer, seen, takes, variable
from tests.runtime.journal.journals import read
from tests.runtime.remote.skewed_clock import SkewedClock

ARM = "arm_pc"
LOOK = seen("look", "door_open", when=[value("near")], host=ARM)
NEAR_BY = seen("ask_gripper", "door_open")
BUMPER = seen("feel", "bumped")
VARIABLES = (variable("door_open", valid_for_s=10.0), variable("bumped"), given("near"))
MODEL = forest(VARIABLES, observer("doors", LOOK), observer("bumps", BUMPER))
WITH_ALTERNATIVE = forest(VARIABLES, observer("doors", LOOK, NEAR_BY), observer("bumps", BUMPER))

ALGORITHMS = tuple(look.algorithm for look in (LOOK, NEAR_BY, BUMPER))


def world() -> World:
    true = {"seen": True}
    return World(
        finds={
            "look": takes(0.2, true, snapshot=True),
            "ask_gripper": takes(0.1, true),
            "feel": takes(0.05, true, snapshot=True),
        }
    )


@dataclass
class Robot:
    """A manager, a host, and the network between them."""

    manager: ContextManager[str, str]
    clock: SimClock
    network: FakeNetwork
    host: Host
    world: World = field(default_factory=World)


@contextmanager
def robot(
    model: ContextModel = MODEL,
    *,
    faults: Faults | None = None,
    seed: int = 0,
    record: EventLog | None = None,
    host_clock: Callable[[SimClock], Clock] = lambda clock: clock,
    own_world: World | None = None,
    **host_settings: Any,
) -> Iterator[Robot]:
    clock, handles = SimClock(), {"world": world() if own_world is None else own_world}
    network = FakeNetwork(clock, seed=seed, faults=faults)
    with ContextManager[str, str](model, clock=clock, resources=handles, record=record) as manager:
        host = Host(
            ARM,
            ALGORITHMS,
            handles=handles,
            clock=host_clock(clock),
            connect=partial(network.connect, manager),
            **host_settings,
        )
        host.start()
        yield Robot(manager, clock, network, host, handles["world"])
        host.close()


def declare_all(manager: ContextManager[str, str]) -> None:
    manager.set("near", True)
    manager.declare("door_open")
    manager.declare("bumped")


def test_without_faults_the_record_is_that_of_one_process() -> None:
    records = []
    for is_hosted in (False, True):
        clock, handles = SimClock(), {"world": world()}
        with ContextManager[str, str](
            WITH_ALTERNATIVE, clock=clock, resources=handles, hosts_here=not is_hosted
        ) as manager:
            if is_hosted:
                network = FakeNetwork(clock)
                connect = partial(network.connect, manager)
                Host(ARM, ALGORITHMS, handles=handles, clock=clock, connect=connect, max_drift=0.0).start()
            declare_all(manager)
            for _ in range(20):
                clock.sleep(0.73)
                manager.set("near", not manager.get("near").value)
            records.append(manager.record.text())
    assert records[0] == records[1]
    assert records[0].count('"returned"') > 20


def test_a_variable_is_unknown_until_its_host_connects() -> None:
    clock = SimClock()
    with ContextManager[str, str](MODEL, clock=clock, resources={"world": world()}) as manager:
        declare_all(manager)
        clock.sleep(1.0)
        reading = manager.get("door_open")
        assert (reading.reason, reading.detail) == (
            Reason.UNREACHABLE,
            "host 'arm_pc' is not connected: it has not connected yet",
        )
        assert manager.get("bumped").value is True
        assert "missing: connect host 'arm_pc'" in str(manager.why("door_open"))


def test_when_the_link_is_cut_exactly_the_variables_of_the_host_become_unknown_and_recover() -> None:
    with robot() as here:
        declare_all(here.manager)
        here.clock.sleep(3.0)
        assert here.manager.get("door_open").value is True
        here.network.is_cut = True
        here.clock.sleep(2.0)
        reading = here.manager.get("door_open")
        assert reading.reason is Reason.UNREACHABLE
        assert "host 'arm_pc' is not connected" in reading.detail
        assert here.manager.get("bumped").value is True
        here.clock.sleep(8.0)
        assert here.manager.get("door_open").reason is Reason.UNREACHABLE
        here.network.is_cut = False
        here.clock.sleep(2.0)
        assert here.manager.get("door_open").value is True
        assert events(here.manager, Kind.HOST) == ["connected", "lost", "connected"]


def test_an_alternative_takes_over_without_a_gap_when_the_host_is_lost() -> None:
    with robot(WITH_ALTERNATIVE) as here:
        declare_all(here.manager)
        here.clock.sleep(3.0)
        assert here.manager.get("door_open").source == "look"
        here.network.is_cut = True
        here.clock.sleep(4.0)
        assert here.manager.get("door_open").source == "ask_gripper"
        assert [event.what for event in here.manager.record.of(Kind.VARIABLE, "door_open")] == (
            ["identified"] * len(here.manager.record.of(Kind.VARIABLE, "door_open"))
        )
        here.network.is_cut = False
        here.clock.sleep(2.0)
        assert here.manager.get("door_open").source == "look"


def test_an_alternative_takes_over_without_its_pause_when_the_host_is_lost_again() -> None:
    with robot(WITH_ALTERNATIVE) as here:
        declare_all(here.manager)
        for _ in range(4):
            here.network.is_cut = False
            here.clock.sleep(2.3)
            here.network.is_cut = True
            here.clock.sleep(1.6)
        here.network.is_cut = False
        here.clock.sleep(2.0)
        whats = [event.what for event in here.manager.record.of(Kind.VARIABLE, "door_open")]
        assert whats == ["identified"] * len(whats)
        assert len(here.manager.record.of(Kind.HOST)) >= 9


def test_a_lost_host_cancels_its_jobs() -> None:
    slow_world = world()
    ended_s: list[float] = []

    def slow(job: Any) -> object:
        job.sleep(4.0)
        ended_s.append(job.now_s())
        return {"seen": True}

    slow_world.finds["look"] = slow
    with robot(own_world=slow_world) as here:
        declare_all(here.manager)
        here.clock.sleep(1.0)
        here.network.is_cut = True
        here.clock.sleep(3.0)
        (failure,) = [event for event in here.manager.record.of(Kind.JOB, "look") if event.what == "failed"]
        assert failure.details["reason"] == Reason.UNREACHABLE
        assert failure.instant_s <= 3.0


def test_results_of_a_job_that_was_ended_count_no_more() -> None:
    sent: list[Mapping[str, Any]] = []
    with robot() as here:
        session = open_session(here.manager, sent.append)
        declare_all(here.manager)
        here.clock.sleep(0.1)
        forged = {"codra": 1, "id": 1, "ask": "ended", "algorithm": "look", "index": 1}
        session.receive({**forged, "values": [{"name": "seen", "value": False}]})
        here.clock.sleep(1.0)
        assert here.manager.get("door_open").value is True


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"host": "arm_cp"}, "the spec has no host 'arm_cp': did you mean 'arm_pc'?"),
        ({"host": ARM}, "host 'arm_pc' is connected already: only one program can be this host"),
        (
            {"host": ARM, "digest": "sha256:other"},
            "host 'arm_pc' has another version of the spec than the manager: "
            "compile both from the same files, with the same --site",
        ),
    ],
)
def test_a_host_that_cannot_be_attached_is_told_why(fields: Mapping[str, str], message: str) -> None:
    sent: list[Mapping[str, Any]] = []
    with robot() as here:
        open_session(here.manager, sent.append).receive({"codra": 1, "id": 1, "ask": "attach", **fields})
        assert sent[0]["error"]["message"] == message


def test_a_variable_tells_that_its_host_has_another_version_of_the_spec(tmp_path: Path) -> None:
    clock, path = SimClock(), tmp_path / "run.mcap"
    with ContextManager[str, str](MODEL, clock=clock, resources={"world": world()}, record=Journal(path)) as manager:
        declare_all(manager)
        attach = {"codra": 1, "ask": "attach", "host": ARM, "digest": "sha256:other"}
        for _ in range(3):
            clock.sleep(0.5)
            open_session(manager, lambda _: None).receive(attach)
        clock.sleep(0.5)
        detail = "host 'arm_pc' is not connected: it has another version of the spec than the manager"
        assert manager.get("door_open").detail == detail
        assert detail in str(manager.why("door_open"))
        assert events(manager, Kind.HOST) == ["lost"]
    assert replay(*read(path), MODEL, ContextManager, None).difference is None


def test_a_host_over_a_bad_network_loses_no_result_for_good() -> None:
    faults = Faults(delay_s=(0.001, 0.08), loss=0.01, duplication=0.05)
    for seed in range(20):
        with robot(faults=faults, seed=seed) as here:
            declare_all(here.manager)
            known_count = 0
            for _ in range(60):
                here.clock.sleep(1.0)
                known_count += here.manager.get("door_open").known
            assert known_count > 30
            here.network._faults = Faults(delay_s=(0.001, 0.01))
            here.clock.sleep(4.0)
            assert here.manager.get("door_open").value is True


def test_a_run_with_a_host_that_is_lost_is_replayed_without_the_host(tmp_path: Path) -> None:
    path, copied = tmp_path / "run.mcap", tmp_path / "replayed.mcap"
    skewed = partial(SkewedClock, offset_s=3.0, drift=50e-6)
    with robot(WITH_ALTERNATIVE, record=Journal(path), faults=Faults(delay_s=(0.001, 0.02)), host_clock=skewed) as here:
        declare_all(here.manager)
        for cut in (False, True, False, True, False):
            here.network.is_cut = cut
            here.clock.sleep(2.7)
            here.manager.set("near", not here.manager.get("near").value)
    assert replay(*read(path), WITH_ALTERNATIVE, ContextManager, Journal(copied)).difference is None
    assert copied.read_bytes() == path.read_bytes()


@dataclass
class Verdicts:
    """Whether each value that counted also counts if its true evidence is judged by the rules of one process."""

    true_intervals: dict[int, tuple[float, float]] = field(default_factory=dict)
    verdicts: list[bool] = field(default_factory=list)

    def watch(self, monkeypatch: pytest.MonkeyPatch) -> None:
        write = Observer.write

        def watched(observing: Observer, name: str, content: Any, algorithm: str, *stamps_s: float) -> bool:
            cells = observing.services.cells
            does_count = write(observing, name, content, algorithm, *stamps_s)
            if algorithm == "look" and does_count:
                (branch,) = observing.branches
                true_s = self.true_intervals[branch._job_index]
                have_held = all(has_held(term, cells, *true_s) for _, term in branch.conditions)
                self.verdicts.append(have_held and cells[name].admits(*true_s))
            return does_count

        monkeypatch.setattr(Observer, "write", watched)


def run_with_wrong_clock(seed: int, verdicts: Verdicts) -> None:
    random = Random(seed)
    offset_s, drift = random.uniform(-5.0, 5.0), random.uniform(-100e-6, 100e-6)
    verdicts.true_intervals.clear()
    own_world = world()

    def look(job: Any) -> object:
        job.sleep(random.uniform(0.0, 0.3))
        start_s = job.now_s()
        job.sleep(random.uniform(0.0, 0.05))
        stamp_s = job.now_s()
        job.evidence(start_s, stamp_s)
        job.sleep(random.uniform(0.0, 0.2))
        true_start_s, true_stamp_s = ((at_s - offset_s) / (1.0 + drift) for at_s in (start_s, stamp_s))
        verdicts.true_intervals[job.index] = (true_start_s, true_stamp_s)
        return {"seen": True}

    own_world.finds["look"] = look
    faults = Faults(delay_s=(0.0005, random.choice((0.002, 0.02, 0.1))), duplication=0.02)
    push = SkillModel(name="push", changes=("door_open",))
    model = forest(VARIABLES, observer("doors", LOOK, period_s=0.3), observer("bumps", BUMPER), skills=(push,))
    host_clock = partial(SkewedClock, offset_s=offset_s, drift=drift)
    with robot(model, faults=faults, seed=seed, host_clock=host_clock, own_world=own_world) as here:
        declare_all(here.manager)
        for _ in range(12):
            here.clock.sleep(random.uniform(0.05, 0.9))
            if random.random() < 0.3:
                with here.manager.skill("push") as skill, skill.acting():
                    here.clock.sleep(random.uniform(0.0, 0.3))
            else:
                here.manager.set("near", not here.manager.get("near").value)


@pytest.mark.parametrize("first_seed", range(0, 200, 50))
def test_with_wrong_clocks_no_evidence_counts_that_one_process_would_reject(
    first_seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    verdicts = Verdicts()
    verdicts.watch(monkeypatch)
    for seed in range(first_seed, first_seed + 50):
        run_with_wrong_clock(seed, verdicts)
        assert all(verdicts.verdicts), f"seed {seed}"
    assert len(verdicts.verdicts) > 100
