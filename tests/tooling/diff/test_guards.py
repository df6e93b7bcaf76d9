"""Relations of guards: examples, and random conditions against the logic of the runtime."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.check.conditions.lowering import to_python
from codra_dsl.language.check.conditions.types import declared_type, infer_condition
from codra_dsl.language.expression import Node, SyntaxProblem, parse
from codra_dsl.language.model import Kind, ValueType
from codra_dsl.logic import Term, Value
from codra_dsl.runtime.values import conditions
from codra_dsl.tooling.diff.guards import Relation, find_relation, is_equal, is_same_choice, is_same_value, joined_types

TYPES: Mapping[str, ValueType] = {
    "a": ValueType(kind=Kind.BOOL),
    "b": ValueType(kind=Kind.BOOL),
    "door": ValueType(kind=Kind.ENUM, values=("open", "ajar", "shut")),
    "word": ValueType(kind=Kind.STR),
    "gap": ValueType(kind=Kind.FLOAT, unit="m", range=(0, 2)),
    "turn": ValueType(kind=Kind.FLOAT, unit="deg"),
    "n": ValueType(kind=Kind.INT, range=(0, 10)),
    "m": ValueType(kind=Kind.INT),
}
JOINED = joined_types(TYPES, TYPES)
SAMPLES: Mapping[str, tuple[Value | None, ...]] = {
    "a": (True, False, None),
    "b": (True, False, None),
    "door": ("open", "ajar", "shut", None),
    "word": ("yes", "no", "else", None),
    "gap": (0.0, 0.05, 0.1, 0.5, 1.0, 1.5, 2.0, None),
    "turn": (-400.0, -30.0, 0.0, 29.0, 30.0, 31.0, None),
    "n": (0, 1, 2, 3, 4, 5, 10, None),
    "m": (-7, 0, 1, 2, 3, 4, None),
}
ATOMS = (
    *("a", "b", "a == b", "a != true", "known(a)", "known(gap)", "age(gap) < 3 s", "age(gap) > 5000 ms"),
    *('door == "open"', 'door != "ajar"', 'door in ("ajar", "shut")', 'door not in ("open", "shut")', 'word == "yes"'),
    *(
        "gap < 10 cm",
        "gap <= 0.1 m",
        "gap > 100 mm",
        "0 < gap < 1 m",
        "gap == 50 cm",
        "gap >= 0",
        "gap in (1 m, 50 cm)",
    ),
    *("turn > 30 deg", "turn > 0.5235987755982988 rad", "abs(turn) < 30 deg", "turn - 10 deg < 20 deg"),
    *("n > 2", "n >= 3", "n < 11", "n == 2", "2 * n > 5", "n + m > 4", "m + n > 3", "n - n < 1", "n / 2 > 1"),
    *("max(n, m) > 3", "max(m, n) > 2", "n * m < 6", "m * n < 7", "(n if a else m) > 2", "10 / m > 3", "true", "false"),
)


@dataclass
class Scene:
    """Known values, and their age."""

    values: Mapping[str, Value | None] = field(default_factory=dict)
    age: float = 0.0

    def value(self, name: str) -> Value | None:
        return self.values.get(name)

    def age_s(self, name: str) -> float | None:
        return None if self.values.get(name) is None else self.age


def tree(text: str) -> Node:
    node = parse(text)
    assert not isinstance(node, SyntaxProblem), text
    return node


def term(text: str) -> Term:
    """Return a condition as it runs on a robot."""
    types = {name: declared_type(value_type) for name, value_type in TYPES.items()}
    typed, problems = infer_condition(tree(text), types, reads_context=True)
    assert not problems, text
    words: dict[str, Any] = {name: getattr(conditions, name) for name in dir(conditions) if not name.startswith("_")}
    condition = eval(to_python(typed), {"__builtins__": {"abs": abs}}, words)
    assert isinstance(condition, Term)
    return condition


def scenes(*texts: str) -> list[Scene]:
    names = sorted(set().union(*(term(text).variables() for text in texts)))
    cases = itertools.product(*(SAMPLES[name] for name in names))
    return [Scene(dict(zip(names, case, strict=True)), age) for case in cases for age in (0.0, 3.0, 4.0, 9.0)]


def related(old: str, new: str) -> Relation:
    return find_relation([tree(old)], [tree(new)], JOINED)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("not (gap < 1 m)", "gap >= 100 cm", Relation.SAME),
        ("not (a and b)", "not b or not a", Relation.SAME),
        ("not not a", "a", Relation.SAME),
        ("0 < gap < 1 m", "gap < 1000 mm and gap > 0", Relation.SAME),
        ('door in ("ajar", "shut")', 'door != "open"', Relation.SAME),
        ('word in ("yes", "no")', 'word != "else"', Relation.WEAKER),
        ("n > 2", "n >= 3", Relation.SAME),
        ("gap > 2 cm", "gap >= 3 cm", Relation.STRONGER),
        ("gap >= 0", "known(gap)", Relation.SAME),
        ("gap <= 3 m", "known(gap)", Relation.SAME),
        ("turn > 30 deg", "turn * 2 > 60 deg", Relation.SAME),
        ("turn >= 0", "known(turn)", Relation.WEAKER),
        ("n - m < 3", "n < m + 3", Relation.SAME),
        ("n - m < 3", "n < m + 5", Relation.WEAKER),
        ("abs(turn) < 30 deg", "abs(-turn) < 20 deg", Relation.STRONGER),
        ("a", "a or not a", Relation.WEAKER),
        ("known(a)", "a or not a", Relation.SAME),
        ("not known(a) or a", "a", Relation.STRONGER),
        ("a", "not known(a) or a", Relation.WEAKER),
        ("age(gap) < 3 s", "age(gap) < 5 s and gap > 0", Relation.OTHER),
        ("age(gap) < 3 s", "age(gap) < 5000 ms", Relation.WEAKER),
        ("age(gap) >= 0 s", "known(gap)", Relation.SAME),
        ("abs(turn) < 30 deg", "-30 deg < turn < 30 deg", Relation.SAME),
        ("max(gap, 1 m) < 2 m", "gap < 2 m", Relation.SAME),
        ("a and gap < 1 m", "a", Relation.WEAKER),
        ("a", "b", Relation.OTHER),
        ("a if b else a", "a", Relation.SAME),
        ("a == b", "b == a", Relation.SAME),
        ("a != b", "a == (not b)", Relation.SAME),
        ("a == true", "a", Relation.SAME),
        ("a and b", "a == b", Relation.WEAKER),
        ("n - n < 1", "known(n)", Relation.SAME),
        ('a and door == "open"', '(a and door == "open") or (b and door == "shut")', Relation.WEAKER),
    ],
)
def test_guards_are_compared_by_meaning(old: str, new: str, expected: Relation) -> None:
    assert related(old, new) is expected


def test_conditions_of_any_depth_are_compared_without_growing() -> None:
    deep = "a"
    for _ in range(30):
        deep = f"({deep} == (b if a else not b))"

    assert related(deep, f"not (not {deep})") is Relation.SAME
    assert related(deep, f"{deep} or b") in (Relation.SAME, Relation.WEAKER)


def test_too_many_cases_are_never_taken_for_the_same() -> None:
    names = [f"v{index}" for index in range(20)]
    types = joined_types({name: ValueType(kind=Kind.BOOL) for name in names}, {})
    one = tree(" or ".join(names))
    other = tree(" or ".join([*names[1:], f"not (not {names[0]} and {names[1]})"]))

    assert find_relation([one], [other], types) is Relation.OTHER
    assert find_relation([one], [tree(" or ".join(reversed(names)))], types) is Relation.SAME


def test_a_name_of_two_types_gives_another_guard() -> None:
    types = joined_types({"a": ValueType(kind=Kind.BOOL)}, {"a": ValueType(kind=Kind.FLOAT)})

    assert find_relation([tree("a")], [tree("not a")], types) is Relation.OTHER


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (("m", (0, 2)), ("cm", (0, 100)), Relation.SAME),
        (("m", (0, 2)), ("cm", (0, 300)), Relation.STRONGER),
        (("m", (0, 2)), ("cm", None), Relation.STRONGER),
    ],
)
def test_ranges_of_both_versions_are_joined_with_units_converted(
    before: tuple[str, tuple[int, int] | None], after: tuple[str, tuple[int, int] | None], expected: Relation
) -> None:
    old, new = (ValueType(kind=Kind.FLOAT, unit=unit, range=ends) for unit, ends in (before, after))

    assert (
        find_relation([tree("known(gap)")], [tree("gap <= 2 m")], joined_types({"gap": old}, {"gap": new})) is expected
    )


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ("gap * 2", "gap + gap", True),
        ("gap + 10 cm", "0.1 m + gap", True),
        ("gap", "gap + 1 mm", False),
        ("gap", "turn / 1 rad * 1 m", False),
        ("10 / n", "10 / n", True),
        ("10 / n - 10 / n", "n - n", False),
        ("max(n, m)", "max(m, n)", True),
        ("n if n < m else m", "min(n, m)", False),
        ("door", "door", True),
        ("word", "word", True),
        ('"open" if a and b else door', '"open" if b and a else door', True),
        ('"open" if a or b else door', '"open" if b and a else door', False),
    ],
)
def test_values_are_the_same_if_they_are_equal_in_every_case(one: str, other: str, expected: bool) -> None:
    """`n if n < m else m` is `min(n, m)`, but this is not detected."""
    assert is_same_value(tree(one), tree(other), JOINED) is expected


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("x: a, y: b", "x: a, y: b and not a", True),
        ("x: a, y: not a", "y: not a, x: a", True),
        ("x: a, y: b", "y: b, x: a", False),
        ("x: a, y: b", "x: a, y: b, z: a and b", True),
        ("x: a, y: b", "x: a", False),
    ],
)
def test_choices_are_the_same_if_each_member_is_the_first_in_the_same_cases(
    before: str, after: str, expected: bool
) -> None:
    one, other = (
        [(member, tree(condition)) for member, condition in (case.split(": ") for case in text.split(", "))]
        for text in (before, after)
    )

    assert is_same_choice(one, other, JOINED) is expected


Guards = st.recursive(
    st.sampled_from(ATOMS),
    lambda inner: st.one_of(
        st.builds(lambda one: f"not ({one})", inner),
        st.builds(lambda one, two: f"({one}) and ({two})", inner, inner),
        st.builds(lambda one, two: f"({one}) or ({two})", inner, inner),
        st.builds(lambda one, two, three: f"({one}) if ({two}) else ({three})", inner, inner, inner),
    ),
    max_leaves=3,
)


@settings(max_examples=75, deadline=None)
@given(Guards, Guards)
def test_the_relation_of_two_guards_holds_on_a_robot(old: str, new: str) -> None:
    decided = related(old, new)
    before, after = term(old), term(new)

    for scene in scenes(old, new):
        held, holds = before.holds(scene), after.holds(scene)
        if decided in (Relation.SAME, Relation.WEAKER):
            assert holds or not held, (old, new, scene)
        if decided in (Relation.SAME, Relation.STRONGER):
            assert held or not holds, (old, new, scene)


@settings(max_examples=50, deadline=None)
@given(Guards, Guards)
def test_equal_conditions_have_the_same_value_even_if_unknown(one: str, other: str) -> None:
    if is_equal(tree(one), tree(other), JOINED):
        first, second = term(one), term(other)
        for scene in scenes(one, other):
            assert first.evaluate(scene) is second.evaluate(scene), (one, other, scene)


@settings(max_examples=50, deadline=None)
@given(Guards)
def test_a_wrapped_guard_is_the_same(text: str) -> None:
    assert related(text, f"not (not ({text}))") is Relation.SAME
    assert related(text, f"({text}) and ({text})") is Relation.SAME
    assert related(text, f"({text}) or a") in (Relation.WEAKER, Relation.SAME)
    assert related(text, f"({text}) and a") in (Relation.STRONGER, Relation.SAME)
