"""Derived variables: they agree with their expressions at every instant, and start what their inputs need."""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as some

from codra_dsl.logic import Term
from codra_dsl.runtime import ContextModel, DecisionState, Journal, Kind, NotASourceError, SimClock
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.conditions import age, choose, first_known, known, maximum, value
from codra_dsl.runtime.values.derived import ContextAt
from codra_dsl.runtime.values.model import ExpectationModel, SkillModel, boolean, real
from tests.runtime.forests import (
    Look,
    Manager,
    World,
    algorithm,
    events,
    forest,
    given,
    observer,
    seen,
    started,
    takes,
    variable,
)
from tests.runtime.journal.journals import read

Tree = tuple[Any, ...]
"""An expression as plain data: the word of its operation, and its operands."""

STEP_S = 0.125
ENDS = (0.0, 1.0, 5.0)
INPUTS = ("told", "agreed", "seen_door", "kept", "level")

truths = some.recursive(
    some.sampled_from([("value", "told"), ("value", "agreed"), ("value", "seen_door"), ("value", "kept")])
    | some.sampled_from([(">", ("value", "level"), ("constant", end)) for end in ENDS]),
    lambda inner: some.one_of(
        some.tuples(some.just("and"), inner, inner),
        some.tuples(some.just("or"), inner, inner),
        some.tuples(some.just("not"), inner),
        some.tuples(some.just("if"), inner, inner, inner),
    ),
    max_leaves=6,
)
inexact_truths = some.one_of(
    some.sampled_from([("known", name) for name in INPUTS]),
    some.sampled_from([("young", name) for name in INPUTS]),
    some.tuples(some.just("else"), truths, truths),
)
numbers = some.one_of(
    some.just(("value", "level")),
    some.sampled_from([("else", ("value", "level"), ("constant", end)) for end in ENDS]),
    some.just(("-", ("constant", 8.0), ("value", "level"))),
    some.just(("/", ("constant", 10.0), ("value", "level"))),
)


PLAIN_OPERATORS: Mapping[str, Callable[..., Any]] = {
    "not": operator.not_,
    ">": operator.gt,
    "-": operator.sub,
    "/": operator.truediv,
}


def plain_value(tree: Tree, readings: Mapping[str, Reading[Any]], now_s: float) -> Any:
    """Return the value of an expression in three-valued logic, by the tables of Kleene; None if it is unknown."""
    word, *operands = tree
    if word == "constant":
        return operands[0]
    if word == "value":
        return readings[operands[0]].content
    if word == "known":
        return readings[operands[0]].known
    if word == "young":
        reading = readings[operands[0]]
        return reading.age_s(now_s) < 1.0 if reading.known else None
    values = [plain_value(operand, readings, now_s) for operand in operands]
    if word in ("and", "or"):
        table: dict[frozenset[Any], Any] = {frozenset({True}): True, frozenset({False}): False}
        absorbing = word == "or"
        return absorbing if absorbing in values else table.get(frozenset(values))
    if word == "if":
        then, truth, otherwise = values
        if truth is None:
            return then if then == otherwise else None
        return then if truth else otherwise
    if word == "else":
        return values[1] if values[0] is None else values[0]
    if None in values or (word == "/" and values[1] == 0.0):
        return None
    return PLAIN_OPERATORS[word](*values)


def term_of(tree: Tree) -> Term:
    """Return an expression in the form of generated code."""
    word, *operands = tree
    if word in ("value", "known"):
        return {"value": value, "known": known}[word](operands[0])
    if word == "young":
        return age(operands[0]) < 1.0
    if word == "constant":
        return operands[0]
    parts = [term_of(operand) for operand in operands]
    built: dict[str, Callable[..., Term]] = {
        "and": operator.and_,
        "or": operator.or_,
        "not": operator.invert,
        "if": choose,
        "else": first_known,
        ">": operator.gt,
        "-": lambda left, right: -(right - left),
        "/": lambda left, right: left / right,
    }
    return built[word](*parts)


