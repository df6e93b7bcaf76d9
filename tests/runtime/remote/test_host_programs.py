"""The program of a host, in real time: its links to managers, its jobs and its end."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest

from codra_dsl.runtime import ContextManager, SimClock, WallClock
from codra_dsl.runtime.remote.host import Host
from codra_dsl.runtime.remote.json_lines import RESPONSE_TIMEOUT_S, line_of, request_of_line
from codra_dsl.runtime.remote.links import Link, Lose, Receive
from codra_dsl.runtime.remote.protocol import VERSION, PlainData, notice
from codra_dsl.runtime.remote.session import open_session
from tests.runtime.forests import World, algorithm
from tests.runtime.remote.test_hosts import ARM, MODEL, declare_all, world
from tests.runtime.remote.test_network import eventually

PATIENCE_S = 30.0


class RecordedLink:
    """A link to a manager that a test plays."""

    token = None
    response_timeout_s = RESPONSE_TIMEOUT_S

    def __init__(self) -> None:
        self.sent: list[PlainData] = []
        self.receive: Receive = lambda _: None
        self.lose: Lose = lambda _: None
        self.ended_event = threading.Event()

    def open(self, receive: Receive, lose: Lose) -> None:
        self.receive, self.lose = receive, lose

    def send(self, message: PlainData) -> None:
        self.sent.append(message)
        if message["ask"] == "ended":
            self.ended_event.set()

    def close(self) -> None:
        pass

    def order(self, index: int = 0) -> None:
        self.receive(notice("perform", algorithm="look", index=index, random_seed="0", arguments=[]))

    def ended(self, number: int = 0) -> Mapping[str, Any]:
        assert self.ended_event.wait(PATIENCE_S)
        return [message for message in self.sent if message["ask"] == "ended"][number]


@contextmanager
def host(own_world: World, *links: Link) -> Iterator[Host]:
    look = algorithm("look", host=ARM)
    unused_links = iter(links)
    with WallClock() as clock:
        program = Host(ARM, [look], handles={"world": own_world}, clock=clock, connect=lambda: next(unused_links))
        program.start()
        yield program
        program.close()


def test_the_result_of_a_job_of_a_lost_manager_is_not_sent_to_the_next_manager() -> None:
    began_event, release_event, results = threading.Event(), threading.Event(), iter((False, True))

    def slow(_job: Any) -> object:
        result = next(results)
        began_event.set()
        assert release_event.wait(PATIENCE_S)
        return {"seen": result}

    first, second = RecordedLink(), RecordedLink()
    with host(World(finds={"look": slow}), first, second) as program:
        first.order()
        assert began_event.wait(PATIENCE_S)
        first.lose("the manager is gone")
        program.start()
        second.order()
        release_event.set()
        assert second.ended()["values"] == [{"name": "seen", "value": True}]
    assert not first.ended_event.is_set()


def test_a_late_end_of_an_earlier_link_does_not_end_the_next_one() -> None:
    first, second = RecordedLink(), RecordedLink()
    with host(World(finds={"look": {"seen": True}}), first, second) as program:
        first.lose("the manager is gone")
        program.start()
        first.lose("the manager is gone")
        first.receive(notice("closed", message="the manager has closed"))
        first.order()
        second.order()
        assert second.ended()["values"] == [{"name": "seen", "value": True}]
        assert "ended" not in [message["ask"] for message in first.sent]


def test_a_host_that_is_closed_while_it_connects_sends_nothing() -> None:
    link = RecordedLink()

    def connect() -> Link:
        closing.start()
        eventually(lambda: program._is_closed)
        return link

    with WallClock() as clock:
        program = Host(ARM, [], handles={}, clock=clock, connect=connect)
        closing = threading.Thread(target=program.close)
        program.start()
        closing.join(PATIENCE_S)
    assert link.sent == []


def test_a_result_that_the_manager_refuses_is_a_failure() -> None:
    link = RecordedLink()
    with host(World(finds={"look": {"seen": True}}), link):
        link.order()
        error = {"kind": "malformed", "message": "no"}
        link.receive({"codra": VERSION, "id": link.ended()["id"], "error": error})
        assert link.ended(1)["message"] == "the manager refuses its result: no"


def test_an_infinite_value_of_a_host_reaches_the_manager() -> None:
    request = {"codra": VERSION, "ask": "ended", "values": [{"name": "range", "value": math.inf}]}
    assert request_of_line(line_of(request)) == request


@pytest.mark.parametrize(
    "fields",
    [
        {"earliest_s": -math.inf},
        {"earliest_s": -1.0},
        {"earliest_s": 0.1},
        {"start_s": -math.inf, "earliest_s": -math.inf},
        {"start_s": 5.0, "earliest_s": 5.0, "stamp_s": 5.0},
    ],
)
def test_evidence_without_a_start_and_a_stamp_in_the_past_is_refused(fields: dict[str, Any]) -> None:
    sent: list[Mapping[str, Any]] = []
    clock = SimClock()
    with ContextManager[str, str](MODEL, clock=clock, resources={"world": world()}) as manager:
        session = open_session(manager, sent.append)
        session.receive({"codra": VERSION, "id": 1, "ask": "attach", "host": ARM})
        declare_all(manager)
        clock.sleep(0.01)
        assert sent[-1]["notice"] == "perform"
        evidence: dict[str, Any] = {
            "codra": VERSION,
            "ask": "evidence",
            "algorithm": "look",
            "index": 0,
            "host_s": [0.0, 0.0],
        }
        evidence |= {"start_s": 0.0, "earliest_s": 0.0, "stamp_s": 0.0}
        session.receive(evidence | fields)
        assert sent[-1]["error"]["kind"] == "not_allowed"
        session.receive(evidence)
        assert "answer" in sent[-1]
