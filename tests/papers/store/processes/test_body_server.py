"""The body of the robot over a socket: the same sensor values and commands, and no command without its process."""

from __future__ import annotations

import queue
import socket
import threading
from collections.abc import Callable, Iterator
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path

import numpy as np
import pytest

from codra_papers.store.body import Body, Lift, Outcome, Side, Way
from codra_papers.store.processes.body_server import BodyServer
from codra_papers.store.processes.event_clock import EventClock
from codra_papers.store.processes.remote_body import RemoteBody
from codra_papers.store.simulator.situations import StoreSettings, beginning
from codra_papers.store.simulator.world import StoreWorld

KEY = b"key of the test"
PATIENCE_S = 60.0


@pytest.fixture
def clock() -> Iterator[EventClock]:
    clock = EventClock(start_s=0.0)
    with clock:
        yield clock


@pytest.fixture
def world(clock: EventClock) -> StoreWorld:
    return StoreWorld(clock, beginning(StoreSettings(shoppers=0)))


@pytest.fixture
def path(world: StoreWorld, clock: EventClock, tmp_path: Path) -> Iterator[Path]:
    with BodyServer(world.body, clock, tmp_path / "body.sock", KEY):
        yield tmp_path / "body.sock"


def connect(path: Path, on_lost: Callable[[], object] = lambda: None) -> RemoteBody:
    return RemoteBody(path, KEY, EventClock(), on_lost)


def test_a_body_elsewhere_has_the_sensor_values_of_the_body(world: StoreWorld, path: Path) -> None:
    body: Body = connect(path)

    assert body.battery_percent() == world.body.battery_percent()
    assert body.localisation_spread_m() == world.body.localisation_spread_m()
    assert body.believed_pose().distance_m(world.body.believed_pose()) < 0.2
    assert (body.is_charging(), body.has_load(), body.is_bumped(), body.speed_m_s()) == (False, False, False, 0.0)
    assert np.array_equal(body.scan(Side.BACK).bearings_rad, world.body.scan(Side.BACK).bearings_rad)
    assert body.look().is_steady


def test_a_command_reports_its_end_and_can_be_stopped(path: Path) -> None:
    body, outcomes = connect(path), queue.Queue[Outcome]()
    body.set_max_speed(1.0)
    body.lift(Lift.UP, outcomes.put)
    assert outcomes.get(timeout=PATIENCE_S) is Outcome.DONE
    stop = body.drive((body.believed_pose().point_at(3.0),), Way.FORWARD, outcomes.put)
    stop()
    assert outcomes.get(timeout=PATIENCE_S) is Outcome.STOPPED
    stop()
    body.turn(0.1, outcomes.put)
    assert outcomes.get(timeout=PATIENCE_S) is Outcome.DONE


def test_the_commands_of_a_lost_process_are_stopped(world: StoreWorld, path: Path) -> None:
    process, lost = Client(str(path), "AF_UNIX", authkey=KEY), threading.Event()
    stopped = threading.Event()
    world.watch(lambda state: stopped.set() if lost.is_set() and state.robot.speed_m_s == 0.0 else None)
    moving = threading.Event()
    world.watch(lambda state: moving.set() if state.robot.speed_m_s > 0.1 else None)
    process.send((1, "drive", ((world.body.believed_pose().point_at(6.0),), Way.FORWARD)))
    assert moving.wait(PATIENCE_S)
    start = world.body.believed_pose()
    process.close()
    lost.set()
    assert stopped.wait(PATIENCE_S)
    assert world.body.believed_pose().distance_m(start) < 3.0


def test_a_process_without_the_key_is_refused_and_others_are_served_on(path: Path) -> None:
    with pytest.raises((AuthenticationError, EOFError, OSError)):
        Client(str(path), "AF_UNIX", authkey=b"another key")

    assert connect(path).battery_percent() == 100.0


def test_a_process_that_is_killed_while_it_connects_does_not_end_the_server(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as killed:
        killed.connect(str(path))

    assert connect(path).battery_percent() == 100.0


def test_a_lost_server_is_reported(tmp_path: Path) -> None:
    path, lost = tmp_path / "body.sock", threading.Event()
    with Listener(str(path), "AF_UNIX", authkey=KEY) as listener:
        accepted = queue.Queue[Connection]()
        threading.Thread(target=lambda: accepted.put(listener.accept())).start()
        body = connect(path, lost.set)
        accepted.get(timeout=PATIENCE_S).close()

    assert lost.wait(PATIENCE_S)
    with pytest.raises(ConnectionError, match="the robot's body is gone"):
        body.battery_percent()


def test_events_and_callbacks_of_an_event_clock_run_in_one_thread(clock: EventClock) -> None:
    threads: queue.Queue[int] = queue.Queue()
    clock.call_at(clock.now_s(), lambda: threads.put(threading.get_ident()))
    clock.start(lambda _: threads.put(threading.get_ident()), lambda _: threads.put(threading.get_ident()))
    assert len({threads.get(timeout=PATIENCE_S) for _ in range(3)}) == 1
    errors: queue.Queue[BaseException] = queue.Queue()

    def wait(work: object) -> None:
        try:
            work.sleep(1.0)  # type: ignore[attr-defined]
        except RuntimeError as error:
            errors.put(error)

    clock.start(wait, lambda _: None)
    assert "must not wait" in str(errors.get(timeout=PATIENCE_S))


def test_an_event_clock_reports_events_that_fail() -> None:
    errors: queue.Queue[BaseException] = queue.Queue()
    with EventClock(on_error=errors.put) as clock:
        clock.call_at(clock.now_s(), lambda: dict[str, None]()["missing"])

        assert isinstance(errors.get(timeout=PATIENCE_S), KeyError)