def house(first: Tree, second: Tree, number: Tree) -> ContextModel:
    """Return a spec with three derived variables; the last one reads the other two."""
    return forest(
        [
            given("told", valid_for_s=3.0),
            variable("agreed", sources=("house",)),
            variable("level", type=real(0.0, 10.0), sources=("house",), valid_for_s=2.0),
            variable("seen_door", valid_for_s=2.0, when_unobservable="forget"),
            variable("kept"),
            variable("first", derived=term_of(first), sources=("other context-variables",)),
            variable("second", derived=term_of(second), sources=("other context-variables",)),
            variable("number", type=real(0.0, 9.0), derived=term_of(number), sources=("other context-variables",)),
            variable(
                "last",
                derived=(value("first") | ~value("second")) & (value("number") > 2.0),
                sources=("other context-variables",),
            ),
        ],
        observer("door", seen("look_at_door", "seen_door", when=[value("told")])),
        observer("shelf", seen("look_at_shelf", "kept", accept=[value("seen")])),
        skills=[SkillModel(name="change", preview=("last",), changes=("agreed", "kept", "told"))],
    )


LAST = ("and", ("or", ("value", "first"), ("not", ("value", "second"))), (">", ("value", "number"), ("constant", 2.0)))

writes = some.tuples(
    some.sampled_from(["told", "agreed", "level"]),
    some.sampled_from([True, False, None]),
    some.sampled_from([0.0, 0.25, 1.5]),
)
deeds = some.one_of(
    some.tuples(some.just("write"), writes),
    some.tuples(some.just("sleep"), some.sampled_from([0.25, 0.5, 1.0, 2.5])),
    some.tuples(some.just("declare"), some.sampled_from(["first", "last", "seen_door"])),
    some.tuples(some.just("withdraw"), some.sampled_from(["first", "last", "seen_door"])),
    some.tuples(some.just("find"), some.sampled_from([True, False, None, "error"])),
    some.just(("act", None)),
)


def do(codra: Manager, world: World, deed: str, argument: Any) -> Iterator[None]:
    """Do one thing; pause at every instant at which something may happen."""
    if deed == "write":
        name, truth, age_s = argument
        content: Any = {True: 7.0, False: 0.0, None: math.nan}[truth] if name == "level" else bool(truth)
        evidence_s = max(0.0, codra.clock.now_s() - age_s)
        if name == "told":
            codra.set(name, content, evidence_s=evidence_s)
        else:
            codra.agent("house").set(name, content, evidence_s=evidence_s)
    elif deed == "declare":
        codra.declare(argument)
    elif deed == "withdraw":
        codra.withdraw(argument)
    elif deed == "find":
        world.finds = dict.fromkeys(world.finds, takes(0.25, {"seen": argument} if argument != "error" else 3))
    elif deed == "act":
        with codra.skill("change") as skill, skill.acting():
            yield
    for _ in range(round(argument / STEP_S) if deed == "sleep" else 1):
        yield
        codra.clock.sleep(STEP_S if deed == "sleep" else 0.0)
    yield


@settings(max_examples=30)
@drawn(truths, some.one_of(truths, inexact_truths), numbers, some.lists(deeds, max_size=25))
def test_a_derived_variable_agrees_with_its_expression_at_every_instant(
    first: Tree, second: Tree, number: Tree, story: list[tuple[str, Any]]
) -> None:
    clock = SimClock()
    world = World(finds=dict.fromkeys(("look_at_door", "look_at_shelf"), takes(0.25, {"seen": True})))
    trees = {"first": first, "second": second, "number": number, "last": LAST}
    with started(house(first, second, number), world, clock) as codra:
        for deed, argument in story:
            for _ in do(codra, world, deed, argument):
                readings = codra.readings(codra.modelled())
                for name, tree in trees.items():
                    wanted = plain_value(tree, readings, clock.now_s())
                    wanted = None if name == "number" and wanted is not None and not 0.0 <= wanted <= 9.0 else wanted
                    assert codra.get(name).content == readings[name].content == wanted, (name, readings)
                    if wanted is None:
                        assert names_an_unknown_input(readings[name], readings)
                assert codra.running() == needed_observers(codra.declared(), trees)
                assert readings["first"].content is None or readings["first"].evidence_s == newest_sufficient_s(
                    first, readings
                )


def needed_observers(declared: frozenset[str], trees: Mapping[str, Tree]) -> set[str]:
    """Return the observers of the declared variables and of all inputs; none of them needs another observer."""
    needed, pending = set[str](), list(declared)
    while pending:
        name = pending.pop()
        needed.add(name)
        pending.extend(names_of(trees[name]) if name in trees else [])
    return {observer_name for observer_name, name in (("door", "seen_door"), ("shelf", "kept")) if name in needed}


def names_of(tree: Tree) -> set[str]:
    """Return the variables that an expression reads."""
    word, *operands = tree
    if word in ("value", "known", "young"):
        return {operands[0]}
    return set() if word == "constant" else set().union(*map(names_of, operands))


