"""What the users of a network can do to each other: real routers, with TLS, users and access control."""

from __future__ import annotations

import json
import stat
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh

from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.remote import NetworkAddress, NotPermittedError, RemoteContext
from codra_dsl.runtime.remote.permissions import Permissions
from codra_dsl.runtime.remote.protocol import REQUESTS, VERSION, request_of
from codra_dsl.runtime.remote.security import SecurityError, access_control, write_credentials
from codra_dsl.runtime.remote.zenoh_server import check_exposure
from codra_dsl.runtime.remote.zenoh_session import ZenohSession
from tests.runtime.remote.test_hosts import ARM, world
from tests.runtime.remote.test_network import Manager, eventually, free_port, host_at, manager_at

SPEC = "test"
SOON_S = 0.5
"""How long a test waits for something that must not happen."""


@pytest.fixture(scope="module")
def credentials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("robot") / "credentials"
    write_credentials(folder, SPEC, hosts=[ARM], agents=["gripper"], names=["127.0.0.1"])
    return folder


@pytest.fixture(scope="module")
def endpoint() -> str:
    return f"tls/127.0.0.1:{free_port()}"


@pytest.fixture(scope="module")
def manager(credentials: Path, endpoint: str) -> Iterator[Manager]:
    with manager_at(NetworkAddress(endpoint, credentials / "manager.json5")) as codra:
        yield codra


@pytest.fixture
def address_as(manager: Manager, credentials: Path, endpoint: str) -> Callable[[str], NetworkAddress]:
    del manager
    return lambda user: NetworkAddress(endpoint, credentials / f"{user}.json5")


@pytest.fixture
def attacker(address_as: Callable[[str], NetworkAddress]) -> Iterator[ZenohSession]:
    session = ZenohSession(address_as("gripper"), is_router=False)
    assert session.find("codra/*/manager", 5.0) == [f"codra/{SPEC}/manager"]
    yield session
    session.close()


def test_each_user_works_in_its_own_name(manager: Manager, address_as: Callable[[str], NetworkAddress]) -> None:
    with host_at(address_as(ARM), world()), RemoteContext(address_as("main_execution")) as codra:
        codra.declare("door_open")
        codra.set("near", True)
        eventually(lambda: codra.get("door_open").known)
        with RemoteContext(address_as("operator")) as operator:
            operator.override("near", False, for_s=60.0, reason="test")
            assert manager.get("near").value is False
            operator.clear_override("near")


@pytest.mark.parametrize(
    ("user", "attempt"),
    [
        ("operator", lambda codra: codra.set("near", True)),
        ("gripper", lambda codra: codra.set("near", True)),
        ("gripper", lambda codra: codra.declare("near", True)),
        ("main_execution", lambda codra: codra.override("near", True, for_s=5.0, reason="x")),
        ("main_execution", lambda codra: codra.set("near", True, agent="gripper")),
    ],
    ids=["operator sets", "agent sets", "agent declares a value", "main overrides", "main sets as agent"],
)
def test_the_manager_refuses_what_a_user_may_not_request(
    user: str, attempt: Callable[[RemoteContext], None], address_as: Callable[[str], NetworkAddress]
) -> None:
    with RemoteContext(address_as(user)) as codra, pytest.raises(NotPermittedError, match=f"user '{user}' may not"):
        attempt(codra)


def test_no_program_connects_without_a_password_or_with_a_wrong_one(
    address_as: Callable[[str], NetworkAddress], tmp_path: Path, endpoint: str
) -> None:
    settings = json.loads(address_as("operator").config.read_text(encoding="utf-8"))  # type: ignore[union-attr]
    for user in ({"user": "operator", "password": "wrong"}, {}):
        settings["transport"]["auth"]["usrpwd"] = user
        forged = tmp_path / "forged.json5"
        forged.write_text(json.dumps(settings), encoding="utf-8")
        with pytest.raises(ConnectionError):
            RemoteContext(NetworkAddress(endpoint, forged))


# Each of the rules that `access_control` writes, against a user who tries what the rule does not allow


