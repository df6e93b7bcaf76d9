"""The manager's interface as messages: requests of a main execution in another process, and their effects."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.observers.urgency import Urgency
from codra_dsl.runtime.remote import VERSION, MessageError, Session, open_session
from codra_dsl.runtime.remote.agents.agent_session import AgentSession
from codra_dsl.runtime.remote.json_lines import line_of, message_of
from codra_dsl.runtime.remote.protocol import (
    AGENT_REQUESTS,
    ERRORS,
    MAX_ID_CHARACTERS,
    OPERATIONS,
    REQUESTS,
    FieldType,
    plain_reading,
    reading_of,
)
from codra_dsl.runtime.remote.session import (
    MAX_LOOKING_DECISIONS,
    MAX_RUNNING_SKILLS,
    MAX_SUBSCRIPTIONS,
    MAX_WAITING_DECISIONS,
)
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Reading
from tests.runtime.door import MODEL, Door, Manager, started
from tests.runtime.journal.journals import read


@dataclass
class Program:
    """A main execution that uses messages, in simulated time."""

    codra: Manager
    clock: SimClock
    received_messages: list[dict[str, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.session: Session = open_session(self.codra, self.received_messages.append)

    def send(self, ask: str, **fields: object) -> None:
        self.session.receive({"codra": VERSION, "id": len(self.received_messages), "ask": ask, **fields})

    def ask(self, ask: str, **fields: object) -> dict[str, Any]:
        """Send a request that is answered at once, and return the answer or the error."""
        before = len(self.received_messages)
        self.send(ask, **fields)
        (message,) = self.received_messages[before:]
        assert message["codra"] == VERSION
        assert message["id"] == before
        return dict(message.get("answer", message.get("error")))

    def notices(self, about: str) -> list[dict[str, Any]]:
        return [message for message in self.received_messages if message.get("notice") == about]


@contextmanager
def running_program(door: Door | None = None) -> Iterator[tuple[Program, Manager, SimClock]]:
    with started(door or Door(angle_rad=1.0)) as (codra, clock):
        yield Program(codra, clock), codra, clock


def test_a_session_receives_the_names_of_variables_and_skills() -> None:
    with running_program() as (program, _codra, _clock):
        hello = program.ask("hello", lease_s=60.0)
    assert hello["variables"] == ["localized", "near", "open"]
    assert hello["skills"] == ["drive", "open_door"]
    assert (hello["spec"], hello["party"], hello["lease_s"]) == ("door", "main_execution 2", 60.0)


def test_a_variable_that_a_session_declares_is_observed() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=60.0)
        assert program.ask("declare", variable="open") == {}
        clock.sleep(5.0)
        reading = program.ask("get", variable="open")["reading"]
        assert codra.running() == {"door_distance", "door_lid"}
    assert (reading["known"], reading["value"], reading["reason"], reading["source"]) == (True, True, None, "look")
    assert reading["evidence_s"] <= clock.now_s()
    assert reading["expires_s"] is None


def test_a_session_and_the_program_itself_declare_independently() -> None:
    with running_program() as (program, codra, clock):
        program.ask("declare", variable="near")
        codra.declare("near")
        codra.withdraw("near")
        clock.sleep(1.0)
        assert codra.declared() == {"near"}
        program.ask("withdraw", variable="near")
        assert codra.declared() == frozenset()


def test_expectations_of_one_session_do_not_replace_those_of_another() -> None:
    with running_program() as (first, codra, clock):
        second = Program(codra, clock)
        first.ask("expect", skills=["drive"])
        second.ask("expect", skills=["open_door"])
        assert codra.declared() == {"near", "open"}
        second.ask("expect", skills=[])
        assert codra.declared() == {"near"}


def test_a_skill_of_a_session_declares_and_invalidates_until_it_ends() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=60.0)
        number = program.ask("begin", skill="open_door")["number"]
        clock.sleep(5.0)
        assert codra.get("open").known
        program.ask("act", number=number)
        assert program.ask("get", variable="open")["reading"]["reason"] == "invalidated"
        program.ask("acted", number=number)
        program.ask("finish", number=number)
        assert codra.declared() == frozenset()
        assert program.ask("finish", number=number)["kind"] == "malformed"


def test_a_session_that_leaves_withdraws_all_that_it_declared() -> None:
    with running_program() as (program, codra, clock):
        program.ask("declare", variable="near")
        program.ask("expect", skills=["open_door"])
        program.ask("begin", skill="drive")
        clock.sleep(1.0)
        assert program.ask("leave") == {}
        assert codra.declared() == frozenset()
        assert codra.running() == frozenset()
        assert program.ask("declare", variable="near")["kind"] == "lease_over"


def test_declarations_of_a_silent_session_are_withdrawn_when_its_lease_is_over() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=3.0)
        program.ask("declare", variable="near")
        clock.sleep(2.9)
        assert codra.running() == {"door_distance"}
        clock.sleep(0.2)
        assert codra.running() == frozenset()
        (over,) = program.notices("lease_over")
        assert over["message"] == "no message was received for 3 s"
        assert program.ask("get", variable="near")["kind"] == "lease_over"


def test_every_request_renews_the_lease() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=3.0)
        program.ask("declare", variable="near")
        for _ in range(10):
            clock.sleep(2.9)
            program.ask("keep")
        assert codra.running() == {"door_distance"}


def test_a_decision_is_answered_from_context() -> None:
    with running_program() as (program, codra, clock):
        codra.declare("open")
        clock.sleep(4.0)
        answer = program.ask("decide", variable="open", max_age_s=3.0)
    assert answer["answered"] is True
    assert answer["reading"]["value"] is True
    assert [event.what for event in codra.record.of(Kind.DECISION)] == ["answered"]


def test_an_override_of_a_session_stays_when_the_session_ends() -> None:
    with running_program() as (program, codra, clock):
        assert program.ask("override", variable="open", value=True, for_s=60.0, reason="sensor broken") == {}
        assert program.ask("override", variable="near", for_s=60.0, reason="sensor broken") == {}
        answer = program.ask("decide", variable="open")
        assert (answer["answered"], answer["reading"]["source"]) == (True, "operator")
        assert (answer["reading"]["start_s"], answer["reading"]["expires_s"]) == (None, 60.0)
        assert program.ask("get", variable="near")["reading"]["reason"] == "overridden"
        program.ask("clear_override", variable="near")
        program.ask("leave")
        clock.sleep(59.9)
        assert (codra.get("open").source, codra.get("near").reason) == ("operator", "never_observed")
        clock.sleep(0.1)
        assert not codra.get("open").known


@pytest.mark.parametrize(
    ("fields", "kind"),
    [
        ({"value": "wide"}, "not_of_type"),
        ({"for_s": 0.0}, "not_allowed"),
        ({"infinite_for_s": 1}, "malformed"),
        ({"for_s": math.inf}, "not_allowed"),
        ({"for_s": "10 min"}, "malformed"),
        ({"reason": " "}, "not_allowed"),
        ({"variable": "opne"}, "unknown_name"),
    ],
)
def test_a_wrong_override_is_answered_with_an_error(fields: dict[str, Any], kind: str) -> None:
    with running_program() as (program, codra, _clock):
        request = {"variable": "open", "value": True, "for_s": 1.0, "reason": "test", **fields}
        assert program.ask("override", **request)["kind"] == kind
        assert not codra.get("open").known


def test_a_decision_without_context_takes_the_value_that_the_main_execution_acquires() -> None:
    with running_program() as (program, codra, _clock):
        program.ask("declare", variable="open")
        answer = program.ask("decide", variable="open")
        assert answer["answered"] is False
        assert answer["reading"]["reason"] == "never_observed"
        assert program.ask("found", decision=answer["decision"], value=True) == {}
        assert codra.get("open").value is True
        assert program.ask("found", decision=answer["decision"], value=True)["kind"] == "malformed"
    (decision,) = codra.record.of(Kind.DECISION)
    assert (decision.what, decision.details["found"], decision.details["kept"]) == ("fell_back", True, True)


def test_a_decision_that_may_wait_is_answered_as_soon_as_context_knows() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=60.0)
        program.ask("declare", variable="open")
        program.send("decide", variable="open", wait_up_to_s=20.0)
        before = len(program.received_messages)
        clock.sleep(10.0)
        (message,) = program.received_messages[before:]
    assert message["answer"]["answered"] is True
    (decision,) = codra.record.of(Kind.DECISION)
    known_s = next(event.instant_s for event in codra.record.of(Kind.VARIABLE) if event.name == "open")
    assert decision.instant_s == known_s


def test_a_decision_that_has_waited_without_success_lets_the_main_execution_look() -> None:
    with running_program(Door(distance_m=5.0)) as (program, codra, clock):
        program.ask("hello", lease_s=60.0)
        program.ask("declare", variable="open")
        program.send("decide", variable="open", wait_up_to_s=7.0)
        clock.sleep(10.0)
        message = program.received_messages[-1]["answer"]
        assert message["answered"] is False
        program.ask("found", decision=message["decision"])
    (decision,) = codra.record.of(Kind.DECISION)
    assert decision.what == "fell_back"


def test_a_session_that_is_over_answers_no_decision_that_waits() -> None:
    with running_program(Door(distance_m=5.0)) as (program, _codra, clock):
        program.ask("hello", lease_s=3.0)
        program.send("decide", variable="open", wait_up_to_s=7.0)
        clock.sleep(10.0)
        assert [list(message)[1] for message in program.received_messages] == ["id", "notice"]


def test_a_subscriber_receives_each_new_reading() -> None:
    door = Door(distance_m=1.0)
    with running_program(door) as (program, _codra, clock):
        program.ask("hello", lease_s=60.0)
        answer = program.ask("subscribe", variables=["near", "near"])
        program.ask("declare", variable="near")
        clock.sleep(3.0)
        readings = program.notices("reading")
        assert readings[0]["reading"]["reason"] == "never_observed"
        assert {reading["subscription"] for reading in readings} == {answer["subscription"]}
        assert readings[-1]["reading"]["value"] is True
        program.ask("unsubscribe", subscription=answer["subscription"])
        clock.sleep(3.0)
        assert program.notices("reading") == readings
        assert program.ask("unsubscribe", subscription=answer["subscription"])["kind"] == "malformed"


def test_each_subscription_of_a_session_receives_its_variables_only_and_no_reading_twice() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=60.0)
        first = program.ask("subscribe", variables=["near"])["subscription"]
        clock.sleep(0.1)
        second = program.ask("subscribe", variables=["near", "localized"])["subscription"]
        clock.sleep(0.1)
        codra.set("localized", False)
        clock.sleep(0.1)
        program.ask("unsubscribe", subscription=first)
        codra.set("localized", True)
        clock.sleep(0.1)
    received = [
        (message["subscription"], message["reading"]["variable"], message["reading"]["value"])
        for message in program.notices("reading")
    ]
    assert received == [
        (first, "near", None),
        (second, "near", None),
        (second, "localized", True),
        (second, "localized", False),
        (second, "localized", True),
    ]


def test_subscriptions_of_a_session_need_one_callback_for_each_change() -> None:
    with running_program() as (program, codra, clock):
        program.ask("hello", lease_s=60.0)
        for _ in range(MAX_SUBSCRIPTIONS):
            program.ask("subscribe", variables=["localized"])
        clock.sleep(0.1)
        started: list[object] = []
        start = clock.start
        clock.start = lambda run, deliver: (started.append(run), start(run, deliver))[1]  # type: ignore[method-assign]
        codra.set("localized", False)
        clock.sleep(0.1)
        assert len(started) == 1
    values = [message["reading"]["value"] for message in program.notices("reading")]
    assert values == [True] * MAX_SUBSCRIPTIONS + [False] * MAX_SUBSCRIPTIONS


WRONG: dict[str, tuple[dict[str, object], str, str]] = {
    "unknown variable": (
        {"ask": "get", "variable": "oben"},
        "unknown_name",
        "the spec has no variable 'oben': did you mean 'open'?",
    ),
    "unknown skill": (
        {"ask": "begin", "skill": "open_dor"},
        "unknown_name",
        "the spec has no skill 'open_dor': did you mean 'open_door'?",
    ),
    "unknown agent": (
        {"ask": "set", "variable": "near", "value": True, "agent": "cat"},
        "unknown_name",
        "the spec has no variable whose source is 'cat'",
    ),
    "not declared": (
        {"ask": "set", "variable": "open", "value": True},
        "not_declared",
        "'open' may be written by observer: the main execution may write the variable only while it is declared",
    ),
    "no such type": (
        {"ask": "declare", "variable": "near", "value": "yes"},
        "not_of_type",
        "'yes' is not of type bool",
    ),
    "the future": (
        {"ask": "set", "variable": "localized", "value": True, "evidence_s": 5.0},
        "not_allowed",
        "evidence for 'localized' cannot be from 5.0: the present instant is 0.0",
    ),
    "field missing": ({"ask": "get"}, "malformed", "`get` needs `variable`: a text of at most 1000 characters"),
    "field unknown": (
        {"ask": "get", "variable": "open", "variabel": 1},
        "malformed",
        "`get` has no field 'variabel': did you mean 'variable'?",
    ),
    "field of another kind": (
        {"ask": "get", "variable": ["open"]},
        "malformed",
        "`variable` of `get` must be a text of at most 1000 characters",
    ),
    "negative time": (
        {"ask": "decide", "variable": "open", "wait_up_to_s": -1},
        "malformed",
        "`wait_up_to_s` of `decide` must be a number that is not negative",
    ),
    "not a number": (
        {"ask": "decide", "variable": "open", "max_age_s": math.nan},
        "malformed",
        "`max_age_s` of `decide` must be a number that is not negative",
    ),
    "endless lease": (
        {"ask": "hello", "lease_s": 3601.0},
        "malformed",
        "`lease_s` of `hello` must be a number of seconds from 0 to 3600",
    ),
    "evidence from before all time": (
        {"ask": "set", "variable": "localized", "value": True, "evidence_s": -math.inf},
        "not_allowed",
        "evidence for 'localized' cannot be from -inf: the present instant is 0.0",
    ),
    "no such request": (
        {"ask": "declair"},
        "malformed",
        f"`ask` must be one of {', '.join(REQUESTS)}: did you mean 'declare'?",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_request_is_answered_with_an_error(wrong: str) -> None:
    fields, kind, message = WRONG[wrong]
    with running_program() as (program, codra, _clock):
        assert program.ask(**fields) == {"kind": kind, "message": message}  # type: ignore[arg-type]
        assert codra.declared() == frozenset()


@pytest.mark.parametrize("message", [None, [], "get", {"ask": "get"}, {"codra": 2, "ask": "keep"}, {"codra": True}])
def test_a_message_of_another_version_is_answered_with_an_error(message: object) -> None:
    with running_program() as (program, _codra, _clock):
        program.session.receive(message)
    (answer,) = program.received_messages
    assert answer["error"]["kind"] == "malformed"
    assert answer["id"] is None


def test_a_closed_manager_takes_no_declarations() -> None:
    with running_program() as (program, codra, _clock):
        codra.close()
        assert program.ask("declare", variable="near")["kind"] == "closed"
        assert program.ask("begin", skill="drive")["kind"] == "closed"


@pytest.mark.parametrize("ask", [{"ask": "hello", "lease_s": 10**400}, {"ask": "act", "number": -(10**400)}])
def test_a_number_that_is_too_large_is_refused(ask: dict[str, Any]) -> None:
    with running_program() as (program, _codra, _clock):
        assert program.ask(**ask)["kind"] == "malformed"


def test_a_decision_that_waits_is_answered_when_the_manager_closes() -> None:
    with running_program(Door(distance_m=5.0)) as (program, codra, clock):
        program.ask("hello", lease_s=600.0)
        program.send("decide", variable="open", wait_up_to_s=300.0)
        codra.close()
        clock.sleep(0.0)
        assert program.received_messages[-1]["answer"]["answered"] is False


def test_a_session_that_ends_abandons_its_decisions_and_their_urgency() -> None:
    with running_program(Door(distance_m=5.0)) as (program, codra, clock):
        program.send("decide", variable="open")
        program.send("decide", variable="open", wait_up_to_s=7.0)
        assert codra.commands.urgency("door_lid") is Urgency.WAITED_FOR
        clock.sleep(6.0)
        assert program.notices("lease_over")
        assert codra.commands.urgency("door_lid") is Urgency.DECLARED
        raised_error_names = [event.details["raised"] for event in codra.record.of(Kind.DECISION)]
        assert raised_error_names == ["LeaseError", "LeaseError"]


def test_the_oldest_of_too_many_unreported_decisions_is_abandoned() -> None:
    with running_program() as (program, _codra, _clock):
        numbers = [program.ask("decide", variable="open")["decision"] for _ in range(MAX_LOOKING_DECISIONS + 1)]
        assert program.ask("found", decision=numbers[0])["kind"] == "malformed"
        assert program.ask("found", decision=numbers[1]) == {}


def test_lone_surrogates_break_neither_the_journal_nor_the_line(tmp_path: Path) -> None:
    journal, clock = Journal(tmp_path / "run.mcap"), SimClock()
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()}, record=journal) as codra:
        program = Program(codra, clock)
        number = program.ask("decide", variable="open")["decision"]
        program.ask("found", decision=number, raised="\ud800")
    assert journal.failure is None
    assert message_of(line_of({"id": "\ud800"})) == {"id": "\ud800"}


def test_an_infinite_value_is_decoded_as_infinite() -> None:
    assert line_of({"id": 1, "value": -math.inf}) == b'{"id":1,"infinite":-1}\n'
    for message in ({"value": math.inf}, {"answer": {"reading": {"known": True, "value": -math.inf}}}):
        assert message_of(line_of(message)) in (message, math.inf)
    assert message_of(line_of({"ask": "decide", "wait_up_to_s": math.inf})) == {
        "ask": "decide",
        "wait_up_to_s": math.inf,
    }


@pytest.mark.parametrize("infinite", [1, -1])
def test_an_infinite_value_is_left_out_and_decoded_as_infinite(infinite: int) -> None:
    reading = Reading(name="range", content=infinite * math.inf, source="scan", evidence_s=1.0)
    line = line_of({"reading": plain_reading(reading)})
    sent = json.loads(line, parse_constant=pytest.fail)["reading"]
    assert ("value" in sent, sent["infinite"], sent["known"]) == (False, infinite, True)
    assert reading_of(message_of(line)["reading"]) == reading  # type: ignore[index]


def test_a_finite_reading_does_not_state_whether_it_is_infinite() -> None:
    assert "infinite" not in plain_reading(Reading(name="range", content=1.0, source="scan", evidence_s=1.0))


@pytest.mark.parametrize(
    ("number", "message"),
    [
        ("NaN", "NaN is not a JSON number: the numbers in a message are finite"),
        ("-Infinity", "-Infinity is not a JSON number: the numbers in a message are finite"),
        ("1e999", "the number 1e999 is too large: the numbers in a message are finite"),
        ("-1e999", "the number -1e999 is too large: the numbers in a message are finite"),
        ("9" * 100 + ".0e999", f"the number {'9' * 20} is too large: the numbers in a message are finite"),
    ],
)
def test_a_number_that_is_not_finite_is_refused(number: str, message: str) -> None:
    with pytest.raises(MessageError) as refusal:
        message_of(f'{{"codra": 1, "ask": "set", "variable": "x", "value": {number}}}'.encode())
    assert str(refusal.value) == message


@pytest.mark.parametrize("message_id", ["x" * (MAX_ID_CHARACTERS + 1), 2**63, -(2**63), 1.5, True, ["a"], {}])
def test_a_request_whose_id_is_too_long_or_of_another_type_is_refused(message_id: object) -> None:
    with running_program() as (program, codra, _clock):
        program.session.receive({"codra": VERSION, "id": message_id, "ask": "declare", "variable": "near"})
        assert codra.declared() == frozenset()
    (answer,) = program.received_messages
    assert (answer["id"], answer["error"]["kind"]) == (None, "malformed")
    assert answer["error"]["message"] == "`id` must be a text of at most 128 characters or an integer of 64 bits"


@pytest.mark.parametrize("message_id", ["x" * MAX_ID_CHARACTERS, 2**63 - 1, 0, ""])
def test_the_longest_ids_are_repeated(message_id: object) -> None:
    with running_program() as (program, _codra, _clock):
        program.session.receive({"codra": VERSION, "id": message_id, "ask": "keep"})
    (answer,) = program.received_messages
    assert (answer["id"], answer["answer"]) == (message_id, {"now_s": 0.0})


LONG = "x" * 100_000


@pytest.mark.parametrize(
    "fields",
    [
        {"ask": LONG},
        {"ask": "get", "variable": LONG},
        {"ask": "get", LONG: 1},
        {"ask": "get", "variable": "open", LONG: 1},
        {"ask": "expect", "skills": [LONG]},
        {"ask": "declare", "variable": "near", "value": LONG},
        {"ask": "set", "variable": "near", "value": LONG, "agent": LONG},
        {"ask": "hello", "token": LONG},
    ],
)
def test_the_answer_to_a_wrong_request_is_short(fields: dict[str, Any]) -> None:
    with running_program() as (program, _codra, _clock):
        program.session.receive({"codra": VERSION, "id": 1, **fields})
    (answer,) = program.received_messages
    assert "error" in answer
    assert len(line_of(answer)) < 2_500


def test_a_session_has_limited_numbers_of_subscriptions_skills_and_waiting_decisions() -> None:
    with running_program(Door(distance_m=5.0)) as (program, _codra, _clock):
        for ask, fields, maximum, what in (
            ("subscribe", {"variables": ["near"]}, MAX_SUBSCRIPTIONS, "subscriptions"),
            ("begin", {"skill": "drive"}, MAX_RUNNING_SKILLS, "skills in progress"),
            ("decide", {"variable": "open", "wait_up_to_s": 60.0}, MAX_WAITING_DECISIONS, "decisions that wait"),
        ):
            for _ in range(maximum):
                program.send(ask, **fields)
            assert program.ask(ask, **fields) == {
                "kind": "not_allowed",
                "message": f"a session may have at most {maximum} {what}",
            }
        program.ask("unsubscribe", subscription=1)
        assert program.ask("subscribe", variables=["near"]) == {"subscription": MAX_SUBSCRIPTIONS + 1}


# For the schema, but not for the manager, a float such as 1.0 is an integer.
fractions = some.floats().filter(lambda number: not number.is_integer())
anything = some.recursive(
    some.none() | some.booleans() | some.integers() | fractions | some.sampled_from(["open", "near", "drive", ""]),
    lambda inner: some.lists(inner, max_size=3) | some.dictionaries(some.text(max_size=3), inner, max_size=3),
    max_leaves=5,
)
fitting = {
    FieldType.TEXT: some.sampled_from(["open", "near", "localized", "drive", "open_door", "x"]),
    FieldType.TEXTS: some.lists(some.sampled_from(["open", "near", "drive", "open_door", "x"]), max_size=3),
    FieldType.INTEGER: some.integers(0, 4),
    FieldType.NUMBER: some.floats(-10, 10),
    FieldType.DURATION: some.floats(0, 10),
    FieldType.LEASE: some.floats(0, 10),
    FieldType.TRUTH: some.booleans(),
    FieldType.VALUE: some.booleans() | some.integers(-5, 5) | some.text(max_size=2),
    FieldType.VALUES: some.lists(some.fixed_dictionaries({"name": some.text(max_size=2), "value": some.booleans()})),
    FieldType.INSTANTS: some.lists(some.floats(-10, 10), min_size=2, max_size=2),
    FieldType.ATTRIBUTES: some.lists(some.fixed_dictionaries({"name": some.text(max_size=2)})),
    FieldType.POSE: some.lists(some.floats(-10, 10), min_size=7, max_size=7),
}


@some.composite
def requests(draw: some.DrawFn) -> dict[str, object]:
    ask = draw(some.sampled_from(sorted(REQUESTS)))
    shape = REQUESTS[ask]
    optional = draw(some.sets(some.sampled_from(sorted(shape.optional)))) if shape.optional else set()
    kinds = {name: kind for name, kind in {**shape.required, **shape.optional}.items() if name not in shape.optional}
    kinds |= {name: shape.optional[name] for name in optional}
    fields = {name: draw(fitting[kind] | anything) for name, kind in sorted(kinds.items())}
    return {"codra": VERSION, "id": draw(some.integers(0, 99)), "ask": ask, **fields}


@settings(max_examples=50, deadline=None)
@given(messages=some.lists(some.tuples(requests() | anything, some.floats(0, 2)), max_size=25))
def test_each_request_has_one_answer_and_leaving_withdraws_all_declarations(
    messages: list[tuple[Any, float]],
) -> None:
    with running_program() as (program, codra, clock):
        for message, pause_s in messages:
            program.session.receive(message)
            clock.sleep(pause_s)
        clock.sleep(20.0)
        program.session.close()
        assert codra.declared() == frozenset()
        assert codra.running() == frozenset()
    answered = [message for message in program.received_messages if "notice" not in message]
    assert json.loads(json.dumps(program.received_messages, allow_nan=False)) == program.received_messages
    assert len(answered) <= len(messages)
    assert all(("answer" in message) != ("error" in message) for message in answered)


def test_every_request_has_a_handler() -> None:
    of_agents = {*AGENT_REQUESTS} - {*OPERATIONS}

    assert [ask for ask in REQUESTS if ask not in AGENT_REQUESTS and not hasattr(Session, f"_{ask}")] == []
    assert [ask for ask in of_agents if not hasattr(AgentSession, f"_{ask}")] == []


def test_the_page_documents_every_request_with_its_fields_and_every_kind_of_error() -> None:
    page = (Path(__file__).parents[3] / "docs/reference/messages.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("| `")
    ]
    documented_fields = {row[0].strip("`"): re.findall(r"`(\w+)`", row[1]) for row in rows}
    for ask, shape in REQUESTS.items():
        assert documented_fields[ask] == [*shape.required, *shape.optional]
    assert set(ERRORS) <= documented_fields.keys()


def test_a_journal_with_two_sessions_whose_leases_end_is_replayed_byte_for_byte(tmp_path: Path) -> None:
    path, copied, clock = tmp_path / "run.mcap", tmp_path / "replayed.mcap", SimClock()
    door = Door(distance_m=5.0)
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": door}, record=Journal(path)) as codra:
        codra.set("localized", True)
        for program in (Program(codra, clock), Program(codra, clock)):
            program.ask("declare", variable="near")
            program.ask("begin", skill="open_door")
            program.send("decide", variable="open", wait_up_to_s=9.0)
        clock.sleep(8.0)
        assert codra.declared() == frozenset()
    assert replay(*read(path), MODEL, ContextManager, Journal(copied)).difference is None
    assert copied.read_bytes() == path.read_bytes()


def test_a_journal_with_sessions_is_replayed_byte_for_byte(tmp_path: Path) -> None:
    path, copied, clock = tmp_path / "run.mcap", tmp_path / "replayed.mcap", SimClock()
    door = Door(angle_rad=1.0)
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": door}, record=Journal(path)) as codra:
        codra.set("localized", True)
        program = Program(codra, clock)
        program.ask("hello", lease_s=6.0)
        program.ask("expect", skills=["open_door"])
        program.send("decide", variable="open", wait_up_to_s=4.0)
        clock.sleep(5.0)
        program.ask("declare", variable="near")
        program.ask("begin", skill="open_door")
        clock.sleep(20.0)
        assert program.notices("lease_over")
    replayed = replay(*read(path), MODEL, ContextManager, Journal(copied))
    assert replayed.difference is None
    assert copied.read_bytes() == path.read_bytes()