def names_an_unknown_input(reading: Reading[Any], readings: Mapping[str, Reading[Any]]) -> bool:
    """Return whether the detail of an unknown reading names only unknown inputs, or the fault of its value."""
    if reading.reason in (Reason.FAILED, Reason.REJECTED) and "is unknown" not in reading.detail:
        return "outside" in reading.detail or reading.detail == "the expression has no value"
    parts = reading.detail.split(", ")
    return all(part == f"{name} is unknown ({readings[name].reason})" for part in parts for name in part.split()[:1])


def newest_sufficient_s(tree: Tree, readings: Mapping[str, Reading[Any]]) -> float:
    """Return the latest instant such that the inputs with evidence from it or later give the value by themselves."""
    wanted = plain_value(tree, readings, 0.0)
    for instant_s in sorted({readings[name].evidence_s for name in INPUTS if readings[name].known}, reverse=True):
        unknown: dict[str, Reading[Any]] = {name: Reading(name=name, reason=Reason.STALE) for name in readings}
        newer_names = (name for name in INPUTS if readings[name].known and readings[name].evidence_s >= instant_s)
        newer = unknown | {name: readings[name] for name in newer_names}
        if plain_value(tree, newer, 0.0) == wanted:
            return instant_s
    raise AssertionError("the inputs do not give the value")


def small_house(**derived: Term) -> ContextModel:
    """Return a spec in which the observer of `shelf` waits for derived variables, and `door` has an observer."""
    return forest(
        [
            given("told", valid_for_s=5.0),
            variable("agreed", sources=("house",)),
            variable("door", valid_for_s=3.0, when_unobservable="forget"),
            variable("shelf", when_unobservable="forget"),
            variable("unneeded"),
            *(variable(name, derived=term, sources=("other context-variables",)) for name, term in derived.items()),
        ],
        observer("door", seen("look_at_door", "door")),
        observer("shelf", seen("look_at_shelf", "shelf", when=[value("ready")])),
        observer("unneeded", seen("look_at_nothing", "unneeded")),
        skills=[
            SkillModel(
                name="drive",
                preview=("calm",),
                monitor=("calm",),
                changes=("agreed",),
                expects=(ExpectationModel(text="calm becomes true within 5 s", condition=value("calm"), within_s=5.0),),
            )
        ],
    )


READY = value("told") & value("door")
CALM = ~value("ready") | value("agreed")
FOUND = {"look_at_door": {"seen": True}, "look_at_shelf": {"seen": True}, "look_at_nothing": {"seen": True}}


def test_declaring_a_derived_variable_starts_what_its_inputs_need_and_nothing_else() -> None:
    with started(small_house(ready=READY, calm=CALM), World(finds=dict(FOUND))) as codra:
        codra.declare("calm")
        assert (codra.declared(), codra.running()) == ({"calm"}, {"door"})
        assert codra.in_force() == {"calm", "ready", "agreed", "told", "door"}
        codra.declare("door")
        codra.withdraw("calm")
        assert codra.running() == {"door"}
        codra.withdraw("door")
        assert (codra.running(), codra.in_force()) == (frozenset(), frozenset())
        with codra.skill("drive"):
            assert codra.running() == {"door"}
        codra.expect("drive")
        assert codra.running() == {"door"}
        codra.expect()
        codra.declare("shelf")
        assert codra.running() == {"door", "shelf"}


def test_a_precondition_on_a_derived_variable_follows_its_inputs() -> None:
    clock, world = SimClock(), World(finds=dict(FOUND))
    with started(small_house(ready=READY, calm=CALM), world, clock) as codra:
        codra.declare("shelf")
        clock.sleep(2.5)
        assert world.asked_s("look_at_shelf") == []
        assert codra.obstacle("shelf") == "value('ready')"
        codra.set("told", True)
        clock.sleep(4.75)
        assert world.asked_s("look_at_shelf") == [2.5, 3.5, 4.5, 5.5, 6.5]
        clock.sleep(0.5)
        assert codra.get("ready").reason is Reason.STALE
        assert codra.get("shelf").reason is Reason.FORGOTTEN


