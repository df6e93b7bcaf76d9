from __future__ import annotations

import ast

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from codra_dsl import logic
from codra_dsl.language.check.conditions.lowering import python_text, to_python
from codra_dsl.language.check.conditions.types import Type, infer, infer_condition
from codra_dsl.language.expression import Node, names_in, parse, to_text
from codra_dsl.language.model import Kind
from codra_dsl.language.units import ONE, UNITS, Unit, convert
from codra_dsl.runtime.values import conditions
from tests.language.check.typed_conditions import (
    CONDITIONS,
    TYPES,
    Exact,
    TooCloseError,
    World,
    meaning,
    quantities,
    worlds,
)

WORDS = {
    word: getattr(conditions, word)
    for word in ("age", "between", "choose", "confirmed", "first_of", "known", "literal", "maximum", "minimum", "value")
}


def build_term(python: str) -> logic.Term:
    term = eval(python, {"__builtins__": {"abs": abs}}, dict(WORDS))
    assert isinstance(term, logic.Term), python
    return term


def lower_text(text: str, types: dict[str, Type] | None = None) -> str:
    tree = parse(text)
    assert isinstance(tree, Node), tree
    typed, problems = infer_condition(tree, TYPES if types is None else types, reads_context=True)
    assert problems == ()
    return to_python(typed)


@settings(max_examples=75)
@given(CONDITIONS, worlds())
def test_lowered_conditions_have_the_meaning_of_the_language(tree: Node, world: World) -> None:
    typed, problems = infer_condition(tree, TYPES, reads_context=True)
    assert problems == ()
    try:
        expected = meaning(tree, world)
    except TooCloseError:
        assume(False)
    assert build_term(to_python(typed)).evaluate(world) is expected


@given(quantities("length"), st.sampled_from(["m", "cm", "mm", "km"]), worlds())
def test_lowered_values_are_in_the_requested_unit(tree: Node, unit: str, world: World) -> None:
    typed, problems = infer(tree, TYPES, reads_context=True)
    assert problems == ()
    try:
        expected = meaning(tree, world)
    except TooCloseError:
        assume(False)
    evaluated_value = build_term(to_python(typed, UNITS[unit])).evaluate(world)
    if expected is None:
        assert evaluated_value is None
    else:
        assert isinstance(expected, Exact)
        assert isinstance(evaluated_value, (int, float))
        in_metres = convert(evaluated_value, UNITS[unit], Unit(UNITS[unit].dimension))
        assert in_metres == pytest.approx(float(expected.number), rel=1e-9, abs=1e-9)


@given(CONDITIONS)
def test_lowered_conditions_read_the_same_names(tree: Node) -> None:
    typed, _ = infer_condition(tree, TYPES, reads_context=True)
    term = build_term(to_python(typed))
    assert term.variables() == {name.name for name in names_in(tree)}


@given(CONDITIONS)
def test_types_do_not_depend_on_how_a_condition_is_spelled(tree: Node) -> None:
    reparsed_tree = parse(to_text(tree))
    if isinstance(reparsed_tree, Node):
        assert to_python(infer_condition(reparsed_tree, TYPES, reads_context=True)[0]) == to_python(
            infer_condition(tree, TYPES, reads_context=True)[0]
        )


@pytest.mark.parametrize(
    ("text", "python"),
    [
        ("b1", 'value("b1")'),
        ("n >= 3", 'value("n") >= 3'),
        ("true", "literal(True)"),
        ("not b1 and b2", '~value("b1") & value("b2")'),
        ("not known(x) or age(x) > 10 s", '~known("x") | (age("x") > 10)'),
        ("age(x) > 2 min", 'age("x") > 120.0'),
        ("500 ms < age(x)", '0.5 < age("x")'),
        ("age(x) > t", 'age("x") > value("t") * 60.0'),
        ("y > 1 cm", 'value("y") > 10.0'),
        ("y > 10 mm", 'value("y") > 10'),
        ("y > 0", 'value("y") > 0'),
        ("x > y", 'value("x") > value("y") * 0.001'),
        ("7 cm > y", '70.0 > value("y")'),
        ("d < 0.5 rad", 'value("d") < 28.64788975654116'),
        ("abs(a - 180 deg) < 0.2 rad", 'abs(value("a") - 3.141592653589793) < 0.2'),
        ("0 < n < 5", '(0 < value("n")) & (value("n") < 5)'),
        ("door == 'open'", 'value("door") == "open"'),
        ("door in ('open', \"ajar\")", 'value("door").is_in("open", "ajar")'),
        ("n not in (1, -2)", '~value("n").is_in(1, -2)'),
        ("y in (1 cm, 2 cm)", 'value("y").is_in(10.0, 20.0)'),
        ("x in (y, 1 m)", '(value("x") == value("y") * 0.001) | (value("x") == 1)'),
        ("-n * 2 > r - (n - 1)", '-value("n") * 2 > value("r") - (value("n") - 1)'),
        ("x / t > 1 km/h", 'value("x") / value("t") > 16.666666666666668'),
        ("x * y > 1 m*m", 'value("x") * value("y") > 1000.0'),
        ("(b1 and b2) == b1", '(value("b1") & value("b2")) == value("b1")'),
        ("min(x, 1 m, y) > 0", 'minimum(value("x"), 1, value("y") * 0.001) > 0'),
        ("(x if b1 else y) > 1 m", 'choose(value("x"), value("b1"), value("y") * 0.001) > 1'),
        ("1 / 4 > 2", "literal(1) / 4 > 2"),
        ("1 < 2", "literal(1) < 2"),
        ("abs(-3) == n", 'abs(literal(-3)) == value("n")'),
        ("b1 == true", 'value("b1")'),
        ("b1 == false", '~value("b1")'),
        ("b1 != true", '~value("b1")'),
        ("b1 != false", 'value("b1")'),
        ("not b1 == false", '~(~value("b1"))'),
        ("true or b1", 'literal(True) | value("b1")'),
        ("true == b1", 'True == value("b1")'),
        ("(n + r) in (1, 2)", '(value("n") + value("r")).is_in(1, 2)'),
    ],
)
def test_conditions_are_lowered_to_readable_python(text: str, python: str) -> None:
    assert lower_text(text) == python
    build_term(python)


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [("y >= 1 cm", 10, True), ("y > 1 cm", 10, False), ("y == 7 cm", 70, True), ("y < 0.3 cm", 3, False)],
)
def test_limits_in_another_unit_are_met_exactly(text: str, value: int, expected: bool) -> None:
    world = World({name: value if name == "y" else None for name in TYPES}, dict.fromkeys(TYPES, 0.0))
    assert build_term(lower_text(text)).evaluate(world) is expected


@given(st.text(max_size=20))
def test_texts_become_python_literals(text: str) -> None:
    assert ast.literal_eval(python_text(text)) == text


def test_plain_texts_are_in_double_quotes() -> None:
    assert python_text("open") == '"open"'
    assert python_text('say "no"') == "'say \"no\"'"


def test_a_duration_age_is_compared_with_flips_at_run_time() -> None:
    world = World({name: True if name == "b1" else None for name in TYPES}, dict.fromkeys(TYPES, 4.0))
    assert build_term(lower_text("age(b1) > 10 s")).flips_s(world) == 6.0


def test_numbers_without_a_unit_are_left_as_they_are_written() -> None:
    tree = parse("0.1")
    assert isinstance(tree, Node)
    typed, _ = infer(tree, {}, reads_context=False)
    assert to_python(typed, ONE) == "literal(0.1)"
    assert typed.type is not None
    assert typed.type.kind is Kind.FLOAT