def test_a_message_in_the_name_of_another_user_has_no_effect(manager: Manager, attacker: ZenohSession) -> None:
    hello = json.dumps({"codra": VERSION, "id": 1, "ask": "declare", "variable": "bumped"}).encode()
    attacker.send(f"codra/{SPEC}/to/main_execution/0123", hello, "1")
    time.sleep(SOON_S)
    assert "bumped" not in manager.declared()


def test_the_messages_of_another_user_are_not_received(
    attacker: ZenohSession, address_as: Callable[[str], NetworkAddress]
) -> None:
    heard: list[str] = []
    for key in (f"codra/{SPEC}/from/**", f"codra/{SPEC}/to/**", f"codra/{SPEC}/from/main_execution/*", "**"):
        attacker.subscribe(key, lambda sent_key, *_: heard.append(sent_key))
    with RemoteContext(address_as("main_execution")) as codra:
        codra.get("near")
        time.sleep(SOON_S)
    assert heard == []


def test_an_answer_in_the_name_of_the_manager_reaches_nobody(
    attacker: ZenohSession, address_as: Callable[[str], NetworkAddress]
) -> None:
    with RemoteContext(address_as("main_execution")) as codra:
        link = codra._link._name  # type: ignore[attr-defined]
        closed = json.dumps({"codra": VERSION, "notice": "closed", "message": "forged"}).encode()
        for number in range(2, 20):
            attacker.send(f"codra/{SPEC}/from/{link}", closed, str(number))
        time.sleep(SOON_S)
        assert codra.get("near").name == "near"


def test_nobody_else_appears_as_a_manager_or_as_another_user(
    attacker: ZenohSession, address_as: Callable[[str], NetworkAddress]
) -> None:
    seen: list[str] = []
    witness = ZenohSession(address_as("operator"), is_router=False)
    witness.watch("codra/*/manager", lambda key, _: seen.append(key))
    for key in ("codra/other/manager", f"codra/{SPEC}/client/operator/0123", "codra/anything"):
        attacker.show(key)
    time.sleep(SOON_S)
    assert seen == [f"codra/{SPEC}/manager"]
    assert witness.find("codra/*/manager", 5.0) == [f"codra/{SPEC}/manager"]
    assert set(witness.find("**", 5.0)) <= {f"codra/{SPEC}/manager"}  # the router refuses this query
    witness.close()


def test_a_user_who_leaves_does_not_end_the_sessions_of_others(
    manager: Manager, attacker: ZenohSession, address_as: Callable[[str], NetworkAddress]
) -> None:
    with RemoteContext(address_as("main_execution")) as codra:
        codra.declare("bumped")
        attacker.show(f"codra/{SPEC}/client/{codra._link._name}")  # type: ignore[attr-defined]
        time.sleep(SOON_S)
        attacker.close()
        time.sleep(SOON_S)
        assert "bumped" in manager.declared()
        assert codra.get("near").name == "near"


def test_zenoh_enforces_one_rule_for_each_kind_of_message() -> None:
    control = access_control(SPEC, ["a"])
    assert control["default_permission"] == "deny"
    config = zenoh.Config()
    config.insert_json5("access_control", json.dumps(control))


def test_credentials_are_for_their_owner_only_and_are_never_replaced(credentials: Path) -> None:
    assert {path.name for path in credentials.iterdir()} == {
        "manager.json5",
        "passwords",
        *(f"{user}.json5" for user in ("main_execution", "operator", ARM, "gripper")),
    }
    assert {stat.S_IMODE(path.stat().st_mode) for path in credentials.iterdir()} == {0o600}
    with pytest.raises(SecurityError, match="exists: choose another folder"):
        write_credentials(credentials, SPEC, hosts=[], agents=[], names=["127.0.0.1"])


@pytest.mark.parametrize("change", ["no users", "no rules", "rules that permit everything"])
def test_a_manager_with_tls_but_without_users_and_rules_listens_only_to_its_own_machine(
    change: str, credentials: Path, tmp_path: Path
) -> None:
    settings = json.loads((credentials / "manager.json5").read_text(encoding="utf-8"))
    match change:
        case "no users":
            del settings["transport"]["auth"]
        case "no rules":
            del settings["access_control"]
        case _:
            settings["access_control"]["default_permission"] = "allow"
    path = tmp_path / "manager.json5"
    path.write_text(json.dumps(settings), encoding="utf-8")
    with pytest.raises(PermissionError, match="other machines could connect"):
        check_exposure(NetworkAddress("tls/192.168.1.5:7447", path))


