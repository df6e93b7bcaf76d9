"""Agents on a network with TLS and users: each user speaks for the agent of its name, and for no other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from codra_dsl.runtime import ContextManager, NotASourceError, WallClock
from codra_dsl.runtime.knowledge import path
from codra_dsl.runtime.remote import NetworkAddress, NotPermittedError, RemoteContext, serve
from codra_dsl.runtime.remote.security import write_credentials
from tests.runtime.remote import shared_store
from tests.runtime.remote.shared_store import manager
from tests.runtime.remote.test_network import eventually, free_port


@pytest.fixture
def codra() -> Iterator[ContextManager[str, str]]:
    with WallClock() as clock, manager(clock) as codra:
        yield codra


@pytest.fixture
def address_as(codra: ContextManager[str, str], tmp_path: Path) -> Iterator[Callable[[str], NetworkAddress]]:
    folder, endpoint = tmp_path / "credentials", f"tls/127.0.0.1:{free_port()}"
    write_credentials(folder, "store", hosts=[], agents=["fork", "picking"], names=["127.0.0.1"])
    with serve(codra, NetworkAddress(endpoint, folder / "manager.json5")):
        yield lambda user: NetworkAddress(endpoint, folder / f"{user}.json5")


def test_agents_hand_over_a_task_and_write_only_in_their_own_names(
    codra: ContextManager[str, str], address_as: Callable[[str], NetworkAddress]
) -> None:
    with RemoteContext(address_as("picking")) as requester, RemoteContext(address_as("operator")) as operator:
        knowledge = requester.knowledge(shared_store)
        with pytest.raises(NotPermittedError, match="user 'picking' may not request `enter` as agent 'fork'"):
            knowledge.as_agent("fork")
        picking = knowledge.as_agent("picking")
        with pytest.raises(NotPermittedError, match="user 'operator' may not request `enter`"):
            operator.knowledge(shared_store).as_agent("picking")
        with RemoteContext(address_as("fork")) as executor:
            fork = executor.knowledge(shared_store).as_agent("fork")
            with pytest.raises(NotASourceError):
                fork.set("battery", "charge", 1.0)
            fork.acknowledge(picking.request("lifting"))
            assert knowledge.wait_for(path("robot", "is", "lifting"), timeout_s=60.0)
        eventually(lambda: knowledge.snapshot().handover("lifting").reason == "executor_lost")
        viewed = operator.knowledge(shared_store)
        eventually(lambda: viewed.snapshot().handover("lifting").reason == "executor_lost")
    assert {refusal.agent for refusal in codra.knowledge.refusals()} == {"fork"}
