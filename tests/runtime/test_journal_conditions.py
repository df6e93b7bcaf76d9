"""Conditions as a journal holds them: texts that build them, of which nothing is run, and what people read."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Term, age, choose, first_of, known, literal, maximum, value
from codra_dsl.runtime.conditions import between, confirmed
from codra_dsl.runtime.term_text import TermTextError, spoken, term_of
from tests.test_logic import TERMS


@given(TERMS)
def test_the_text_of_a_condition_builds_it_again(term: Term) -> None:
    assert repr(term_of(repr(term))) == repr(term)


@given(TERMS)
def test_every_condition_can_be_said(term: Term) -> None:
    assert spoken(repr(term))


@given(st.text(max_size=60))
def test_any_other_text_is_refused(text: str) -> None:
    try:
        term = term_of(text)
    except TermTextError:
        return
    assert isinstance(term, Term)


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
def test_what_is_no_condition_is_refused_and_not_run(text: str) -> None:
    with pytest.raises(TermTextError):
        term_of(text)


@pytest.mark.parametrize(
    ("term", "said"),
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
def test_a_condition_is_said_as_a_spec_would(term: Term, said: str) -> None:
    assert spoken(repr(term)) == said.replace("literal", "2")