def test_evidence_does_not_count_if_an_input_failed_while_it_was_taken() -> None:
    clock = SimClock()
    world = World(finds={**FOUND, "look_at_shelf": takes(1.0, {"seen": True})})
    with started(small_house(ready=READY, calm=CALM), world, clock) as codra:
        codra.declare("shelf")
        codra.set("told", True)
        clock.sleep(0.5)
        codra.set("told", False, evidence_s=0.25)
        codra.set("told", True)
        clock.sleep(0.75)
        assert not codra.get("shelf").known
        assert "voided" in events(codra, Kind.JOB, "look_at_shelf")
        clock.sleep(1.5)
        assert codra.get("shelf").value is True


def test_the_evidence_is_that_of_the_oldest_input_that_decides() -> None:
    clock, world = SimClock(), World(finds={**FOUND, "look_at_door": {"seen": None}})
    with started(small_house(ready=READY, calm=value("told") | value("agreed")), world, clock) as codra:
        house = codra.agent("house")
        house.set("agreed", True)
        clock.sleep(1.0)
        codra.set("told", True)
        assert codra.get("calm").evidence_s == 1.0
        assert codra.decide("calm", lambda: None, since_s=0.5) is True
        clock.sleep(1.0)
        codra.set("told", False)
        assert (codra.get("calm").value, codra.get("calm").evidence_s) == (True, 0.0)
        assert codra.decide("calm", lambda: None, since_s=0.5) is None
        assert [reading.evidence_s for reading in codra.history("calm")] == [0.0, 0.0, 1.0, 0.0]


def test_the_history_is_in_the_order_of_the_derivations() -> None:
    clock = SimClock()
    with started(small_house(ready=value("told") & value("agreed"), calm=CALM), World(), clock) as codra:
        codra.agent("house").set("agreed", True)
        for told in (True, False, True):
            clock.sleep(1.0)
            codra.set("told", told)
        assert [reading.content for reading in codra.history("ready")] == [None, None, True, False, True]


def test_the_history_ends_with_the_newest_derivations_even_if_their_evidence_is_old() -> None:
    with started(small_house(ready=READY, calm=value("told") & value("agreed")), World(finds=dict(FOUND))) as codra:
        codra.agent("house").set("agreed", True)
        for step in range(300):
            codra.clock.sleep(1.0)
            codra.set("told", step % 2 == 1)
        history = codra.history("calm")
        assert [reading.content for reading in history] == [False, True] * 50
        assert [reading.identified_s for reading in history] == [float(step) for step in range(201, 301)]


def test_an_unknown_variable_names_the_inputs_because_of_which_it_is_unknown() -> None:
    clock, world = SimClock(), World(finds={**FOUND, "look_at_door": {"seen": None}})
    with started(small_house(ready=READY, calm=CALM), world, clock) as codra:
        assert codra.get("ready").reason is Reason.NEVER_OBSERVED
        detail = "told is unknown (never_observed), door is unknown (never_observed)"
        assert codra.get("ready").detail == detail
        codra.set("told", True)
        codra.declare("ready")
        clock.sleep(0.5)
        assert (codra.get("ready").reason, codra.get("ready").detail) == (Reason.REJECTED, "door is unknown (rejected)")
        assert codra.get("calm").detail == "ready is unknown (rejected), agreed is unknown (never_observed)"
        codra.set("told", False)
        assert codra.get("ready").value is False


def test_instants_of_inputs_limit_the_evidence_of_a_derived_variable(tmp_path: Path) -> None:
    variables = [given("told"), given("heard"), variable("both", derived=value("told") & value("heard"))]
    path, clock = tmp_path / "run.mcap", SimClock()
    with Manager(forest(variables), clock=clock, resources={"world": World()}, record=Journal(path)) as codra:
        codra.set("told", True)
        codra.set("heard", True, evidence_s=0.0)
        clock.sleep(5.0)
        codra.set("heard", True)
        assert codra.can_answer("both", since_s={"heard": 5.0, "nothing": 9.0})
        assert not codra.can_answer("both", since_s={"heard": 5.0, "told": 1.0})
        assert not codra.can_answer("both", since_s=5.0)
        assert codra.ask("both", since_s={"told": 1.0}).state is DecisionState.LOOKING
        assert codra.ask("both", since_s={"heard": 1.0}).value is True
        codra.set("heard", False)
        assert codra.can_answer("both", since_s={"told": 1.0})  # `heard` alone decides the value
        codra.override("both", False, for_s=9.0, reason="test")
        assert codra.can_answer("both", since_s={"told": 1.0})
        codra.override("both", True, for_s=9.0, reason="test")
        assert not codra.can_answer("both", since_s={"told": 1.0})
        assert codra.can_answer("both", since_s={"nothing": 1.0})
    header, recorded_events = read(path)
    assert replay(header, recorded_events, forest(variables), Manager, None).difference is None