def test_a_manager_with_tls_and_users_may_listen_to_other_machines(credentials: Path) -> None:
    check_exposure(NetworkAddress("tls/192.168.1.5:7447", credentials / "manager.json5"))


@pytest.mark.parametrize("text", ["", "{", "{transport: {auth: 5}}"])
def test_credentials_that_cannot_be_read_are_named(text: str, tmp_path: Path) -> None:
    path = tmp_path / "operator.json5"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConnectionError, match=f"the credentials '{path}' cannot be read: [^\n]+$"):
        ZenohSession(NetworkAddress("tls/127.0.0.1:7447", path), is_router=False)


@pytest.mark.parametrize(
    ("hosts", "agents", "kind"),
    [
        (["manager"], [], "host 'manager'"),
        (["operator"], [], "host 'operator'"),
        (["main_execution"], [], "host 'main_execution'"),
        ([ARM], [ARM], f"host '{ARM}'"),
        ([], ["operator"], "agent 'operator'"),
        ([], ["passwords"], "agent 'passwords'"),
    ],
)
def test_no_user_gets_the_credentials_of_another_one(
    hosts: list[str], agents: list[str], kind: str, tmp_path: Path
) -> None:
    with pytest.raises(SecurityError, match=f"{kind} has the name of another user"):
        write_credentials(tmp_path / "new", SPEC, hosts=hosts, agents=agents, names=["127.0.0.1"])
    assert not (tmp_path / "new").exists()


def test_a_decision_of_a_user_who_may_not_report_its_own_value_has_this_value(
    manager: Manager, address_as: Callable[[str], NetworkAddress]
) -> None:
    with RemoteContext(address_as("gripper")) as codra:
        codra.declare("door_open")
        assert codra.decide("door_open", lambda: True) is True
    assert manager.record.of(Kind.DECISION, "door_open")[-1].details["raised"] == "NotPermittedError"


def test_a_message_that_is_no_request_does_not_end_the_messages_of_its_link(attacker: ZenohSession) -> None:
    answers: list[object] = []
    attacker.subscribe(f"codra/{SPEC}/from/gripper/0123", lambda _key, payload, _: answers.append(json.loads(payload)))
    keep = json.dumps({"codra": VERSION, "id": 7, "ask": "keep"}).encode()
    for number, payload in enumerate((keep, b"no request", keep), 1):
        attacker.send(f"codra/{SPEC}/to/gripper/0123", payload, str(number))
    eventually(lambda: len(answers) == 3)
    assert ["error" in answer for answer in answers] == [False, True, False]  # type: ignore[operator]


def test_every_request_is_permitted_to_somebody() -> None:
    users = ["main_execution", "operator", ARM, "gripper", "viewer"]
    example = {"host": ARM, "agent": "gripper", "pose": [0.0] * 7}
    for ask, shape in REQUESTS.items():
        fields = {name: example.get(name, _fitting(str(kind))) for name, kind in shape.required.items()}
        request = request_of({"codra": VERSION, "ask": ask, **fields})
        permitted = []
        for user in users:
            try:
                Permissions(user=user, hosts=[ARM], agents=["gripper"]).check(request)
                permitted.append(user)
            except NotPermittedError:
                pass
        assert permitted, ask
        assert ("viewer" in permitted) <= ("main_execution" in permitted)


def _fitting(kind: str) -> object:
    examples: dict[str, object] = {"a text": "near", "a list of two": [0.0, 1.0], "a list of at most": []}
    return next((example for start, example in examples.items() if kind.startswith(start)), 1)


def test_an_address_with_tls_and_without_credentials_says_what_is_missing(
    address_as: Callable[[str], NetworkAddress],
) -> None:
    endpoint = address_as("operator").endpoint
    with pytest.raises(ConnectionError, match="it needs the credentials of one of them"):
        RemoteContext(NetworkAddress(endpoint))
    with pytest.raises(ConnectionError, match="codra serve --write-security"):
        ZenohSession(NetworkAddress(f"tls/127.0.0.1:{free_port()}"), is_router=True)
