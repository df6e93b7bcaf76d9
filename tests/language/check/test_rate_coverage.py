"""Rates that can never be known, because their variable keeps too few readings or is written too rarely."""

from __future__ import annotations

import pytest

from codra_dsl.language.check.loops.rate_coverage import MIN_SPAN_SHARE
from codra_dsl.runtime.loops import rates
from tests.language.check.specs import finding_texts, findings

SPEC = """\
codra: 1
name: cart
context:
  battery: {{type: float, unit: percent, range: [0, 100], source: {source}, valid_for: forever{history}}}
  drain: {{type: float, unit: percent/min, range: [0, 5], rate_of: battery, over: {over}}}
  max_speed: {{type: float, unit: m/s, range: [0, 1.5], source: adaptation}}
agents: {{power: {{{period}}}, page: {{}}}}
adaptation:
  speed: {{set: max_speed, value: '0.6 m/s if drain > 1 percent/min else 1.2 m/s', otherwise: 0.6 m/s}}
loops:
  driving: {{adapt: [speed]}}
"""


def spec(over: str = "2 min", period: str = "period: 500 ms", history: str = "", source: str = "[power, page]") -> str:
    return SPEC.format(over=over, period=period, history=history, source=source)


def uncovered(text: str) -> tuple[str, str, str]:
    """Return the marked text, the message and the help of the only finding about a rate."""
    ((_, *texts),) = (texts for texts in finding_texts(text) if texts[0] == "uncovered-rate")
    marked, message, help_text = texts
    return marked, message, help_text


def codes(text: str) -> list[str]:
    return [finding.code for finding in findings(text) if finding.code == "CDR7131"]


def test_a_rate_over_more_time_than_the_readings_can_span_is_never_known() -> None:
    marked, message, help_text = uncovered(spec(source="power"))
    assert marked == "2 min"
    assert message == (
        "context-variable 'drain' is never known: a rate over 120 s needs readings that span 60 s, "
        "but 'battery' keeps 100 readings, which span 49.5 s"
    )
    assert help_text == "write 'history: 241' in 'battery', or a shorter 'over'"
    assert codes(spec(source="power", history=", history: 241")) == []


@pytest.mark.parametrize(("history", "is_covered"), [("120", False), ("121", True)])
def test_the_readings_need_to_span_half_of_the_time(history: str, is_covered: bool) -> None:
    assert codes(spec(history=f", history: {history}")) == ([] if is_covered else ["CDR7131"])


def test_a_writer_that_states_no_period_is_not_guessed() -> None:
    assert codes(spec(period="")) == []
    assert codes(spec(over="1 ms", period="", source="page")) == []


def test_a_rate_over_less_time_than_the_period_of_its_only_writer_is_never_known() -> None:
    _, message, help_text = uncovered(spec(over="400 ms", source="power"))
    assert message.endswith("but there is at most one reading in 0.4 s")
    assert help_text == "write an 'over' of at least 1 s"
    assert codes(spec(over="500 ms", source="power")) == []
    assert codes(spec(over="400 ms")) == []  # the other writer may write more often


OBSERVED = """
perception:
  measure:
    call: cart.power:measure
    {interval}
    returns: {{share: {{type: float, unit: percent, range: [0, 100]}}}}
    identifies: {{battery: share}}
"""


@pytest.mark.parametrize(
    ("over", "interval", "is_covered"),
    [("198 s", "rank: 1", True), ("199 s", "rank: 1", False), ("199 s", "min_interval: 2 s", True)],
)
def test_an_observer_writes_at_its_period_or_at_the_interval_of_its_algorithm(
    over: str, interval: str, is_covered: bool
) -> None:
    text = spec(over=over, period="", source="observer") + OBSERVED.format(interval=interval)
    assert codes(text) == ([] if is_covered else ["CDR7131"])


def test_an_observer_that_looks_after_events_has_no_period() -> None:
    text = spec(over="199 s", period="", source="observer, refresh: on_event") + OBSERVED.format(interval="rank: 1")
    assert codes(text) == []


@pytest.mark.parametrize(("over", "is_covered"), [("80 s", True), ("81 s", False)])
def test_a_share_counts_the_time_after_the_newest_reading(over: str, is_covered: bool) -> None:
    text = spec(over=over, period="period: 20 s", source="power", history=", history: 2")
    text = text.replace("type: float, unit: percent, range: [0, 100]", "type: bool")
    text = text.replace("unit: percent/min, range: [0, 5], rate_of", "range: [0, 1], share_of")
    text = text.replace("drain > 1 percent/min", "drain > 0.5")
    assert codes(text) == ([] if is_covered else ["CDR7131"])


@pytest.mark.parametrize(("duration", "is_covered"), [("40 s", True), ("41 s", False)])
def test_a_held_bool_needs_readings_that_span_all_of_its_time(duration: str, is_covered: bool) -> None:
    text = spec(over="1 s", period="period: 20 s", source="power", history=", history: 2")
    text = text.replace("type: float, unit: percent, range: [0, 100]", "type: bool")
    text = text.replace(
        "type: float, unit: percent/min, range: [0, 5], rate_of: battery, over: 1 s",
        f"type: bool, held: battery, for: {duration}",
    )
    text = text.replace("drain > 1 percent/min", "drain")
    assert codes(text) == ([] if is_covered else ["CDR7131"])
    if not is_covered:
        marked, message, help_text = uncovered(text)
        assert marked == duration
        assert message == (
            "context-variable 'drain' is never true: a bool that is held for 41 s needs readings that span 41 s, "
            "but 'battery' keeps 2 readings, which span 40 s"
        )
        assert help_text == "write 'history: 4' in 'battery', or a shorter 'for'"


def test_the_check_needs_the_same_span_as_the_runtime() -> None:
    assert MIN_SPAN_SHARE == rates.MIN_SPAN_SHARE