def test_an_input_is_missing_only_once() -> None:
    sides = {"left": value("told"), "right": ~value("told")}
    with started(small_house(**sides, ready=value("left") | value("right"), calm=CALM), World()) as codra:
        assert [str(change) for change in codra.why("ready").missing] == ["only main_execution may write told"]
        assert codra.obstacle("ready") == "told: only main_execution may write it"


def test_a_fallback_is_as_old_as_the_unknown_state_of_a_derived_input() -> None:
    variables = [
        given("told", valid_for_s=3.0),
        given("heard", valid_for_s=5.0),
        variable("both", derived=value("told") & value("heard")),
        variable("safe", derived=first_known(value("both"), False)),
    ]
    clock = SimClock()
    with started(forest(variables), World(), clock) as codra:
        codra.set("told", True)
        codra.set("heard", True)
        clock.sleep(6.0)
        assert codra.get("both").detail == "told is unknown (stale), heard is unknown (stale)"
        assert "unknown from 3 s on" in str(codra.why("both"))
        assert (codra.get("safe").value, codra.get("safe").evidence_s) == (False, 3.0)


def test_why_explains_a_look_that_waits_for_a_long_chain_of_derived_variables() -> None:
    chain = {f"step_{number}": ~(value(f"step_{number - 1}") & value("told")) for number in range(1, 120)}
    terms = {"step_0": value("told"), **chain, "ready": ~(value("step_119") & value("told")), "calm": CALM}
    with started(small_house(**terms), World()) as codra:
        codra.declare("shelf")
        assert "told" in str(codra.why("shelf"))


@pytest.mark.parametrize("is_known", [True, False])
def test_why_leaves_out_the_rest_of_a_long_chain_and_names_where_to_ask_and_what_is_missing(is_known: bool) -> None:
    steps = [variable(f"step_{number}", derived=~value(f"step_{number - 1}")) for number in range(1, 600)]
    with started(forest([given("told"), variable("step_0", derived=value("told")), *steps]), World()) as codra:
        if is_known:
            codra.set("told", True)
        text = str(codra.why("step_599"))
        assert "its causes are left out, because this chain is long: ask about step_559" in text
        assert "told is" in str(codra.why("step_9"))
        assert ("missing: only main_execution may write told" in text) is not is_known


def test_variables_that_read_each_other_often_are_derived_once_each() -> None:
    steps = [
        variable(f"step_{number}", derived=value(f"step_{number - 1}") & value(f"step_{number - 2}"))
        for number in range(2, 60)
    ]
    first = [variable(f"step_{number}", derived=value("told")) for number in range(2)]
    clock = SimClock()
    with started(forest([given("told", valid_for_s=5.0), *first, *steps]), World(), clock) as codra:
        codra.set("told", True)
        cells = codra._store.cells
        assert ContextAt(cells, 2.0).value("step_59") is True
        assert cells["step_59"].now(6.0).reason is Reason.STALE


@pytest.mark.parametrize("number_of_steps", [2, 600])
def test_a_chain_of_derived_variables_of_any_length_has_a_past_and_expires(number_of_steps: int) -> None:
    steps = [variable(f"step_{number}", derived=~value(f"step_{number - 1}")) for number in range(1, number_of_steps)]
    model = forest([given("told", valid_for_s=5.0), variable("step_0", derived=value("told")), *steps])
    clock, last = SimClock(), f"step_{number_of_steps - 1}"
    with started(model, World(), clock) as codra:
        codra.set("told", True)
        cells = codra._store.cells
        assert (ContextAt(cells, 2.0).value(last), cells[last].now(6.0).reason) == (False, Reason.STALE)


def test_a_change_is_as_much_work_however_many_variables_are_derived_from_others() -> None:
    line_count = 0

    def count(_: FrameType, event: str, __: object) -> Any:
        nonlocal line_count
        line_count += event == "line"
        return count

    def work(number_of_rooms: int) -> int:
        nonlocal line_count
        rooms = range(number_of_rooms)
        variables = [given(f"door_{room}") for room in rooms]
        variables += [variable(f"ready_{room}", derived=~value(f"door_{room}")) for room in rooms]
        with started(forest(variables), World()) as codra:
            codra.set("door_1", True)
            line_count, before = 0, sys.gettrace()
            sys.settrace(count)
            try:
                codra.set("door_1", False)
            finally:
                sys.settrace(before)
        return line_count

    assert work(200) < work(20) + 20


