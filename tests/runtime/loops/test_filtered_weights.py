"""Filtered weights as context-variables: P2's tentative actions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime import ContextManager, EventLog, Journal, Kind
from codra_dsl.runtime.replay import replay
from tests.runtime.journal.journals import read
from tests.runtime.loops.shop import CHOICES, COURSE, KNOWLEDGE, MAPE, MODEL, Shop, degree

FILTERED = {name: f"filtered_weight_of_{name}" for name in CHOICES}
CONTEXT = replace(MODEL, variables=(*MODEL.variables, *map(degree, FILTERED.values())))
LOOPS = replace(MAPE, courses=(replace(COURSE, filtered_weights=FILTERED),))


def readings(record: EventLog, name: str) -> list[tuple[float, Value | None]]:
    """Return the readings that the loop wrote, one for each analysis; None if the variable was unknown."""
    events = (event for event in record.of(Kind.VARIABLE) if event.name == name)
    return [(event.instant_s, event.details.get("value")) for event in events]


def smoothed(weights: Sequence[tuple[float, Value | None]], smooth_s: float) -> Iterator[float | None]:
    """Yield the smoothed weight of each analysis: it approaches the weight of the analysis before."""
    before_s, before, weight = 0.0, None, None
    for instant_s, now in weights:
        assert now is None or isinstance(now, float)
        is_known = now is not None and before is not None and weight is not None
        weight = before + (weight - before) * math.exp(-(instant_s - before_s) / smooth_s) if is_known else now
        before_s, before = instant_s, now
        yield weight


@settings(max_examples=20)
@given(st.lists(st.tuples(st.sampled_from([None, 1.0, 1.8, 2.2, 6.0]), st.integers(1, 6)), min_size=2, max_size=6))
def test_filtered_weights_are_the_smoothed_weights_of_a_plain_model(phases: list[tuple[float | None, int]]) -> None:
    """While the distance is None, nobody writes it, so it becomes unknown after two seconds."""
    shop = Shop(LOOPS, context=CONTEXT)
    shop.write(person=6.0, battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    for person, halves in phases:
        for _ in range(halves):
            shop.write(person=person, battery=80.0)
            shop.clock.sleep(0.5)
    for name, filtered in FILTERED.items():
        weights, written = (readings(shop.codra.record, each) for each in (f"weight_of_{name}", filtered))
        assert [instant_s for instant_s, _ in written] == [instant_s for instant_s, _ in weights]
        expected = list(smoothed(weights, COURSE.smooth_s))
        assert [value for _, value in written] == pytest.approx(expected, abs=1e-9)


def test_the_graph_and_why_show_the_filtered_weights_beside_the_weights() -> None:
    shop = Shop(LOOPS, context=CONTEXT)
    shop.begin()
    shop.write(person=1.0)
    shop.clock.sleep(1.0)
    snapshot = shop.codra.knowledge.snapshot()
    weight, filtered = (snapshot.get("context", name).value for name in ("weight_of_start", FILTERED["start"]))
    assert weight > filtered > snapshot.get("context", FILTERED["dock"]).value
    story = str(shop.codra.why(FILTERED["start"]))
    assert "filtered_weight_of_start is weight_of_start, smoothed by the filter of its course" in story
    assert "if safety is medium then start is high: activation 1" in story


def test_a_variable_of_an_agent_with_such_a_name_is_not_explained_as_a_filtered_weight() -> None:
    variable = replace(degree(FILTERED["start"]), sources=("people",))
    shop = Shop(context=replace(MODEL, variables=(*MODEL.variables, variable)))
    shop.begin()
    shop.agents["people"].set(variable.name, 0.3)
    assert "weight_of_start, smoothed" not in str(shop.codra.why(variable.name))
    assert "if safety is not medium then start is low" in str(shop.codra.why("weight_of_start"))


def test_a_replay_makes_the_same_filtered_weights(tmp_path: Path) -> None:
    shop = Shop(LOOPS, context=CONTEXT, record=Journal(tmp_path / "run.mcap"))
    shop.begin()
    shop.pass_s(4.0, person=1.0)
    shop.mape.close()
    shop.codra.close()
    head, events = read(tmp_path / "run.mcap")
    result = replay(head, events, CONTEXT, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert result.difference is None
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()
