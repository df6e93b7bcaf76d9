"""Managers, hosts and programs over Zenoh, on this machine."""

from __future__ import annotations

import logging
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from codra_dsl.runtime import ContextManager, WallClock
from codra_dsl.runtime.remote import RemoteContext, zenoh_server
from codra_dsl.runtime.remote.endpoints import connect, serve
from codra_dsl.runtime.remote.host import Host
from codra_dsl.runtime.remote.zenoh_server import check_exposure
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress
from codra_dsl.runtime.values.cell import Reason
from tests.runtime.forests import World
from tests.runtime.remote.test_hosts import ALGORITHMS, ARM, MODEL, declare_all, world

PATIENCE_S = 60.0
Manager = ContextManager[str, str]


def eventually(is_ready: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not is_ready():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def is_gone(codra: RemoteContext) -> bool:
    try:
        codra.get("near")
    except ConnectionError:
        return True
    return False


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def address() -> NetworkAddress:
    return NetworkAddress(f"tcp/127.0.0.1:{free_port()}")


@contextmanager
def manager_at(address: NetworkAddress) -> Iterator[Manager]:
    with (
        WallClock() as clock,
        Manager(MODEL, clock=clock, resources={"world": world()}) as manager,
        serve(manager, address),
    ):
        yield manager


@contextmanager
def host_at(address: NetworkAddress, own_world: World) -> Iterator[Host]:
    with WallClock() as clock:
        host = Host(ARM, ALGORITHMS, handles={"world": own_world}, clock=clock, connect=lambda: connect(address))
        host.start()
        yield host
        host.close()


def test_a_program_uses_a_manager_and_its_host_over_a_network(address: NetworkAddress) -> None:
    readings = []
    with manager_at(address) as manager, host_at(address, world()), RemoteContext(address) as codra:
        codra.declare("door_open")
        codra.subscribe("door_open", readings.append)
        codra.set("near", True)
        eventually(lambda: codra.get("door_open").known)
        assert codra.decide("door_open", lambda: False) is True
        eventually(lambda: any(reading.known for reading in readings))
        assert manager.get("door_open").source == "look"


def test_a_host_that_leaves_is_named_and_another_one_takes_its_place(address: NetworkAddress) -> None:
    with manager_at(address) as manager:
        declare_all(manager)
        with host_at(address, world()):
            eventually(lambda: manager.get("door_open").known)
        eventually(lambda: manager.get("door_open").reason is Reason.UNREACHABLE)
        with host_at(address, world()):
            eventually(lambda: manager.get("door_open").known)


def test_when_the_manager_closes_programs_are_told_and_a_host_waits_for_the_next_manager(
    address: NetworkAddress, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING), host_at(address, world()):
        with manager_at(address) as manager:
            declare_all(manager)
            eventually(lambda: manager.get("door_open").known)
            codra = RemoteContext(address)
        eventually(lambda: is_gone(codra))
        with manager_at(address) as manager:
            declare_all(manager)
            eventually(lambda: manager.get("door_open").known)
    states = [record.args[1] for record in caplog.records if "arm_pc" in record.getMessage()]  # type: ignore[index]
    assert states.count("connected") == 2


def test_a_manager_without_a_free_place_says_so(address: NetworkAddress, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_server, "MAX_CONNECTIONS", 1)
    with manager_at(address), RemoteContext(address) as codra:
        with pytest.raises(ConnectionError, match="1 programs are connected already: connect again when one has left"):
            RemoteContext(address)
        assert codra.get("near").name == "near"


def test_the_address_of_no_manager_is_reported(address: NetworkAddress) -> None:
    with pytest.raises(ConnectionError, match=re.escape("cannot connect at tcp/127.0.0.1")):
        RemoteContext(address)


@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.1.5:7447", "tls/0.0.0.0:7447"])
def test_a_manager_without_users_listens_only_to_its_own_machine(endpoint: str) -> None:
    with pytest.raises(PermissionError, match="other machines could connect"):
        check_exposure(NetworkAddress(endpoint))


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:7447", "tcp/localhost:7447", "tcp/[::1]:7447"])
def test_a_manager_may_listen_to_its_own_machine(endpoint: str) -> None:
    check_exposure(NetworkAddress(endpoint))


PROGRAM = """
import sys
from codra_dsl.runtime.remote import RemoteContext, zenoh_server
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress

codra = RemoteContext(NetworkAddress(sys.argv[1]))
codra.subscribe("near", lambda reading: None)
codra.declare("door_open")
if sys.argv[2] == "raises":
    raise ValueError("the program fails")
"""


@pytest.mark.parametrize("how", ["ends", "raises"])
def test_a_program_that_does_not_close_its_connection_ends(address: NetworkAddress, how: str) -> None:
    with manager_at(address) as manager:
        result = subprocess.run(
            [sys.executable, "-c", PROGRAM, address.endpoint, how],
            cwd=Path(__file__).parents[3],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        assert result.returncode == (how == "raises"), result.stderr
        eventually(lambda: manager.declared() == frozenset())


def test_programs_that_use_no_network_do_not_import_zenoh() -> None:
    code = "import sys, codra_dsl.runtime.remote, codra_dsl.runtime.remote.endpoints; print('zenoh' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "False\n"
