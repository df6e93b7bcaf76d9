"""The chain of one adaptation in the store, computed again from the journal of the run and the rules of the spec.

The test does not use the runtime's arithmetic: it parses the rule texts, and copies the terms from specs/store.yaml.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from itertools import pairwise

import pytest

from codra_dsl.runtime.journal import Event, Kind
from codra_papers.store.simulator.situations import Situation
from tests.papers.store.test_loops_of_the_store import LASTS_S, SEEDS, RecordedRun

ACTIONS = ("pick", "deliver", "start", "dock")
SMOOTH_S, LEAD, HOLD_S, DWELL_S = 1.0, 0.1, 3.0, 5.0
RAMPS = {
    ("battery_level", "empty"): (30.0, 10.0),
    ("battery_level", "full"): (10.0, 30.0),
    ("battery_level", "scarce"): (45.0, 30.0),
    ("battery_level", "charged"): (70.0, 95.0),
    ("battery_drain", "fast"): (5.0, 7.0),
    ("crowding", "persistent"): (0.5, 0.7),
    ("person_distance", "close"): (2.5, 1.5),
    ("people_at_container", "nobody"): (1.0, 0.0),
    ("people_at_container", "several"): (1.0, 2.0),
}
DRAINS = [step / 10.0 for step in range(201)]
"""The possible values of an unknown drain."""

POINTS = 1000
"""FuzzyLite's default resolution, which is the number of points in an output's range."""

Values = Mapping[str, object]


def ramp(x: float, start: float, end: float) -> float:
    return min(1.0, max(0.0, (x - start) / (end - start)))


def share_is(term: str, x: float) -> float:
    return {"low": ramp(x, 0.5, 0.2), "medium": 1.0 - min(1.0, abs(x - 0.5) / 0.3), "high": ramp(x, 0.5, 0.8)}[term]


XS = [(index + 0.5) / POINTS for index in range(POINTS)]
SHARES = {term: [share_is(term, x) for x in XS] for term in ("low", "medium", "high")}


def degree(variable: str, term: str, value: object) -> float:
    if isinstance(value, (bool, str)):
        return float(str(value).lower() == term)
    assert isinstance(value, (int, float))
    if (variable, term) == ("people_at_container", "one"):
        return max(0.0, 1.0 - abs(value - 1.0))
    if (variable, term) in RAMPS:
        return ramp(value, *RAMPS[variable, term])
    return share_is(term, value)


def holds(proposition: str, values: Values) -> float:
    variable, _, *words = proposition.split()
    membership = degree(variable, words[-1], values[variable])
    return 1.0 - membership if words[:-1] == ["not"] else membership


def strength(rule: str, values: Values) -> float:
    condition, _, conclusion = rule.removeprefix("if ").partition(" then ")
    weight = float(conclusion.partition(" with ")[2] or 1.0)
    return weight * max(
        min(holds(proposition, values) for proposition in part.split(" and ")) for part in condition.split(" or ")
    )


def infer(rules: list[str], values: Values) -> float:
    """Mamdani's method: conclusions cut off at their rules' strengths, and the centre of gravity of all of them."""
    clipped_conclusions = [(SHARES[rule.partition(" then ")[2].split()[2]], strength(rule, values)) for rule in rules]
    ys = [max(min(most, shares[index]) for shares, most in clipped_conclusions) for index in range(POINTS)]
    return sum(x * y for x, y in zip(XS, ys, strict=True)) / sum(ys)


@pytest.fixture(scope="module")
def events(tmp_path_factory: pytest.TempPathFactory) -> list[Event]:
    situation = Situation.PEOPLE_CLOSE
    return RecordedRun(tmp_path_factory.mktemp("run"), situation, SEEDS[situation], LASTS_S[situation]).events


@pytest.fixture(scope="module")
def switch(events: list[Event]) -> Event:
    """The switch by which the robot gives up the pick-up because a person is close."""
    (*_, last) = [event for event in events if (event.name, event.what) == ("course", "chosen")]
    assert (last.details["before"], last.details["action"]) == ("pick", "start")
    return last


def readings(switch: Event) -> dict[str, object]:
    return {
        reading["variable"]: json.loads(reading["value"])
        for reading in switch.details["readings"]
        if "value" in reading
    }


def rules_about(switch: Event, output: str) -> list[str]:
    return [rule["text"] for rule in switch.details["rules"] if rule["concludes"] == [output]]


def test_the_readings_of_the_chain_are_those_that_were_written(events: list[Event], switch: Event) -> None:
    before = events[: events.index(switch)]
    for reading in switch.details["readings"]:
        (*_, last) = [event for event in before if (event.kind, event.name) == (Kind.VARIABLE, reading["variable"])]
        if reading["variable"] == "crowding":  # a written reading never has older evidence than the reading before
            assert last.details["value"] == json.loads(reading["value"])
        elif "value" in reading:
            assert (last.details["value"], last.details["evidence_s"]) == (
                json.loads(reading["value"]),
                reading["evidence_s"],
            )
        else:
            assert last.what == "unknown"


def computed_metrics(switch: Event) -> dict[str, float]:
    """The metrics: the smallest values for all possible values of an unknown drain."""
    values_by_name = readings(switch)
    scenes = (
        [values_by_name]
        if "battery_drain" in values_by_name
        else [{**values_by_name, "battery_drain": drain} for drain in DRAINS]
    )
    return {
        name: min(infer(rules_about(switch, name), scene) for scene in scenes)
        for name in ("safety", "mission_completion", "power_autonomy")
    }


def test_metrics_weights_and_strengths_follow_from_the_readings(switch: Event) -> None:
    metrics = computed_metrics(switch)
    recorded_metrics = {metric["name"]: metric["value"] for metric in switch.details["metrics"]}
    values_by_name: dict[str, object] = {**readings(switch), **recorded_metrics}
    for metric in switch.details["metrics"]:
        is_certain = metric["low"] == metric["high"]
        assert metric["value"] == pytest.approx(metrics[metric["name"]], abs=1e-6 if is_certain else 5e-3)
        assert metric["value"] <= metrics[metric["name"]] + 1e-6  # bounds may be too wide, never too narrow
    for weight in switch.details["weights"]:
        expected = infer(rules_about(switch, weight["name"]), values_by_name)
        assert weight["value"] == pytest.approx(expected, abs=1e-3)
    for rule in switch.details["rules"]:
        if "battery_drain" not in rule["text"]:
            assert rule["low"] == rule["high"] == pytest.approx(strength(rule["text"], values_by_name), abs=1e-3)


def changes(events: list[Event], action: str) -> Iterator[tuple[float, float]]:
    """The instants and values of a written weight."""
    for event in events:
        if (event.kind, event.name, event.what) == (Kind.VARIABLE, f"weight_of_{action}", "identified"):
            yield event.instant_s, event.details["value"]


def smoothed_weight(written_values: list[tuple[float, float]], instant_s: float) -> float:
    smoothed_value = written_values[0][1]
    for (since_s, weight), (until_s, _) in pairwise([*written_values, (math.inf, 0.0)]):
        if since_s <= instant_s:
            smoothed_value = weight + (smoothed_value - weight) * math.exp(
                (since_s - min(until_s, instant_s)) / SMOOTH_S
            )
    return smoothed_value


def test_the_state_of_the_filter_follows_from_the_weights_that_were_written(events: list[Event], switch: Event) -> None:
    before = events[: events.index(switch)]
    values_by_action = {action: list(changes(before, action)) for action in ACTIONS}
    weights = {record["name"]: record for record in switch.details["weights"]}

    def lead(instant_s: float) -> float:
        return smoothed_weight(values_by_action["start"], instant_s) - smoothed_weight(
            values_by_action["pick"], instant_s
        )

    for action in ACTIONS:
        assert weights[action]["smoothed"] == pytest.approx(
            smoothed_weight(values_by_action[action], switch.instant_s), abs=1e-9
        )
    since_s = weights["start"]["leads_since_s"]
    assert lead(since_s) == pytest.approx(LEAD, abs=1e-6)
    assert all(lead(since_s + share * HOLD_S) >= LEAD - 1e-6 for share in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0))
    assert switch.instant_s == pytest.approx(since_s + HOLD_S, abs=1e-5)
    earlier_choices = [record for record in before if (record.name, record.what) == ("course", "chosen")]
    assert switch.details["since_s"] == earlier_choices[-1].instant_s
    assert switch.details["dwell_until_s"] == earlier_choices[-1].instant_s + DWELL_S


def test_each_counterfactual_would_have_kept_the_pick_up(events: list[Event], switch: Event) -> None:
    after = events[events.index(switch) :]
    explanation = next(event for event in after if (event.name, event.what) == ("course", "explained"))
    kept_by = {change["kind"]: change for change in explanation.details["kept_by"]}
    values_by_name: dict[str, object] = {
        **readings(switch),
        kept_by["input"]["name"]: json.loads(kept_by["input"]["other"]),
    }
    for name in ("safety", "mission_completion"):
        values_by_name[name] = infer(rules_about(switch, name), values_by_name)
    values_by_name["power_autonomy"] = computed_metrics(switch)["power_autonomy"]
    start, pick = (infer(rules_about(switch, action), values_by_name) for action in ("start", "pick"))

    assert kept_by["input"]["name"] == "crowding"
    assert 0.5 < values_by_name["crowding"] < 0.7  # type: ignore[operator]
    assert start - pick == pytest.approx(LEAD, abs=1e-6)
    (pick_weight,) = (record["value"] for record in switch.details["weights"] if record["name"] == "pick")
    assert kept_by["weight"]["name"] == "start"
    assert json.loads(kept_by["weight"]["other"]) == pytest.approx(pick_weight + LEAD, abs=1e-6)