def test_evidence_that_alone_decides_a_value_keeps_the_instant_at_which_its_taking_began() -> None:
    def photo(start_s: float, stamp_s: float) -> Callable[[Any], object]:
        def find(job: Any) -> object:
            job.sleep(stamp_s)
            job.evidence(start_s, stamp_s)
            return {"seen": True}

        return find

    world, clock = World(finds={"look_at_door": photo(1.0, 5.0), "look_at_window": photo(3.0, 4.0)}), SimClock()
    rooms = [variable("door"), variable("window"), variable("either", derived=value("door") | value("window"))]
    looks = [observer(name, seen(f"look_at_{name}", name), period_s=60.0) for name in ("door", "window")]
    with started(forest(rooms, *looks), world, clock) as codra:
        codra.declare("either")
        clock.sleep(6.0)
        assert (codra.get("either").start_s, codra.get("either").evidence_s) == (1.0, 5.0)


def test_readings_that_belong_together_change_a_derived_variable_once() -> None:
    clock, world = SimClock(), World(finds={"look": {"left": False, "right": True}})
    sides = {"left": value("left"), "right": value("right")}
    both = forest(
        [variable("left"), variable("right"), variable("none", derived=~value("left") & ~value("right"))],
        observer("sides", Look(algorithm("look", dict.fromkeys(sides, boolean())), sides)),
    )
    with started(both, world, clock) as codra:
        codra.declare("none")
        clock.sleep(0.5)
        world.finds["look"] = {"left": True, "right": False}
        clock.sleep(1.0)
        values = [reading.content for reading in codra.history("none")]
        assert values == [None, False, False]


def test_variables_that_are_forgotten_together_change_a_derived_variable_once() -> None:
    clock, world = SimClock(), World(finds={"look": {"left": True, "right": True}})
    sides = {"left": value("left"), "right": value("right")}
    both = forest(
        [
            *(variable(name, when_unobservable="forget") for name in sides),
            variable("same", derived=known("left") == known("right")),
        ],
        observer("sides", Look(algorithm("look", dict.fromkeys(sides, boolean())), sides)),
    )
    with started(both, world, clock) as codra:
        codra.declare("left")
        clock.sleep(0.5)
        codra.withdraw("left")
        assert not codra.get("right").known
        assert {reading.content for reading in codra.history("same")} == {True}


def test_nobody_can_write_a_derived_variable() -> None:
    with started(small_house(ready=READY, calm=CALM), World(finds=dict(FOUND))) as codra:
        codra.declare("ready")
        with pytest.raises(NotASourceError, match="'ready' follows from other context-variables and cannot be written"):
            codra.set("ready", True)
        with pytest.raises(NotASourceError, match="cannot be written"):
            codra.agent("house").set("ready", True)
        assert codra.decide("ready", lambda: True) is True
        assert not codra.get("ready").known


def test_an_expectation_of_a_derived_variable_is_met() -> None:
    clock, world = SimClock(), World(finds=dict(FOUND))
    with started(small_house(ready=READY, calm=value("agreed")), world, clock) as codra:
        with codra.skill("drive") as skill, skill.acting():
            clock.sleep(1.0)
            codra.agent("house").set("agreed", True)
            clock.sleep(0.5)
        assert events(codra, Kind.EXPECTATION) == ["met"]


def test_an_age_in_an_expression_changes_its_value_without_new_evidence() -> None:
    clock, world = SimClock(), World(finds=dict(FOUND))
    with started(small_house(ready=READY, calm=age("told") < 2.0), world, clock) as codra:
        codra.set("told", True)
        assert codra.get("calm").value is True
        clock.sleep(2.5)
        assert codra.get("calm").value is False
        changes = [(reading.identified_s, reading.content) for reading in codra.history("calm")]
        assert changes == [(0.0, None), (0.0, True), (pytest.approx(2.0), False)]


def test_a_value_outside_of_the_range_is_a_failure() -> None:
    variables = [
        given("told", type=real(0.0, 20.0)),
        variable("double", type=real(0.0, 10.0), derived=maximum(value("told") * 2.0, 1.0)),
    ]
    with started(forest(variables), World()) as codra:
        codra.set("told", 3.0)
        assert codra.get("double").value == 6.0
        codra.set("told", 7.0)
        assert (codra.get("double").reason, codra.get("double").detail) == (Reason.FAILED, "14.0 lies outside [0, 10]")
