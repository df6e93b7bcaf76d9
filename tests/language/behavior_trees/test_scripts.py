"""The scripting language, compared with BehaviorTree.CPP's guide."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.behavior_trees.scripts import ScriptProblem, parse_condition, parse_script
from codra_dsl.language.expression import parse, to_text
from codra_dsl.runtime.behavior_trees import Robot, Scope, TreeError
from tests.language.behavior_trees.stories import compiled, document, findings, main_tree

_ESCAPE = str.maketrans({"&": "&amp;", "<": "&lt;", '"': "&quot;"})


def after(code: str, scope: Scope | None = None) -> Scope:
    """Return the entries after a script."""
    tree = main_tree(document(f'<Script code="{code.translate(_ESCAPE)}"/>'), Robot(), scope=scope)
    tree.tick()
    return tree.scope


def value(expression: str, **entries: object) -> object:
    """Return the value of an expression."""
    scope = Scope()
    for name, entry_value in entries.items():
        scope.create(name, entry_value)
    return after(f"result := {expression}", scope).get("result")


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("param_A := 42; param_B := 3.14; message := 'hello world'", {"param_A": 42, "message": "hello world"}),
        (
            "param_A := 7; param_B := 5; param_B *= 2; param_C := (param_A * 3) + param_B",
            {"param_B": 10, "param_C": 31},
        ),
        ("a := 1; a += 2; b := 9; b -= 4; c := 7; c /= 2", {"a": 3, "b": 5, "c": 3.5}),
        ("val_A := true; val_B := 5 > 3; val_C := (val_A == val_B)", {"val_B": True, "val_C": True}),
        ("a := true; b := 5 > 3; d := (a && b) || !a", {"d": True}),
        ("a := 2; b := (a > 1) ? 42 : 24", {"b": 42}),
        ("s := 'ab'; s += 'c'", {"s": "abc"}),
        ("value := 0x7F;", {"value": 127}),
        ("b := !false", {"b": 1}),
    ],
)
def test_the_examples_of_the_guide(code: str, expected: dict[str, object]) -> None:
    scope = after(code)

    assert {name: scope.get(name) for name in expected} == expected


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("1 + 2 * 3 - 4 / 2", 5),
        ("10 - 4 - 3", 3),
        ("-x + -(x - 1)", -9),
        ("(x == 5 && y != 'b') || false", True),
        ("!(x == 5) || y == 'a'", True),
        ("!x == 0", True),
        ("1 < x < 6", True),
        ("1 < x < 5", False),
        ("text == 42 && 42 == text && text > 41", True),
        ("x > 3 ? x > 4 ? 'big' : 'middle' : 'small'", "big"),
        ("(x > 9 || y == 'a') && x >= 5", True),
        ("x + 0.1 + 0.2 == 5.3 && x != 5.001", True),
        ("x / 0", math.inf),
        ("-x / 0", -math.inf),
        ("x && y == 'a'", True),
    ],
)
def test_operators_bind_as_in_c(expression: str, expected: object) -> None:
    assert value(expression, x=5, y="a", text="42") == expected


@pytest.mark.parametrize(
    "text", ["!a || -b < 3.5", "(a && b) || c == 'd'", "a > 1 ? b + 2 * 3 : (c - 1) / 4", "1 < a <= 0x10"]
)
def test_a_script_is_a_condition_of_our_own_language(text: str) -> None:
    node = parse_condition(text)

    assert not isinstance(node, ScriptProblem)
    assert parse(to_text(node)) == node


def test_a_long_script_has_a_function_of_its_own_with_the_same_meaning() -> None:
    long = " && ".join(f"x != 'a text that makes it long {number}'" for number in range(5))
    body = f'<Sequence><ScriptCondition code="{long} && 7"/><Script code="y := {long} && 7"/></Sequence>'
    text = document(body.replace("&", "&amp;"))
    scope = Scope()
    scope.create("x", "b")

    assert "def _script_2_of_main_tree(it: Scope) -> object:" in compiled(text)
    main_tree(text, Robot(), scope=scope).tick()
    assert scope.get("y") is True


def test_names_of_an_enum_are_their_numbers() -> None:
    body = '<Sequence><Script code="color := RED"/><ScriptCondition code="color != BLUE"/></Sequence>'

    module = compiled(document(body), {"RED": 1, "BLUE": 2})
    assert 'create("color", lambda it: 1)' in module
    assert 'script_condition(lambda it: it["color"] != 2)' in module


def test_equals_needs_an_entry_and_colon_equals_creates_one() -> None:
    with pytest.raises(TreeError, match="the entry 'a' does not exist yet; existing entries: b"):
        after("b := 1; a = 1")
    assert after("a := 1; a = 2").get("a") == 2


def test_an_entry_keeps_the_type_of_its_first_value() -> None:
    with pytest.raises(TreeError, match="the entry 'a' holds a number, and 'x' is a text"):
        after("a := 1; a := 'x'")
    assert after("a := 1; a := '2.5'").get("a") == 2.5


@pytest.mark.parametrize("expression", ["y - 1", "x < 'a'", "x == 'a'", "y + 1", "y && true"])
def test_a_meaningless_operation_is_an_error_when_it_is_evaluated(expression: str) -> None:
    with pytest.raises((TreeError, TypeError)):
        value(expression, x=1, y="a")


@pytest.mark.parametrize(
    ("attribute", "underlined", "rule", "help_"),
    [
        ('_skipIf="a &amp; b"', "", "script-unsupported", "use &&, || and !, or compute it in an action of the robot"),
        ('_skipIf="a := 1"', ":=", "script-unsupported", "write '==' to compare"),
        ('_skipIf="a ="', "=", "script-unsupported", "write '==' to compare"),
        ('_skipIf="a || b &amp;&amp; c"', "", "script-unsupported", "group them with parentheses"),
        ('_skipIf="a || b || c == (d || e) ? f"', "f", "script-syntax", "complete it"),
        ("_onSuccess=\"a := 'b' .. 'c'\"", "..", "script-unsupported", "write '+'"),
        ('_skipIf="(a"', "a", "script-syntax", "complete it"),
        ('_skipIf="a b"', "b", "script-syntax", "remove it, or add an operator"),
        ('_skipIf=""', '"', "script-syntax", "complete it"),
        ("_skipIf='a == \"x\"'", '"', "script-syntax", "put texts between '...'"),
        ('_onSuccess="a + 1"', "a", "script-unsupported", "write entry := value; use a condition"),
        ('_onSuccess="a := 1 b := 2"', "b", "script-syntax", "remove it, or add an operator"),
        ('_onSuccess=""', '"', "script-syntax", "write a statement such as done := true"),
        ('_onSuccess="a := 1e999"', "1e999", "script-unsupported", "write a smaller one"),
    ],
)
def test_a_script_that_cannot_be_compiled_is_reported_with_its_place(
    attribute: str, underlined: str, rule: str, help_: str
) -> None:
    line = document(f"<A {attribute}/>")
    (finding,) = findings(line)
    span = finding.place.span

    assert finding.rule.name == rule
    assert finding.help.startswith(help_)
    complete_script = attribute.split('"')[1]  # offsets within a value with references are not those in the file
    assert line[span.column - 1 : span.end_column - 1] == (complete_script if "&" in attribute else underlined)


@given(st.text(alphabet="ab1 .'()!&|<>=+-*/?:;~^@", max_size=60))
def test_any_text_is_a_script_or_has_a_problem(text: str) -> None:
    for parsed in (parse_condition(text), parse_script(text)):
        if isinstance(parsed, ScriptProblem):
            assert 0 <= parsed.start <= parsed.end <= len(text) + 1
            assert parsed.help


@pytest.mark.parametrize("text", ["(" * 5000, "!" * 5000, "a?" * 5000, "1+" * 5000 + "1", "-" * 9999 + "1"])
def test_a_script_without_bound_is_refused(text: str) -> None:
    assert isinstance(parse_condition(text), ScriptProblem)
