"""Conditions in a journal: texts from which they are built without running code, and readable texts."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Term, age, choose, first_of, known, literal, maximum, value
from codra_dsl.runtime.values.condition_text import ConditionTextError, format_condition, parse_condition
from codra_dsl.runtime.values.conditions import between, confirmed
from tests.test_logic import TERMS


@given(TERMS)
def test_the_text_of_a_condition_builds_it_again(term: Term) -> None:
    assert repr(parse_condition(repr(term))) == repr(term)


@given(TERMS)
def test_every_condition_has_a_readable_text(term: Term) -> None:
    assert format_condition(repr(term))


OTHER_CODE = (
    "print({})",
    "[{}]",
    "lambda: {}",
    "{}.evaluate(1)",
    "{} if True else 1",
    "{}; 1",
    "a = {}",
    "await {}",
    "{}[0]",
)


@given(TERMS, st.sampled_from(OTHER_CODE))
def test_a_condition_within_other_code_is_refused(term: Term, code: str) -> None:
    with pytest.raises(ConditionTextError):
        parse_condition(code.format(repr(term)))


@given(TERMS, st.integers(0, 200), st.integers(0, 3), st.text(max_size=3))
def test_a_changed_text_of_a_condition_is_the_text_of_a_condition_or_refused(
    term: Term, start: int, length: int, inserted: str
) -> None:
    text = repr(term)
    parsed = parsed_condition(text[:start] + inserted + text[start + length :])

    assert isinstance(parsed, ConditionTextError) or repr(parsed_condition(repr(parsed))) == repr(parsed)


def parsed_condition(text: str) -> Term | ConditionTextError:
    try:
        return parse_condition(text)
    except ConditionTextError as error:
        return error


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "open('/etc/passwd')",
        "value('a').__class__",
        "value('a').evaluate(1)",
        "(lambda: value('a'))()",
        "value(name='a')",
        "value(*'a')",
        "[value('a')]",
        "value('a') if True else value('b')",
        "value('a') < value('b') < value('c')",
        "value(b'a')",
        "~True",
        "3",
        "'a'",
        "",
        "value(",
        "value('a')\nvalue('b')",
        "(" * 500 + ")" * 500,
        "~" * 100_000 + "value('a')",
        "\0",
    ],
)
def test_a_text_that_is_not_a_condition_is_refused_and_not_run(text: str) -> None:
    with pytest.raises(ConditionTextError):
        parse_condition(text)


@pytest.mark.parametrize(
    ("term", "text"),
    [
        (value("lid_angle") > 0.6, "lid_angle > 0.6"),
        (value("a") & (value("b") >= 2) & ~value("c"), "a and b >= 2 and not c"),
        ((value("a") | value("b")) & value("c"), "(a or b) and c"),
        (~known("a") | (age("a") > 10.0), "not known(a) or age(a) > 10.0"),
        (~(value("a") & value("b")), "not (a and b)"),
        (value("a").is_in("idle", "done"), "a in ('idle', 'done')"),
        (abs(value("a") - 3.0) < 0.2, "abs(a - 3.0) < 0.2"),
        (-value("a") == 1, "-a == 1"),
        (maximum(value("a"), 2) > literal(True), "max(a, literal) > true"),
        (choose(value("a"), value("b"), value("c")), "a if b else c"),
        (first_of(("near", value("d") < 1.0), ("far", literal(True))), "'near': d < 1.0, 'far': true"),
        (between(value("a") > 2, value("a") < 1), "enter: a > 2, leave: a < 1"),
        (confirmed(value("a") > 2, 2, 3), "a > 2, confirm: 2 of 3"),
    ],
)
def test_a_condition_reads_as_in_a_spec(term: Term, text: str) -> None:
    assert format_condition(repr(term)) == text.replace("literal", "2")


class Cycle:
    """An object that only the garbage collector frees, which then runs Python code at an arbitrary point."""

    def __init__(self) -> None:
        self.itself = self

    def __del__(self) -> None:
        for _ in range(20):
            pass


@pytest.fixture
def threads_that_change_places_all_the_time() -> Iterator[None]:
    interval_s, thresholds = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(40)
    yield
    sys.setswitchinterval(interval_s)
    gc.set_threshold(*thresholds)


@pytest.mark.usefixtures("threads_that_change_places_all_the_time")
def test_threads_read_conditions_at_once() -> None:
    def format_conditions(thread: int) -> list[str]:
        texts = []
        for number in range(60):
            _ = [Cycle() for _ in range(30)]
            texts.append(
                format_condition(" & ".join(f"(value('v{thread}_{number}') > {limit}.5)" for limit in range(30)))
            )
        return texts

    with ThreadPoolExecutor(6) as threads:
        all_texts = [text for texts in threads.map(format_conditions, range(6)) for text in texts]
    assert all_texts == [
        " and ".join(f"v{thread}_{number} > {limit}.5" for limit in range(30))
        for thread in range(6)
        for number in range(60)
    ]
