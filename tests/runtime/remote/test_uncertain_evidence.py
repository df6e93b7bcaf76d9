"""Evidence of a host whose clock is known only roughly: what depends on one instant must hold at all possible ones."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from codra_dsl.logic import Term
from codra_dsl.runtime import ContextManager, SimClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.remote.protocol import VERSION, PlainData
from codra_dsl.runtime.remote.session import Session, open_session
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.values.hysteresis import between, confirmed
from codra_dsl.runtime.values.model import integer
from tests.runtime.forests import Look, algorithm, forest, observer, variable

HOST = "arm_pc"
Manager = ContextManager[str, str]


class HandMadeHost:
    """A host that reports what a test says."""

    def __init__(self, manager: Manager, clock: SimClock) -> None:
        self._session: Session = open_session(manager, self._note)
        self._clock = clock
        self.orders: list[PlainData] = []
        self._session.receive({"codra": VERSION, "ask": "hello", "lease_s": 3600.0})
        self._session.receive({"codra": VERSION, "ask": "attach", "host": HOST})

    def _note(self, message: PlainData) -> None:
        assert "error" not in message
        if message.get("notice") == "perform":
            self.orders.append(message)

    def report(self, seen: int, *, earliest_s: float, latest_s: float) -> None:
        """Return a result from evidence that was taken at an instant between two bounds."""
        job = {"algorithm": "look", "index": self.orders[-1]["index"]}
        evidence = {"start_s": earliest_s, "earliest_s": earliest_s, "stamp_s": latest_s, "host_s": [0.0, 0.0]}
        self._session.receive({"codra": VERSION, "ask": "evidence", **job, **evidence})
        self._session.receive({"codra": VERSION, "ask": "ended", **job, "values": [{"name": "seen", "value": seen}]})
        self._clock.sleep(0.001)


@contextmanager
def robot(term: Term, **settings: Any) -> Iterator[tuple[Manager, SimClock, HandMadeHost]]:
    look = Look(algorithm("look", {"seen": integer(0, 9)}, host=HOST, timeout_s=60.0), {"near": term})
    variables = [variable("near", sources=("main_execution",), **settings)]
    clock = SimClock()
    model = forest(variables, observer("looking", look, period_s=1.0))
    with Manager(model, clock=clock, resources={"world": None}) as manager:
        host = HandMadeHost(manager, clock)
        manager.declare("near")
        clock.sleep(0.9)
        yield manager, clock, host


@pytest.mark.parametrize(("latest_s", "is_known"), [(2.4, True), (2.6, False)])
def test_a_vote_that_may_have_expired_does_not_count(latest_s: float, is_known: bool) -> None:
    with robot(confirmed(value("seen") > 5, 2, 2), valid_for_s=2.0) as (manager, clock, host):
        host.report(7, earliest_s=0.5, latest_s=0.5)
        clock.sleep(2.1)
        assert len(host.orders) == 2
        host.report(7, earliest_s=2.3, latest_s=latest_s)
        assert manager.get("near").known is is_known


@pytest.mark.parametrize(("latest_s", "is_kept"), [(1.4, True), (1.6, False)])
def test_a_result_between_both_thresholds_keeps_a_value_only_if_it_was_the_value_at_all_possible_instants(
    latest_s: float, is_kept: bool
) -> None:
    with robot(between(value("seen") > 6, value("seen") < 3), valid_for_s=60.0) as (manager, clock, host):
        host.report(7, earliest_s=0.5, latest_s=0.5)
        clock.sleep(1.1)
        manager.set("near", False, evidence_s=1.5)
        host.report(5, earliest_s=1.3, latest_s=latest_s)
        whats = [event.what for event in manager.record.of(Kind.JOB, "look")]
        assert ("rejected" in whats) is not is_kept
